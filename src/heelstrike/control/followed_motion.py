"""A motion of any phases that a law follows: where in it the robot is, and what stands then.

The phase is that of the contacts: where points come down, their touchdown ends it, whenever that
is, and the clock of the next phase starts then. Elsewhere time ends it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics import contact_jacobian
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.phases import standing
from heelstrike.gait.motion.request import Repeat
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts

EARLIEST = 0.5
"""Share of a phase before which a touchdown does not end it: the foot scuffs."""
SLOWLY = 0.02
"""What comes down more slowly than this (m/s) does so earlier or later by any small error."""
LATEST = 1.1
"""Share of a phase until which its polynomials go on if no touchdown ends it."""


class FollowedMotion(Bundle):
    """Numbers of a law that follows a motion: its phases, those of its mirror image after them."""

    duration: Floats = array("phases")
    """Duration of each phase (s)."""
    begins: Floats = array("pieces")
    """When each piece begins in its phase (s)."""
    first: Integers = array("phases + 1", of=int)
    """First piece of each phase."""
    pieces: Floats = array("pieces", "terms", "nv")
    """Coefficients of all coordinates, lowest first."""
    stands: Integers = array("phases", "rows", of=int)
    """Whether the force along each row is one of those that hold the robot."""
    fresh: Integers = array("phases", "nc", of=int)
    """Whether the touchdown of a contact point ends a phase."""
    rolls: Integers = array("phases", of=int)
    """Whether all that comes down at the end of a phase is of links that stand already, and comes
    down slowly: a foot that rolls flat may touch at no speed, and so late by any small error. Then
    time ends the phase, and the torques of the next one press the foot down."""
    following: Integers = array("phases", of=int)
    """The phase after each; -1 after the last of a motion that never repeats."""
    earliest: float = number(float)
    latest: float = number(float)
    """earliest, latest: Shares of a phase, see :data:`EARLIEST` and :data:`LATEST`."""


class PhaseClock(Bundle):
    """The phase that a law is in."""

    phase: int = cell(int)
    """Which it is."""
    start: float = cell(float)
    """When that began (s)."""


@kernel
def advance_phase(
    t: float, contacts: Contacts, parameters: FollowedMotion, clock: PhaseClock
) -> int:
    """Go on to the next phase: at the touchdown that ends one, or as it is over.

    Returned is the contact point whose touchdown ended it, or -1.
    """
    phase = clock.phase
    gone, duration = t - clock.start, parameters.duration[phase]
    ends_by_touchdown, touched = False, -1
    for i in range(parameters.fresh.shape[1]):
        if parameters.fresh[phase, i] == 1:
            ends_by_touchdown = True
            if contacts.force[i, 0] > 0.0:
                touched = i
    if parameters.following[phase] < 0:
        return -1
    if touched >= 0 and gone >= parameters.earliest * duration:
        clock.start = t
        clock.phase = parameters.following[phase]
        return touched
    if gone >= duration and (not ends_by_touchdown or parameters.rolls[phase] == 1):
        clock.start += duration
        clock.phase = parameters.following[phase]
    return -1


@kernel
def place_in_phase(
    t: float, parameters: FollowedMotion, clock: PhaseClock
) -> tuple[int, float, float]:
    """Where in the motion the robot is: the piece, the time since its beginning, and 1.

    Or, where a phase lasts too long, the place where the motion stops, and 0: nothing moves.
    """
    phase = clock.phase
    latest = parameters.duration[phase]
    if parameters.following[phase] >= 0:
        latest *= parameters.latest
    gone = t - clock.start
    moves = 0.0 if gone > latest else 1.0
    gone = min(gone, latest)
    first, last = parameters.first[phase], parameters.first[phase + 1]
    piece = first
    while piece < last - 1 and gone >= parameters.begins[piece + 1]:
        piece += 1
    return piece, gone - parameters.begins[piece], moves


def followed_motion(robot: Robot, motion: Motion) -> dict[str, Any]:
    """Numbers of `FollowedMotion`."""
    cycle = cycle_of(robot, motion)
    repeats = motion.repeat is not Repeat.NEVER
    following = [*range(1, len(cycle)), 0 if repeats else -1]
    points = [points_of_phase(robot, phase) for phase in cycle]
    fresh = np.zeros((len(cycle), robot.nc), np.int64)
    for p, after in enumerate(following):
        fresh[p, list(points[after] - points[p] if after >= 0 else ())] = 1
    rolls = [
        _rolls(robot, motion.slope, phase, np.flatnonzero(row))
        for phase, row in zip(cycle, fresh, strict=True)
    ]
    return {
        "duration": np.array([phase.duration for phase in cycle]),
        "begins": np.concatenate([phase.breakpoints[:-1] for phase in cycle]),
        "first": np.cumsum([0, *(len(phase.pieces) for phase in cycle)]),
        "pieces": np.concatenate([phase.pieces for phase in cycle]),
        "stands": np.array([_rows_of(robot, each) for each in points]),
        "fresh": fresh,
        "rolls": np.array(rolls, np.int64),
        "following": np.array(following),
        "earliest": EARLIEST,
        "latest": LATEST,
    }


def _rolls(robot: Robot, slope: float, phase: MotionPhase, fresh: Integers) -> bool:
    """Whether what comes down is of links that stand already, and comes down slowly."""
    link, stand = robot.model.contact_link, sorted(points_of_phase(robot, phase))
    if not fresh.size or not set(link[fresh].tolist()) <= set(link[stand].tolist()):
        return False
    speeds = arrival_speeds(robot, slope, phase)
    return bool(speeds[fresh].min() < SLOWLY)


def arrival_speeds(robot: Robot, slope: float, phase: MotionPhase) -> Floats:
    """How fast all contact points come down at the end of a phase, (nc,), in m/s."""
    q, v = (phase.coordinates(phase.duration, order=order) for order in range(2))
    up, ahead = (contact_jacobian(robot, q) @ v).T
    return np.asarray(np.sin(slope) * ahead - np.cos(slope) * up, np.float64)


def points_of_phase(robot: Robot, phase: MotionPhase) -> set[int]:
    """Return the contact points that stand in a phase."""
    return {robot.contact_names.index(name) for name in phase.contacts}


def _rows_of(robot: Robot, points: set[int]) -> Integers:
    """Whether a force along each row holds the robot while points stand, (2 nc,)."""
    rows = np.zeros(2 * robot.nc, np.int64)
    rows[standing(robot, sorted(points)).forces] = 1
    return rows


def cycle_of(robot: Robot, motion: Motion) -> list[MotionPhase]:
    """Return the phases of a motion, those of its mirror image after them if it has one."""
    cycle = list(motion.phases)
    if motion.repeat is Repeat.MIRRORED:
        cycle += [mirrored_phase(robot, motion, phase) for phase in motion.phases]
    return cycle


def mirrored_phase(robot: Robot, motion: Motion, phase: MotionPhase) -> MotionPhase:
    """Return the mirror image of a phase."""
    pieces = motion.mirror_sign * phase.pieces[..., motion.mirror_joint]
    pieces[:, 0] += motion.mirror_offset
    names = robot.contact_names
    points = sorted(int(motion.mirror_contact[names.index(name)]) for name in phase.contacts)
    return MotionPhase(
        contacts=tuple(names[i] for i in points),
        breakpoints=phase.breakpoints,
        pieces=pieces,
        force=phase.force[:, :, motion.mirror_contact],
        impulse=phase.impulse[motion.mirror_contact],
    )
