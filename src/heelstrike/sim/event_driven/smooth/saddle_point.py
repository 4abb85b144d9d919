"""Forces and motion at once, where the Delassus matrix hides the forces.

Contact forces come from ``J A⁻¹ Jᵀ`` as long as its digits tell them. Where a link has next to no
inertia they do not: forces of some newtons cancel to what turns it, and of a matrix with entries of
1e12 nothing is left but rounding. Nothing is wrong with the equations themselves::

    A x − Jᵀ λ = f        J x = −b

(a saddle point: A, J and their right-hand sides are known digit by digit, whatever the inverse of A
is). They are solved by complete pivoting, in units in which the largest entry of every row and
column is 1, and the contact modes are those that this solution agrees with.

An answer is taken only with a certificate of its own (:func:`is_proven`). Like that of the contact
problem it is measured against the size of the data: the largest ``|b|`` in these units. So the
motion, the forces and the equations are met to a part of what is given, and unknowns that are
a million times as large as the data prove nothing.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.modes import (
    OPEN,
    SLIDING_BACKWARD,
    SLIDING_FORWARD,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SOLVED,
    STICK,
)
from heelstrike.contact.sets import INTERVAL, LINE
from heelstrike.contact.workspace import ContactAnswer, ContactProblem, Tally
from heelstrike.dynamics.dense import solve_to_rank
from heelstrike.dynamics.kernels import mass_matrix
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.candidates import part_of
from heelstrike.sim.contacts.geometry import row_product
from heelstrike.sim.contacts.loops import rows_of
from heelstrike.sim.contacts.rows import Rows
from heelstrike.sim.event_driven.phase import HeldRows, Phase, SaddlePoint
from heelstrike.sim.event_driven.smooth.candidates import (
    hold_row,
    pose_problem,
    solve_candidates,
)
from heelstrike.sim.event_driven.smooth.gaps import free_gap_accelerations
from heelstrike.sim.memory import Assembly, Memory

SMALL_PIVOT = 1e-6
"""Pivots of the contacts' unit-diagonal matrix below this leave too few digits of the forces."""

INCONSISTENT = 1e-9
"""Equations dropped as dependent that are left with more than this, relative, are not dependent."""

STRAINED = 1e6
"""Velocities that cancel in a contact problem, in units of the data, from which on rounding of its
matrix counts."""

GREATEST = 1e6
"""Unknowns larger than this, in units of the data, are not proven."""

PROVEN = 1e-9
"""Largest residual of an answer, relative to the data."""

SWEEPS = 4
"""How often rows and columns are scaled: the largest entries are within a tenth of 1 then."""

ROUNDS = 12
"""How often contact modes are corrected."""


@kernel
def is_delicate(size: int, rank: int, system: Floats) -> bool:
    """Whether the equations just solved by complete pivoting leave few digits, or were cut short.

    ``system`` is what elimination left of them, the right-hand side in its last column.
    """
    if rank == 0:
        return False
    if abs(system[rank - 1, rank - 1]) < SMALL_PIVOT * abs(system[0, 0]):
        return True
    if rank == size:
        return False
    largest = 0.0
    left = 0.0
    for i in range(size):
        if i < rank:
            largest = max(largest, abs(system[i, size]))
        else:
            left = max(left, abs(system[i, size]))
    return left > INCONSISTENT * largest


@kernel
def write_equations(
    size: int, nv: int, matrix: Floats, jacobian: Floats, held: HeldRows, system: Floats
) -> None:
    """Write the matrix of the equations: those of motion first, then those of ``held.row``.

    A force along a row brings along its tangential one, by ``held.friction_ratio``.
    """
    for i in range(nv):
        for j in range(nv):
            system[i, j] = matrix[i, j]
    for k in range(size):
        row, ratio = held.row[k], held.friction_ratio[k]
        for j in range(nv):
            system[nv + k, j] = jacobian[row, j]
            system[j, nv + k] = -jacobian[row, j]
            if ratio != 0.0:
                system[j, nv + k] -= ratio * jacobian[row + 1, j]
        for other in range(size):
            system[nv + k, nv + other] = 0.0


@kernel
def state_accelerations(
    count: int, total: int, candidate: Integers, first: Integers, model: Model, tree: Workspace,
    rows: Rows, face: Integers, curvature: Floats, loop_bias: Floats, jacobian: Floats,
    bias: Floats,
) -> None:  # fmt: skip
    """State the problem of accelerations: J̇ v of the candidates, up to `total` those of loops.

    No force is divided by an inertia.
    """
    free_gap_accelerations(
        count, candidate, first, model, tree, rows, face, curvature, tree.zero, jacobian, bias
    )
    for place in range(count, total):
        bias[first[place]] = loop_bias[place - count]


