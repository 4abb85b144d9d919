"""The compass gait in every engine: whether it walks down there, and how disturbances die out.

Its legs are of one length, so that the foot that swings passes through the ground in the middle of
a step; Goswami, Thuilot and Espiau (1998) let it. Here an engine has two robots: one touches the
ground with the foot that stands alone, the other with both feet. The first walks from a little
after a landing, when the foot that has left the ground is highest, to the middle of the step; the
second from there over the next landing. States are handed over as they are, and the legs change
names at each landing.

A robot is two legs of 10 kg, each with half the mass of the hip: the same mechanism as a point mass
of 10 kg between two legs of 5 kg, without links that have no mass or no moment of inertia.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.entries import Entry
from heelstrike.experiments.engine_comparison.scenes import leaning
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.experiments.engines.served import EngineProcesses, served
from heelstrike.experiments.passive import passive_walk
from heelstrike.field_texts import dataclass
from heelstrike.robot import Robot, RobotBuilder, State, load_robot
from heelstrike.robot.model import Floats
from heelstrike.sim.method import Method

DESCENT = math.radians(3.0)
"""Slope of Goswami's walk."""
FRICTION = 0.8
"""Of the ground, as the library's walker has it."""

STRIDES = 25
"""Steps that it is to take: of a disturbance 0.58 a step are left, of all of them 1e-6."""
LAST = 5
"""Of so many of them the cycle is the mean."""
DISTURBANCE = (0.03, 0.015, 0.06)
"""Largest disturbance of what the middle of a step is described by: rate of the leg that stands
(rad/s), angle (rad) and rate of the one that swings."""
DISTURBED, SEED = 32, 1998
"""Steps with random disturbances, and the seed of these."""
RESAMPLED = 200
"""Samples of these steps of which the multipliers' standard errors are told (bootstrap)."""

LIFTED = 5e-3
"""Height (m) above which a foot has left the ground."""
LOWEST, LONGEST = 0.5, 2.0
"""Height of the hip (m) below which it has fallen, and time (s) after which it stands."""
AT_ONCE = 0.025
"""Seconds that are simulated at once."""

LEG, HALF, MASS = 1.0, 0.25, 10.0
"""Length of a leg (m), where its centre of mass is from the hip (m), and its mass (kg)."""
INERTIA = 0.625
"""About its centre of mass (kg m²): of 5 kg on the hip and 5 kg in the middle."""


class NotWalkingError(Exception):
    """It did not come to the next step, and why."""


def compass(*, both: bool) -> Robot:
    """Return the walker on its slope, standing on its first leg.

    Parameters
    ----------
    both : bool
        Whether both feet touch the ground; else only that of the first leg does.
    """
    builder = RobotBuilder("compass")
    properties: Any = {"mass": MASS, "inertia": INERTIA, "center_of_mass": (0.0, -HALF)}
    first = builder.floating_base("first", (0.0, LEG), **properties)
    second = builder.hinge("hip", first, **properties)
    builder.contact(first, at=(0.0, -LEG))
    if both:
        builder.contact(second, at=(0.0, -LEG))
    return leaning(builder.build(), DESCENT)


class Mover(Protocol):
    """What moves the walker from a state on."""

    step: float

    def begin(self, both: bool, q: Floats, v: Floats) -> None:
        """Begin at a state, with the foot that stands or both feet on the ground."""

    def more(self, steps: int) -> Floats:
        """Return position and velocity after each of the next steps, (steps, 8)."""


class InEngine:
    """The walker in an engine, in two processes: on one foot, and on both.

    Parameters
    ----------
    entry : Entry
        The engine's row.
    step : float
        Seconds.
    given : mapping
        Its settings.
    processes : EngineProcesses
        Where engines are asked; they are not ended.

    Raises
    ------
    InvalidRunError
        If the engine is missing, ends, hangs or refuses.
    """

    def __init__(
        self, entry: Entry, step: float, given: Mapping[str, Any], processes: EngineProcesses
    ) -> None:
        self.step = step
        self._peers = [
            served(
                entry.package,
                Scenario("compass", robot, robot.reference_state(), step, friction=FRICTION),
                step, process=processes.of(entry.package, both), **given,
            )
            for both, robot in enumerate((compass(both=False), compass(both=True)))
        ]  # fmt: skip

    def begin(self, both: bool, q: Floats, v: Floats) -> None:
        """Begin at a state."""
        self._peer = self._peers[both]
        self._peer.start = State(q, v)
        self._peer.restart()

    def more(self, steps: int) -> Floats:
        """Return position and velocity after each of the next steps."""
        return self._peer.record(steps)[:, :8]


