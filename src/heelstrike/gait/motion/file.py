"""Motions as files: readable JSON with units in the names, read back strictly.

Reading a file never runs anything from it.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from heelstrike.arguments import takes
from heelstrike.dynamics.loops import count_rows
from heelstrike.errors import GaitError
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.request import Repeat
from heelstrike.json_checksum import Entries, json_text, reading_json
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.whole_file import write_whole

VERSION = 1
LARGEST_NUMBER = 1e15
"""No number of a motion is larger, in any unit: last coefficients of short pieces are large."""

_TEXTS = {"robot": "robot", "robot_fingerprint": "fingerprint"}
_SCALARS = {
    "distance_m": "distance",
    "slope_rad": "slope",
    "friction": "friction",
    "cost_N2m2s": "cost",
    "spent": "spent",
}
_VECTORS = {
    "mirror_joint": "mirror_joint",
    "mirror_sign": "mirror_sign",
    "mirror_offset_rad": "mirror_offset",
}


INFINITE = "infinite"
"""What stands for the distance of a motion that cannot be integrated."""
_LOOPS = {"loop_force": "loop_force_N", "loop_impulse": "loop_impulse_Ns"}
"""Entries of forces of loops (N, of some coupled joints N m), and what they were called first."""


def save_motion(motion: Motion, path: str | PathLike[str]) -> None:
    """Write a motion to a JSON file, which appears whole or not at all."""
    entries = {
        **{key: getattr(motion, name) for key, name in _TEXTS.items()},
        **{key: getattr(motion, name) for key, name in _SCALARS.items()},
        **{key: np.asarray(getattr(motion, name)).tolist() for key, name in _VECTORS.items()},
        "mirror_contact": motion.mirror_contact.tolist(),
        "repeat": motion.repeat.value,
        "optimal": motion.optimal,
        "rise_m": motion.rise,
        **_closing(motion.closes_to),
        "initial_position": motion.initial_state.q.tolist(),
        "initial_velocity": motion.initial_state.v.tolist(),
        "margins": {name: float(value) for name, value in motion.margins.items()},
        "phases": [
            {
                "contacts": list(phase.contacts),
                "breakpoints_s": phase.breakpoints.tolist(),
                "pieces": phase.pieces.tolist(),
                "force_N": phase.force.tolist(),
                "impulse_Ns": phase.impulse.tolist(),
                **_of_loops(phase),
            }
            for phase in motion.phases
        ],
    }
    write_whole(path, json_text("motion", VERSION, entries), GaitError)


def _closing(closes_to: float) -> dict[str, Any]:
    """By how much a motion closes, if somebody looked; a number in JSON is finite."""
    if np.isnan(closes_to):
        return {}
    return {"closes_to": closes_to if np.isfinite(closes_to) else INFINITE}


def _of_loops(phase: MotionPhase) -> dict[str, Any]:
    """What only robots with loops have."""
    if not phase.loop_force.size:
        return {}
    return {name: getattr(phase, name).tolist() for name in _LOOPS}


@takes(GaitError)
def load_motion(path: str | PathLike[str], robot: Robot | None = None) -> Motion:
    """Read a motion that :meth:`Motion.save` wrote.

    Parameters
    ----------
    path : path
        The file.
    robot : Robot, optional
        The robot that is to move; the motion must have been designed for it.

    Returns
    -------
    Motion
        The motion, with exactly the numbers it was saved with.

    Raises
    ------
    GaitError
        If there is no such file, it is not a motion, its numbers are missing, of the wrong number,
        not finite or not those that were saved, or the motion belongs to another robot.
    """
    with reading_json(path, "motion", (VERSION, VERSION), LARGEST_NUMBER, GaitError) as entries:
        motion = _motion_of(entries)
        if robot is not None:
            motion.check_robot(robot)
            _check_rows(motion, count_rows(robot.model))
        return motion


def _check_rows(motion: Motion, rows: int) -> None:
    """Refuse forces of more or fewer rows of loops and coupled joints than there are."""
    for p, phase in enumerate(motion.phases, start=1):
        if phase.loop_impulse.size != rows:
            raise GaitError(
                f'"loop_force" of phase {p} has {phase.loop_impulse.size} rows where {rows} belong'
            )


def _motion_of(entries: Entries) -> Motion:
    position = entries.numbers("initial_position", None)
    nv, margins = position.size, entries.object("margins")
    counterpart = entries.numbers("mirror_joint", nv).astype(np.int64)
    contact = entries.numbers("mirror_contact", None).astype(np.int64)
    for name, places in (("mirror_joint", counterpart), ("mirror_contact", contact)):
        if not np.array_equal(np.sort(places), np.arange(places.size)):
            raise GaitError(f'"{name}" must be a permutation')
    values: dict[str, Any] = {name: entries.text(key) for key, name in _TEXTS.items()}
    values |= {name: entries.number(key) for key, name in _SCALARS.items()}
    phases = tuple(_phase_of(each, nv, contact.size) for each in entries.objects("phases"))
    if not phases:
        raise GaitError("a motion needs one phase or more")
    motion = Motion(
        **values,
        phases=phases,
        repeat=entries.member("repeat", Repeat),
        mirror_joint=counterpart,
        mirror_sign=entries.numbers("mirror_sign", nv),
        mirror_offset=entries.numbers("mirror_offset_rad", nv),
        mirror_contact=contact,
        initial_state=State(position, entries.numbers("initial_velocity", nv)),
        optimal=entries.data.get("optimal") is True,
        rise=entries.number("rise_m") if "rise_m" in entries.data else 0.0,
        closes_to=_closes_to(entries),
        margins={name: margins.number(name) for name in margins.data},
    )
    _check_rows(motion, phases[0].loop_impulse.size)
    return motion


def _closes_to(entries: Entries) -> float:
    if "closes_to" not in entries.data:
        return np.nan
    return np.inf if entries.data["closes_to"] == INFINITE else entries.number("closes_to")


def _phase_of(entries: Entries, nv: int, nc: int) -> MotionPhase:
    ends = entries.numbers("breakpoints_s", None)
    pieces = entries.numbers("pieces", ends.size - 1, None, nv)
    if ends[0] != 0.0 or np.any(np.diff(ends) <= 0.0):
        raise GaitError('"breakpoints_s" must rise from 0')
    contacts = entries.data.get("contacts")
    names = entries.names("contacts") if contacts else ()
    force = entries.numbers("force_N", ends.size - 1, None, nc, 2)
    loops: dict[str, Any] = {}
    known = [names for names in zip(*_LOOPS.items(), strict=True) if names[0] in entries.data]
    for pull, strike in known:
        loops["loop_force"] = entries.numbers(pull, ends.size - 1, force.shape[1], None)
        loops["loop_impulse"] = entries.numbers(strike, loops["loop_force"].shape[2])
    return MotionPhase(
        contacts=names,
        breakpoints=ends,
        pieces=pieces,
        force=force,
        impulse=entries.numbers("impulse_Ns", nc, 2),
        **loops,
    )
