"""A walk that repeats itself with all that its controller remembers, and with the samples it takes.

What goes on from the middle of a step is a snapshot: the robot, the controller's memory, where the
clock is between two calls. A walk repeats if all of that is the same when the same foot stands in
the middle of its next step: places farther on, instants later. Newton's method finds it as a fixed
point of the return, in the coordinates in which errors are measured
(:mod:`heelstrike.analysis.stability.section`). Every iteration goes on from where the walk before
it ended, so that what is no coordinate, such as the force of the last step, is as the walk left it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heelstrike.analysis.stability.across import NEUTRAL, Across
from heelstrike.analysis.stability.loop import SMOOTH, ClosedLoop, Walk
from heelstrike.analysis.stability.returns import Disturbed, returned, stays_early
from heelstrike.analysis.stability.section import Section
from heelstrike.errors import LimitCycleError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.snapshot import Snapshot

SETTLING = 4
"""Steps before a walk is looked at."""

FAST = 0.1
"""A return that differs by less than this part of what the one before did is differentiated only in
the end."""

BETWEEN = 0.01
"""Part of a sample that is told apart from none."""

HALVINGS = 6
"""How often a Newton step is halved that leads no nearer."""

PATIENCE = 3
"""Iterations that lead no nearer before the search ends."""


@dataclass(frozen=True)
class Repeating:
    """A walk that repeats itself."""

    walk: Walk
    """Its one return."""
    errors: Across
    """What errors do in it."""
    residual: float
    """By how much it does not."""
    iterations: int
    """Newton steps taken."""


def repeating_walk(
    loop: ClosedLoop, *, longest_step: float, tolerance: float, max_iterations: int
) -> Repeating:
    """Find a walk that repeats itself near one that begins somewhere.

    Raises
    ------
    LimitCycleError
        If there is none, or it is not found.
    """
    walk = loop.follow(SETTLING, 1, longest_step)
    walk = _nearest(loop, Section(loop, walk, SMOOTH, None), walk)
    newton = _Newton.at(loop, walk)
    before, left = np.inf, PATIENCE
    for iteration in range(max_iterations + 1):
        missed = newton.section.missed(*walk.begins)
        residual = newton.residual(walk, missed)
        if residual <= tolerance:
            break
        left = PATIENCE if residual < 0.5 * before else left - 1
        if left == 0 or iteration == max_iterations:
            raise LimitCycleError(_why_not(loop, newton.section, walk, residual, iteration))
        if iteration and residual > FAST * before:
            newton = _Newton.at(loop, walk)
            missed = newton.section.missed(*walk.begins)
        before = residual
        walk = newton.moved_on(loop, walk, missed)
    _check_again(loop, newton.section, walk, float(np.sqrt(tolerance)))
    if walk is not newton.walk:
        newton = _Newton.at(loop, walk)
    early = stays_early(loop, newton.section, walk)
    errors = Across.of([newton.found], early, newton.section.of_robot, smooth=True)
    return Repeating(walk, errors, residual, iteration)


@dataclass(frozen=True)
class _Newton:
    """A return, differentiated where it begins: what misses it are coordinates there."""

    walk: Walk
    section: Section
    found: Disturbed
    errors: Across

    @classmethod
    def at(cls, loop: ClosedLoop, walk: Walk) -> _Newton:
        section = Section(loop, walk, SMOOTH, None)
        found = returned(loop, section, walk, 0, SMOOTH)
        return cls(walk, section, found, Across.of([found], 1.0, section.of_robot, smooth=True))

    def residual(self, walk: Walk, missed: Floats) -> float:
        """Largest of what is missed, of the state and of the numbers on which anything hangs."""
        first, unit = self.section.of_robot, self.section.words.unit
        words = [abs(missed[i]) * unit[i - first] for i in self.errors.kept if i >= first]
        return float(max([_far(self.section, walk), *words]))

    def moved_on(self, loop: ClosedLoop, walk: Walk, missed: Floats) -> Walk:
        """Take a Newton step, a shorter one if it leads no nearer; or else walk on.

        From where the walk has ended: that is where it began, moved by what it missed.
        """
        kept, free = list(self.errors.kept), loop.grid == 0.0
        matrix, rate = self.errors.matrices[0], self.found.begins
        system = np.eye(len(kept)) - matrix
        if free:  # of samples: how long a return lasts is to be found, too
            system = np.column_stack((system, -rate[kept]))
        step = np.linalg.lstsq(system, missed[kept], rcond=NEUTRAL)[0]
        longer = float(step[len(kept)]) if free else 0.0
        change = longer * rate
        change[kept] += matrix @ step[: len(kept)]
        end, far = walk.begins[1], _far(self.section, walk)
        for halving in range(HALVINGS):
            part = 0.5**halving
            try:
                self.section.disturb(loop.simulation, end, part * change)
                begin = loop.simulation.snapshot()
                found = _walked(loop, begin, walk, walk.duration + part * longer)
            except LimitCycleError:
                continue
            found = _nearest(loop, self.section, found)
            if _far(self.section, found) < far:
                return found
        return _nearest(loop, self.section, _walked(loop, end, walk, walk.duration))


def _walked(loop: ClosedLoop, begin: Snapshot, like: Walk, duration: float) -> Walk:
    """Walk on from a snapshot for some time."""
    simulation = loop.simulation
    simulation.restore(begin)
    loop.advanced(simulation, begin.time + duration, "the walk does not go on")
    end = simulation.snapshot()
    length = abs(float((end.state.q[:2] - begin.state.q[:2]) @ loop.along))
    return replace(like, begins=(begin, end), duration=duration, length=length)


def _nearest(loop: ClosedLoop, section: Section, walk: Walk) -> Walk:
    """Give a return as many samples as bring it nearest to where it began."""
    while loop.grid > 0.0 and (samples := loop.sampled(_ahead(section, walk))):
        found = _walked(loop, walk.begins[0], walk, walk.duration - samples)
        if _far(section, found) >= _far(section, walk):
            break
        walk = found
    return walk


def _gone(section: Section, walk: Walk) -> Floats:
    """What the end of a return differs by from its begin, but for the way along the ground."""
    begin, end = (each.state.vector for each in walk.begins)
    return section.flat(end - begin)


def _far(section: Section, walk: Walk) -> float:
    return float(np.abs(_gone(section, walk)).max())


def _ahead(section: Section, walk: Walk) -> float:
    """Seconds by which the end of a return is ahead of its begin."""
    return section.ahead(_gone(section, walk), section.rate(walk.begins[0]))


def _check_again(loop: ClosedLoop, section: Section, walk: Walk, tolerance: float) -> None:
    """Refuse what comes back once, by chance: a clock that drives a walk has its own period."""
    far = _far(section, _walked(loop, walk.begins[1], walk, walk.duration))
    if far > tolerance:
        raise LimitCycleError(
            f"a walk of robot {loop.robot.name!r} comes back to itself after {walk.duration:.6g} "
            f"s, but differs by {far:.3g} one return later: its controller has a clock of "
            "another period. Choose a control_period that divides that period"
        )


def _why_not(
    loop: ClosedLoop, section: Section, walk: Walk, residual: float, iteration: int
) -> str:
    told = (
        f"no limit cycle of robot {loop.robot.name!r} in {iteration} iterations: its state still "
        f"changes by {residual:.3g} from return to return"
    )
    ahead = abs(_ahead(section, walk))
    if loop.grid > 0.0 and ahead > BETWEEN * loop.grid:
        of = "steps of the method" if loop.controller is None else "calls of its controller"
        return (
            f"{told}, as it comes back {ahead:.3g} s between two {of}, every "
            f"{loop.grid:.3g} s: it does not keep step with them. hs.floquet_multipliers tells how "
            "errors of such walks die"
        )
    return f"{told}; begin nearer to the cycle"