@kernel
def state_velocities(size: int, free: Floats, saddle: SaddlePoint) -> None:
    """State the problem of an impact: no known impulse, and the free velocities of its rows."""
    for i in range(saddle.force.shape[0]):
        saddle.force[i] = 0.0
    for row in range(size):
        saddle.bias[row] = free[row]


@kernel
def solve_saddle_point(size: int, saddle: SaddlePoint) -> int:
    """Solve the equations, their right-hand side in the last column; return their rank.

    Writes ``unknown`` and ``scale``, the unit of each; the system is used up.
    """
    system, scale, unknown = saddle.system, saddle.scale, saddle.unknown
    for i in range(size):
        scale[i] = 1.0
    for _ in range(SWEEPS):
        for i in range(size):
            largest = 0.0
            for j in range(size):
                entry = max(abs(system[i, j]), abs(system[j, i]))
                largest = max(largest, scale[j] * entry)
            unknown[i] = math.sqrt(scale[i] * largest)
        for i in range(size):
            if unknown[i] > 0.0:
                scale[i] /= unknown[i]
    for i in range(size):
        for j in range(size):
            system[i, j] *= scale[i] * scale[j]
        system[i, size] *= scale[i]
    rank = solve_to_rank(size, system, saddle.order, unknown)
    for i in range(size):
        unknown[i] *= scale[i]
    return rank


@kernel
def rubbing_ratio(mode: int, friction: float) -> float:
    """Tangential over normal force of what slips or slides in a mode, zero of others."""
    if mode in (SLIP_FORWARD, SLIDING_FORWARD):
        return -friction
    return friction if mode in (SLIP_BACKWARD, SLIDING_BACKWARD) else 0.0


@kernel
def list_rows(total: int, problem: ContactProblem, mode: Integers, held: HeldRows) -> int:
    """List the rows in which some modes allow no velocity; return how many."""
    size = 0
    for place in range(total):
        does, friction, row = mode[place], problem.friction[place], problem.first[place]
        if problem.set[place] != INTERVAL and does != OPEN:
            size = hold_row(place, row, rubbing_ratio(does, friction), size, held)
        if does == STICK and friction > 0.0:
            size = hold_row(place, row + 1, 0.0, size, held)
    return size


@kernel
def begin_impulses(total: int, problem: ContactProblem, answer: ContactAnswer) -> None:
    """Put the impulses of the answer on what its modes allow: these are corrected then."""
    mode, impulse, first = answer.mode, answer.impulse, problem.first
    for place in range(total):
        does, normal = mode[place], first[place]
        if problem.set[place] == INTERVAL:
            impulse[normal] = problem.bound[place]
        elif does == OPEN:
            for row in range(normal, first[place + 1]):
                impulse[row] = 0.0
        if does not in (OPEN, STICK):
            ratio = rubbing_ratio(does, problem.friction[place])
            impulse[normal + 1] = ratio * impulse[normal]


@kernel
def solve_modes(
    total: int, matrix: Floats, jacobian: Floats, problem: ContactProblem, answer: ContactAnswer,
    held: HeldRows, saddle: SaddlePoint,
) -> int:  # fmt: skip
    """Correct the impulses of the answer, and find velocities, by the modes; return how many rows.

    The motion goes to ``saddle.unknown``, the units of coordinates and rows to ``saddle.scale``.
    """
    nv, bias, rows = matrix.shape[0], saddle.bias, problem.first[total]
    begin_impulses(total, problem, answer)
    size = list_rows(total, problem, answer.mode, held)
    write_equations(size, nv, matrix, jacobian, held, saddle.system)
    for j in range(nv):
        pushed = saddle.force[j]
        for row in range(rows):
            pushed += jacobian[row, j] * answer.impulse[row]
        saddle.system[j, nv + size] = pushed
    for k in range(size):
        saddle.system[nv + k, nv + size] = -bias[held.row[k]]
    solve_saddle_point(nv + size, saddle)
    for k in range(size):
        row, force = held.row[k], saddle.unknown[nv + k]
        answer.impulse[row] += force
        if held.friction_ratio[k] != 0.0:
            answer.impulse[row + 1] += held.friction_ratio[k] * force
    for row in range(rows):
        answer.velocity[row] = bias[row] + row_product(jacobian, row, saddle.unknown[:nv])
    for place in range(total):
        if problem.set[place] == INTERVAL:
            answer.velocity[problem.first[place]] = 0.0
    return size


@kernel
def unit_of(row: int, nv: int, jacobian: Floats, scale: Floats) -> float:
    """Unit of the velocity along a row, in which those of the coordinates are 1."""
    largest = 0.0
    for j in range(nv):
        largest = max(largest, abs(jacobian[row, j]) * scale[j])
    return largest


