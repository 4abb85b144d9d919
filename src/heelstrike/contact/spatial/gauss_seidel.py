"""Block Gauss-Seidel: one block after the other is solved exactly, the others held fixed.

A point is open, sticks, or slips in a direction that is the root of one equation in its angle.
"""

from __future__ import annotations

import math

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import HALF_LINE, INTERVAL, LINE
from heelstrike.contact.spatial.cones import Triple, project
from heelstrike.contact.spatial.workspace import (
    BlockProblem,
    BlockTally,
    Floats,
    Iterate,
    ScaledBlocks,
)

NEARLY_FLAT = 1e-14
"""Determinant of the rows of a point, of size one, up to which they depend on each other."""

DIRECTIONS = 16
"""Directions from which the slip is sought."""

COSINES = np.cos(2.0 * np.pi * np.arange(DIRECTIONS + 1) / DIRECTIONS)
SINES = np.sin(2.0 * np.pi * np.arange(DIRECTIONS + 1) / DIRECTIONS)

BISECTIONS = 60
"""How often an interval that has the direction is divided."""

SAME_DIRECTION = 1e-15
"""Length of an interval of directions that is none."""


@kernel
def slip_balance(matrix: Floats, row: int, friction: float, q: Triple, c: float, s: float) -> float:
    """What the slip lacks to be opposite to friction along (c, s), times what the point weighs."""
    n, x, y = row, row + 1, row + 2
    weight = matrix[n, n] + friction * (matrix[n, x] * c + matrix[n, y] * s)
    along = matrix[x, n] + friction * (matrix[x, x] * c + matrix[x, y] * s)
    across = matrix[y, n] + friction * (matrix[y, x] * c + matrix[y, y] * s)
    return weight * (c * q[2] - s * q[1]) - q[0] * (c * across - s * along)


@kernel
def slip_force(matrix: Floats, row: int, friction: float, q: Triple, c: float, s: float) -> float:
    """Normal impulse of a point whose friction is along (c, s); -1 if that is none."""
    n, x, y = row, row + 1, row + 2
    weight = matrix[n, n] + friction * (matrix[n, x] * c + matrix[n, y] * s)
    if not weight > 0.0:
        return -1.0
    force = -q[0] / weight
    slip_x = q[1] + force * (matrix[x, n] + friction * (matrix[x, x] * c + matrix[x, y] * s))
    slip_y = q[2] + force * (matrix[y, n] + friction * (matrix[y, x] * c + matrix[y, y] * s))
    return force if c * slip_x + s * slip_y <= 0.0 else -1.0


@kernel
def solve_slip(matrix: Floats, row: int, friction: float, q: Triple) -> Triple:
    """Impulse of a point that slips, or nothing if no direction is found."""
    before = slip_balance(matrix, row, friction, q, COSINES[0], SINES[0])
    for place in range(DIRECTIONS):
        after = slip_balance(matrix, row, friction, q, COSINES[place + 1], SINES[place + 1])
        if (before <= 0.0) != (after <= 0.0):
            low_c, low_s = COSINES[place], SINES[place]
            high_c, high_s = COSINES[place + 1], SINES[place + 1]
            c, s = low_c, low_s
            for _ in range(BISECTIONS):
                c, s = low_c + high_c, low_s + high_s
                length = math.sqrt(c * c + s * s)
                c, s = c / length, s / length
                value = slip_balance(matrix, row, friction, q, c, s)
                if (value <= 0.0) == (before <= 0.0):
                    low_c, low_s = c, s
                else:
                    high_c, high_s = c, s
                if abs(high_c - low_c) + abs(high_s - low_s) < SAME_DIRECTION:
                    break
            force = slip_force(matrix, row, friction, q, c, s)
            if force >= 0.0:
                return force, friction * force * c, friction * force * s
        before = after
    return 0.0, 0.0, 0.0


