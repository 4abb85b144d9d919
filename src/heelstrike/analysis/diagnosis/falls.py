"""Why a robot fell: what went wrong first, and what followed from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.diagnosis.symptoms import Cause, Symptom, Walk, find_symptoms, spells
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.push import Push
from heelstrike.sim.run import AnyRun, Run

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

RECOVERED = 1.5
"""Steps without a symptom after which a robot has recovered from what was before."""
BACK = 0.03
"""Time (s) on its gait after which a robot has recovered, too: all joints pass theirs for less."""
LONGER = 1.1
"""How much longer something lasts that is worse than it was before."""
ANSWERS = {Cause.TORQUE_LIMIT: 0.02, Cause.SPEED_LIMIT: 0.02, Cause.CONTROLLER: 0.005}
"""What a controller shows that answers something else, such as a foot that slips or tips, and how
long before (s) that is seen: a foot that begins to tip turns slowly at first."""
DRIVEN, DRIVES = 1.5, 0.01
"""Torque with which a controller drives a joint away, in the largest before, and how near in time
(s) a foot tips: at once under what drives its ankle."""
WILD_AFTER = 0.02
"""Time (s) after its first symptom in which a run grows beyond all bounds that was never sound."""
SUNK = 0.8
"""Height of the centre of mass above the ground, in that at the start, of a robot that goes
down."""


@dataclass(frozen=True)
class Fall:
    """Why a run did not go well: the first cause and its consequences."""

    cause: Cause
    """What went wrong first."""
    time: float
    """When that began, in s."""
    where: str
    """Name of the foot or joint at which it did; nothing if it was at none."""
    evidence: Mapping[str, float]
    """Numbers that show it, by names that end in their units."""
    chain: tuple[Symptom, ...]
    """The first cause and what followed, the first of each kind, in the order of time."""
    pushes: tuple[Push, ...]
    """Pushes that acted then or up to a step before."""
    end: float
    """When the run ended, in s."""

    def __str__(self) -> str:
        at = f" ({self.where.replace('_', ' ')})" if self.where else ""
        then = ", ".join(each.cause.value for each in self.chain[1:])
        return f"{self.cause.value} at {self.time:.3f} s{at}" + (f"; then {then}" if then else "")


def first_cause(run: Run, gait: Gait | None = None) -> Fall | None:
    """Find the first cause of a fall.

    Symptoms are found one by one (:class:`~heelstrike.analysis.diagnosis.symptoms.Cause` lists
    them). Those from which the robot recovered are left out: a step and a half without any shows
    that, or joints that are back on the gait. The first of the others is the cause. What is known
    of walking is that of flat and point feet; a gait that means to roll over its toes shows
    symptoms when nothing is wrong.

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait, optional
        The gait that it followed. Without it, torques at their limits count when they last, late
        steps by the steps of the run itself, and joints at their stops where nothing else is seen:
        the gait may go there.

    Returns
    -------
    Fall or None
        Nothing if the run lasted as long as it was asked to and the robot is still up and was so
        for a step and a half, or its controller ended it while nothing went wrong.

    Raises
    ------
    GaitError
        If the gait does not fit the robot of the run.
    """
    if not len(run.time) or run.status is RunStatus.INTERRUPTED:
        return None
    walk = Walk(run, gait)
    if run.completed and not _sinks(walk):
        return None
    found = find_symptoms(walk)
    if gait is None and any(each.cause is not Cause.JOINT_STOP for each in found):
        found = tuple(each for each in found if each.cause is not Cause.JOINT_STOP)
    return fall_of(run, found, walk.step_duration, walk.on_its_gait)


def fall_of(
    run: AnyRun, found: tuple[Symptom, ...], step_duration: float,
    on_its_gait: NDArray[np.bool_] | None = None,
) -> Fall | None:  # fmt: skip
    """Say what of some symptoms led to the end of a run that did not go well.

    Parameters
    ----------
    run : Run or SpatialRun
        The run, of at least one row.
    found : tuple of Symptom
        In the order of time.
    step_duration : float
        How long a step takes (s): without a symptom for longer the robot has recovered.
    on_its_gait : (nt,) bool, optional
        When it was as if nothing had gone wrong.

    Returns
    -------
    Fall or None
        Nothing if no symptom lasted, and nothing but its controller or its time ended the run.
    """
    end = float(run.time[-1])
    back = () if on_its_gait is None else _lasting(run.time, on_its_gait)
    chain = _unrecovered(found, end, RECOVERED * step_duration, back)
    if not chain and run.status in (RunStatus.COMPLETED, RunStatus.STOPPED):  # squats; is done
        return None
    if not chain:
        chain = [Symptom(Cause.UNKNOWN, end, end)]
    first = chain[0]
    kinds: dict[Cause, Symptom] = {}
    for each in chain:
        if each is first or each.cause is not Cause.CONTROLLER:  # in a fall motors do what they can
            kinds.setdefault(each.cause, each)
    since = first.time - step_duration
    pushes = tuple(p for p in run.pushes if p.start <= first.time and p.end >= since)
    return Fall(
        first.cause, first.time, first.where, first.evidence, tuple(kinds.values()), pushes, end
    )


def walked_on(run: AnyRun, fall: Fall | None) -> bool:
    """Whether a run lasted as long as it was asked to, and its robot did not go down.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.
    fall : Fall or None
        What :func:`first_cause` says of it: a method can sink a robot into the ground, and end.
    """
    return run.completed and fall is None


def _sinks(walk: Walk) -> bool:
    """Whether a robot on feet goes down, or did so too shortly before the end to have recovered."""
    if not (walk.run.robot.floating and walk.run.robot.feet):
        return False
    x, z = walk.motion.center_of_mass.T
    height = z - walk.run.ground.height(x)
    late = walk.run.time >= walk.run.time[-1] - RECOVERED * walk.step_duration
    return bool(height[late].min() < SUNK * height[0])


def _lasting(time: Floats, rows: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return from when to when something holds without a break, where that lasts."""
    stretches = ((float(time[a]), float(time[b])) for a, b in spells(time, rows, 0.0))
    return tuple((begin, end) for begin, end in stretches if end - begin >= BACK)