class ByOurs:
    """The walker by a method of ours.

    Parameters
    ----------
    method : callable
        Makes the method of a step.
    step : float
        Seconds.
    """

    def __init__(self, method: Callable[[float], Method], step: float) -> None:
        self.step = step
        self._method = method(step)
        self._robots = compass(both=False), compass(both=True)

    def begin(self, both: bool, q: Floats, v: Floats) -> None:
        """Begin at a state."""
        self._robot, self._state = self._robots[both], State(q, v)

    def more(self, steps: int) -> Floats:
        """Return position and velocity after each of the next steps."""
        scenario = Scenario(
            "compass", self._robot, self._state, steps * self.step, friction=FRICTION
        )
        run = scenario.run(self._method, record_every=1)
        ends = self.step * np.arange(1, steps + 1)
        last = np.searchsorted(run.time, ends + 1e-3 * self.step) - 1  # events have rows, too
        rows = np.hstack((run.position, run.velocity))[last]
        self._state = State(rows[-1, :4], rows[-1, 4:])
        return rows


@dataclass(frozen=True)
class CompassWalk:
    """The walk of the compass gait in an engine."""

    strides: int
    """Steps taken, of `STRIDES`."""
    ending: str
    """Why it took no more; empty if it took all."""
    period_s: float
    step_m: float
    """period_s, step_m: Duration and length of a step of its cycle."""
    middle: tuple[float, float, float]
    """Rate of the leg that stands (rad/s), angle (rad) and rate of the one that swings, at the
    instant at which the leg that stands is upright on the slope."""
    spread: float
    """Largest difference of these numbers from their means over the last steps."""
    multipliers: tuple[complex, complex, complex]
    """Floquet multipliers of a step, largest first."""
    error: float
    """Standard error of the modulus of the largest: the phase in which a landing meets the steps of
    an engine is chance."""
    undetermined: str = ""
    """Why there are no multipliers, though it took all steps; empty if there are."""


def middle_of(q: Floats, v: Floats) -> Floats:
    """Return what describes the middle of a step: three numbers of `CompassWalk`."""
    return np.array([v[2], q[2] + q[3], v[2] + v[3]])


def on_one_foot(angle: float, swing: float, rates: tuple[float, float], foot: float = 0.0) -> Any:
    """Return position and velocity of the walker whose first foot stands on the ground.

    Parameters
    ----------
    angle, swing : float
        Of the leg that stands and of the other, from upright on the slope (rad).
    rates : (float, float)
        Theirs (rad/s).
    foot : float
        Where the foot is along the slope (m).
    """
    q = np.array([foot + LEG * math.sin(angle), LEG * math.cos(angle), angle, swing - angle])
    v = np.array(
        [LEG * math.cos(angle) * rates[0], -LEG * math.sin(angle) * rates[0], rates[0],
         rates[1] - rates[0]]
    )  # fmt: skip
    return q, v


def our_cycle() -> tuple[CompassWalk, State]:
    """Find the walk event by event; return it, and its state just after a landing."""
    cycle = passive_walk(load_robot("compass_gait"), Ground(slope=-DESCENT, friction=FRICTION))
    stance, swing = (float(angle) - DESCENT for angle in cycle.state.q[2:])
    rates = float(cycle.state.v[2]), float(cycle.state.v[3])
    q, v = on_one_foot(stance, swing, rates)
    multipliers = tuple(complex(each) for each in cycle.multipliers)
    nan = math.nan
    walk = CompassWalk(
        STRIDES, "", cycle.period, cycle.step_length, (nan, nan, nan), cycle.residual,
        (multipliers[0], multipliers[1], multipliers[2]), 0.0,
    )  # fmt: skip
    return walk, State(q, v)


