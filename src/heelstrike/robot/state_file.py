"""States as files: readable JSON in SI units with the names of the joints, read back strictly.

Reading a file never runs anything from it. Numbers are written with all their digits: what is read
is what was saved, bit by bit, on every machine.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.errors import RobotError, WriteError
from heelstrike.json_checksum import read_json, require_unchanged, shown, with_checksum
from heelstrike.robot.coordinates import checked
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

if TYPE_CHECKING:
    from heelstrike.robot.robot import Robot

VERSION = 1

_VECTORS = ("position_rad_or_m", "velocity_rad_or_m_per_s")


def save_state(robot: Robot, state: State, path: str | os.PathLike[str]) -> Path:
    """Write a state to a JSON file; see :meth:`Robot.save_state`."""
    state = checked(robot, state)
    data = {
        "format": "heelstrike state",
        "version": VERSION,
        "robot": robot.name,
        "joints": list(robot.joint_names),
        _VECTORS[0]: state.q.tolist(),
        _VECTORS[1]: state.v.tolist(),
    }
    try:
        text = json.dumps(with_checksum(data), indent=2, ensure_ascii=False)
        return write_whole(path, text + "\n")
    except WriteError as error:
        raise RobotError(str(error)) from error


def load_state(robot: Robot, path: str | os.PathLike[str]) -> State:
    """Read a state from a JSON file; see :meth:`Robot.load_state`."""
    data = read_json(path, "state", (VERSION,), RobotError)
    joints = data.get("joints")
    if not isinstance(joints, list) or not all(isinstance(name, str) for name in joints):
        raise RobotError(f'{path}: "joints" must be a list of names, got {shown(joints)}.')
    if sorted(joints) != sorted(robot.joint_names):
        raise RobotError(
            f"{path}: this is a state of robot {shown(data.get('robot'))} with the joints "
            f"{', '.join(joints)[:300]}; robot {robot.name!r} has {', '.join(robot.joint_names)}."
        )
    order = [joints.index(name) for name in robot.joint_names]
    q, v = (_numbers(path, data, key, len(joints))[order] for key in _VECTORS)
    require_unchanged(path, data, RobotError)
    return State(q, v)


def _numbers(path: str | os.PathLike[str], data: dict[str, Any], key: str, size: int) -> Floats:
    values = data.get(key)
    if (
        not isinstance(values, list)
        or len(values) != size
        or not all(
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and abs(value) <= sys.float_info.max  # also of whole numbers, and no NaN
            for value in values
        )
    ):
        raise RobotError(f'{path}: "{key}" must be a list of {size} finite numbers.')
    return np.array(values, dtype=np.float64)
