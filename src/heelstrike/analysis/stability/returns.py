"""One return of a walk, disturbed in every coordinate."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.analysis.stability.loop import ClosedLoop, Walk
from heelstrike.analysis.stability.section import Section
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.linearized.derivatives import step_derivatives
from heelstrike.sim.run import Run
from heelstrike.sim.snapshot import Snapshot
from heelstrike.sim.whole_run import whole

IN_STEP = 0.1
"""A walk that is nearer to itself than it moves in this part of a sample, return by return, may be
kept in step with them."""

HARDLY = 1e-5
"""Size of a disturbance that is less than what moves in any sample."""

LOST = 0.5
"""Being early has been taken away if less than this part of it is left."""

DIFFERENT, NOTICEABLE = 0.5, 0.05
"""Errors of either sign do different things if they differ by so much of the larger, and that is
not too small to matter."""


@dataclass(frozen=True)
class Disturbed:
    """Derivative of a return by differences."""

    matrix: Floats
    """(n, n) Columns by coordinate disturbed."""
    seen: Floats
    """(l, n) The same of indicators."""
    residual: float
    residual_but_late: float
    """residual, residual_but_late: How far the undisturbed walk is from where it was one return
    before (m, rad, velocities by the length they make in half a step), and apart from being early
    or late."""
    begins: Floats
    ends: Floats
    """begins, ends: (n,) Rates of the walk at its beginning and end."""
    one_sided: frozenset[str]
    switched: frozenset[str]
    """one_sided, switched: Coordinates whose errors of either sign do different things; whole
    numbers of the memory that came out otherwise."""


def returned(
    loop: ClosedLoop, section: Section, walk: Walk, place: int, size: float,
    indicator: Callable[[Run], ArrayLike] | None = None,
) -> Disturbed:  # fmt: skip
    """Disturb a walk in every coordinate, both ways, and see what is left one return later.

    And what an indicator of the return makes of it. Where nothing but the robot is disturbed, and
    its motion can be linearised, errors are derivatives.
    """
    begin, end = walk.begins[place], walk.begins[place + 1]
    simulation = loop.simulation
    exact = None if indicator is not None else _linearised(loop, section, walk, place)
    simulation.restore(end)
    usual = section.read(simulation)
    counts = section.words.counts(simulation)
    columns, told, one_sided, switched = [], [], set(), set()
    units = np.eye(len(section.names)) if exact is None else ()
    for name, unit in zip(section.names, units, strict=exact is None):
        sides, seen = [], []
        for sign in (1.0, -1.0):
            section.disturb(simulation, begin, sign * size * unit)
            loop.advanced(simulation, end.time, f"a disturbance of {name} by {sign * size:.3g}")
            _same_feet(section, end, simulation.snapshot(), name, sign * size)
            error = section.error(section.read(simulation), usual)
            sides.append(error / (sign * size))
            if indicator is not None:
                seen.append(np.atleast_1d(np.asarray(indicator(whole(simulation.record)))))
            now = section.words.counts(simulation)
            switched |= {each for each in now if not np.array_equal(now[each], counts[each])}
        sizes = [float(np.linalg.norm(side)) for side in sides]
        apart = float(np.linalg.norm(sides[0] - sides[1]))
        if apart > max(DIFFERENT * max(sizes), NOTICEABLE):
            one_sided.add(name)
        columns.append(0.5 * (sides[0] + sides[1]))
        told.append((seen[0] - seen[1]) / (2.0 * size) if seen else np.zeros(0))
    missed = section.flat(usual[0] - begin.state.vector)
    return Disturbed(
        matrix=np.array(columns).T if exact is None else exact,
        seen=np.array(told).T,
        residual=section.size(missed),
        residual_but_late=section.size(section.but_late(missed, section.rate(begin))),
        begins=section.way(begin),
        ends=section.way(end),
        one_sided=frozenset(one_sided),
        switched=frozenset(switched),
    )


def _linearised(loop: ClosedLoop, section: Section, walk: Walk, place: int) -> Floats | None:
    """Return the derivative of a return from its steps, or flows and events.

    None where numbers of the memory are disturbed too, where steps of the integration fall
    otherwise for disturbances, and of what has no derivative, or one to each side.
    """
    simulation = loop.simulation
    if section.words.names or not loop.even(walk):
        return None
    simulation.restore(walk.begins[place])
    try:
        found = step_derivatives(simulation, until=walk.begins[place + 1].time)
    except SimulationError:
        return None
    return section.of(found.state @ section.directions) if found.spread == 0.0 else None


def keeps_step(loop: ClosedLoop, section: Section, walk: Walk) -> Floats | None:
    """What a return makes of being early by hardly anything, (n,), if the samples take that away.

    As a part of the rate of the walk. None of walks that are not kept in step with the calls of
    their controller, or whose controller is not called at samples.
    """
    if loop.grid == 0.0:
        return None
    begin, end = walk.begins[:2]
    rate = section.rate(begin)
    moves = IN_STEP * loop.grid * section.size(section.flat(rate))
    states = [each.state.vector for each in walk.begins]
    if any(section.size(section.flat(b - a)) > moves for a, b in pairwise(states)):
        return None
    way = section.way(begin)
    change, sides = HARDLY * way / np.abs(way).max(), []
    for sign in (1.0, -1.0):
        section.disturb(loop.simulation, begin, sign * change)
        try:
            loop.advanced(loop.simulation, end.time, "a walk that is hardly early")
        except LimitCycleError:
            return None
        sides.append(section.read(loop.simulation))
    left = section.error(*sides) * np.abs(way).max() / (2.0 * HARDLY)
    robot = way[: section.of_robot]
    return left if left[: len(robot)] @ robot <= LOST * (robot @ robot) else None


def stays_early(loop: ClosedLoop, section: Section, walk: Walk) -> float:
    """Begin as the walk is a little later; say how much of that is left in the end.

    What this makes of a controller is not known to the last: a first return takes that away, if
    there are more, and what stays is being early alone. Zero if it does not go on so.
    """
    simulation, seconds = loop.fresh(), section.early
    section.put_early(simulation, walk.begins[0], seconds)
    by = [1.0]
    for end in walk.begins[1:]:
        try:
            loop.advanced(simulation, end.time, "a walk that is early")
        except LimitCycleError:
            return 0.0
        here = end.state.vector
        way = section.of(section.later(end, seconds)[0] - here)
        by.append(float(way @ section.of(section.read(simulation)[0] - here) / (way @ way)))
    first = by[1] if len(by) > 2 else by[0]
    return by[-1] / first if first != 0.0 else 0.0


def _same_feet(
    section: Section, usual: Snapshot, disturbed: Snapshot, name: str, size: float
) -> None:
    """Refuse disturbances after which the robot stands on another foot."""
    if section.feet(usual) != section.feet(disturbed):
        raise LimitCycleError(
            f"a disturbance of {name} by {size:.3g} makes the robot stand on another foot one "
            "return later; a smaller disturbance= may do"
        )
