"""The proximal-point method: problems tied to the answer before, which tend to the one at hand.

With τ on the diagonal and −τ λₖ in the offset a problem is better conditioned, Newton's method
mostly solves it, and where λₖ₊₁ = λₖ nothing has been added at all (Rockafellar 1976).
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.spatial.gauss_seidel import sweep
from heelstrike.contact.spatial.iterates import begin_at, look, return_to_best
from heelstrike.contact.spatial.newton import RIDGE, iterate_newton
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

INNER_STEPS = 12
"""Steps of Newton's method for each."""

OUTER_STEPS = 4
"""Steps of Newton's method on the problem itself after each."""

NOTHING_YET = math.inf
"""Residual of no impulses at all."""


@kernel
def remember(rows: int, scaled: ScaledBlocks, anchor: Anchor) -> None:
    """Keep diagonal and offset of the problem itself."""
    for row in range(rows):
        anchor.diagonal[row] = scaled.matrix[row, row]
        anchor.offset[row] = scaled.offset[row]


@kernel
def tie(rows: int, strength: float, x: Floats, anchor: Anchor, scaled: ScaledBlocks) -> None:
    """Tie the problem to impulses, with some strength; none restores it."""
    for row in range(rows):
        scaled.matrix[row, row] = anchor.diagonal[row] + strength
        scaled.offset[row] = anchor.offset[row] - strength * x[row]


@kernel
def keep_aside(rows: int, least: float, iterate: Iterate, anchor: Anchor) -> float:
    """Keep the best impulses so far; return their residual, or the one before if it is smaller."""
    if iterate.least < least:
        for row in range(rows):
            anchor.center[row] = iterate.best[row]
        return iterate.least
    return least


@kernel
def approach(
    problem: BlockProblem, settings: BlockSettings, strength: float, ties: int,
    scaled: ScaledBlocks, tally: BlockTally, iterate: Iterate, newton: NewtonSystem, anchor: Anchor,
) -> bool:  # fmt: skip
    """Solve problems with a larger diagonal, one after the other; return if one is solved.

    Between two of them Newton's method tries the problem itself. The best impulses are kept.
    """
    rows = problem.first[problem.count]
    remember(rows, scaled, anchor)
    least = keep_aside(rows, NOTHING_YET, iterate, anchor)
    for _ in range(ties):
        if tally.iterations >= settings.effort or least <= settings.tolerance:
            break
        tie(rows, strength, iterate.x, anchor, scaled)
        iterate.least = NOTHING_YET
        look(problem, scaled, iterate)
        sweep(problem, scaled, 1, tally, iterate)
        iterate_newton(
            problem, scaled, settings, INNER_STEPS, 0.0, False, tally, iterate, newton
        )  # fmt: skip
        return_to_best(problem, scaled, iterate)
        tie(rows, 0.0, iterate.x, anchor, scaled)
        for row in range(rows):
            anchor.path[row] = iterate.x[row]
        iterate.least = NOTHING_YET
        iterate_newton(
            problem, scaled, settings, OUTER_STEPS, RIDGE, False, tally, iterate, newton
        )  # fmt: skip
        least = keep_aside(rows, least, iterate, anchor)
        for row in range(rows):
            iterate.x[row] = anchor.path[row]
    begin_at(problem, scaled, anchor.center, iterate)
    return iterate.least <= settings.tolerance
