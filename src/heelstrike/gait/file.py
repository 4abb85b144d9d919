"""Gaits as files: readable JSON with units in the names, read back strictly.

Reading a file never runs anything from it.
"""

from __future__ import annotations

import enum
import json
import math
from dataclasses import fields
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError, WriteError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import Footing, Gait, Phase, fingerprint
from heelstrike.gait.margins import Margins
from heelstrike.gait.polynomials import coefficients
from heelstrike.json_checksum import KEY as CHECKSUM
from heelstrike.json_checksum import is_changed, with_checksum
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

FORMAT = "heelstrike gait"
VERSION = 2
"""Version 1 had gaits of one phase: of a single cubic, given by its ends, or of several pieces."""
LARGEST_FILE = 2**20
"""Gait files larger than this (in bytes) are refused: one has some 4 kB."""
LARGEST_NUMBER = 1e9
"""No angle, velocity, force or cost of a gait is larger than this, in any unit."""

Made = TypeVar("Made", Gait, Phase)
Member = TypeVar("Member", bound=enum.Enum)

_VECTORS = {"mirror_sign": "mirror_sign", "mirror_offset_rad": "mirror_offset"}
_NUMBERS = {
    "step_length_m": "step_length",
    "cost_N2m2s": "cost",
    "friction": "friction",
    "clearance_m": "clearance",
}
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
        "joints": list(gait.joint_names),
        **{key: getattr(gait, name).tolist() for key, name in _VECTORS.items()},
        "mirror_joint": gait.mirror_joint.tolist(),
        "initial_position": gait.initial_state.q.tolist(),
        "initial_velocity": gait.initial_state.v.tolist(),
        "touchdown_impulse_Ns": gait.touchdown_impulse.tolist(),
        "phases": [_phase_data(phase) for phase in gait.phases],
        # JSON knows no infinity: no limit, no margin.
        "margins": {
            key: value if math.isfinite(value := getattr(gait.margins, name)) else None
            for key, name in _MARGINS.items()
        },
    }
    data = with_checksum(data)
    lines = ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in data.items())
    try:
        write_whole(path, f"{{\n{lines}\n}}\n")
    except WriteError as error:
        raise GaitError(str(error)) from error


