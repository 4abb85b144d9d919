"""What holds, or is open, as in the step before: found in the velocities of the robot.

Contacts and dry friction that stick make the equations (A + ε I) x = −b of
:mod:`heelstrike.contact.spatial.sticking`. With the scaled and whitened rows Y, A = Y Yᵀ, and
(Woodbury 1950)::

    x = −(b − Y (Yᵀ Y + ε I)⁻¹ Yᵀ b) / ε

The matrix in brackets has a row for each velocity, however many contacts and joints hold, and
nothing where the mass matrix has nothing: it is factored along the tree, and no Delassus matrix is
needed. Impulses, modes and certificate are those of the solvers, to rounding.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.compensated import UNIT_ROUNDOFF
from heelstrike.contact.spatial.certificate import judge_blocks, weigh_blocks
from heelstrike.contact.spatial.certified_solve import begin_from
from heelstrike.contact.spatial.iterates import measure
from heelstrike.contact.spatial.modes import LAST_MODES, STICK
from heelstrike.contact.spatial.scaling import give_impulses, scale_data
from heelstrike.contact.spatial.sticking import (
    FIRM,
    REFINED,
    REFINEMENTS,
    ROUNDS_OF_OPENING,
    STAGNANT,
    STUCK,
    begin_at_bounds,
    correct_modes,
    list_sticking_rows,
)
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockTally,
    BlockWorkspace,
    ScaledBlocks,
)
from heelstrike.dynamics.spatial.equations import factorize, solve_factorized
from heelstrike.dynamics.spatial.rows import add_row_forces, along_rows, write_diagonal
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.spatial.memory import SpatialAssembly, SpatialHolding

LEAST_ROWS = 18
"""Rows that stick from which on the equations of the velocities are the cheaper ones."""


@kernel
def gather_held(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, mode: Integers,
    last: Integers, rows: Floats, matrix: Floats,
) -> None:  # fmt: skip
    """Write Yᵀ Y + ε I of the blocks that stick, each row along the chain of its velocity."""
    for k in range(model.nv):
        for a in range(model.depth[k]):
            matrix[k, a] = 0.0
        matrix[k, model.depth[k]] = FIRM
    for block in range(problem.count):
        if mode[block] != STICK:
            continue
        end, r = last[block], problem.first[block]
        square = scaled.scale[block] * scaled.scale[block]
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
def take_along(
    model: SpatialModel, problem: BlockProblem, last: Integers, rows: Floats, impulse: Floats,
    along: Floats,
) -> None:  # fmt: skip
    """Write Yᵀ λ of whitened rows."""
    for k in range(model.nv):
        along[k] = 0.0
    for block in range(problem.count):
        r = problem.first[block]
        size = problem.first[block + 1] - r
        add_row_forces(model, last[block], r, size, rows, impulse, along)


@kernel
def give_along(
    model: SpatialModel, problem: BlockProblem, last: Integers, rows: Floats, along: Floats,
    velocity: Floats,
) -> None:  # fmt: skip
    """Write Y z of whitened rows."""
    for block in range(problem.count):
        r = problem.first[block]
        along_rows(model, last[block], r, problem.first[block + 1] - r, rows, along, velocity)


@kernel
def find_velocities_along(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, last: Integers,
    rows: Floats, x: Floats, holding: SpatialHolding, u: Floats,
) -> None:  # fmt: skip
    """Write the velocities that scaled impulses give, in units of the problem."""
    count, weighted = problem.first[problem.count], holding.weighted
    for row in range(count):
        weighted[row] = scaled.weight[row] * x[row]
    take_along(model, problem, last, rows, weighted, holding.along)
    give_along(model, problem, last, rows, holding.along, u)
    for row in range(count):
        u[row] = scaled.offset[row] + scaled.weight[row] * u[row]


@kernel
def hold_along(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, mode: Integers,
    last: Integers, rows: Floats, holding: SpatialHolding, x: Floats, u: Floats,
) -> None:  # fmt: skip
    """Find the impulses of least norm that hold what sticks, and the velocities they give."""
    gather_held(model, problem, scaled, mode, last, rows, holding.tree.matrix)
    factorize(model, holding.tree)
    pull, weighted, weight = holding.along, holding.weighted, scaled.weight
    before = math.inf
    for _ in range(REFINEMENTS):
        find_velocities_along(model, problem, scaled, last, rows, x, holding, u)
        left = 0.0
        for block in range(problem.count):
            for row in range(problem.first[block], problem.first[block + 1]):
                weighted[row] = 0.0
                if mode[block] == STICK:
                    left = max(left, abs(u[row]))
                    weighted[row] = weight[row] * u[row]
        if left <= REFINED or left > STAGNANT * before:
            return
        before = left
        take_along(model, problem, last, rows, weighted, pull)
        solve_factorized(model, holding.tree, pull)
        give_along(model, problem, last, rows, pull, weighted)
        for block in range(problem.count):
            if mode[block] == STICK:
                for row in range(problem.first[block], problem.first[block + 1]):
                    x[row] -= (u[row] - weight[row] * weighted[row]) / FIRM
    find_velocities_along(model, problem, scaled, last, rows, x, holding, u)


@kernel
def certify_along(
    model: SpatialModel, problem: BlockProblem, scaled: ScaledBlocks, last: Integers,
    rows: Floats, holding: SpatialHolding, answer: BlockAnswer,
) -> float:  # fmt: skip
    """Certify impulses by the velocities that the rows give; return the residual with rounding.

    Scaled rows have the length one at most. So, relative to the data, no velocity is off by more
    than rounding of as many terms of the size of all scaled impulses together.
    """
    count = problem.first[problem.count]
    take_along(model, problem, last, rows, answer.impulse, holding.along)
    give_along(model, problem, last, rows, holding.along, answer.velocity)
    size = 1.0
    for row in range(count):
        answer.velocity[row] += problem.free[row]
        if scaled.weight[row] > 0.0:
            size += abs(answer.impulse[row]) / (scaled.weight[row] * scaled.unit)
    terms = count + model.longest + 2.0
    return judge_blocks(problem, terms * UNIT_ROUNDOFF * size, scaled, answer)


@kernel
def note_shortcut(tally: BlockTally) -> None:
    """Count a solve whose answer is that of the last modes."""
    tally.solves += 1
    tally.shortcuts += 1
    tally.iterations = 1
    tally.last_fallbacks = 0
    tally.solver = LAST_MODES


@kernel
def goes_on_holding(
    model: SpatialModel, assembly: SpatialAssembly, holding: SpatialHolding,
    solver: BlockWorkspace,
) -> bool:  # fmt: skip
    """Solve the problem of a step if what touches goes on sticking; return if it is certified."""
    problem, answer, last, rows = assembly.problem, assembly.answer, assembly.last, assembly.rows
    scaled, iterate = solver.scaled, solver.iterate
    write_diagonal(model, problem.count, problem.first, last, rows, problem.delassus)
    weigh_blocks(problem, solver.settings, scaled)
    scale_data(problem, scaled)
    begin_from(problem, scaled, answer, iterate)
    for _ in range(ROUNDS_OF_OPENING):
        if list_sticking_rows(problem, scaled, iterate.mode, solver.newton) < LEAST_ROWS:
            return False
        begin_at_bounds(problem, scaled, iterate)
        hold_along(
            model, problem, scaled, iterate.mode, last, rows, holding, iterate.x, iterate.u
        )  # fmt: skip
        iterate.worst, iterate.square = measure(problem, scaled, iterate.x, iterate.u)
        if iterate.worst <= STUCK:
            give_impulses(problem, scaled, iterate.x, answer)
            residual = certify_along(model, problem, scaled, last, rows, holding, answer)
            if residual <= solver.settings.tolerance:
                note_shortcut(solver.tally)
                return True
            return False
        if correct_modes(problem, scaled, iterate) == 0:
            return False
    return False
