"""Which feet carry the robot, when, and how many steps it took."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.run import AnyRun, Event, Run
from heelstrike.tolerances import STANDING_GAP

NOTHING = 1e-9
"""Normal forces below this fraction of the robot's weight are no force."""

CHATTER = 0.02
"""A foot that lands again within this time (s) has not stepped, nor one that leaves again within
it: they chatter, or scuff."""


def pushing(run: AnyRun) -> NDArray[np.bool_]:
    """Tell which contact points push in each row, (nt, nc).

    A row's forces act over the step that follows it, so that a foot pushes in the row whose step
    ends with its touchdown.
    """
    return np.asarray(run.contact_force[..., 0] > NOTHING * run.robot.weight)


def carrying(run: AnyRun) -> NDArray[np.bool_]:
    """Tell which contact points touch the ground or push on it in each row, (nt, nc)."""
    return np.asarray((run.gap <= STANDING_GAP) | pushing(run))


def on_ground(run: AnyRun) -> Floats:
    """Project the contact points onto the ground, (nt, nc, dimension), in m."""
    return np.asarray(run.contact_point - run.gap[..., None] * run.contact_normal)


def pushing_feet(run: AnyRun) -> NDArray[np.bool_]:
    """Tell which feet push in each row, (nt, nf)."""
    return np.asarray(foot_sums(run, pushing(run)) > 0)


def foot_sums(run: AnyRun, values: NDArray[Any]) -> NDArray[Any]:
    """Sum what is of contact points, (nt, nc, ...), over those of each foot, (nt, nf, ...)."""
    sums = [values[:, list(foot.contacts)].sum(axis=1) for foot in run.robot.feet]
    return np.stack(sums, axis=1) if sums else np.zeros((len(values), 0, *values.shape[2:]))


def single_support(run: Run) -> NDArray[np.bool_]:
    """Tell in which rows exactly one foot, and nothing else, carries the robot, (nt,).

    An impact at which the foot behind still pushes is not single support; the impact of a foot
    that takes over at once is.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    (nt,) bool
        True in rows of single support.
    """
    feet = [list(foot.contacts) for foot in run.robot.feet]
    elsewhere = np.delete(pushing(run), [i for contacts in feet for i in contacts], axis=1)
    return np.asarray((pushing_feet(run).sum(axis=1) == 1) & ~elsewhere.any(axis=1))


@dataclass(frozen=True)
class SupportPhase:
    """Time during which the same feet carry the robot."""

    start: float
    end: float
    """start, end: Time in s."""
    feet: tuple[int, ...]
    """Indices of the feet that push: one in single support, two in double support, none in
    flight."""

    @property
    def duration(self) -> float:
        """Length of the phase in s."""
        return self.end - self.start


def support_phases(run: AnyRun) -> tuple[SupportPhase, ...]:
    """Divide a run into phases between which the set of pushing feet changes.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    tuple of SupportPhase
        In the order of time.
    """
    feet = pushing_feet(run)
    if not len(feet):
        return ()
    changes = np.flatnonzero((feet[1:] != feet[:-1]).any(axis=1)) + 1
    bounds = [0, *changes.tolist(), len(feet) - 1]
    return tuple(
        SupportPhase(
            float(run.time[first]),
            float(run.time[last]),
            tuple(int(foot) for foot in np.flatnonzero(feet[first])),
        )
        for first, last in pairwise(bounds)
        if run.time[last] > run.time[first]
    )


def double_support_fraction(run: AnyRun) -> float:
    """Share of the time in which two feet or more push; NaN for a run without duration.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    float
        Share, from 0 to 1.
    """
    held = np.diff(run.time)
    if not held.sum() > 0.0:
        return float("nan")
    double = pushing_feet(run)[:-1].sum(axis=1) >= 2
    return float(held[double].sum() / held.sum())


@dataclass(frozen=True)
class Stance:
    """Stance of a foot on the ground, from its touchdown to its lift-off."""

    foot: int
    """Index of the foot."""
    touchdown: float
    """When its first contact point met the ground, in s."""
    liftoff: float
    """When its last one left it, in s; infinite if it was still there at the end."""
    impulse: float
    """Normal impulse on the foot in the step of its touchdown, in N s."""


