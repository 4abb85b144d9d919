"""What holds, or is open, as in the step before: found in the velocities of the robot.

Contacts and dry friction that stick make the equations (A + ε S⁻¹) x = −b of
:mod:`heelstrike.contact.spatial.sticking`, with the share of each row on the diagonal of S. With
the scaled and whitened rows Y, A = Y Yᵀ, and (Woodbury 1950)::

    x = −S (b − Y (Yᵀ S Y + ε I)⁻¹ Yᵀ S b) / ε

The matrix in brackets has a row for each velocity, however many contacts and joints hold, and
nothing where the mass matrix has nothing: it is factored along the tree, and no Delassus matrix is
needed. Modes and certificate are those of the solvers, velocities to 1e-12, impulses to 1e-6 of
their size: along what moves nothing both are only as good as rounding over ε.
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
    NEAR,
    NEARLY,
    REFINED,
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
    last: Integers, rows: Floats, x: Floats, holding: SpatialHolding,
) -> None:  # fmt: skip
    """Write what dry friction that slides does along the velocities, whatever else holds."""
    for k in range(model.nv):
        holding.steady[k] = 0.0
    for row in range(problem.first[problem.count]):
        holding.weighted[row] = scaled.weight[row] * x[row]
    add_along(model, problem, mode, SLIP, last, rows, holding.weighted, holding.steady)


@kernel
def hold_along(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, mode: Integers,
    last: Integers, rows: Floats, holding: SpatialHolding, u: Floats, x: Floats,
) -> None:  # fmt: skip
    """Find the impulses of least norm that hold what sticks; u is scratch.

    Those of what sticks are zero at first.
    """
    gather_held(model, problem, scaled, mode, last, rows, holding.tree.matrix)
    factorize(model, holding.tree)
    begin_along(model, problem, scaled, mode, last, rows, x, holding)
    along, weighted, weight = holding.along, holding.weighted, scaled.weight
    before = math.inf
    for turn in range(REFINEMENTS):
        for k in range(model.nv):
            along[k] = holding.steady[k]
        if turn > 0:
            add_along(model, problem, mode, STICK, last, rows, weighted, along)
        give_along(model, problem, mode, STICK, last, rows, along, u)
        left = 0.0
        for block in range(problem.count):
            share = share_of_load(problem.set[block])
            for row in range(problem.first[block], problem.first[block + 1]):
                if mode[block] == STICK:
                    u[row] = scaled.offset[row] + weight[row] * u[row]
                    left = max(left, abs(u[row]) if weight[row] > 0.0 else 0.0)
                    weighted[row] = share * weight[row] * u[row]
        if left <= REFINED or left > STAGNANT * before:
            return
        is_last = turn > 0 and left <= NEAR and left * left <= NEARLY * before  # as much less again
        before = left
        for k in range(model.nv):
            along[k] = 0.0
        add_along(model, problem, mode, STICK, last, rows, weighted, along)
        solve_factorized(model, holding.tree, along)
        give_along(model, problem, mode, STICK, last, rows, along, weighted)
        for block in range(problem.count):
            firm = FIRM / share_of_load(problem.set[block])
            for row in range(problem.first[block], problem.first[block + 1]):
                if mode[block] == STICK and weight[row] > 0.0:  # else nothing moves it
                    x[row] -= (u[row] - weight[row] * weighted[row]) / firm
                    weighted[row] = weight[row] * x[row]
        if is_last:
            return


@kernel
def certify_along(
    model: SpatialModel, factor: TreeFactor, problem: BlockProblem, last: Integers, rows: Floats,
    scaled: ScaledBlocks, holding: SpatialHolding, answer: BlockAnswer,
) -> float:  # fmt: skip
    """Certify impulses by the velocities that the rows give; return the residual with rounding.

    Scaled rows, those of dry friction as well, have the length one at most. So, relative to the
    data, no velocity is off by more than rounding of as many terms of the size of all scaled
    impulses together; infinite is returned if that is more than `WELL_ROUNDED`. The change of the
    velocities of the robot is kept.
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
    size = 1.0
    for row in range(count):
        answer.velocity[row] += problem.free[row]
        if scaled.weight[row] > 0.0:
            size += abs(answer.impulse[row]) / (scaled.weight[row] * scaled.unit)
    terms = count + 2.0 * model.longest + 2.0
    rounding = terms * UNIT_ROUNDOFF * size
    residual = judge_blocks(problem, rounding, scaled, answer)
    return residual if rounding <= WELL_ROUNDED else math.inf


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
    for _ in range(ROUNDS_OF_OPENING):
        if begin_round(problem, scaled, iterate, newton) < 0:
            return False
        hold_along(
            model, problem, scaled, iterate.mode, last, rows, holding, iterate.u, iterate.x
        )  # fmt: skip
        give_impulses(problem, scaled, iterate.x, answer)
        residual = certify_along(model, factor, problem, last, rows, scaled, holding, answer)
        if answer.residual <= STUCK and residual <= solver.settings.tolerance:
            count_solve(solver.tally)
            solver.tally.iterations += 1
            solver.tally.shortcuts += 1
            return True
        for row in range(problem.first[problem.count]):
            iterate.u[row] = answer.velocity[row] * scaled.weight[row] / scaled.unit
        if correct_modes(problem, scaled, iterate) == 0:
            return False
    return False
