"""Families on one branch: gaits that a neighbour leads to a better optimum.

From a neighbour's gait the optimiser finds the optimum that goes over into it, which need not be
the least one. Where two branches of optima meet, neighbours move differently. There each is sought
again from the other, and the cheaper branch spreads as far as it is cheaper.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import combinations

import numpy as np

from heelstrike.gait.gait import Gait
from heelstrike.robot.model import Floats

Place = tuple[int, ...]
"""Indices of a point of the grid, an axis each."""

Pair = tuple[Place, Place]
"""Neighbours, the one first whose indices come first."""

APART = 3.0
"""Neighbours of another branch differ at least so many times as much as neighbours usually do."""
CHEAPER = 1e-3
"""Share by which a gait must be cheaper to take the place of another."""
POSTURES = 21
"""Postures of a step that are compared."""


def on_the_cheaper_branch(
    gaits: dict[Place, Gait],
    sought: Callable[[Place, Gait], Gait | None],
    settled: set[Pair],
    told: Callable[[float], None],
) -> None:
    """Let the cheaper one of two branches spread over a family.

    Parameters
    ----------
    gaits : dict
        The gaits by their place in the grid; better ones take their place.
    sought : callable
        Seeks the gait of a place from another; None if there is none.
    settled : set of pair
        Neighbours between which nothing is left to seek, which grows to all of them.
    told : callable
        Called with the share of the work that is done after each pair of neighbours has been
        settled, and in the beginning; never if there is nothing to do.
    """
    postures = {place: _postures(gait) for place, gait in gaits.items()}
    usual = _usual(postures)

    def apart(one: Place, other: Place) -> bool:
        limit = APART * usual[_axis(one, other)]
        return _distance(postures[one], postures[other]) > limit

    new = [pair for pair in _neighbours(postures) if pair not in settled]
    if not new:
        return
    waiting = [pair for pair in new if apart(*pair)]
    settled.update(set(new).difference(waiting))
    done, share = 0, 0.0
    while waiting:
        share = max(share, done / (done + len(waiting)))
        told(share)
        pair = waiting.pop()
        done += 1
        if pair in settled:
            continue
        settled.add(pair)
        if not apart(*pair):
            continue
        for place, other in (pair, pair[::-1]):
            found = sought(place, gaits[other])
            if found is None or not found.optimal:
                continue
            if gaits[place].optimal and spending(found) > (1.0 - CHEAPER) * spending(gaits[place]):
                continue
            gaits[place], postures[place] = found, _postures(found)
            again = [each for each in _neighbours(postures) if place in each and each != pair]
            settled.difference_update(again)
            waiting += again
            break
    told(1.0)


def spending(gait: Gait) -> float:
    """What a gait spends, to be compared; without limit where it is not known."""
    return math.inf if gait.spent is None else gait.spent


def _postures(gait: Gait) -> Floats:
    """Positions of the joints over a step, (POSTURES, nu)."""
    return gait.position(np.linspace(0.0, gait.step_duration, POSTURES))


def _distance(one: Floats, other: Floats) -> float:
    """Root mean square difference of positions (rad, m)."""
    return float(np.sqrt(np.mean((one - other) ** 2)))


def _axis(one: Place, other: Place) -> int:
    """Axis along which two neighbours differ."""
    return next(k for k, (i, j) in enumerate(zip(one, other, strict=True)) if i != j)


def _neighbours(places: Mapping[Place, Floats]) -> list[Pair]:
    """Pairs of places that differ by one along one axis."""
    return [
        (one, other)
        for one, other in combinations(sorted(places), 2)
        if sum(abs(i - j) for i, j in zip(one, other, strict=True)) == 1
    ]


def _usual(postures: Mapping[Place, Floats]) -> dict[int, float]:
    """Median distance of neighbours along each axis."""
    distances: dict[int, list[float]] = {}
    for one, other in _neighbours(postures):
        along = distances.setdefault(_axis(one, other), [])
        along.append(_distance(postures[one], postures[other]))
    return {axis: float(np.median(each)) for axis, each in distances.items()}
