"""What a mimicry leaves in a folder: the motion, tables, a figure, the walk and numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from heelstrike.experiments.people.figure import draw_mimicry
from heelstrike.experiments.people.mimicry import Mimicry
from heelstrike.gait.recordings.saving import save_joints
from heelstrike.view.style import save_figure
from heelstrike.whole_file import write_whole

RATE = 1000.0
"""Rows a second of the table of the motion."""


def figures_of(found: Mimicry) -> dict[str, Any]:
    """Return the figures of a mimicry by name, with units."""
    stride, nearest, person = found.wanted.stride, found.nearest, found.person
    return {
        "robot": found.robot.name,
        "person": {
            "mass_kg": float(person.robot.model.mass.sum()),
            "leg_m": stride.leg,
            "speed_m_per_s": stride.speed,
            "stride_s": stride.duration,
            "stride_m": stride.length,
            "strides": stride.strides,
            "marker_rms_m": dict(person.residual),
        },
        "gait": {
            "step_m": 0.5 * found.wanted.length,
            "step_s": nearest.motion.duration,
            "cost_N2m2s": nearest.motion.cost,
            "optimal": nearest.motion.optimal,
            "distance_deg": nearest.distance,
            "distance_by_joint_deg": dict(
                zip(found.robot.actuator_names, nearest.by_joint, strict=True)
            ),
            "pitch_deg": nearest.pitch,
            "residual_N": nearest.residual,
        },
        "walk": {
            "steps": found.walk.steps,
            "asked": found.walk.asked,
            "kp_per_s2": found.walk.gains[0],
            "kd_per_s": found.walk.gains[1],
        },
    }


def write_mimicry(found: Mimicry, folder: Path, *, rate: float = RATE) -> tuple[Path, ...]:
    """Write motion.json, motion.csv, person.csv, angles.png, walk.nc and summary.json.

    Parameters
    ----------
    found : Mimicry
        The mimicry.
    folder : path
        Where; it is made if there is none.
    rate : float
        Rows a second of motion.csv.

    Returns
    -------
    tuple of Path
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = ("motion.json", "motion.csv", "person.csv", "angles.png", "walk.nc", "summary.json")
    files = tuple(folder / name for name in names)
    motion, robot, person = found.nearest.motion, found.robot, found.person
    motion.save(files[0])
    motion.save(files[1], robot=robot, rate=rate)
    joints = person.robot.joint_names
    save_joints(files[2], joints, person.time, person.q, hinges=[k > 1 for k in range(len(joints))])
    save_figure(draw_mimicry(found), files[3])
    found.walk.run.save(files[4])
    write_whole(files[5], json.dumps(figures_of(found), indent=2, ensure_ascii=False) + "\n")
    return files