def _unrecovered(
    found: tuple[Symptom, ...], end: float, calm: float, back: tuple[tuple[float, float], ...]
) -> list[Symptom]:
    """Symptoms since the last recovery before the end; what a controller answers after its cause.

    What lasts no longer than it did when the robot recovered from it is left out: from the same
    state it would recover again.
    """
    first, latest = 0, -math.inf
    for i, each in enumerate(found):
        if i and (each.time - latest > calm or _returned(latest, each.time, back)):
            first = i
        latest = max(latest, each.end)
    if not found or end - latest > calm:
        return []
    survived: dict[tuple[Cause, str], float] = {}
    for each in found[:first]:
        place = each.cause, each.where
        survived[place] = max(survived.get(place, 0.0), each.end - each.time)
    chain = [
        each for each in found[first:]
        if each.end - each.time > LONGER * survived.get((each.cause, each.where), -1.0)
    ] or list(found[first:])  # fmt: skip
    wild = next((each for each in chain if each.cause is Cause.NUMERICAL), None)
    if wild is not None and wild.time <= chain[0].time + WILD_AFTER:
        chain.remove(wild)
        return [wild, *chain]
    soon = chain[0].time + ANSWERS.get(chain[0].cause, 0.0)
    cause = next(
        (each for each in chain if each.cause not in ANSWERS and each.time <= soon), chain[0]
    )
    if cause.cause in (Cause.TIPPED_FORWARD, Cause.TIPPED_BACK):
        cause = next((each for each in chain if _drives(each, cause.time)), cause)
    chain.remove(cause)
    return [cause, *chain]


def _returned(since: float, until: float, back: tuple[tuple[float, float], ...]) -> bool:
    """Whether a robot was back on its gait between two times, for long enough."""
    return any(min(end, until) - max(begin, since) >= BACK for begin, end in back)


def _drives(each: Symptom, tipped: float) -> bool:
    """Whether a controller drove a joint away as a foot tipped."""
    strong = each.evidence.get("in_usual_torques", 0.0) > DRIVEN
    return strong and abs(each.time - tipped) <= DRIVES
