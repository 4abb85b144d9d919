"""Gaits as files: readable JSON with units in the names, read back strictly.

Reading a file never runs anything from it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError, WriteError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import Gait, fingerprint
from heelstrike.gait.margins import Margins
from heelstrike.gait.piecewise import PiecewiseGait
from heelstrike.json_checksum import KEY as CHECKSUM
from heelstrike.json_checksum import is_changed, with_checksum
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

FORMAT = "heelstrike gait"
VERSION = 1
LARGEST_FILE = 2**20
"""Gait files larger than this (in bytes) are refused: one has some 4 kB."""
LARGEST_NUMBER = 1e9
"""No angle, velocity, force or cost of a gait is larger than this, in any unit."""

_VECTORS = {
    "start_position_rad": "start_position",
    "end_position_rad": "end_position",
    "start_velocity_rad_per_s": "start_velocity",
    "end_velocity_rad_per_s": "end_velocity",
    "mirror_sign": "mirror_sign",
    "mirror_offset_rad": "mirror_offset",
}
_NUMBERS = {
    "step_length_m": "step_length",
    "step_duration_s": "step_duration",
    "cost_N2m2s": "cost",
    "friction": "friction",
    "clearance_m": "clearance",
}
_PIECES = {
    "breakpoints_s": "breakpoints",
    "joint_pieces": "pieces",
    "pitch_pieces": "pitch_pieces",
}
"""What a gait of piecewise polynomials has besides; a file with the first of these is one."""
_MARGINS = {
    "normal_force_N": "normal_force",
    "friction_use": "friction_use",
    "zero_moment_point_m": "zero_moment_point",
    "clearance_m": "clearance",
    "joint_range_rad": "joint_range",
    "torque_Nm": "torque",
    "peak_torque_Nm": "peak_torque",
    "impulse_Ns": "impulse",
    "impulse_friction_use": "impulse_friction_use",
    "impulse_center_m": "impulse_center",
    "landing_velocity_m_per_s": "landing_velocity",
    "lift_velocity_m_per_s": "lift_velocity",
    "touchdown_error": "touchdown_error",
    "impact_error": "impact_error",
}
assert set(_MARGINS.values()) == {field.name for field in fields(Margins)}


def save_gait(gait: Gait, path: str | PathLike[str]) -> None:
    """Write a gait to a JSON file, which appears whole or not at all."""
    data: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "robot": gait.robot,
        "robot_fingerprint": gait.fingerprint,
        **{key: getattr(gait, name) for key, name in _NUMBERS.items()},
        "clearance_profile": gait.clearance_profile.value,
        "stance_foot": gait.stance_foot,
        "joints": list(gait.joint_names),
        **{key: getattr(gait, name).tolist() for key, name in _VECTORS.items()},
        "mirror_joint": gait.mirror_joint.tolist(),
        "initial_position": gait.initial_state.q.tolist(),
        "initial_velocity": gait.initial_state.v.tolist(),
        "touchdown_impulse_Ns": gait.touchdown_impulse.tolist(),
        # JSON knows no infinity: no limit, no margin.
        "margins": {
            key: value if math.isfinite(value := getattr(gait.margins, name)) else None
            for key, name in _MARGINS.items()
        },
    }
    if isinstance(gait, PiecewiseGait):
        data |= {key: getattr(gait, name).tolist() for key, name in _PIECES.items()}
    data = with_checksum(data)
    lines = ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in data.items())
    try:
        write_whole(path, f"{{\n{lines}\n}}\n")
    except WriteError as error:
        raise GaitError(str(error)) from error


def load_gait(path: str | PathLike[str], robot: Robot | None = None) -> Gait:
    """Read a gait that :meth:`Gait.save` wrote.

    Parameters
    ----------
    path : path
        The file.
    robot : Robot, optional
        The robot that is to walk; the gait must have been designed for it.

    Returns
    -------
    Gait
        The gait, with exactly the numbers it was saved with.

    Raises
    ------
    GaitError
        If there is no such file, it is not a gait, its numbers are missing, of the wrong number,
        not finite or not those that were saved, or the gait belongs to another robot.
    """
    path = Path(path)
    reader = _Reader(path, _parsed(path))
    gait = reader.gait()
    if robot is not None:
        _check_robot(gait, robot, path)
    if is_changed(reader.data):
        raise GaitError(
            f"{path}: damaged: its numbers are not those that were saved. If you changed them, "
            f'remove the entry "{CHECKSUM}".'
        )
    return gait


def _parsed(path: Path) -> Any:
    def refuse(constant: str) -> NoReturn:
        raise GaitError(f"{path}: contains {constant}; every number of a gait is finite.")

    try:
        if path.is_dir():
            raise GaitError(f"{path}: is a directory; name the gait file in it.")
        if not path.exists():
            raise GaitError(f"{path}: there is no such file.")
        if not path.is_file():
            raise GaitError(f"{path}: is not a regular file.")
        if path.stat().st_size > LARGEST_FILE:
            raise GaitError(f"{path}: larger than {LARGEST_FILE // 2**20} MB; is it a gait?")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise GaitError(f"{path}: cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise GaitError(f"{path}: not a text file; gaits are JSON text.") from error
    except ValueError as error:  # a path with a null character
        raise GaitError(f"{path!r}: is not a path to a file ({error}).") from error
    try:
        return json.loads(text, parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise GaitError(
            f"{path}: not valid JSON: {error.msg} in line {error.lineno}, column {error.colno}."
        ) from error
    except (RecursionError, ValueError) as error:  # nested without end; a number of 5000 digits
        raise GaitError(f"{path}: not a gait file ({error}).") from error


class _Reader:
    """Entries of a gait file, each checked for its kind before use."""

    def __init__(self, path: Path, data: Any) -> None:
        self.path = path
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise self.error(f'not a gait file: it must be a JSON object with "format": "{FORMAT}"')
        if data.get("version") != VERSION or isinstance(data["version"], bool):
            raise self.error(
                f"version {_shown(data.get('version'))} of the format is not known here, only "
                f"{VERSION}; was it written by a newer heelstrike?"
            )
        self.data = data

    def error(self, what: str) -> GaitError:
        return GaitError(f"{self.path}: {what}")

    def gait(self) -> Gait:
        joints = self.names("joints")
        nu = len(joints)
        margins = self.entry(self.data, "margins")
        if not isinstance(margins, dict):
            raise self.error('"margins" must be an object')
        values: dict[str, Any] = {
            **{name: self.number(self.data, key) for key, name in _NUMBERS.items()},
            **{name: self.vector(key, nu) for key, name in _VECTORS.items()},
            "robot": self.text("robot"),
            "fingerprint": self.text("robot_fingerprint"),
            "joint_names": joints,
            "mirror_joint": [
                self.whole("mirror_joint", x) for x in self.vector("mirror_joint", nu)
            ],
            "stance_foot": self.whole("stance_foot", self.number(self.data, "stance_foot")),
            "initial_state": State(
                self.vector("initial_position", nu + 3), self.vector("initial_velocity", nu + 3)
            ),
            "clearance_profile": self.profile("clearance_profile"),
            "touchdown_impulse": self.vector("touchdown_impulse_Ns", 3),
            "margins": Margins(
                **{name: self.margin(margins, key) for key, name in _MARGINS.items()}
            ),
        }
        kind: type[Gait] = Gait
        if any(key in self.data for key in _PIECES):
            kind = PiecewiseGait
            values |= self.pieces(nu)
        try:
            return kind(**values)
        except GaitError as error:
            raise self.error(str(error)) from None

    def pieces(self, nu: int) -> dict[str, NDArray[np.float64]]:
        breakpoints, joints, pitch = (self.table(key) for key in _PIECES)
        if joints.ndim != 3 or joints.shape[2] != nu or pitch.ndim != 2 or breakpoints.ndim != 1:
            raise self.error(
                f'"joint_pieces" must hold a list of coefficients of {nu} joints for every piece, '
                '"pitch_pieces" a list of coefficients, "breakpoints_s" the times between them'
            )
        return {"breakpoints": breakpoints, "pieces": joints, "pitch_pieces": pitch}

    def table(self, key: str) -> NDArray[np.float64]:
        """Numbers in lists of lists, all of the same length."""

        def checked(value: Any, depth: int) -> Any:
            if depth and isinstance(value, list) and value:
                return [checked(each, depth - 1) for each in value]
            return self.checked(key, value)

        numbers = checked(self.entry(self.data, key), 3)
        try:
            return np.array(numbers, dtype=np.float64)
        except ValueError:
            raise self.error(f'"{key}" must hold lists of one length') from None

    def entry(self, data: Mapping[str, Any], key: str) -> Any:
        if key not in data:
            raise self.error(f'"{key}" is missing')
        return data[key]

    def text(self, key: str) -> str:
        value = self.entry(self.data, key)
        if not isinstance(value, str):
            raise self.error(f'"{key}" must be a text, got {_shown(value)}')
        return value

    def profile(self, key: str) -> ClearanceProfile:
        try:
            return ClearanceProfile(self.text(key))
        except ValueError:
            names = ", ".join(f'"{known.value}"' for known in ClearanceProfile)
            raise self.error(f'"{key}" must be one of {names}') from None

    def names(self, key: str) -> tuple[str, ...]:
        value = self.entry(self.data, key)
        if (
            not isinstance(value, list)
            or not value
            or not all(isinstance(name, str) for name in value)
            or len(set(value)) != len(value)
        ):
            raise self.error(f'"{key}" must be a list of different names, got {_shown(value)}')
        return tuple(value)

    def number(self, data: Mapping[str, Any], key: str) -> float:
        return self.checked(key, self.entry(data, key))

    def margin(self, data: Mapping[str, Any], key: str) -> float:
        value = self.entry(data, key)
        return math.inf if value is None else self.checked(key, value)

    def vector(self, key: str, size: int) -> NDArray[np.float64]:
        value = self.entry(self.data, key)
        if not isinstance(value, list) or len(value) != size:
            raise self.error(f'"{key}" must be a list of {size} numbers, got {_shown(value)}')
        return np.array([self.checked(key, number) for number in value])

    def checked(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f'"{key}" must be a number, got {_shown(value)}')
        if not abs(value) <= LARGEST_NUMBER:
            raise self.error(f'"{key}" holds {_shown(value)}, which no gait has')
        return float(value)

    def whole(self, key: str, value: float) -> int:
        if value != int(value):
            raise self.error(f'"{key}" must hold whole numbers, got {value:g}')
        return int(value)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def _check_robot(gait: Gait, robot: Robot, path: Path) -> None:
    if gait.robot != robot.name:
        raise GaitError(
            f"{path}: is a gait of robot {_shown(gait.robot)}, not of {robot.name!r}. Load that "
            "robot, or design a gait for this one with optimize_gait."
        )
    try:
        gait.check_joints(robot)
    except GaitError as error:
        raise GaitError(f"{path}: {error}") from None
    if gait.fingerprint != fingerprint(robot):
        raise GaitError(
            f"{path}: was designed for another version of robot {robot.name!r}, with other masses, "
            "lengths or limits. Design it again with optimize_gait."
        )