def compass_walk(mover: Mover, start: State) -> CompassWalk:
    """Walk down the slope, and measure the cycle and its multipliers.

    Parameters
    ----------
    mover : Mover
        What moves the walker.
    start : State
        Just after a landing, on the first leg.

    Returns
    -------
    CompassWalk
        Its numbers are NaN where it does not walk, and its multipliers where it does not walk on
        from a disturbance.
    """
    taken: list[_Middle] = []
    ending = ""
    try:
        row = _to_the_middle(mover, start.q, start.v)
        taken.append(row)
        while len(taken) <= STRIDES:
            taken.append(_stride(mover, taken[-1]))
    except NotWalkingError as fell:
        ending = str(fell)
    nan = math.nan
    none = nan, nan, nan
    if ending:
        return CompassWalk(max(0, len(taken) - 1), ending, nan, nan, none, nan, none, nan)
    kicks = np.random.default_rng(SEED).uniform(-1.0, 1.0, (DISTURBED, 3)) * DISTURBANCE
    undetermined = ""
    try:
        after = np.array([_stride(mover, _disturbed(taken[-1], each)).numbers for each in kicks])
    except NotWalkingError as fell:
        undetermined = str(fell)
    last = taken[-LAST - 1 :]
    lasting = [b.time for b in last[1:]]
    lengths = [b.foot - a.foot for a, b in pairwise(last)]
    numbers = np.array([each.numbers for each in last])
    mean = numbers.mean(axis=0)
    multipliers, error = (none, nan) if undetermined else _multipliers(kicks, after)
    return CompassWalk(
        STRIDES, "", float(np.mean(lasting)), float(np.mean(lengths)),
        (float(mean[0]), float(mean[1]), float(mean[2])), float(np.abs(numbers - mean).max()),
        multipliers, error, undetermined,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Middle:
    """The middle of a step."""

    q: Floats
    v: Floats
    """q, v: The row after it."""
    late: float
    """How long after it that is (s)."""
    numbers: Floats
    """(3,) What describes it, at the very instant."""
    foot: float
    """Where the foot is along the slope (m)."""
    time: float
    """Since the middle before (s)."""


def _disturbed(middle: _Middle, disturbance: Floats) -> _Middle:
    """Change a middle of a step; the foot that stands stays where it is."""
    q, v = middle.q.copy(), middle.v.copy()
    v[0] += LEG * math.cos(q[2]) * disturbance[0]
    v[1] -= LEG * math.sin(q[2]) * disturbance[0]
    v[2] += disturbance[0]
    v[3] += disturbance[2] - disturbance[0]
    q[3] += disturbance[1]
    return _Middle(q, v, middle.late, middle.numbers + disturbance, middle.foot, 0.0)


def _multipliers(before: Floats, after: Floats) -> tuple[tuple[complex, complex, complex], float]:
    """Fit the map of a step, to second order; return its eigenvalues and their standard error."""

    def fitted(rows: Any) -> Any:
        terms = _terms(before[rows] / DISTURBANCE)
        fit, *_ = np.linalg.lstsq(terms, after[rows] / DISTURBANCE, rcond=None)
        found = np.linalg.eigvals(fit[1:4].T)
        return found[np.lexsort((found.imag, -np.abs(found)))]

    count = len(before)
    found = fitted(np.arange(count))
    chance = np.random.default_rng(SEED)
    moduli = np.abs([fitted(chance.integers(0, count, count)) for _ in range(RESAMPLED)])
    first, second, third = (complex(each) for each in found)
    return (first, second, third), float(moduli[:, 0].std())


def _terms(x: Floats) -> Floats:
    """Return 1, the three numbers and their six products."""
    products = [x[:, i] * x[:, j] for i in range(3) for j in range(i, 3)]
    return np.column_stack((np.ones(len(x)), x, *products))


def _stride(mover: Mover, middle: _Middle) -> _Middle:
    """Walk from the middle of a step to that of the next."""
    landed = _until(mover, True, middle.q, middle.v, _behind_is_highest)
    q, v = _renamed(landed[-1])
    following = _to_the_middle(mover, q, v)
    time = middle.late + mover.step * len(landed) + following.time
    return _Middle(
        following.q, following.v, following.late, following.numbers, following.foot, time
    )


def _to_the_middle(mover: Mover, q: Floats, v: Floats) -> _Middle:
    """Walk on one foot until the leg that stands is upright on the slope."""
    rows = np.vstack((np.concatenate((q, v)), _until(mover, False, q, v, _is_upright)))
    before, row = rows[-2], rows[-1]
    share = before[2] / (before[2] - row[2]) if before[2] < 0.0 else 1.0
    numbers = [middle_of(each[:4], each[4:]) for each in (before, row)]
    at = (1.0 - share) * numbers[0] + share * numbers[1]
    late = (1.0 - share) * mover.step
    foot = float(row[0] - LEG * math.sin(row[2]))
    return _Middle(row[:4], row[4:], late, at, foot, mover.step * (len(rows) - 1) - late)


def _is_upright(rows: Floats) -> Any:
    return rows[:, 2] >= 0.0


def _behind_is_highest(rows: Floats) -> Any:
    """Whether the foot of the first leg has left the ground and rises no more."""
    height = rows[:, 1] - LEG * np.cos(rows[:, 2])
    rising = rows[:, 5] + LEG * np.sin(rows[:, 2]) * rows[:, 6]
    return (height > LIFTED) & (rising <= 0.0)


def _renamed(row: Floats) -> tuple[Floats, Floats]:
    """Exchange the legs: the second stands."""
    q, v = row[:4].copy(), row[4:].copy()
    q[2:] = q[2] + q[3], -q[3]
    v[2:] = v[2] + v[3], -v[3]
    return q, v


def _until(
    mover: Mover, both: bool, q: Floats, v: Floats, reached: Callable[[Floats], Any]
) -> Floats:
    """Move on until something is reached; return all rows up to there."""
    mover.begin(both, q, v)
    chunk = max(2, round(AT_ONCE / mover.step))
    rows: list[Floats] = []
    try:
        while len(rows) * chunk * mover.step < LONGEST:
            new = mover.more(chunk)
            if not np.all(np.isfinite(new)):
                raise NotWalkingError("its numbers are not finite")
            there = reached(new)
            if there.any():
                rows.append(new[: int(np.argmax(there)) + 1])
                return np.vstack(rows)
            rows.append(new)
            if new[-1, 1] < LOWEST:
                raise NotWalkingError("it falls")
    except SimulationError as error:
        raise NotWalkingError(str(error)) from error
    raise NotWalkingError("it does not take the next step")
