"""Gaits as files: readable JSON with units in the names, read back strictly.

Reading a file never runs anything from it.
"""

from __future__ import annotations

import enum
import json
import math
from collections.abc import Mapping
from dataclasses import fields
from os import PathLike
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError, WriteError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import Footing, Gait, Phase, fingerprint
from heelstrike.gait.margins import Margins
from heelstrike.gait.polynomials import cubic
from heelstrike.json_checksum import read_json, require_unchanged, shown, with_checksum
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

VERSION = 2
"""Version 1 had gaits of one phase: of a single cubic, given by its ends, or of several pieces."""
LARGEST_NUMBER = 1e9
"""No angle, velocity, force or cost of a gait is larger than this, in any unit."""

Made = TypeVar("Made", Gait, Phase)
Member = TypeVar("Member", bound=enum.Enum)

_ENTRIES = {
    "robot": ("robot", "text"),
    "robot_fingerprint": ("fingerprint", "text"),
    "step_length_m": ("step_length", "number"),
    "cost_N2m2s": ("cost", "number"),
    "friction": ("friction", "number"),
    "clearance_m": ("clearance", "number"),
    "clearance_profile": ("clearance_profile", "profile"),
    "joints": ("joint_names", "names"),
    "mirror_sign": ("mirror_sign", "joints"),
    "mirror_offset_rad": ("mirror_offset", "joints"),
    "mirror_joint": ("mirror_joint", "indices"),
    "touchdown_impulse_Ns": ("touchdown_impulse", "impulse"),
}
"""What stands in a file: the attribute of a gait, and the method of `_Reader` that reads it."""

_MARGINS = {"_".join([each.name, *each.metadata.values()]): each.name for each in fields(Margins)}
"""Names of the margins with their units."""


def save_gait(gait: Gait, path: str | PathLike[str]) -> None:
    """Write a gait to a JSON file, which appears whole or not at all."""
    data: dict[str, Any] = {
        "format": "heelstrike gait",
        "version": VERSION,
        **{key: _plain(getattr(gait, name)) for key, (name, _) in _ENTRIES.items()},
        "initial_position": gait.initial_state.q.tolist(),
        "initial_velocity": gait.initial_state.v.tolist(),
        "phases": [
            {key: _plain(getattr(phase, name)) for key, name in _phase_entries(phase).items()}
            for phase in gait.phases
        ],
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


def _phase_entries(phase: Phase) -> dict[str, str]:
    entries = {"contacts": "contacts", "breakpoints_s": "breakpoints", "joint_pieces": "pieces"}
    return entries if phase.pitch_pieces is None else {**entries, "pitch_pieces": "pitch_pieces"}


def _plain(value: Any) -> Any:
    """What JSON knows of a value."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, enum.Enum):
        return value.value
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


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
    data = read_json(path, "gait", (1, VERSION), GaitError)
    gait = _Reader(path, data).gait()
    if robot is not None:
        _check_robot(gait, robot, path)
    require_unchanged(path, data, GaitError)
    return gait


class _Reader:
    """Entries of a gait file, or of an object in it, each checked for its kind before use."""

    def __init__(self, path: str | PathLike[str], data: Any) -> None:
        self.path = path
        self.data = data

    def error(self, what: str) -> GaitError:
        return GaitError(f"{self.path}: {what}")

    def gait(self) -> Gait:
        values = {name: getattr(self, kind)(key) for key, (name, kind) in _ENTRIES.items()}
        nu = len(values["joint_names"])
        size = nu + 3
        values["initial_state"] = State(
            self.vector("initial_position", size), self.vector("initial_velocity", size)
        )
        margins = self.object("margins")
        values["margins"] = Margins(**{n: margins.margin(key) for key, n in _MARGINS.items()})
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
            raise self.error(f'"contacts" must name feet "0" or "1", got {shown(list(feet))}')
        return self.piecewise({int(foot): feet[foot] for foot in feet}, nu)

    def only_phase(self, nu: int) -> Phase:
        """What a file of version 1 says of the motion."""
        foot = self.whole("stance_foot", self.number("stance_foot"))
        if {"breakpoints_s", "joint_pieces", "pitch_pieces"} & set(self.data):
            return self.piecewise({foot: Footing.POINT}, nu)
        duration = self.number("step_duration_s")
        if not duration > 0.0:
            raise self.error("step_duration must be positive")
        positions = [self.vector(f"{end}_position_rad", nu) for end in ("start", "end")]
        velocities = [self.vector(f"{end}_velocity_rad_per_s", nu) for end in ("start", "end")]
        pieces = cubic(positions, velocities, duration)[None]
        breakpoints = np.array([0.0, duration])
        contacts = {foot: Footing.FLAT}
        return self.made(Phase, contacts=contacts, breakpoints=breakpoints, pieces=pieces)

    def piecewise(self, contacts: dict[int, Footing], nu: int) -> Phase:
        values = {"breakpoints": self.table("breakpoints_s"), "pieces": self.table("joint_pieces")}
        if "pitch_pieces" in self.data or Footing.FLAT not in contacts.values():
            values["pitch_pieces"] = self.table("pitch_pieces")
        if values["breakpoints"].ndim != 1 or values["pieces"].shape[2:] != (nu,):
            raise self.error(
                f'"joint_pieces" must hold a list of coefficients of {nu} joints for every piece, '
                '"breakpoints_s" the times between them'
            )
        return self.made(Phase, contacts=contacts, **values)

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
            raise self.error(f'an object with "{key}" must stand where {shown(self.data)} does')
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
            raise self.error(f'"{key}" must be a text, got {shown(value)}')
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
            raise self.error(f'"{key}" must be a list of different names, got {shown(value)}')
        return tuple(value)

    def number(self, key: str) -> float:
        return self.checked(key, self.entry(key))

    def joints(self, key: str) -> NDArray[np.float64]:
        return self.vector(key, len(self.names("joints")))

    def indices(self, key: str) -> list[int]:
        return [self.whole(key, value) for value in self.joints(key)]

    def impulse(self, key: str) -> NDArray[np.float64]:
        return self.vector(key, 3)

    def profile(self, key: str) -> ClearanceProfile:
        return self.member(key, ClearanceProfile)

    def margin(self, key: str) -> float:
        value = self.entry(key)
        return math.inf if value is None else self.checked(key, value)

    def vector(self, key: str, size: int) -> NDArray[np.float64]:
        value = self.entry(key)
        if not isinstance(value, list) or len(value) != size:
            raise self.error(f'"{key}" must be a list of {size} numbers, got {shown(value)}')
        return np.array([self.checked(key, number) for number in value])

    def checked(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f'"{key}" must be a number, got {shown(value)}')
        if not abs(value) <= LARGEST_NUMBER:
            raise self.error(f'"{key}" holds {shown(value)}, which no gait has')
        return float(value)

    def whole(self, key: str, value: float) -> int:
        if value != int(value):
            raise self.error(f'"{key}" must hold whole numbers, got {value:g}')
        return int(value)


def _check_robot(gait: Gait, robot: Robot, path: str | PathLike[str]) -> None:
    if gait.robot != robot.name:
        raise GaitError(
            f"{path}: is a gait of robot {shown(gait.robot)}, not of {robot.name!r}. Load that "
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
