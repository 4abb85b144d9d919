"""The last resort: slip speeds are guessed, and a convex problem says which they ought to be.

With the slip speeds in De Saxcé's velocity ``u + μ ‖u_t‖ n`` held fixed, impulses solve a convex
problem: ``½ λ·W λ + λ·(b + μ s n)`` is smallest within the cones. Where its answer slips with the
speeds s it solves the contact problem (Acary, Cadoux, Lemaréchal and Malick 2011); existence of
solutions is proven by this map. Speeds go half of the way from the guess to the answer, which also
settles where whole ways go round in circles. Between guesses Newton's method tries the problem.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import CONE
from heelstrike.contact.spatial.cones import entries_of, project
from heelstrike.contact.spatial.iterates import begin_at, find_velocities
from heelstrike.contact.spatial.newton import RIDGE, iterate_newton
from heelstrike.contact.spatial.proximal import NOTHING_YET, OUTER_STEPS, keep_aside
from heelstrike.contact.spatial.workspace import (
    Anchor,
    BlockProblem,
    BlockSettings,
    BlockTally,
    Floats,
    Iterate,
    NewtonSystem,
    ScaledBlocks,
)

GUESSES = 600
"""How often slip speeds are guessed."""

GRADIENT_STEPS = 60
"""Steps towards the answer of each convex problem. Each counts as an iteration, as sweeps do: all
of them multiply by the matrix once."""

SHARE_OF_THE_WAY = 0.5
"""How far slip speeds go from a guess to the answer."""


@kernel
def largest_row(rows: int, matrix: Floats) -> float:
    """Largest sum of the sizes of a row: no eigenvalue of the matrix is larger."""
    most = 0.0
    for row in range(rows):
        total = 0.0
        for column in range(rows):
            total += abs(matrix[row, column])
        most = max(most, total)
    return most


@kernel
def slip_speed(problem: BlockProblem, block: int, u: Floats) -> float:
    """Tangential speed of a contact; zero of all other blocks."""
    if problem.set[block] != CONE:
        return 0.0
    square = 0.0
    for row in range(problem.first[block] + 1, problem.first[block + 1]):
        square += u[row] * u[row]
    return math.sqrt(square)


@kernel
def descend(
    problem: BlockProblem, scaled: ScaledBlocks, rate: float, near: Floats, iterate: Iterate
) -> None:
    """Go towards the smallest value of the convex problem of the scaled offset.

    Projected gradients with momentum, which is given up where it leads back (O'Donoghue and Candès
    2015). `near` receives the impulses; ``iterate.x`` and ``iterate.u`` are scratch.
    """
    first, y = problem.first, iterate.x
    for row in range(first[problem.count]):
        y[row] = near[row]
    momentum = 1.0
    for _ in range(GRADIENT_STEPS):
        find_velocities(first[problem.count], scaled, y, iterate.u)
        back = 0.0
        next_momentum = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * momentum * momentum))
        for block in range(problem.count):
            row = first[block]
            size = first[block + 1] - row
            now, there = (
                entries_of(y, row, first[block + 1]),
                entries_of(iterate.u, row, first[block + 1]),
            )
            found = project(
                problem.set[block], problem.friction[block], scaled.bound[block],
                now[0] - rate * there[0], now[1] - rate * there[1], now[2] - rate * there[2],
            )  # fmt: skip
            for i in range(size):
                change = found[i] - near[row + i]
                back += (y[row + i] - found[i]) * change
                near[row + i] = found[i]
                y[row + i] = found[i] + (momentum - 1.0) / next_momentum * change
        momentum = next_momentum
        if back > 0.0:
            momentum = 1.0
            for row in range(first[problem.count]):
                y[row] = near[row]


@kernel
def guess_slips(
    problem: BlockProblem, settings: BlockSettings, scaled: ScaledBlocks, tally: BlockTally,
    iterate: Iterate, newton: NewtonSystem, anchor: Anchor,
) -> None:  # fmt: skip
    """Guess slip speeds until the problem is solved or the effort is spent; keep the best.

    The first guess is that nothing slips: the best impulses so far may be where there is almost a
    solution, but none. ``anchor.slip`` has the guess of each block, ``anchor.offset`` the offset of
    the problem, ``anchor.path`` the impulses.
    """
    rows, first = problem.first[problem.count], problem.first
    rate = largest_row(rows, scaled.matrix)
    rate = 1.0 / rate if rate > 0.0 else 0.0
    least = keep_aside(rows, NOTHING_YET, iterate, anchor)
    for row in range(rows):
        anchor.offset[row] = scaled.offset[row]
        anchor.path[row] = 0.0
    for block in range(problem.count):
        anchor.slip[block] = 0.0
    for _ in range(GUESSES):
        if tally.iterations >= settings.effort or least <= settings.tolerance:
            break
        tally.iterations += GRADIENT_STEPS
        for block in range(problem.count):
            if problem.set[block] == CONE:
                scaled.offset[first[block]] += problem.friction[block] * anchor.slip[block]
        descend(problem, scaled, rate, anchor.path, iterate)
        for row in range(rows):
            scaled.offset[row] = anchor.offset[row]
        begin_at(problem, scaled, anchor.path, iterate)
        for block in range(problem.count):
            lacks = slip_speed(problem, block, iterate.u) - anchor.slip[block]
            anchor.slip[block] += SHARE_OF_THE_WAY * lacks
        iterate_newton(
            problem, scaled, settings, OUTER_STEPS, RIDGE, False, tally, iterate, newton
        )  # fmt: skip
        least = keep_aside(rows, least, iterate, anchor)
    begin_at(problem, scaled, anchor.center, iterate)
