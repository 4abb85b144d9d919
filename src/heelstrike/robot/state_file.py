"""States as files: readable JSON in SI units with the names of the joints, read back strictly.

Reading a file never runs anything from it. Numbers are written with all their digits: what is read
is what was saved, bit by bit, on every machine.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from heelstrike.errors import RobotError, WriteError
from heelstrike.json_checksum import KEY as CHECKSUM
from heelstrike.json_checksum import is_changed, with_checksum
from heelstrike.robot.coordinates import checked
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

if TYPE_CHECKING:
    from heelstrike.robot.robot import Robot

FORMAT = "heelstrike state"
VERSION = 1
LARGEST_FILE = 2**20
"""State files larger than this (in bytes) are refused: one has some 500 bytes."""

_VECTORS = ("position_rad_or_m", "velocity_rad_or_m_per_s")


def save_state(robot: Robot, state: State, path: str | os.PathLike[str]) -> Path:
    """Write a state to a JSON file; see :meth:`Robot.save_state`."""
    state = checked(robot, state)
    data = {
        "format": FORMAT,
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
    file = Path(path)
    data = _parsed(file)
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise RobotError(
            f'{file}: not a state file: it must be a JSON object with "format": "{FORMAT}".'
        )
    if data.get("version") != VERSION or isinstance(data["version"], bool):
        raise RobotError(
            f"{file}: version {_shown(repr(data.get('version')))} of the format is not known here, "
            f"only {VERSION}; was it written by a newer heelstrike?"
        )
    joints = data.get("joints")
    if not isinstance(joints, list) or not all(isinstance(name, str) for name in joints):
        raise RobotError(f'{file}: "joints" must be a list of names, got {_shown(repr(joints))}.')
    if sorted(joints) != sorted(robot.joint_names):
        has = ", ".join(joints)
        raise RobotError(
            f"{file}: this is a state of robot {_shown(repr(data.get('robot')))} with the joints "
            f"{_shown(has)}; robot {robot.name!r} has {', '.join(robot.joint_names)}."
        )
    order = [joints.index(name) for name in robot.joint_names]
    q, v = (_numbers(file, data, key, len(joints))[order] for key in _VECTORS)
    if is_changed(data):
        raise RobotError(
            f"{file}: damaged: its numbers are not those that were saved. If you changed them, "
            f'remove the entry "{CHECKSUM}".'
        )
    return State(q, v)


def _shown(text: str) -> str:
    return text if len(text) <= 300 else text[:297] + "…"


def _numbers(file: Path, data: dict[str, Any], key: str, size: int) -> Floats:
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
        raise RobotError(f'{file}: "{key}" must be a list of {size} finite numbers.')
    return np.array(values, dtype=np.float64)


def _parsed(file: Path) -> Any:
    def refuse(constant: str) -> NoReturn:
        raise RobotError(f"{file}: contains {constant}; every number of a state is finite.")

    try:
        if not file.is_file():
            raise RobotError(f"{file}: there is no such file.")
        if file.stat().st_size > LARGEST_FILE:
            raise RobotError(f"{file}: larger than {LARGEST_FILE // 2**20} MB; is it a state?")
        return json.loads(file.read_text(encoding="utf-8-sig"), parse_constant=refuse)
    except RobotError:
        raise
    except json.JSONDecodeError as error:
        raise RobotError(
            f"{file}: not valid JSON: {error.msg} in line {error.lineno}, column {error.colno}."
        ) from error
    except (OSError, ValueError, RecursionError) as error:
        raise RobotError(f"{file}: the state cannot be read: {error}.") from error
