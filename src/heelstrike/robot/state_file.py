"""States as files: readable JSON in SI units with the names of the joints, read back strictly.

Reading a file never runs anything from it. Numbers are written with all their digits: what is read
is what was saved, bit by bit, on every machine.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from heelstrike.errors import RobotError
from heelstrike.json_checksum import json_text, reading_json, shown
from heelstrike.robot.coordinates import checked
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

if TYPE_CHECKING:
    from heelstrike.robot.robot import Robot

VERSION = 1

_VECTORS = ("position_rad_or_m", "velocity_rad_or_m_per_s")


def save_state(robot: Robot, state: State, path: str | os.PathLike[str]) -> Path:
    """Write a state to a JSON file; see :meth:`Robot.save_state`."""
    state = checked(robot, state)
    entries = {
        "robot": robot.name,
        "joints": list(robot.joint_names),
        _VECTORS[0]: state.q.tolist(),
        _VECTORS[1]: state.v.tolist(),
    }
    return write_whole(path, json_text("state", VERSION, entries), RobotError)


def load_state(robot: Robot, path: str | os.PathLike[str]) -> State:
    """Read a state from a JSON file; see :meth:`Robot.load_state`."""
    with reading_json(path, "state", (VERSION,), sys.float_info.max, RobotError) as entries:
        joints = entries.names("joints")
        if sorted(joints) != sorted(robot.joint_names):
            raise RobotError(
                f"this is a state of robot {shown(entries.data.get('robot'))} with the joints "
                f"{', '.join(joints)[:300]}; robot {robot.name!r} has "
                f"{', '.join(robot.joint_names)}."
            )
        order = [joints.index(name) for name in robot.joint_names]
        return State(*(entries.numbers(key, len(joints))[order] for key in _VECTORS))