@kernel
def solve_point(matrix: Floats, row: int, friction: float, q: Triple) -> Triple:
    """Solve a point of three rows for its own impulse, where q is its velocity without."""
    if q[0] >= 0.0:
        return 0.0, 0.0, 0.0
    a, b, c = matrix[row, row], matrix[row, row + 1], matrix[row, row + 2]
    d, e, f = matrix[row + 1, row + 1], matrix[row + 1, row + 2], matrix[row + 2, row + 2]
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * first + b * second + c * third
    if determinant > NEARLY_FLAT:
        fourth, fifth, sixth = a * f - c * c, b * c - a * e, a * d - b * b
        n = -(first * q[0] + second * q[1] + third * q[2]) / determinant
        s = -(second * q[0] + fourth * q[1] + fifth * q[2]) / determinant
        t = -(third * q[0] + fifth * q[1] + sixth * q[2]) / determinant
        if s * s + t * t <= friction * friction * n * n and n >= 0.0:
            return n, s, t
    if friction == 0.0:
        return (-q[0] / a if a > 0.0 else 0.0), 0.0, 0.0
    n, s, t = solve_slip(matrix, row, friction, q)
    if n > 0.0 or not a > 0.0:
        return n, s, t
    return -q[0] / a, 0.0, 0.0


@kernel
def solve_planar_point(matrix: Floats, row: int, friction: float, q: Triple) -> Triple:
    """Solve a point of two rows for its own impulse."""
    if q[0] >= 0.0:
        return 0.0, 0.0, 0.0
    a, b, d = matrix[row, row], matrix[row, row + 1], matrix[row + 1, row + 1]
    determinant = a * d - b * b
    if determinant > NEARLY_FLAT:
        n, s = (b * q[1] - d * q[0]) / determinant, (b * q[0] - a * q[1]) / determinant
        if abs(s) <= friction * n:
            return n, s, 0.0
    for side in range(-1, 2, 2):
        ratio = friction * side
        weight = a + ratio * b
        if weight > 0.0:
            n = -q[0] / weight
            if side * (q[1] + (b + ratio * d) * n) <= 0.0:
                return n, ratio * n, 0.0
    return (-q[0] / a if a > 0.0 else 0.0), 0.0, 0.0


@kernel
def solve_one_block(
    problem: BlockProblem, scaled: ScaledBlocks, block: int, iterate: Iterate
) -> Triple:
    """Solve a block for its own impulse, the others held fixed."""
    row, kind, matrix = problem.first[block], problem.set[block], scaled.matrix
    size = problem.first[block + 1] - row
    x, u = iterate.x, iterate.u
    if kind in (LINE, HALF_LINE, INTERVAL):
        # A line of several rows goes row by row.
        weight = matrix[row, row]
        n = x[row] - u[row] / weight if weight > 0.0 else 0.0
        return project(kind, 0.0, scaled.bound[block], n, 0.0, 0.0)
    free = u[row], u[row + 1], u[row + 2] if size == 3 else 0.0
    qn, qs, qt = free
    for i in range(size):
        qn -= matrix[row, row + i] * x[row + i]
        qs -= matrix[row + 1, row + i] * x[row + i]
        if size == 3:
            qt -= matrix[row + 2, row + i] * x[row + i]
    if size == 2:
        return solve_planar_point(matrix, row, problem.friction[block], (qn, qs, 0.0))
    return solve_point(matrix, row, problem.friction[block], (qn, qs, qt))


@kernel
def change_row(rows: int, scaled: ScaledBlocks, row: int, change: float, iterate: Iterate) -> None:
    """Change one impulse, and the velocities with it."""
    if change != 0.0:
        iterate.x[row] += change
        for i in range(rows):
            iterate.u[i] += scaled.matrix[row, i] * change


@kernel
def sweep(
    problem: BlockProblem, scaled: ScaledBlocks, sweeps: int, tally: BlockTally, iterate: Iterate
) -> None:
    """Go over all blocks some times; ``iterate.u`` belongs to ``iterate.x`` before and after."""
    first = problem.first
    rows = first[problem.count]
    for _ in range(sweeps):
        tally.iterations += 1
        for block in range(problem.count):
            if scaled.scale[block] == 0.0:
                continue
            row = first[block]
            size = first[block + 1] - row
            n, s, t = solve_one_block(problem, scaled, block, iterate)
            change_row(rows, scaled, row, n - iterate.x[row], iterate)
            if problem.set[block] == LINE:
                for i in range(1, size):
                    weight = scaled.matrix[row + i, row + i]
                    change = -iterate.u[row + i] / weight if weight > 0.0 else 0.0
                    change_row(rows, scaled, row + i, change, iterate)
            elif size > 1:
                change_row(rows, scaled, row + 1, s - iterate.x[row + 1], iterate)
                if size > 2:
                    change_row(rows, scaled, row + 2, t - iterate.x[row + 2], iterate)
