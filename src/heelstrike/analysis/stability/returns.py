"""One return of a walk, disturbed in every coordinate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.stability.loop import ClosedLoop, Walk
from heelstrike.analysis.stability.section import Section
from heelstrike.errors import LimitCycleError
from heelstrike.sim.snapshot import Snapshot

Floats = NDArray[np.float64]

DIFFERENT, NOTICEABLE = 0.5, 0.05
"""Errors of either sign do different things if they differ by so much of the larger, and that is
not too small to matter."""


@dataclass(frozen=True)
class Disturbed:
    """Derivative of a return by differences.

    Attributes
    ----------
    matrix : (n, n) float
        Columns by coordinate disturbed.
    residual : float
        How far the undisturbed walk is from where it was one return before.
    one_sided, switched : frozenset of str
        Coordinates whose errors of either sign do different things; whole numbers of the memory
        that came out otherwise.
    """

    matrix: Floats
    residual: float
    one_sided: frozenset[str]
    switched: frozenset[str]


def returned(loop: ClosedLoop, section: Section, walk: Walk, place: int, size: float) -> Disturbed:
    """Disturb a walk in every coordinate, both ways, and see what is left one return later."""
    begin, end = walk.begins[place], walk.begins[place + 1]
    simulation = loop.simulation
    simulation.restore(end)
    state, words = section.read(simulation)
    counts = section.words.counts(simulation)
    columns, one_sided, switched = [], set(), set()
    for coordinate, name in enumerate(section.names):
        sides = []
        for sign in (1.0, -1.0):
            section.disturb(simulation, begin, coordinate, sign * size)
            loop.advanced(simulation, end.time, f"a disturbance of {name} by {sign * size:.3g}")
            _same_feet(section, end, simulation.snapshot(), name, sign * size)
            there, numbers = section.read(simulation)
            error = np.concatenate((section.of(there - state), numbers - words))
            sides.append(error / (sign * size))
            now = section.words.counts(simulation)
            switched |= {each for each in now if not np.array_equal(now[each], counts[each])}
        sizes = [float(np.linalg.norm(side)) for side in sides]
        apart = float(np.linalg.norm(sides[0] - sides[1]))
        if apart > max(DIFFERENT * max(sizes), NOTICEABLE):
            one_sided.add(name)
        columns.append(0.5 * (sides[0] + sides[1]))
    before = np.concatenate((begin.state.q, begin.state.v))
    residual = float(np.abs(section.flat(state - before)).max())
    return Disturbed(np.array(columns).T, residual, frozenset(one_sided), frozenset(switched))


def _same_feet(
    section: Section, usual: Snapshot, disturbed: Snapshot, name: str, size: float
) -> None:
    """Refuse disturbances after which the robot stands on another foot."""
    if section.feet(usual) != section.feet(disturbed):
        raise LimitCycleError(
            f"a disturbance of {name} by {size:.3g} makes the robot stand on another foot one "
            "return later; a smaller disturbance= may do"
        )
