"""Newton's method from other impulses, which are drawn but always the same."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import CONE
from heelstrike.contact.spatial.gauss_seidel import sweep
from heelstrike.contact.spatial.iterates import look
from heelstrike.contact.spatial.newton import RIDGE, iterate_newton
from heelstrike.contact.spatial.workspace import (
    BlockProblem,
    BlockSettings,
    BlockTally,
    Floats,
    Iterate,
    NewtonSystem,
    ScaledBlocks,
)

STARTS = 60
"""How many beginnings are tried."""

STEPS_OF_EACH = 30
"""Steps of Newton's method from each."""

MULTIPLIER, INCREMENT, MODULUS = 1103515245, 12345, 2**31
"""Of the generator x ← (a x + c) mod m (ISO C's example), here of numbers from −1 to 1."""

SPREADS = 4
"""Drawn impulses are 1, 2, 4 or 8 times the data at most."""


@kernel
def draw(problem: BlockProblem, start: int, x: Floats) -> None:
    """Write drawn impulses, those of cones within these."""
    seed = 2 * start + 1
    largest = 2.0 ** (start % SPREADS)
    for block in range(problem.count):
        begin = problem.first[block]
        for row in range(begin, problem.first[block + 1]):
            seed = (MULTIPLIER * seed + INCREMENT) % MODULUS
            value = largest * (2.0 * seed / MODULUS - 1.0)
            if problem.set[block] != CONE:
                x[row] = value
            elif row == begin:
                x[row] = max(value, 0.0)
            else:
                x[row] = 0.5 * problem.friction[block] * x[begin] * value / largest


@kernel
def try_other_starts(
    problem: BlockProblem, settings: BlockSettings, scaled: ScaledBlocks, tally: BlockTally,
    iterate: Iterate, newton: NewtonSystem,
) -> None:  # fmt: skip
    """Begin again and again until a solution is found or the effort is spent."""
    for start in range(STARTS):
        if tally.iterations >= settings.effort or iterate.least <= settings.tolerance:
            break
        draw(problem, start, iterate.x)
        look(problem, scaled, iterate)
        sweep(problem, scaled, start % 3, tally, iterate)
        iterate_newton(
            problem, scaled, settings, STEPS_OF_EACH, RIDGE, False, tally, iterate, newton
        )  # fmt: skip