@kernel
def corrected_mode(
    place: int, slide: int, data: float, nv: int, assembly: Assembly, scale: Floats
) -> int:
    """Mode of a candidate that does not contradict its impulse and velocity as the one it has does.

    What closes goes on sliding as it did, by ``slide``, or sticks to begin with. What has one row
    is open or sticks.
    """
    problem, first = assembly.problem, assembly.problem.first
    normal, tangent = first[place], first[place + 1] - 1
    jacobian = assembly.directions.jacobian
    impulse, velocity = assembly.answer.impulse, assembly.answer.velocity
    mode = assembly.answer.mode[place]
    across = PROVEN * data * unit_of(tangent, nv, jacobian, scale)
    speed, limit = across, problem.bound[place]
    if problem.set[place] != INTERVAL:
        speed = PROVEN * data * unit_of(normal, nv, jacobian, scale)
        limit = problem.friction[place] * impulse[normal]
    force = (PROVEN * data) ** 2 / speed if speed > 0.0 else 0.0
    if mode == OPEN:
        if velocity[normal] >= -speed:
            return OPEN
        if slide == 0:
            return STICK
        return SLIDING_FORWARD if slide > 0 else SLIDING_BACKWARD
    if problem.set[place] != INTERVAL and impulse[normal] < -force:
        return OPEN
    if mode == STICK and limit > 0.0 and abs(impulse[tangent]) > limit + force:
        return SLIP_BACKWARD if impulse[tangent] > 0.0 else SLIP_FORWARD
    if mode == SLIP_FORWARD and velocity[tangent] < -across:
        return STICK
    if mode == SLIP_BACKWARD and velocity[tangent] > across:
        return STICK
    return mode


@kernel
def correct_modes(
    total: int, accelerations: bool, nv: int, data: float, slides: Integers, scale: Floats,
    assembly: Assembly,
) -> bool:  # fmt: skip
    """Change the modes of the answer that it contradicts; return whether there are any."""
    changed = False
    for place in range(total):
        if assembly.problem.set[place] == LINE:
            continue
        slide = slides[assembly.candidate[place]] if accelerations else 0
        mode = corrected_mode(place, slide, data, nv, assembly, scale)
        changed = changed or mode != assembly.answer.mode[place]
        assembly.answer.mode[place] = mode
    return changed


@kernel
def size_of_data(rows: int, nv: int, jacobian: Floats, saddle: SaddlePoint) -> float:
    """Largest force on a coordinate, and velocity of a row that these can move, in their units."""
    largest = 0.0
    for i in range(nv):
        largest = max(largest, abs(saddle.force[i]) * saddle.scale[i])
    for row in range(rows):
        unit = unit_of(row, nv, jacobian, saddle.scale)
        if unit > 0.0:
            largest = max(largest, abs(saddle.bias[row]) / unit)
    return largest


@kernel
def is_proven(
    size: int, rows: int, data: float, matrix: Floats, held: Integers, saddle: SaddlePoint,
    assembly: Assembly,
) -> bool:  # fmt: skip
    """Certify the answer, whose modes agree with it; write its residuals.

    Whether the equations of motion hold and the held rows have no velocity, to a part of the data,
    and no unknown is beyond all proportion to them.
    """
    nv = matrix.shape[0]
    answer, jacobian = assembly.answer, assembly.directions.jacobian
    worst = 0.0
    largest = 0.0
    for i in range(nv):
        left = -saddle.force[i]
        for j in range(nv):
            left += matrix[i, j] * saddle.unknown[j]
        for row in range(rows):
            left -= jacobian[row, i] * answer.impulse[row]
        worst = max(worst, abs(left) * saddle.scale[i])
        largest = max(largest, abs(saddle.unknown[i]) / saddle.scale[i])
    for k in range(size):
        worst = max(worst, abs(answer.velocity[held[k]]) * saddle.scale[nv + k])
        largest = max(largest, abs(answer.impulse[held[k]]) / saddle.scale[nv + k])
    answer.residual[0] = worst / data if worst > 0.0 else 0.0
    answer.residual[1] = answer.residual[2] = 0.0  # the modes agree with it
    return worst <= PROVEN * data and largest <= GREATEST * data


@kernel
def solve_by_saddle_point(
    total: int, accelerations: bool, matrix: Floats, slide: Integers, assembly: Assembly,
    held: HeldRows, saddle: SaddlePoint,
) -> bool:  # fmt: skip
    """Solve the contact problem of the candidates from the full equations; return whether proven.

    It begins with the modes and impulses of the answer. `matrix` is the mass matrix.
    Forces or impulses, velocities, modes and residuals go to ``assembly.answer``, the accelerations
    of the coordinates, or what the impulses change of their velocities, to ``saddle.unknown``.
    """
    nv, scale, jacobian = matrix.shape[0], saddle.scale, assembly.directions.jacobian
    rows = assembly.problem.first[total]
    for _ in range(ROUNDS):
        size = solve_modes(total, matrix, jacobian, assembly.problem, assembly.answer, held, saddle)
        data = size_of_data(rows, nv, jacobian, saddle)
        if not correct_modes(total, accelerations, nv, data, slide, scale, assembly):
            return is_proven(size, rows, data, matrix, held.row, saddle, assembly)
    return False


