"""Numbers of joints in space: attributes of the file, or custom data where MJCF has no word."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.robot.files.joint_numbers import custom_numbers, limits
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.posture import joint_name
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import BALL, FREE
from heelstrike.robot.warning import warn

_CUSTOM = ("speed_limit", "stall_torque", "no_load_speed", "winding_resistance")


def read_spatial_numbers(file: MujocoFile) -> dict[str, Any]:
    """Return the numbers of all joints that a file gives.

    Raises
    ------
    RobotError
        If custom data are no number, or one too small.

    Warns
    -----
    RobotWarning
        Of a free joint that resists, as a default class of the file makes it.
    """
    model = file.model

    def unless(flag: str, values: Any) -> Floats:
        return np.asarray(values, dtype=np.float64) * float(not file.disabled(flag))

    numbers = {
        "reference": np.array(file.pose.qpos),
        "rest": np.array(model.qpos_spring),
        "armature": np.array(model.dof_armature),
        "damping": unless("damper", model.dof_damping),
        "dry_friction": unless("frictionloss", model.dof_frictionloss),
        "stiffness": unless("spring", model.jnt_stiffness),
    }
    _tell_of_free_joints(file, numbers)
    return numbers | _ranges(file) | {name: _custom(file, name) for name in _CUSTOM}


def _tell_of_free_joints(file: MujocoFile, numbers: dict[str, Floats]) -> None:
    """Say that a free joint resists, which hardly anybody means."""
    model = file.model
    for joint in np.flatnonzero(model.jnt_type == FREE).tolist():
        own = slice(int(model.jnt_dofadr[joint]), int(model.jnt_dofadr[joint]) + 6)
        given = {
            name.replace("_", " "): float(numbers[name][own].max())
            for name in ("armature", "damping", "dry_friction")
            if np.any(numbers[name][own])
        }
        if numbers["stiffness"][joint]:
            given["stiffness"] = float(numbers["stiffness"][joint])
        if given:
            words = ", ".join(f"{name} {value:g}" for name, value in given.items())
            warn(
                f"{file.source}: free joint {joint_name(model, joint)!r} has {words}, as a default "
                "class of the file may give it: the trunk feels that in the air, too. Write "
                '<freejoint/> in the place of <joint type="free"/> if it is not meant.'
            )


def _ranges(file: MujocoFile) -> dict[str, Floats]:
    """Ranges of hinges and slides, and the greatest turns of ball joints."""
    model = file.model
    kind = np.asarray(model.jnt_type)
    limited = model.jnt_limited.astype(bool) & (not file.disabled("limit")) & (kind != FREE)
    low, high = np.array(model.jnt_range, dtype=np.float64).reshape(-1, 2).T
    low = np.where(limited & (kind != BALL), low, -np.inf)
    high = np.where(limited, high, np.inf)
    return {"lower": limits(low), "upper": limits(high)}


def _custom(file: MujocoFile, name: str) -> Floats:
    """Numbers of velocities by the names of their joints, one for all of a joint."""
    model = file.model
    of_joint = np.asarray(model.dof_jntid)
    places = {
        joint_name(model, joint): np.flatnonzero(of_joint == joint).tolist()
        for joint in reversed(range(model.njnt))
    }
    return custom_numbers(file, name, model.nv, places)
