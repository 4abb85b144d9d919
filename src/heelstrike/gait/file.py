"""Gaits as files: readable JSON with units in the names, read back strictly.

Reading a file never runs anything from it.
"""

from __future__ import annotations

import math
from dataclasses import fields
from os import PathLike
from typing import Any

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import GaitError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import Footing, Gait, Phase, fingerprint
from heelstrike.gait.margins import Margins
from heelstrike.gait.polynomials import cubic
from heelstrike.json_checksum import Entries, json_text, reading_json, shown
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

VERSION = 2
"""Version 1 had gaits of one phase: of a single cubic, given by its ends, or of several pieces."""
LARGEST_NUMBER = 1e9
"""No angle, velocity, force or cost of a gait is larger than this, in any unit."""

_TEXTS = {"robot": "robot", "robot_fingerprint": "fingerprint"}
_NUMBERS: dict[str, tuple[str, tuple[int, ...]]] = {
    "step_length_m": ("step_length", ()),
    "cost_N2m2s": ("cost", ()),
    "friction": ("friction", ()),
    "clearance_m": ("clearance", ()),
    "mirror_sign": ("mirror_sign", (0,)),
    "mirror_offset_rad": ("mirror_offset", (0,)),
    "mirror_joint": ("mirror_joint", (0,)),
    "touchdown_impulse_Ns": ("touchdown_impulse", (3,)),
}
_LATER = {"slope_rad": "slope", "rise_m": "rise", "spent": "spent"}
"""Numbers that older files lack, of gaits that have their defaults."""
"""Entries of a file: the attribute of the gait, and the shape of its numbers; 0 is one a joint."""

_MARGINS = {"_".join([each.name, *each.metadata.values()]): each.name for each in fields(Margins)}
"""Names of the margins with their units."""


def save_gait(gait: Gait, path: str | PathLike[str]) -> None:
    """Write a gait to a JSON file, which appears whole or not at all."""
    write_whole(path, json_text("gait", VERSION, entries_of(gait)), GaitError)


def entries_of(gait: Gait) -> dict[str, Any]:
    """Return what stands of a gait in a file."""
    return {
        **{key: getattr(gait, name) for key, name in _TEXTS.items()},
        **{key: np.asarray(getattr(gait, name)).tolist() for key, (name, _) in _NUMBERS.items()},
        **{
            key: value
            for key, name in _LATER.items()
            if (value := getattr(gait, name)) not in (0.0, None)
        },
        **({} if gait.optimal else {"optimal": False}),
        "clearance_profile": gait.clearance_profile.value,
        "joints": list(gait.joint_names),
        "initial_position": gait.initial_state.q.tolist(),
        "initial_velocity": gait.initial_state.v.tolist(),
        "phases": [_of_phase(phase) for phase in gait.phases],
        # JSON knows no infinity: no limit, no margin.
        "margins": {
            key: value if math.isfinite(value := getattr(gait.margins, name)) else None
            for key, name in _MARGINS.items()
        },
    }


def _of_phase(phase: Phase) -> dict[str, Any]:
    entries = {
        "contacts": {str(foot): footing.value for foot, footing in phase.contacts.items()},
        "breakpoints_s": phase.breakpoints.tolist(),
        "joint_pieces": phase.pieces.tolist(),
    }
    if phase.pitch_pieces is not None:
        entries["pitch_pieces"] = phase.pitch_pieces.tolist()
    return entries


@takes(GaitError)
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
    with reading_json(path, "gait", (1, VERSION), LARGEST_NUMBER, GaitError) as entries:
        gait = gait_of(entries, entries.data["version"])
        if robot is not None:
            check_robot(gait, robot)
        return gait


def gait_of(entries: Entries, version: int = VERSION) -> Gait:
    """Return the gait of which entries in a file tell."""
    joints = entries.names("joints")
    nu, given = len(joints), entries.data.get("initial_position")
    # More than trunk and motors where joints follow by closed loops.
    size = max(nu + 3, len(given) if isinstance(given, list) else 0)
    values: dict[str, Any] = {
        name: entries.numbers(key, *(length or nu for length in shape)).tolist()
        for key, (name, shape) in _NUMBERS.items()
    }
    values |= {name: entries.text(key) for key, name in _TEXTS.items()}
    if version == 1:
        phases = [_only_phase(entries, nu)]
    else:
        phases = [_phase(each, nu) for each in entries.objects("phases")]
    values |= {name: entries.number(key) for key, name in _LATER.items() if key in entries.data}
    margins = entries.object("margins")
    return Gait(
        **values,
        optimal=entries.data.get("optimal", True) is True,
        clearance_profile=entries.member("clearance_profile", ClearanceProfile),
        joint_names=joints,
        initial_state=State(
            entries.numbers("initial_position", size), entries.numbers("initial_velocity", size)
        ),
        phases=tuple(phases),
        margins=Margins(
            **{
                name: math.inf if margins.entry(key) is None else margins.number(key)
                for key, name in _MARGINS.items()
            }
        ),
    )


def _phase(entries: Entries, nu: int) -> Phase:
    contacts = entries.object("contacts")
    if not contacts.data or not set(contacts.data) <= {"0", "1"}:
        raise GaitError(f'"contacts" must name feet "0" or "1", got {shown(list(contacts.data))}')
    return _of_pieces(
        entries, {int(foot): contacts.member(foot, Footing) for foot in contacts.data}, nu
    )


def _only_phase(entries: Entries, nu: int) -> Phase:
    """What a file of version 1 says of the motion."""
    foot: Any = entries.number("stance_foot")
    if {"breakpoints_s", "joint_pieces", "pitch_pieces"} & set(entries.data):
        return _of_pieces(entries, {foot: Footing.POINT}, nu)
    duration = entries.number("step_duration_s")
    if not duration > 0.0:
        raise GaitError("step_duration must be positive")
    positions = [entries.numbers(f"{end}_position_rad", nu) for end in ("start", "end")]
    velocities = [entries.numbers(f"{end}_velocity_rad_per_s", nu) for end in ("start", "end")]
    return Phase(
        contacts={foot: Footing.FLAT},
        breakpoints=np.array([0.0, duration]),
        pieces=cubic(positions, velocities, duration)[None],
    )


def _of_pieces(entries: Entries, contacts: dict[int, Footing], nu: int) -> Phase:
    free = "pitch_pieces" in entries.data or Footing.FLAT not in contacts.values()
    return Phase(
        contacts=contacts,
        breakpoints=entries.numbers("breakpoints_s", None),
        pieces=entries.numbers("joint_pieces", None, None, nu),
        pitch_pieces=entries.numbers("pitch_pieces", None, None) if free else None,
    )


def check_robot(gait: Gait, robot: Robot) -> None:
    """Raise a `GaitError` unless a gait was designed for a robot."""
    if gait.robot != robot.name:
        raise GaitError(
            f"is a gait of robot {shown(gait.robot)}, not of {robot.name!r}. Load that "
            "robot, or design a gait for this one with optimize_gait."
        )
    gait.check_joints(robot)
    if gait.fingerprint != fingerprint(robot):
        raise GaitError(
            f"was designed for another version of robot {robot.name!r}, with other masses, "
            "lengths or limits. Design it again with optimize_gait."
        )