def stances(run: Run) -> tuple[Stance, ...]:
    """List the stances of all feet in the order of their touchdowns.

    A foot that pushes in the first row touches down there, with no impulse.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    tuple of Stance
        In the order of touchdown.
    """
    foot_of = {i: foot for foot, each in enumerate(run.robot.feet) for i in each.contacts}
    closed: dict[int, set[int]] = {foot: set() for foot in range(len(run.robot.feet))}
    current: dict[int, int] = {}
    found: list[Stance] = []
    standing = np.any(pushing(run)[:1], axis=0).tolist()
    begin = [
        Event(float(run.time[0]), EventKind.TOUCHDOWN, contact, (0.0, 0.0))
        for contact in foot_of
        if standing[contact]
    ]
    for event in (*begin, *run.events):
        foot = foot_of.get(event.contact, -1)
        if foot < 0:
            continue
        if event.kind is EventKind.TOUCHDOWN:
            if not closed[foot]:
                current[foot] = len(found)
                found.append(Stance(foot, event.time, np.inf, 0.0))
            stance = found[current[foot]]
            if event.time == stance.touchdown:  # heel and toe may land in the same step
                impulse = stance.impulse + event.impulse[0]
                found[current[foot]] = replace(stance, impulse=impulse)
            closed[foot].add(event.contact)
        elif event.kind is EventKind.LIFTOFF and event.contact in closed[foot]:
            closed[foot].remove(event.contact)
            if not closed[foot]:
                found[current[foot]] = replace(found[current[foot]], liftoff=event.time)
    return tuple(sorted(found, key=lambda stance: stance.touchdown))


def walking_steps(run: Run) -> tuple[Stance, ...]:
    """List the stances that end a walking step: the landing foot is not the one that landed last.

    The contact the robot starts with is no step, nor is the first landing of a robot dropped from
    the air, nor a foot that lands again without the other one having landed in between, nor one
    that was in the air for less than `CHATTER`, nor one that stayed for less, however often it
    bounced.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    tuple of Stance
        In the order of touchdown.
    """
    taken: list[Stance] = []
    last: set[int] = set()
    for stance in _without_chatter(stances(run)):
        if stance.touchdown == run.time[0]:
            last.add(stance.foot)
        elif stance.liftoff - stance.touchdown >= CHATTER:
            if last and last != {stance.foot}:
                taken.append(stance)
            last = {stance.foot}
    return tuple(taken)


def step_times(run: Run) -> tuple[float, ...]:
    """Return when the steps of a walk began, in s: at its first row and at every landing.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    tuple of float
        Times (s); a step ends where the next begins, and the last may not have.
    """
    return float(run.time[0]), *(stance.touchdown for stance in walking_steps(run))


def _without_chatter(found: tuple[Stance, ...]) -> list[Stance]:
    """Join stances of a foot between which it was in the air for less than `CHATTER`."""
    joined: list[Stance] = []
    current: dict[int, int] = {}
    for stance in found:
        place = current.get(stance.foot, -1)
        if place >= 0 and stance.touchdown - joined[place].liftoff < CHATTER:
            joined[place] = replace(joined[place], liftoff=stance.liftoff)
        else:
            current[stance.foot] = len(joined)
            joined.append(stance)
    return joined


def phase_time(run: Run, step: int, phase: float) -> float:
    """Return when a walk is at a phase of one of its steps: when to push it.

    A simulation that begins in the same way walks in the same way until it is pushed, so that a run
    without pushes tells when a push shall begin.

    Parameters
    ----------
    run : Run
        A walk.
    step : int
        Which step: 0 is the one that begins with the run, 1 begins with the first landing.
    phase : float
        Part of the step that has passed, from 0 at one landing to 1 at the next.

    Returns
    -------
    float
        Time in s.

    Raises
    ------
    SimulationError
        If the run has no such step, or the phase is none.
    """
    landings = step_times(run)
    if not 0.0 <= phase <= 1.0:
        raise SimulationError(f"the phase of a step is a number from 0 to 1, got {phase!r}")
    if not 0 <= step < len(landings) - 1:
        raise SimulationError(
            f"there is no step {step!r} in this run: it has {len(landings) - 1} whole steps, the "
            "first of which is step 0"
        )
    begin, end = landings[step : step + 2]
    return begin + phase * (end - begin)
