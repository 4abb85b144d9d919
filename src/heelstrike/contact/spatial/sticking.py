"""The usual case: contacts go on sticking, or stay open, as in the solve before.

Sticking contacts make one symmetric system, often singular: the points of one rigid foot have more
rows than it has freedoms. A little is added to the diagonal, and the answer refined from zero, so
that it is the one of least norm. From the impulses of the step before it would wander to the edge
of the cones.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import CONE, HALF_LINE
from heelstrike.contact.spatial.iterates import look
from heelstrike.contact.spatial.modes import OPEN, SLIP, STICK
from heelstrike.contact.spatial.workspace import (
    BlockProblem,
    Floats,
    Integers,
    Iterate,
    NewtonSystem,
    ScaledBlocks,
)

FIRM = 1e-8
"""What is added to the unit diagonal. Rounding, 1e-16, leaves 1e-8 of an impulse along what moves
nothing; each refinement leaves this over the least eigenvalue that moves anything."""

REFINEMENTS = 6
"""How often the answer is refined."""

REFINED = 1e-14
"""Velocities that are left, of data of size one, below which nothing is to be gained."""

STAGNANT = 0.25
"""Part of them that a refinement leaves where rounding is all there is."""

ROUNDS_OF_OPENING = 4
"""How often contacts that pull are opened, and open ones that sink closed."""

STUCK = 1e-12
"""Residual up to which an answer of sticking contacts is taken."""


@kernel
def factorize(size: int, matrix: Floats) -> bool:
    """Replace the lower half of a positive matrix by its Cholesky factor, 1/d on the diagonal."""
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i > j:
                matrix[i, j] = total * matrix[j, j]
                continue
            if not total > 0.0:
                return False
            matrix[i, i] = 1.0 / math.sqrt(total)
    return True


@kernel
def solve_factored(size: int, factor: Floats, right: Floats) -> None:
    """Replace a right side by the solution, with the factor of :func:`factorize`."""
    for i in range(size):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * right[k]
        right[i] = total * factor[i, i]
    for i in range(size - 1, -1, -1):
        right[i] *= factor[i, i]
        for k in range(i):
            right[k] -= factor[i, k] * right[i]


@kernel
def list_sticking_rows(
    problem: BlockProblem, scaled: ScaledBlocks, mode: Integers, newton: NewtonSystem
) -> int:
    """List the rows of blocks that stick; return how many, or -1 if one slips."""
    size = 0
    for block in range(problem.count):
        if mode[block] == SLIP:
            return -1
        if mode[block] == OPEN or scaled.scale[block] == 0.0:
            continue
        if problem.set[block] == CONE and problem.friction[block] == 0.0:
            return -1
        for row in range(problem.first[block], problem.first[block + 1]):
            newton.row[size] = row
            size += 1
    return size


@kernel
def hold(size: int, scaled: ScaledBlocks, newton: NewtonSystem, x: Floats) -> bool:
    """Find the impulses of least norm that hold the listed rows; return success."""
    row, system, right, matrix = newton.row, newton.system, newton.right, scaled.matrix
    for i in range(size):
        for j in range(i + 1):
            system[i, j] = matrix[row[i], row[j]]
        system[i, i] += FIRM
    if not factorize(size, system):
        return False
    before = math.inf
    for turn in range(REFINEMENTS):
        left = 0.0
        for i in range(size):
            total = scaled.offset[row[i]]
            if turn > 0:
                for j in range(size):
                    total += matrix[row[i], row[j]] * x[row[j]]
            right[i] = -total
            left = max(left, abs(total))
        if left <= REFINED or left > STAGNANT * before:
            break
        before = left
        solve_factored(size, system, right)
        for i in range(size):
            x[row[i]] += right[i]
    return True


@kernel
def correct_modes(problem: BlockProblem, iterate: Iterate) -> int:
    """Open what pulls and close what sinks; return how many blocks changed."""
    changed = 0
    for block in range(problem.count):
        row, kind = problem.first[block], problem.set[block]
        if kind != CONE and kind != HALF_LINE:
            continue
        if iterate.mode[block] == OPEN:
            if iterate.u[row] < -STUCK:
                iterate.mode[block] = STICK
                changed += 1
        elif iterate.x[row] < 0.0:
            iterate.mode[block] = OPEN
            changed += 1
    return changed


@kernel
def try_sticking(
    problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate, newton: NewtonSystem
) -> bool:
    """Solve the problem if its blocks stick or are open, as their modes say; return success."""
    for _ in range(ROUNDS_OF_OPENING):
        size = list_sticking_rows(problem, scaled, iterate.mode, newton)
        if size < 0:
            return False
        for row in range(problem.first[problem.count]):
            iterate.x[row] = 0.0
        if not hold(size, scaled, newton, iterate.x):
            return False
        look(problem, scaled, iterate)
        if iterate.worst <= STUCK:
            return True
        if correct_modes(problem, iterate) == 0:
            return False
    return False
