"""What holds, or is open, as in the step before: found in the velocities of the robot.

Contacts and dry friction that stick have the scaled and whitened rows Y, and S is diagonal with the
share of each. The impulses of least norm S⁻¹ that stop the velocities u are, with the
pseudoinverse of A = Yᵀ S Y (Penrose 1955)::

    x = −S Y (A⁺)² Yᵀ S u

A has a row for each velocity, however many contacts and joints hold, and nothing where the mass
matrix has nothing: with G = A + ε I it is factored along the tree, and no Delassus matrix is
needed. Where rows move anything, q = ε G⁻¹ is small and ::

    (A⁺)² = G⁻² (1 + 2 q + 3 q² + …)

Where they move nothing, Y gives nothing, whatever rounding over ε² has left there. So impulses and
velocities are as good as rounding over the least eigenvalue of A that moves something. Modes and
certificate are those of the solvers, to whose (Y Yᵀ + ε S⁻¹) x = −u this is another way.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.compensated import UNIT_ROUNDOFF
from heelstrike.contact.spatial.certificate import judge_blocks, weigh_blocks
from heelstrike.contact.spatial.certified_solve import begin_from, count_solve
from heelstrike.contact.spatial.modes import SLIP, STICK
from heelstrike.contact.spatial.scaling import give_impulses, scale_data
from heelstrike.contact.spatial.sticking import (
    FIRM,
    REFINEMENTS,
    ROUNDS_OF_OPENING,
    STAGNANT,
    STUCK,
    begin_round,
    correct_modes,
    list_sticking_rows,
    share_of_load,
)
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockWorkspace,
    ScaledBlocks,
)
from heelstrike.dynamics.spatial.equations import (
    factorize,
    solve_factorized,
    solve_lower,
)
from heelstrike.dynamics.spatial.rows import add_row_forces, along_rows, write_diagonal
from heelstrike.dynamics.spatial.workspace import TreeFactor
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.spatial.memory import SpatialAssembly, SpatialHolding

WORTHWHILE = 2
"""How many times more entries the matrix of the rows that stick has where that of the velocities
takes less time: steps of robots of 18 and 35 velocities that stand were timed with each
(``python benchmarks/spatial_speed.py``)."""

EVERY = -1
"""Stands for every mode."""

TERMS = 3
"""How many terms of the series are added up. What holds least, dry friction alone, has q of 1e-5 to
1e-4, and four times their cube is left."""

NOTHING_LEFT = 1e-13
"""Velocities, of data of size one, of what sticks below which nothing is to be gained."""

WELL_ROUNDED = 1e-11
"""Rounding of velocities, of data of size one, above which the solvers, which can sum up without
any, take over."""


@kernel
def is_worthwhile(model: SpatialModel, size: int) -> bool:
    """Whether so many rows that stick are solved faster in the velocities."""
    entries = model.nv
    for k in range(model.nv):
        entries += model.depth[k]
    return size * size >= WORTHWHILE * entries


@kernel
def gather_held(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, mode: Integers,
    last: Integers, rows: Floats, matrix: Floats,
) -> None:  # fmt: skip
    """Write Yᵀ S Y + ε I of the blocks that stick, each row along the chain of its velocity."""
    for k in range(model.nv):
        for a in range(model.depth[k]):
            matrix[k, a] = 0.0
        matrix[k, model.depth[k]] = FIRM
    for block in range(problem.count):
        if mode[block] != STICK:
            continue
        end, r = last[block], problem.first[block]
        square = share_of_load(problem.set[block]) * scaled.scale[block] * scaled.scale[block]
        if problem.first[block + 1] - r == 3:
            for a in range(model.depth[end] + 1):
                k = model.chain[end, a]
                n, s, t = square * rows[r, a], square * rows[r + 1, a], square * rows[r + 2, a]
                for b in range(a + 1):
                    matrix[k, b] += n * rows[r, b] + s * rows[r + 1, b] + t * rows[r + 2, b]
            continue
        for row in range(r, problem.first[block + 1]):
            for a in range(model.depth[end] + 1):
                k = model.chain[end, a]
                own = square * rows[row, a]
                for b in range(a + 1):
                    matrix[k, b] += own * rows[row, b]


@kernel
def add_along(
    model: SpatialModel, problem: BlockProblem, mode: Integers, wanted: int, last: Integers,
    rows: Floats, impulse: Floats, along: Floats,
) -> None:  # fmt: skip
    """Add Yᵀ λ of the blocks of one mode, or of `EVERY` one."""
    for block in range(problem.count):
        if wanted in (mode[block], EVERY):
            r = problem.first[block]
            size = problem.first[block + 1] - r
            add_row_forces(model, last[block], r, size, rows, impulse, along)


@kernel
def give_along(
    model: SpatialModel, problem: BlockProblem, mode: Integers, wanted: int, last: Integers,
    rows: Floats, along: Floats, velocity: Floats,
) -> None:  # fmt: skip
    """Write Y z of the blocks of one mode, or of `EVERY` one."""
    for block in range(problem.count):
        if wanted in (mode[block], EVERY):
            r = problem.first[block]
            size = problem.first[block + 1] - r
            along_rows(model, last[block], r, size, rows, along, velocity)


@kernel
def begin_along(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, mode: Integers,
    last: Integers, rows: Floats, x: Floats, holding: SpatialHolding, u: Floats,
) -> None:  # fmt: skip
    """Write the velocities of what sticks where only dry friction that slides acts."""
    along, weighted, weight = holding.along, holding.weighted, scaled.weight
    slides = 0
    for block in range(problem.count):
        slides += mode[block] == SLIP
    if slides > 0:
        for k in range(model.nv):
            along[k] = 0.0
        for row in range(problem.first[problem.count]):
            weighted[row] = weight[row] * x[row]
        add_along(model, problem, mode, SLIP, last, rows, weighted, along)
        give_along(model, problem, mode, STICK, last, rows, along, weighted)
    for block in range(problem.count):
        for row in range(problem.first[block], problem.first[block + 1]):
            if mode[block] == STICK:
                moved = weight[row] * weighted[row] if slides > 0 else 0.0
                u[row] = scaled.offset[row] + moved


@kernel
def hold_along(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, mode: Integers,
    last: Integers, rows: Floats, u: Floats, holding: SpatialHolding, x: Floats,
) -> None:  # fmt: skip
    """Add the impulses of least norm that stop what sticks, which has the velocities u.

    Their equations have been factored.
    """
    along, part, weighted, weight = holding.along, holding.part, holding.weighted, scaled.weight
    for block in range(problem.count):
        share = share_of_load(problem.set[block])
        for row in range(problem.first[block], problem.first[block + 1]):
            weighted[row] = share * weight[row] * u[row]
    for k in range(model.nv):
        part[k] = 0.0
    add_along(model, problem, mode, STICK, last, rows, weighted, part)
    solve_factorized(model, holding.tree, part)
    solve_factorized(model, holding.tree, part)
    for k in range(model.nv):
        along[k] = part[k]
    for term in range(2, TERMS + 1):
        for k in range(model.nv):
            part[k] *= FIRM
        solve_factorized(model, holding.tree, part)
        for k in range(model.nv):
            along[k] += term * part[k]
    give_along(model, problem, mode, STICK, last, rows, along, weighted)
    for block in range(problem.count):
        share = share_of_load(problem.set[block])
        for row in range(problem.first[block], problem.first[block + 1]):
            if mode[block] == STICK:
                x[row] -= share * weight[row] * weighted[row]


@kernel
def certify_along(
    model: SpatialModel, factor: TreeFactor, problem: BlockProblem, last: Integers, rows: Floats,
    scaled: ScaledBlocks, holding: SpatialHolding, answer: BlockAnswer,
) -> float:  # fmt: skip
    """Certify impulses by the velocities that the rows give; return the residual with rounding.

    Scaled rows, those of dry friction as well, have the length one at most. So, relative to the
    data, no velocity is off by more than rounding of as many terms of the size of all scaled
    impulses together, and of the largest free velocity; infinite is returned if that is more than
    `WELL_ROUNDED`. The change of the velocities of the robot is kept.
    """
    count = problem.first[problem.count]
    for k in range(model.nv):
        holding.along[k] = 0.0
    add_along(
        model, problem, answer.mode, EVERY, last, rows, answer.impulse, holding.along
    )  # fmt: skip
    give_along(
        model, problem, answer.mode, EVERY, last, rows, holding.along, answer.velocity
    )  # fmt: skip
    for k in range(model.nv):
        holding.change[k] = factor.root[k] * holding.along[k]
    solve_lower(model, factor, holding.change)
    size, largest = 0.0, 1.0  # free velocities that open may be larger than the unit
    for row in range(count):
        answer.velocity[row] += problem.free[row]
        largest = max(largest, abs(scaled.offset[row]))
        if scaled.weight[row] > 0.0:
            size += abs(answer.impulse[row]) / (scaled.weight[row] * scaled.unit)
    terms = count + 2.0 * model.longest + 2.0
    rounding = terms * UNIT_ROUNDOFF * (largest + size)
    residual = judge_blocks(problem, rounding, scaled, answer)
    return residual if rounding <= WELL_ROUNDED else math.inf


@kernel
def take_velocities(
    problem: BlockProblem, scaled: ScaledBlocks, answer: BlockAnswer, mode: Integers, u: Floats
) -> float:
    """Write the velocities of an answer in units of the solvers; return the largest that sticks."""
    left = 0.0
    for block in range(problem.count):
        for row in range(problem.first[block], problem.first[block + 1]):
            u[row] = answer.velocity[row] * scaled.weight[row] / scaled.unit
            if mode[block] == STICK:
                left = max(left, abs(u[row]))
    return left


@kernel
def goes_on_holding(
    model: SpatialModel, factor: TreeFactor, assembly: SpatialAssembly, holding: SpatialHolding,
    solver: BlockWorkspace,
) -> bool:  # fmt: skip
    """Solve the problem of a step if what touches goes on sticking; return if it is certified.

    The answer is changed in any case. Where it is not certified, the caller restores the modes and
    impulses of the last step. The solvers then try the same again, since Newton's method begins
    well where that ends.
    """
    problem, answer, last, rows = assembly.problem, assembly.answer, assembly.last, assembly.rows
    scaled, iterate, newton = solver.scaled, solver.iterate, solver.newton
    for block in range(problem.count):
        iterate.mode[block] = answer.mode[block]
        scaled.scale[block] = 1.0  # not known yet; what nothing moves counts as well
    if not is_worthwhile(model, max(list_sticking_rows(problem, scaled, iterate.mode, newton), 0)):
        return False
    write_diagonal(model, problem.count, problem.first, last, rows, problem.delassus)
    weigh_blocks(problem, solver.settings, scaled)
    scale_data(problem, scaled)
    begin_from(problem, scaled, answer, iterate)
    mode, u = iterate.mode, iterate.u
    for _ in range(ROUNDS_OF_OPENING):
        if begin_round(problem, scaled, iterate, newton) < 0:
            return False
        gather_held(model, problem, scaled, mode, last, rows, holding.tree.matrix)
        factorize(model, holding.tree)
        begin_along(model, problem, scaled, mode, last, rows, iterate.x, holding, u)
        residual, before = math.inf, math.inf
        for _ in range(REFINEMENTS):
            hold_along(model, problem, scaled, mode, last, rows, u, holding, iterate.x)
            give_impulses(problem, scaled, iterate.x, answer)
            residual = certify_along(model, factor, problem, last, rows, scaled, holding, answer)
            left = take_velocities(problem, scaled, answer, mode, u)
            if left <= NOTHING_LEFT or left > STAGNANT * before:
                break
            before = left
        if answer.residual <= STUCK and residual <= solver.settings.tolerance:
            count_solve(solver.tally)
            solver.tally.iterations += 1
            solver.tally.shortcuts += 1
            return True
        if correct_modes(problem, scaled, iterate) == 0:
            return False
    return False
