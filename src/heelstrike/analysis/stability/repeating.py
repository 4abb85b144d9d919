"""A walk that repeats itself with all that its controller remembers, and with the samples it takes.

What goes on from the middle of a step is a snapshot: the robot, the controller's memory, where the
clock is between two calls. A walk repeats if all of that is the same when the same foot stands in
the middle of its next step: places farther on, instants later. Newton's method finds it as a fixed
point of the return, in the coordinates in which errors are measured
(:mod:`heelstrike.analysis.stability.section`). Every iteration goes on from where the walk before
it ended, so that what is no coordinate, such as the force of the last step, is as the walk left it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.stability.across import NEUTRAL, Across
from heelstrike.analysis.stability.loop import SMOOTH, ClosedLoop, Walk
from heelstrike.analysis.stability.returns import returned, stays_early
from heelstrike.analysis.stability.section import Section
from heelstrike.errors import LimitCycleError
from heelstrike.sim.snapshot import Snapshot

Floats = NDArray[np.float64]

SETTLING = 4
"""Steps before a walk is looked at."""

HALVINGS = 6
"""How often a Newton step is halved that leads no nearer."""

PATIENCE = 3
"""Iterations that lead no nearer before the search ends."""


@dataclass(frozen=True)
class Repeating:
    """A walk that repeats itself.

    Attributes
    ----------
    walk : Walk
        Its one return.
    errors : Across
        What errors do in it.
    residual : float
        By how much it does not.
    iterations : int
        Newton steps taken.
    """

    walk: Walk
    errors: Across
    residual: float
    iterations: int


def repeating_walk(
    loop: ClosedLoop, *, longest_step: float, tolerance: float, max_iterations: int
) -> Repeating:
    """Find a walk that repeats itself near one that begins somewhere.

    Raises
    ------
    LimitCycleError
        If there is none, or it is not found.
    """
    one = _Return.of(loop, loop.follow(SETTLING, 1, longest_step))
    best, patience = np.inf, PATIENCE
    for iteration in range(max_iterations + 1):
        found = [returned(loop, one.section, one.walk, 0, SMOOTH)]
        errors = Across.of(found, 1.0, one.section.of_robot, smooth=True)
        missed = one.section.missed(*one.walk.begins)
        residual = one.residual(missed, errors)
        if residual <= tolerance:
            _check_again(loop, one, np.sqrt(tolerance))
            early = stays_early(loop, one.section, one.walk)
            errors = Across.of(found, early, one.section.of_robot, smooth=True)
            return Repeating(one.walk, errors, residual, iteration)
        patience = PATIENCE if residual < 0.5 * best else patience - 1
        best = min(best, residual)
        if patience == 0 or iteration == max_iterations:
            break
        one = _moved_on(loop, one, missed, errors, found[0].begins)
    why = f"; it ends {one.ahead:.3g} s ahead of itself" if loop.grid > 0.0 else ""
    raise LimitCycleError(
        f"no limit cycle of robot {loop.robot.name!r} in {iteration} iterations: its state still "
        f"changes by {residual:.3g} from return to return; begin nearer to the cycle{why}"
    )


@dataclass(frozen=True)
class _Return:
    """A return of a walk, from its begin to its end, and coordinates of errors there."""

    walk: Walk
    section: Section
    gone: Floats
    ahead: float

    @classmethod
    def of(cls, loop: ClosedLoop, walk: Walk) -> _Return:
        """Look at a return; give it as many samples as bring it nearest to where it began."""
        found: _Return | None = None
        while True:
            section, (begin, end) = Section(loop, walk, SMOOTH, None), walk.begins
            gone = section.flat(_vector(end) - _vector(begin))
            one = cls(walk, section, gone, section.ahead(gone, section.rate(begin)))
            if found is not None and found.far <= one.far:
                return found
            samples = loop.sampled(one.ahead)
            if loop.grid == 0.0 or samples == 0.0:
                return one
            found, walk = one, _walked(loop, begin, walk, walk.duration - samples)

    @property
    def far(self) -> float:
        """How far the walk is from where it began."""
        return float(np.abs(self.gone).max())

    def residual(self, missed: Floats, errors: Across) -> float:
        """Largest of what is missed, of the state and of the numbers on which anything hangs."""
        first = self.section.of_robot
        unit = self.section.words.unit
        words = [abs(missed[i]) * unit[i - first] for i in errors.kept if i >= first]
        return float(max([self.far, *words]))


def _walked(loop: ClosedLoop, begin: Snapshot, like: Walk, duration: float) -> Walk:
    """Walk on from a snapshot for some time."""
    simulation = loop.simulation
    simulation.restore(begin)
    loop.advanced(simulation, begin.time + duration, "the walk does not go on")
    end = simulation.snapshot()
    length = abs(float((end.state.q[:2] - begin.state.q[:2]) @ loop.along))
    return replace(like, begins=(begin, end), duration=duration, length=length)


def _moved_on(
    loop: ClosedLoop, one: _Return, missed: Floats, errors: Across, rate: Floats
) -> _Return:
    """Take a Newton step, a shorter one if it leads no nearer; or else walk on."""
    kept, free = list(errors.kept), loop.grid == 0.0
    matrix = errors.matrices[0]
    system = np.eye(len(kept)) - matrix
    if free:  # of samples: how long a return lasts is to be found, too
        system = np.column_stack((system, -rate[kept]))
    newton = np.linalg.lstsq(system, missed[kept], rcond=NEUTRAL)[0]
    longer = float(newton[len(kept)]) if free else 0.0
    # From where the walk before has ended: its begin, moved by Newton's step, one return later.
    change = longer * rate
    change[kept] += matrix @ newton[: len(kept)]
    (_, end), duration = one.walk.begins, one.walk.duration
    for halving in range(HALVINGS):
        part = 0.5**halving
        try:
            one.section.disturb(loop.simulation, end, part * change)
            begin = loop.simulation.snapshot()
            found = _Return.of(loop, _walked(loop, begin, one.walk, duration + part * longer))
        except LimitCycleError:
            continue
        if found.far < one.far:
            return found
    return _Return.of(loop, _walked(loop, end, one.walk, duration))


def _check_again(loop: ClosedLoop, one: _Return, far: float) -> None:
    """Refuse what comes back once, by chance: a clock that drives a walk has its own period."""
    end, duration = one.walk.begins[1], one.walk.duration
    again = _walked(loop, end, one.walk, duration).begins[1]
    gone = float(np.abs(one.section.flat(_vector(again) - _vector(end))).max())
    if gone > far:
        raise LimitCycleError(
            f"a walk of robot {loop.robot.name!r} comes back to itself after {duration:.6g} s, but "
            f"differs by {gone:.3g} one return later: its controller goes by a clock of another "
            "period. Give it a control_period of which that is a whole number"
        )


def _vector(snapshot: Snapshot) -> Floats:
    return np.concatenate((snapshot.state.q, snapshot.state.v))
