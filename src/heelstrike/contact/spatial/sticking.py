"""The usual case: contacts go on sticking, or stay open, as in the solve before.

Dry friction may slide meanwhile, with the impulse of its bound. Sticking contacts make one
symmetric system, often singular: the points of one rigid foot have more rows than it has freedoms.
A little is added to the diagonal, and the answer refined from zero, so that it is the one of least
norm, with more weight on dry friction. From the impulses of the step before it would wander to the
edge of the cones.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL
from heelstrike.contact.spatial.cones import entries_of, project
from heelstrike.contact.spatial.iterates import find_velocities, look, return_to_best
from heelstrike.contact.spatial.modes import OPEN, SLIP, STICK
from heelstrike.contact.spatial.newton import apply_matrix
from heelstrike.contact.spatial.scaling import sign
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

SHARE_OF_FRICTION = 1e-3
"""Share of a load that dry friction takes where contacts or stops hold the joint as well, beside
theirs. It bears far less than they do: with a like share it would be beyond its bound and seem to
slide, and what slides and what sticks would take turns."""

REFINEMENTS = 6
"""How often the answer is refined."""

REFINED = 1e-14
"""Velocities that are left, of data of size one, below which nothing is to be gained."""

STAGNANT = 0.25
"""Part of them that a refinement leaves where rounding is all there is."""

ROUNDS_OF_OPENING = 6
"""How often contacts that pull are opened, and open ones that sink closed."""

STUCK = 1e-10
"""Residual up to which an answer of sticking contacts is taken. Points of one foot, and dry
friction of what they hold, contradict each other by the rounding of their gaps: some 1e-16 m, over
a step of 1e-3 s and the 1e-2 m/s that gravity gives in it, 1e-11, and a few of them add up. To look
for what is better is in vain."""

PROJECTIONS, CORRECTIONS = 100, 2
"""How often impulses that hold are brought into their cones, and held again each time."""

INSIDE = 0.95
"""Part of the friction that they are brought into, so that a few times are enough."""

BEYOND = 1.8
"""How far they go, in ways to the cone: nearly to the mirror image, which saves two turns of
three."""

AT_ITS_BOUND = 1.0 - 1e-9
"""Part of its bound from which on dry friction is taken to slide."""


@kernel
def factorize(size: int, matrix: Floats) -> bool:
    """Replace the lower half of a positive matrix A by L of A = Lᵀ L, with 1/d on the diagonal.

    The last row goes first. So all inner loops go along rows from their beginning: processors take
    several of their numbers at a time, and no index needs to be looked at for its sign.
    """
    for k in range(size - 1, -1, -1):
        if not matrix[k, k] > 0.0:
            return False
        inverse = 1.0 / math.sqrt(matrix[k, k])
        matrix[k, k] = inverse
        for j in range(k):
            matrix[k, j] *= inverse
        for i in range(k):
            share = matrix[k, i]
            for j in range(i + 1):
                matrix[i, j] -= share * matrix[k, j]
    return True


@kernel
def solve_factored(size: int, factor: Floats, right: Floats) -> None:
    """Replace a right side by the solution, with the factor of :func:`factorize`."""
    for k in range(size - 1, -1, -1):
        right[k] *= factor[k, k]
        own = right[k]
        for i in range(k):
            right[i] -= factor[k, i] * own
    for k in range(size):
        total = right[k]
        for i in range(k):
            total -= factor[k, i] * right[i]
        right[k] = total * factor[k, k]


@kernel
def share_of_load(kind: int) -> float:
    """Share of a load that a block of a kind takes where others could take it, beside a contact."""
    return SHARE_OF_FRICTION if kind == INTERVAL else 1.0


@kernel
def list_rows_of(problem: BlockProblem, block: int, size: int, newton: NewtonSystem) -> int:
    """Add the rows of a block to a list of so many; return how many it has then."""
    for row in range(problem.first[block], problem.first[block + 1]):
        newton.row[size] = row
        newton.extra[size] = FIRM / share_of_load(problem.set[block])
        size += 1
    return size


@kernel
def list_sticking_rows(
    problem: BlockProblem, scaled: ScaledBlocks, mode: Integers, newton: NewtonSystem
) -> int:
    """List the rows of blocks that stick; return how many, or -1 if a contact slips."""
    size = 0
    for block in range(problem.count):
        if mode[block] == SLIP:
            if problem.set[block] == INTERVAL:
                continue
            return -1
        if mode[block] == OPEN or scaled.scale[block] == 0.0:
            continue
        if problem.set[block] == CONE and problem.friction[block] == 0.0:
            return -1
        size = list_rows_of(problem, block, size, newton)
    return size


@kernel
def begin_at_bounds(problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate) -> None:
    """Let dry friction that slides be at its bound, and all other impulses be zero."""
    x = iterate.x
    for block in range(problem.count):
        begin = problem.first[block]
        if problem.set[block] == INTERVAL and iterate.mode[block] == SLIP:
            x[begin] = math.copysign(scaled.bound[block], x[begin])
            continue
        for row in range(begin, problem.first[block + 1]):
            x[row] = 0.0


@kernel
def begin_round(
    problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate, newton: NewtonSystem
) -> int:
    """List the rows that stick, and begin with no impulses of theirs.

    Returns how many there are, or -1 if a contact slips.
    """
    size = list_sticking_rows(problem, scaled, iterate.mode, newton)
    if size >= 0:
        begin_at_bounds(problem, scaled, iterate)
    return size


@kernel
def factorize_held(size: int, scaled: ScaledBlocks, newton: NewtonSystem) -> bool:
    """Factor the matrix of the listed rows, made a little firmer; return success."""
    row, system, matrix = newton.row, newton.system, scaled.matrix
    for i in range(size):
        at = row[i]
        for j in range(i + 1):
            system[i, j] = matrix[at, row[j]]
        system[i, i] += newton.extra[i]
    return factorize(size, system)


@kernel
def hold(rows: int, size: int, scaled: ScaledBlocks, newton: NewtonSystem, x: Floats) -> bool:
    """Find the impulses of least norm that hold the listed of all rows; return success."""
    row, right, matrix, velocity = newton.row, newton.right, scaled.matrix, newton.trial_u
    if not factorize_held(size, scaled, newton):
        return False
    before = math.inf
    for turn in range(REFINEMENTS):
        for other in range(rows):
            velocity[other] = scaled.offset[other] + newton.moved[other]
        for i in range(size if turn > 0 else 0):
            at = row[i]
            own = x[at]
            for other in range(rows):
                velocity[other] += matrix[at, other] * own
        left = 0.0
        for i in range(size):
            total = velocity[row[i]]
            right[i] = -total
            left = max(left, abs(total))
        if left <= REFINED or left > STAGNANT * before:
            break
        before = left
        solve_factored(size, newton.system, right)
        for i in range(size):
            x[row[i]] += right[i]
    return True


@kernel
def correct_modes(problem: BlockProblem, scaled: ScaledBlocks, iterate: Iterate) -> int:
    """Open what pulls, close what sinks, let dry friction slide or stick; count the changes."""
    changed = 0
    for block in range(problem.count):
        row, kind = problem.first[block], problem.set[block]
        if kind == INTERVAL:
            x, bound = iterate.x[row], scaled.bound[block]
            slides = iterate.mode[block] == SLIP
            if slides and sign(x) * iterate.u[row] > STUCK:
                iterate.mode[block] = STICK
                changed += 1
            elif not slides and abs(x) > bound:
                iterate.mode[block] = SLIP
                changed += 1
            continue
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
        size = begin_round(problem, scaled, iterate, newton)
        if size < 0:
            return False
        apply_matrix(problem.first[problem.count], scaled, iterate.x, newton.moved)
        if not hold(problem.first[problem.count], size, scaled, newton, iterate.x):
            return False
        look(problem, scaled, iterate)
        if iterate.worst <= STUCK:
            return True
        if correct_modes(problem, scaled, iterate) == 0:
            return False
    return False


@kernel
def list_held_rows(
    problem: BlockProblem, scaled: ScaledBlocks, tolerance: float, iterate: Iterate,
    newton: NewtonSystem,
) -> int:  # fmt: skip
    """List the rows of all that touches or sticks; return how many.

    Their impulses become zero. Dry friction that slides keeps its own.
    """
    size = 0
    for block in range(problem.count):
        begin, kind = problem.first[block], problem.set[block]
        pressed = iterate.x[begin]
        free = kind == INTERVAL and abs(pressed) >= AT_ITS_BOUND * scaled.bound[block]
        if kind in (CONE, HALF_LINE):
            free = pressed <= 0.0 and iterate.u[begin] > tolerance
        if not free and scaled.scale[block] != 0.0:
            size = list_rows_of(problem, block, size, newton)
        for row in range(begin, problem.first[block + 1]):
            if kind != INTERVAL or not free:
                iterate.x[row] = 0.0
    return size


@kernel
def bring_inside(problem: BlockProblem, scaled: ScaledBlocks, x: Floats) -> None:
    """Move all impulses into their sets, whose friction is a little less than it is."""
    for block in range(problem.count):
        begin = problem.first[block]
        size = problem.first[block + 1] - begin
        n, s, t = entries_of(x, begin, begin + size)
        kind, friction = problem.set[block], INSIDE * problem.friction[block]
        inside = project(kind, friction, scaled.bound[block], n, s, t)
        for i in range(size):
            x[begin + i] += BEYOND * (inside[i] - x[begin + i])


@kernel
def project_in_turn(
    problem: BlockProblem, scaled: ScaledBlocks, tolerance: float, iterate: Iterate,
    newton: NewtonSystem,
) -> bool:  # fmt: skip
    """Project onto what holds and onto the cones until both are met; return success."""
    return_to_best(problem, scaled, iterate)
    rows = problem.first[problem.count]
    size = list_held_rows(problem, scaled, tolerance, iterate, newton)
    row, right, x = newton.row, newton.right, iterate.x
    if not factorize_held(size, scaled, newton):
        return False
    for _ in range(PROJECTIONS):
        for _ in range(CORRECTIONS):
            find_velocities(rows, scaled, x, iterate.u)
            for i in range(size):
                right[i] = -iterate.u[row[i]]
            solve_factored(size, newton.system, right)
            for i in range(size):
                x[row[i]] += right[i]
        look(problem, scaled, iterate)
        if iterate.worst <= tolerance:
            return True
        bring_inside(problem, scaled, x)
    return False


@kernel
def stick_within_cones(
    problem: BlockProblem, scaled: ScaledBlocks, tolerance: float, iterate: Iterate,
    newton: NewtonSystem,
) -> bool:  # fmt: skip
    """Look for impulses that hold all that touches, and lie within their cones; return success.

    Points of one body that stick share its load in many ways. That of least norm may leave a cone
    where others do not: projections onto the cones and onto what holds, in turn, find one (Bregman
    1965). If they do not, the impulses stay as they were.
    """
    rows = problem.first[problem.count]
    for k in range(rows):
        newton.trial_x[k] = iterate.x[k]
    if project_in_turn(problem, scaled, tolerance, iterate, newton):
        return True
    for k in range(rows):
        iterate.x[k] = newton.trial_x[k]
    look(problem, scaled, iterate)
    return False
