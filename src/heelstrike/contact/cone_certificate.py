"""The certificate of a few contacts with friction, and of joint stops, as straight-line code.

There is a program for each number of both, for all robots. It says what
:mod:`heelstrike.contact.certificate` says by loops.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import Program, inverse_above, larger, smaller
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.contact.workspace import PROGRAM_ROWS, Floats

MOST_CONES = 5
MOST_STOPS = 6
"""MOST_CONES, MOST_STOPS: Contacts, and rows without friction after them, of the largest problems
with a program; its length grows with the square of their number."""


def has_stops(cones: int, stops: int) -> bool:
    """Whether there are programs for so many contacts, of one foot or two, and so many stops."""
    rows = 2 * cones + stops
    return cones in (2, 4) and 0 < stops <= MOST_STOPS and rows <= PROGRAM_ROWS


UNIT, EFFORT, LEAST, FASTEST = range(4)
"""What the programs measure with: the size of the data, the effort in its own unit, the least of
the diagonal, and the largest ``|velocity| / g``."""

SIZES, EFFORTS, DIAGONAL, SPEEDS, PENETRATION, CONE, COMPLEMENTARITY = range(7)
"""What is gathered from the rows."""


@kernel
def gather(count: int, combine: Callable[[float, float], float], level: Floats) -> float:
    """Combine numbers two by two, the first half of them with the second, until one is left.

    Machine code combines several at once.

    Parameters
    ----------
    count : int
        How many there are, at least one.
    combine : callable
    level : (any,) float
        The first are the numbers. What becomes of them is written behind, each time to new places.
    """
    begin = 0
    while count > 1:
        half = (count + 1) // 2
        end = begin + count
        for i in range(count - half):
            level[end + i] = combine(level[begin + i], level[begin + half + i])
        if count < 2 * half:
            level[end + half - 1] = level[begin + half - 1]
        begin, count = end, half
    last: float = level[begin]
    return last


@kernel
def plus(one: float, other: float) -> float:
    """Sum of two numbers."""
    return one + other


@kernel
def measure_rows(
    first: int, last: int, delassus: Floats, free: Floats, impulse: Floats, limit: Floats,
    root: Floats, velocity: Floats, tree: Floats,
) -> None:  # fmt: skip
    """Weights of rows, their velocities, and what tells the size of the data."""
    for i in range(first, last):
        root[i] = sqrt(delassus[i, i])
        velocity[i] = free[i]
    for j in range(root.shape[0]):
        for i in range(first, last):
            velocity[i] += delassus[j, i] * impulse[j]
    for i in range(first, last):
        tree[SIZES, i - first] = abs(free[i]) / root[i]
        # What is no number, or infinite, makes the effort none.
        nothing = (velocity[i] - velocity[i]) + (limit[i] - limit[i])
        tree[EFFORTS, i - first] = root[i] * abs(impulse[i]) + nothing
        tree[DIAGONAL, i - first] = delassus[i, i]


@kernel
def judge_row(
    place: int, speed: float, scale: float, inverse: float, lower: float, upper: float, tree: Floats
) -> None:
    """Residuals of a row, of what its impulse lacks to its limits below and above."""
    lower, upper, speed = lower * scale, upper * scale, speed * inverse
    tree[CONE, place] = -smaller(lower, upper)
    tree[COMPLEMENTARITY, place] = larger(smaller(speed, lower), smaller(-speed, upper))


@kernel
def certify_rows(
    delassus: Floats, free: Floats, friction: Floats, held: Floats, impulse: Floats, root: Floats,
    velocity: Floats, residual: Floats, size: Floats, limit: Floats, cones: Floats, stops: Floats,
) -> None:  # fmt: skip
    """Weights of rows, what impulses make of their velocities, and residuals.

    Of use where every row is moved by something, where rounding is not to be seen, and where all
    are numbers: otherwise the effort is none.

    Parameters
    ----------
    delassus : (PROGRAM_ROWS, PROGRAM_ROWS) float
        Its first m rows and columns are symmetric: columns are read as rows.
    free, impulse : (m,) float
        Of n contacts with two rows each, and of as many stops as there are more rows.
    friction : (n,) float
    held : (stops,) float
        1 for the stops whose velocity counts among the fastest, 0 for the others.
    root : (m,) float
        Receives ``g = sqrt(diag G)``.
    velocity : (m,) float
        Receives ``G impulse + free``.
    residual : (3,) float
        Receives complementarity, cone and non-penetration, in units of the data.
    size : (4,) float
        In: the floor in the place of the size of the data. Receives all four.
    limit, cones, stops : (m,), (7, any), (7, any) float
        Scratch.
    """
    number, rows = friction.shape[0], root.shape[0]
    edge = 2 * number
    for i in range(rows):
        limit[i] = friction[i // 2] * impulse[i - i % 2] if i < edge else 0.0
    measure_rows(0, edge, delassus, free, impulse, limit, root, velocity, cones)
    measure_rows(edge, rows, delassus, free, impulse, limit, root, velocity, stops)
    unit = larger(gather(edge, larger, cones[SIZES]), size[UNIT])
    effort = gather(edge, plus, cones[EFFORTS])
    least = gather(edge, smaller, cones[DIAGONAL])
    if rows > edge:
        unit = larger(gather(rows - edge, larger, stops[SIZES]), unit)
        effort = plus(gather(rows - edge, plus, stops[EFFORTS]), effort)
        least = smaller(gather(rows - edge, smaller, stops[DIAGONAL]), least)
    inverse = inverse_above(unit, 0.0)
    for i in range(edge):
        speed, scale = velocity[i] / root[i], root[i] * inverse
        cones[SPEEDS, i] = abs(speed)
        if i % 2 == 0:
            # A normal impulse lacks itself to zero, and nothing holds it on the other side.
            cones[PENETRATION, i // 2] = -speed
            judge_row(i, speed, scale, inverse, impulse[i], 0.0, cones)
        else:
            lower, upper = limit[i] + impulse[i], limit[i] - impulse[i]
            judge_row(i, speed, scale, inverse, lower, upper, cones)
    for i in range(edge, rows):
        speed, scale = velocity[i] / root[i], root[i] * inverse
        stops[SPEEDS, i - edge] = abs(speed) * held[i - edge]
        stops[PENETRATION, i - edge] = -speed
        judge_row(i - edge, speed, scale, inverse, impulse[i], 0.0, stops)
    fastest = gather(edge, larger, cones[SPEEDS])
    deepest = larger(gather(number, larger, cones[PENETRATION]), 0.0)
    outside = larger(gather(edge, larger, cones[CONE]), 0.0)
    worst = larger(gather(edge, larger, cones[COMPLEMENTARITY]), 0.0)
    if rows > edge:
        fastest = larger(gather(rows - edge, larger, stops[SPEEDS]), fastest)
        deepest = larger(gather(rows - edge, larger, stops[PENETRATION]), deepest)
        outside = larger(gather(rows - edge, larger, stops[CONE]), outside)
        worst = larger(gather(rows - edge, larger, stops[COMPLEMENTARITY]), worst)
    residual[0], residual[1], residual[2] = worst, outside, deepest * inverse
    size[UNIT], size[EFFORT], size[LEAST], size[FASTEST] = unit, effort, least, fastest


@lru_cache(maxsize=1)
def certificate_programs() -> NDArray[np.int64]:
    """Addresses of the programs by the numbers of contacts and of stops; zero where there is none.

    Read-only: all workspaces share them.
    """
    programs = np.zeros((MOST_CONES + 1, MOST_STOPS + 1), dtype=np.int64)
    numbers = [
        (cones, stops)
        for cones in range(1, MOST_CONES + 1)
        for stops in range(MOST_STOPS + 1)
        if stops == 0 or has_stops(cones, stops)
    ]
    programs[tuple(np.transpose(numbers))] = straight_line_code([_program(*n) for n in numbers])
    programs.flags.writeable = False
    return programs


def _program(cones: int, stops: int) -> Program:
    rows = 2 * cones + stops
    by_row = {name: np.zeros(rows) for name in ("impulse", "root", "velocity")}
    scratch = {
        "limit": np.zeros(rows),
        "cones": np.zeros((7, 4 * cones + 4)),
        "stops": np.zeros((7, 2 * stops + 4)),
    }
    return Program(
        certify_rows,
        {
            "delassus": np.zeros((PROGRAM_ROWS, PROGRAM_ROWS)),
            "free": np.zeros(rows),
            "friction": np.zeros(cones),
            "held": np.zeros(stops),
            **by_row,
            "residual": np.zeros(3),
            "size": np.zeros(4),
            **scratch,
        },
        name=f"certify_{cones}_and_{stops}",
        scratch=tuple(scratch),
        side_by_side=True,
    )
