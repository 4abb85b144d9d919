"""What a mimicry leaves in a folder: the motion, tables, a figure, the walk and numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.experiments.people.figure import draw_mimicry
from heelstrike.experiments.people.mimicry import Mimicry
from heelstrike.experiments.people.moments import Moments
from heelstrike.gait.recordings.saving import save_columns, save_joints
from heelstrike.robot.robot import Robot
from heelstrike.view.style import save_figure
from heelstrike.whole_file import write_whole

RATE = 1000.0
"""Rows a second of the table of the motion."""


def figures_of(found: Mimicry) -> dict[str, Any]:
    """Return the figures of a mimicry by name, with units."""
    stride, nearest, person = found.wanted.stride, found.nearest, found.person
    measured = {} if found.moments is None else {"moments": _peaks(found.moments, person.robot)}
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
        **measured,
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
    """Write motion.json, person.csv, angles.png, walk.nc, summary.json and motion.csv.

    Where forces were measured, moments.csv is written, too. motion.csv, whose rate may be one at
    which it cannot be written, comes last.

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

    Raises
    ------
    GaitError
        If motion.csv has too few or too many rows at that rate; the other files are there then.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = ["motion.json", "person.csv", "angles.png", "walk.nc", "summary.json"]
    files = [folder / name for name in names]
    motion, robot, person = found.nearest.motion, found.robot, found.person
    motion.save(files[0])
    joints = person.robot.joint_names
    save_joints(files[1], joints, person.time, person.q, hinges=[k > 1 for k in range(len(joints))])
    save_figure(draw_mimicry(found), files[2])
    found.walk.run.save(files[3])
    write_whole(files[4], json.dumps(figures_of(found), indent=2, ensure_ascii=False) + "\n")
    if found.moments is not None:
        files.append(folder / "moments.csv")
        _save_moments(files[-1], found.moments, person.robot)
    files.append(folder / "motion.csv")
    motion.save(files[-1], robot=robot, rate=rate)
    return tuple(files)


def _peaks(moments: Moments, robot: Robot) -> dict[str, Any]:
    """Largest magnitudes of moments, and of what is left over on the trunk."""
    peaks = np.abs(moments.torque).max(axis=0).tolist()
    lacking = np.abs(moments.residual).max(axis=0)
    return {
        "peak_Nm": dict(zip(robot.actuator_names, peaks, strict=True)),
        "trunk_lacks_N": float(lacking[:2].max()),
        "trunk_lacks_Nm": float(lacking[2]),
    }


def _save_moments(path: Path, moments: Moments, robot: Robot) -> None:
    """Write the moments of all joints, and what is left over on the trunk, over time."""
    headings = [f"{name}_moment [N m]" for name in robot.actuator_names]
    headings += ["trunk_lacks_x [N]", "trunk_lacks_z [N]", "trunk_lacks_moment [N m]"]
    save_columns(path, headings, moments.time, np.hstack([moments.torque, moments.residual]))