def _phase_data(phase: Phase) -> dict[str, Any]:
    pitch = phase.pitch_pieces
    return {
        "contacts": {str(foot): footing.value for foot, footing in phase.contacts.items()},
        "breakpoints_s": phase.breakpoints.tolist(),
        "joint_pieces": phase.pieces.tolist(),
        **({} if pitch is None else {"pitch_pieces": pitch.tolist()}),
    }


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
    data = _parsed(path)
    reader = _Reader(path, data)
    reader.check_format()
    gait = reader.gait()
    if robot is not None:
        _check_robot(gait, robot, path)
    if is_changed(data):
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
    """Entries of a gait file, or of an object in it, each checked for its kind before use."""

    def __init__(self, path: Path, data: Any) -> None:
        self.path = path
        self.data = data

    def check_format(self) -> None:
        if not isinstance(self.data, dict) or self.data.get("format") != FORMAT:
            raise self.error(f'not a gait file: it must be a JSON object with "format": "{FORMAT}"')
        version = self.data.get("version")
        if isinstance(version, bool) or version not in range(1, VERSION + 1):
            raise self.error(
                f"version {_shown(version)} of the format is not known here, only those to "
                f"{VERSION}; was it written by a newer heelstrike?"
            )

    def error(self, what: str) -> GaitError:
        return GaitError(f"{self.path}: {what}")

    def gait(self) -> Gait:
        joints = self.names("joints")
        nu = len(joints)
        margins = self.object("margins")
        values: dict[str, Any] = {
            **{name: self.number(key) for key, name in _NUMBERS.items()},
            **{name: self.vector(key, nu) for key, name in _VECTORS.items()},
            "robot": self.text("robot"),
            "fingerprint": self.text("robot_fingerprint"),
            "joint_names": joints,
            "mirror_joint": [
                self.whole("mirror_joint", x) for x in self.vector("mirror_joint", nu)
            ],
            "initial_state": State(
                self.vector("initial_position", nu + 3), self.vector("initial_velocity", nu + 3)
            ),
            "clearance_profile": self.member("clearance_profile", ClearanceProfile),
            "touchdown_impulse": self.vector("touchdown_impulse_Ns", 3),
            "margins": Margins(**{name: margins.margin(key) for key, name in _MARGINS.items()}),
        }
        if self.data["version"] == 1:
            return self.made(Gait, **values, phases=(self.only_phase(nu),))
        phases = self.entry("phases")
        if not isinstance(phases, list):
            raise self.error('"phases" must be a list')
        read = tuple(_Reader(self.path, phase).phase(nu) for phase in phases)
        return self.made(Gait, **values, phases=read)

    def made(self, kind: type[Made], **values: Any) -> Made:
        try:
            return kind(**values)
        except GaitError as error:
            raise self.error(str(error)) from None

    def phase(self, nu: int) -> Phase:
        contacts = self.object("contacts")
        feet = {key: contacts.member(key, Footing) for key in contacts.data}
        if not feet or not set(feet) <= {"0", "1"}:
            raise self.error(f'"contacts" must name feet "0" or "1", got {_shown(list(feet))}')
        pitch = ("pitch_pieces",) if "pitch_pieces" in self.data else ()
        return self.piecewise({int(foot): feet[foot] for foot in feet}, nu, *pitch)

    def only_phase(self, nu: int) -> Phase:
        """What a file of version 1 says of the motion."""
        foot = self.whole("stance_foot", self.number("stance_foot"))
        if {"breakpoints_s", "joint_pieces", "pitch_pieces"} & set(self.data):
            return self.piecewise({foot: Footing.POINT}, nu, "pitch_pieces")
        duration = self.number("step_duration_s")
        if not duration > 0.0:
            raise self.error("step_duration must be positive")
        ends = [
            self.vector(f"{end}_{key}", nu)
            for end in ("start", "end")
            for key in ("position_rad", "velocity_rad_per_s")
        ]
        pieces = coefficients(np.stack(ends), duration)[None]
        breakpoints = np.array([0.0, duration])
        contacts = {foot: Footing.FLAT}
        return self.made(Phase, contacts=contacts, breakpoints=breakpoints, pieces=pieces)

    def piecewise(self, contacts: dict[int, Footing], nu: int, *pitch: str) -> Phase:
        breakpoints, pieces = self.table("breakpoints_s"), self.table("joint_pieces")
        pitches = [self.table(key) for key in pitch]
        shapes = [breakpoints.ndim, pieces.ndim, *(each.ndim for each in pitches)]
        if shapes != [1, 3, 2][: len(shapes)] or pieces.shape[2] != nu:
            raise self.error(
                f'"joint_pieces" must hold a list of coefficients of {nu} joints for every piece, '
                '"pitch_pieces" a list of coefficients, "breakpoints_s" the times between them'
            )
        return self.made(
            Phase,
            contacts=contacts,
            breakpoints=breakpoints,
            pieces=pieces,
            pitch_pieces=pitches[0] if pitches else None,
        )

    def table(self, key: str) -> NDArray[np.float64]:
        """Numbers in lists of lists, all of the same length."""

        def checked(value: Any, depth: int) -> Any:
            if depth and isinstance(value, list) and value:
                return [checked(each, depth - 1) for each in value]
            return self.checked(key, value)

        numbers = checked(self.entry(key), 3)
        try:
            return np.array(numbers, dtype=np.float64)
        except ValueError:
            raise self.error(f'"{key}" must hold lists of one length') from None

    def entry(self, key: str) -> Any:
        if not isinstance(self.data, dict):
            raise self.error(f'an object with "{key}" must stand where {_shown(self.data)} does')
        if key not in self.data:
            raise self.error(f'"{key}" is missing')
        return self.data[key]

    def object(self, key: str) -> _Reader:
        value = self.entry(key)
        if not isinstance(value, dict):
            raise self.error(f'"{key}" must be an object')
        return _Reader(self.path, value)

    def text(self, key: str) -> str:
        value = self.entry(key)
        if not isinstance(value, str):
            raise self.error(f'"{key}" must be a text, got {_shown(value)}')
        return value

    def member(self, key: str, kind: type[Member]) -> Member:
        try:
            return kind(self.text(key))
        except ValueError:
            names = ", ".join(f'"{known.value}"' for known in kind)
            raise self.error(f'"{key}" must be one of {names}') from None

    def names(self, key: str) -> tuple[str, ...]:
        value = self.entry(key)
        if (
            not isinstance(value, list)
            or not value
            or not all(isinstance(name, str) for name in value)
            or len(set(value)) != len(value)
        ):
            raise self.error(f'"{key}" must be a list of different names, got {_shown(value)}')
        return tuple(value)

    def number(self, key: str) -> float:
        return self.checked(key, self.entry(key))

    def margin(self, key: str) -> float:
        value = self.entry(key)
        return math.inf if value is None else self.checked(key, value)

    def vector(self, key: str, size: int) -> NDArray[np.float64]:
        value = self.entry(key)
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
