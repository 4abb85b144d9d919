"""Scaled impulses under trial: their velocities, their residual, and the best of them."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.spatial.cones import entries_of, natural_map
from heelstrike.contact.spatial.workspace import (
    BlockProblem,
    Floats,
    Iterate,
    ScaledBlocks,
)


@kernel
def find_velocities(rows: int, scaled: ScaledBlocks, x: Floats, u: Floats) -> None:
    """Write ``u = matrix x + offset``; the matrix is symmetric."""
    for row in range(rows):
        u[row] = scaled.offset[row]
    add_products(rows, scaled.matrix, x, u)


@kernel
def add_products(rows: int, matrix: Floats, x: Floats, u: Floats) -> None:
    """Add ``matrix x`` to u; the matrix is symmetric."""
    for column in range(rows):
        own = x[column]
        if own != 0.0:
            for row in range(rows):
                u[row] += matrix[column, row] * own


@kernel
def block_value(
    problem: BlockProblem, scaled: ScaledBlocks, block: int, x: Floats, u: Floats
) -> float:
    """Natural map of a block of the scaled problem."""
    begin, end = problem.first[block], problem.first[block + 1]
    return natural_map(
        problem.set[block], problem.friction[block], scaled.bound[block],
        entries_of(x, begin, end), entries_of(u, begin, end),
    )  # fmt: skip


@kernel
def measure(
    problem: BlockProblem, scaled: ScaledBlocks, x: Floats, u: Floats
) -> tuple[float, float]:
    """Return the largest natural map of a block and the sum of the squares of all."""
    worst = square = 0.0
    for block in range(problem.count):
        value = block_value(problem, scaled, block, x, u)
        worst = max(worst, value)
        square += value * value
    if not square < math.inf:
        worst = square = math.inf
    return worst, square


@kernel
def look(problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate) -> None:
    """Find velocities and residual of the impulses, and keep them if they are the best so far."""
    find_velocities(problem.first[problem.count], scaled, iterate.x, iterate.u)
    iterate.worst, iterate.square = measure(problem, scaled, iterate.x, iterate.u)
    note_best(problem, iterate)


@kernel
def begin_at(
    problem: BlockProblem, scaled: ScaledBlocks, impulses: Floats, iterate: Iterate
) -> None:
    """Go to some impulses, and forget what was the best so far."""
    for row in range(problem.first[problem.count]):
        iterate.x[row] = impulses[row]
    iterate.least = math.inf
    look(problem, scaled, iterate)


@kernel
def note_best(problem: BlockProblem, iterate: Iterate) -> None:
    """Keep the impulses if their residual is the smallest so far."""
    if iterate.worst < iterate.least:
        iterate.least = iterate.worst
        for row in range(problem.first[problem.count]):
            iterate.best[row] = iterate.x[row]


@kernel
def return_to_best(problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate) -> None:
    """Go back to the impulses of the smallest residual."""
    for row in range(problem.first[problem.count]):
        iterate.x[row] = iterate.best[row]
    look(problem, scaled, iterate)