@kernel
def copy_answer(source: ContactAnswer, target: ContactAnswer) -> None:
    """Copy an answer of the contact solvers to where it is kept, or back."""
    copy_words(source.mode, target.mode)
    copy_words(source.impulse, target.impulse)
    copy_words(source.velocity, target.velocity)
    copy_words(source.residual, target.residual)


@kernel
def guess_modes(total: int, bias: Floats, assembly: Assembly) -> None:
    """Let the candidates of an impact slip as they would without it, and those open that leave."""
    problem, mode, first = assembly.problem, assembly.answer.mode, assembly.problem.first
    for place in range(total):
        if problem.set[place] == LINE:
            continue
        normal, tangent = part_of(place, first, bias)
        mode[place] = STICK
        if first[place + 1] > first[place] + 1:
            mode[place] = SLIP_FORWARD if tangent > 0.0 else SLIP_BACKWARD
        if problem.set[place] != INTERVAL and normal > 0.0:
            mode[place] = OPEN


@kernel
def solve_once_more(
    solved: bool, accelerations: bool, matrix: Floats, slide: Integers, tally: Tally,
    assembly: Assembly, held: HeldRows, saddle: SaddlePoint,
) -> bool:  # fmt: skip
    """Solve again what the solvers left, or could not solve; return whether the answer is proven.

    If not the answer is theirs.
    """
    answer, total = assembly.answer, assembly.problem.count
    rows = assembly.problem.first[total]
    copy_answer(answer, saddle.answer)
    for attempt in range(1 if solved or accelerations else 2):
        if attempt == 1:
            guess_modes(total, saddle.bias, assembly)
        for row in range(0 if solved else rows):
            answer.impulse[row] = 0.0
        if solve_by_saddle_point(total, accelerations, matrix, slide, assembly, held, saddle):
            if not solved:
                tally.failures -= 1
                tally.fallbacks += 1
            return True
    copy_answer(saddle.answer, answer)
    return False


@kernel
def solve_contacts(
    count: int, accelerations: bool, model: Model, memory: Memory, phase: Phase
) -> int:
    """Solve the contact problem of the candidates, from the full equations where its matrix fails.

    It is one of accelerations, whose state has been evaluated, or of velocities, whose free terms
    are those of the contact problem. Otherwise this is
    :func:`~heelstrike.sim.event_driven.smooth.candidates.solve_candidates`, of whose certificate
    nothing is left where rounding of the matrix counts. Where the last evaluation took the full
    equations, the solvers are not asked unless the answer is not proven.
    """
    saddle, held, slide = phase.saddle, phase.held, phase.modes.slide
    face, curvature = phase.modes.face, phase.modes.curvature
    tree, matrix = memory.equations.tree, memory.equations.mass_matrix
    assembly, loops, rows = memory.assembly, memory.loops, memory.rows
    candidate, jacobian, bias = assembly.candidate, assembly.directions.jacobian, saddle.bias
    first = assembly.problem.first
    friction, guess, tally = memory.surface.friction, memory.reaction.mode, memory.solver.tally
    total = count + rows_of(loops)
    saddle.used = 0
    if accelerations and saddle.needed == 1:
        state_accelerations(
            count, total, candidate, first, model, tree, rows, face, curvature, loops.rows.bias,
            jacobian, bias,
        )  # fmt: skip
        mass_matrix(model, tree, matrix)
        pose_problem(
            count, total, True, rows.set, friction, guess, slide, rows.latch_stop, loops.held,
            assembly,
        )  # fmt: skip
        for row in range(first[total]):
            assembly.answer.impulse[row] = 0.0
        if solve_by_saddle_point(total, True, matrix, slide, assembly, held, saddle):
            tally.solves += 1
            tally.shortcuts += 1
            saddle.used = 1
            return SOLVED
    status = solve_candidates(
        count, loops, accelerations, friction, guess, rows, slide, phase.forces.solvers, assembly,
        memory.solver,
    )  # fmt: skip
    solved = status == SOLVED
    if solved and not memory.solver.scaling.effort > STRAINED:
        return status
    if accelerations:
        state_accelerations(
            count, total, candidate, first, model, tree, rows, face, curvature, loops.rows.bias,
            jacobian, bias,
        )  # fmt: skip
    else:
        state_velocities(first[total], assembly.problem.free, saddle)
    mass_matrix(model, tree, matrix)
    if solve_once_more(solved, accelerations, matrix, slide, tally, assembly, held, saddle):
        saddle.used = 1
        return SOLVED
    return status
