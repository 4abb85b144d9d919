"""Newton's method on contact modes, in the unknowns that the modes leave.

With p = λ_t − u_t (Alart and Curnier 1991) a contact is open where λ_n ≤ u_n, sticks where
‖p‖ ≤ μ (λ_n − u_n) and slips otherwise, with its friction along p̂ = p / ‖p‖. A sticking contact has
three unknowns, whose velocities vanish. A slipping one has two, along (1, μ p̂) and across, along
ŝ ⟂ p̂::

    u_n + du_n = 0
    κ ŝ·du_t + (1 − κ) z = −ŝ·λ_t,    κ = μ (λ_n − u_n) / ‖p‖

In a plane there is nothing across. Steps are as long as the natural map allows.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL
from heelstrike.contact.spatial.iterates import add_products, look, measure
from heelstrike.contact.spatial.modes import OPEN, SLIP, STICK
from heelstrike.contact.spatial.workspace import (
    BlockProblem,
    BlockSettings,
    BlockTally,
    Floats,
    Iterate,
    NewtonSystem,
    ScaledBlocks,
)

RIDGE = 1e-10
"""Part of one that is added to the diagonal: dependent rows have unit diagonals, too."""

SETTLED = 1e-13
"""Residual below which nothing is to be gained."""

SHORTENINGS = 10
"""How often a step is halved."""

STALLS = 4
"""Steps in a row that may leave the residual larger than it was."""

ENOUGH = 0.99
"""Part of the residual that a step may leave."""

NO_SPEED = 1e-300
"""Lengths below this have no direction."""


@kernel
def name_modes(problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate) -> None:
    """Name what each block would do after Alart and Curnier."""
    x, u, mode = iterate.x, iterate.u, iterate.mode
    for block in range(problem.count):
        row = problem.first[block]
        size = problem.first[block + 1] - row
        kind = problem.set[block]
        pressed = x[row] - u[row]
        mode[block] = STICK
        if kind == HALF_LINE:
            mode[block] = STICK if pressed > 0.0 else OPEN
        elif kind == INTERVAL:
            mode[block] = STICK if abs(pressed) <= scaled.bound[block] else SLIP
        elif kind == CONE:
            if pressed <= 0.0:
                mode[block] = OPEN
                continue
            along = x[row + 1] - u[row + 1]
            across = x[row + 2] - u[row + 2] if size > 2 else 0.0
            limit = problem.friction[block] * pressed
            if problem.friction[block] == 0.0 or along * along + across * across > limit * limit:
                mode[block] = SLIP


@kernel
def add_unknown(
    block: int, d: tuple[float, float, float], e: tuple[float, float, float], newton: NewtonSystem
) -> int:
    """Add an unknown with its direction and the velocities that its equation adds up."""
    k = newton.size
    newton.size = k + 1
    newton.block[k] = block
    newton.extra[k] = 0.0
    newton.across[k] = 0
    newton.right[k] = 0.0
    for i in range(3):
        newton.direction[k, i] = d[i]
        newton.equation[k, i] = e[i]
    return k


@kernel
def list_slip(
    problem: BlockProblem, block: int, x: Floats, u: Floats, newton: NewtonSystem
) -> None:
    """List the unknowns of a slipping contact, and what its mode says by itself."""
    row = problem.first[block]
    friction = problem.friction[block]
    flat = problem.first[block + 1] - row == 2
    along = x[row + 1] - u[row + 1]
    across = 0.0 if flat else x[row + 2] - u[row + 2]
    length = math.sqrt(along * along + across * across)
    c, s = 1.0, 0.0
    if length > NO_SPEED:
        c, s = along / length, across / length
    add_unknown(block, (1.0, friction * c, friction * s), (1.0, 0.0, 0.0), newton)
    lacks = friction * x[row] - c * x[row + 1]
    if flat:
        newton.known[row + 1] = lacks * c
        return
    lacks -= s * x[row + 2]
    newton.known[row + 1] = lacks * c
    newton.known[row + 2] = lacks * s
    share = 0.0
    if length > NO_SPEED:
        share = min(friction * (x[row] - u[row]) / length, 1.0)
    k = add_unknown(block, (0.0, -s, c), (0.0, -share * s, share * c), newton)
    newton.extra[k] = 1.0 - share
    newton.across[k] = 1
    newton.right[k] = s * x[row + 1] - c * x[row + 2]


@kernel
def axis_of(component: int) -> tuple[float, float, float]:
    """Unit vector along a component."""
    if component == 0:
        return 1.0, 0.0, 0.0
    return (0.0, 1.0, 0.0) if component == 1 else (0.0, 0.0, 1.0)


@kernel
def list_unknowns(
    problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate, newton: NewtonSystem
) -> None:
    """List the unknowns that the modes leave, and the changes they say by themselves."""
    x, u, mode = iterate.x, iterate.u, iterate.mode
    newton.size = 0
    for block in range(problem.count):
        begin, end = problem.first[block], problem.first[block + 1]
        for row in range(begin, end):
            newton.known[row] = -x[row] if mode[block] == OPEN else 0.0
        if mode[block] == OPEN or scaled.scale[block] == 0.0:
            continue
        if problem.set[block] == INTERVAL and mode[block] == SLIP:
            bound = scaled.bound[block]
            newton.known[begin] = (bound if x[begin] > u[begin] else -bound) - x[begin]
            continue
        if mode[block] == SLIP:
            list_slip(problem, block, x, u, newton)
            continue
        for row in range(begin, end):
            one = axis_of(row - begin)
            add_unknown(block, one, one, newton)


@kernel
def apply_matrix(rows: int, scaled: ScaledBlocks, change: Floats, moved: Floats) -> None:
    """Write what a change of the impulses does to the velocities; the matrix is symmetric."""
    for row in range(rows):
        moved[row] = 0.0
    add_products(rows, scaled.matrix, change, moved)


@kernel
def write_system(
    problem: BlockProblem, scaled: ScaledBlocks, u: Floats, ridge: float, newton: NewtonSystem
) -> None:
    """Write the matrix and the right side of the equations of the unknowns."""
    size, first, matrix = newton.size, problem.first, scaled.matrix
    block, spread, direction = newton.block, newton.spread, newton.direction
    last = -1
    for k in range(size):
        if block[k] == last:
            continue
        last = block[k]
        for row in range(first[last], first[last + 1]):
            for other in range(size):
                begin = first[block[other]]
                total = 0.0
                for i in range(first[block[other] + 1] - begin):
                    total += matrix[row, begin + i] * direction[other, i]
                spread[row, other] = total
    for k in range(size):
        begin = first[block[k]]
        components = first[block[k] + 1] - begin
        right = newton.right[k]
        for i in range(components):
            part = newton.equation[k, i]
            there = newton.moved[begin + i]
            right -= part * (there if newton.across[k] == 1 else there + u[begin + i])
        newton.right[k] = right
        for other in range(size):
            total = 0.0
            for i in range(components):
                total += newton.equation[k, i] * spread[begin + i, other]
            newton.system[k, other] = total
        newton.system[k, k] += newton.extra[k] + ridge


@kernel
def solve_general(size: int, matrix: Floats, right: Floats) -> bool:
    """Replace a right side by the solution of linear equations; return success.

    Elimination with the largest pivot of each column; the matrix becomes its factors. The last
    unknown goes first, so that the inner loops begin at zero, as in
    :func:`~heelstrike.contact.spatial.sticking.factorize`.
    """
    for k in range(size - 1, -1, -1):
        best, place = abs(matrix[k, k]), k
        for i in range(k):
            if abs(matrix[i, k]) > best:
                best, place = abs(matrix[i, k]), i
        if not best > 0.0:
            return False
        if place != k:
            for j in range(k + 1):
                matrix[k, j], matrix[place, j] = matrix[place, j], matrix[k, j]
            right[k], right[place] = right[place], right[k]
        inverse = 1.0 / matrix[k, k]
        for i in range(k):
            factor = matrix[i, k] * inverse
            if factor == 0.0:
                continue
            for j in range(k):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(size):
        total = right[k]
        for j in range(k):
            total -= matrix[k, j] * right[j]
        right[k] = total / matrix[k, k]
    return True


@kernel
def find_step(
    problem: BlockProblem, scaled: ScaledBlocks, ridge: float, iterate: Iterate,
    newton: NewtonSystem,
) -> bool:  # fmt: skip
    """Write the step of Newton's method for the modes; return success.

    ``newton.step`` receives the change of the impulses, ``newton.moved`` that of the velocities.
    """
    rows, first = problem.first[problem.count], problem.first
    list_unknowns(problem, scaled, iterate, newton)
    apply_matrix(rows, scaled, newton.known, newton.moved)
    write_system(problem, scaled, iterate.u, ridge, newton)
    if not solve_general(newton.size, newton.system, newton.right):
        return False
    for row in range(rows):
        newton.step[row] = newton.known[row]
    for k in range(newton.size):
        begin = first[newton.block[k]]
        for i in range(first[newton.block[k] + 1] - begin):
            newton.step[begin + i] += newton.right[k] * newton.direction[k, i]
    apply_matrix(rows, scaled, newton.step, newton.moved)
    return True


@kernel
def go(problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate, newton: NewtonSystem) -> bool:
    """Go along a step as far as the residual shrinks most or enough; return whether it shrank."""
    rows = problem.first[problem.count]
    before = iterate.square
    share, best, least = 1.0, 1.0, math.inf
    for _ in range(SHORTENINGS):
        for row in range(rows):
            newton.trial_x[row] = iterate.x[row] + share * newton.step[row]
            newton.trial_u[row] = iterate.u[row] + share * newton.moved[row]
        _, square = measure(problem, scaled, newton.trial_x, newton.trial_u)
        if square < least:
            best, least = share, square
        if square < ENOUGH * before:
            break
        share *= 0.5
    if not least < math.inf:
        return False
    for row in range(rows):
        iterate.x[row] += best * newton.step[row]
    look(problem, scaled, iterate)
    return iterate.square < before


@kernel
def iterate_newton(
    problem: BlockProblem, scaled: ScaledBlocks, settings: BlockSettings, most: int, ridge: float,
    named: bool, tally: BlockTally, iterate: Iterate, newton: NewtonSystem,
) -> bool:  # fmt: skip
    """Take steps of Newton's method from the impulses of the iterate; return if it settled.

    Parameters
    ----------
    problem, scaled : BlockProblem, ScaledBlocks
        The problem, and in units of the solvers.
    settings : BlockSettings
        What counts as solved, and how much may be tried.
    most : int
        Most steps.
    ridge : float
        What is added to the diagonal.
    named : bool
        Whether the modes of the first step are those of the iterate, not named again.
    tally, iterate, newton
        Counts, impulses and scratch. The best impulses so far are kept.
    """
    look(problem, scaled, iterate)
    stalls = 0
    for attempt in range(most):
        if iterate.worst <= SETTLED:
            return True
        if tally.iterations >= settings.effort:
            break
        tally.iterations += 1
        before = iterate.worst
        if attempt > 0 or not named:
            name_modes(problem, scaled, iterate)
        if not find_step(problem, scaled, ridge, iterate, newton):
            break
        shrank = go(problem, scaled, iterate, newton)
        if iterate.worst <= settings.tolerance and not iterate.worst < 0.5 * before:
            return True
        stalls = 0 if shrank else stalls + 1
        if stalls > STALLS:
            break
    return iterate.least <= settings.tolerance
