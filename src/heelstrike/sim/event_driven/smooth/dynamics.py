"""Motion within a smooth phase: the acceleration when every contact point keeps its mode.

Closed points have no normal acceleration, sticking ones no tangential acceleration either, and
sliding ones feel friction μ λ_n against the direction of sliding. With the contact forces λ that
this takes (a small linear system in J A⁻¹ Jᵀ) the motion obeys eq. 1 of the paper.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.workspace import ContactAnswer
from heelstrike.dynamics.dense import raise_to_zero, shorten, solve_to_rank
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities, mass_matrix
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.candidates import place_candidate
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    evaluate_equations,
    row_product,
)
from heelstrike.sim.contacts.loops import append_loops, find_loops, free_loops, rows_of
from heelstrike.sim.contacts.rows import DRY_JOINT, Rows
from heelstrike.sim.controller.asking import consult
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.motors import try_torque
from heelstrike.sim.event_driven.phase import HeldRows, Modes, Phase, SaddlePoint, Watch
from heelstrike.sim.event_driven.smooth.candidates import (
    free_acceleration,
    hold_row,
    share_redundant,
    tell_parts,
)
from heelstrike.sim.event_driven.smooth.faces import locate
from heelstrike.sim.event_driven.smooth.gaps import free_gap_accelerations, write_candidates
from heelstrike.sim.event_driven.smooth.saddle_point import (
    is_delicate,
    solve_saddle_point,
    state_accelerations,
    write_equations,
)
from heelstrike.sim.event_driven.smooth.watch import (
    friction_limit,
    trust_latches,
    watch_forces,
    watch_geometry,
    watch_slips,
)
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Equations, Loops, Memory, Surface


@kernel
def list_closed(
    rows: Rows, modes: Modes, candidate: Integers, first: Integers, bound: Floats
) -> int:
    """List the closed contacts as candidates, and the bounds of dry joints; return their number.

    Dry joints that move are none of them: their friction is known.
    """
    count = 0
    for contact in range(modes.watched):
        if modes.closed[contact] == 0:
            continue
        if rows.kind[contact] == DRY_JOINT:
            if modes.slide[contact] != 0:
                continue
            bound[count] = modes.breakaway[rows.owner[contact]]
        place_candidate(contact, count, rows.components[contact], candidate, first)
        count += 1
    return count


@kernel
def list_unknowns(
    count: int, total: int, candidate: Integers, first: Integers, friction: Floats, modes: Modes,
    held: HeldRows,
) -> int:  # fmt: skip
    """List the Jacobian rows along which contacts are held, and friction per normal force.

    Open contacts among the `count` are held along their normals, and so are the rows of the loops,
    which come after the contacts, up to `total`.
    """
    size = 0
    for place in range(total):
        contact = candidate[place]
        is_loop = place >= count
        if is_loop or modes.carrier[contact] == 1 or modes.closed[contact] == 0:
            ratio = 0.0 if is_loop else -modes.slide[contact] * friction[contact]
            size = hold_row(place, first[place], ratio, size, held)
        if not is_loop and modes.holder[contact] == 1:
            size = hold_row(place, first[place] + 1, 0.0, size, held)
    return size


@kernel
def solve_constraints(size: int, friction: float, delassus: Floats, held: HeldRows) -> int:
    """Solve the equations of the contact forces, with friction (1) or without (0); return the rank.

    Their right-hand side is there. A contact may be a million times heavier than another: only in
    units in which all weigh the same does the size of a pivot tell whether it is one.
    """
    row, ratio, scale, system = held.row, held.friction_ratio, held.scale, held.system
    for i in range(size):
        weight = delassus[row[i], row[i]]
        scale[i] = 1.0 / math.sqrt(weight) if weight > 0.0 else 1.0
    for i in range(size):
        for j in range(size):
            entry = delassus[row[i], row[j]]
            if ratio[j] != 0.0:
                entry += friction * ratio[j] * delassus[row[i], row[j] + 1]
            system[i, j] = scale[i] * scale[j] * entry
        system[i, size] *= scale[i]
    rank = solve_to_rank(size, system, held.column, held.unknown)
    for i in range(size):
        held.unknown[i] *= scale[i]
    return rank


@dissolved_kernel
def share_forces(
    count: int, assembly: Assembly, friction: Floats, modes: Modes, force: Floats
) -> None:
    """Write the force of every contact point, that of a group split like its normal forces."""
    candidate, first, impulse = assembly.candidate, assembly.problem.first, assembly.answer.impulse
    tell_parts(count, modes.watched, assembly, impulse, force)
    for place in range(count):
        leader = candidate[place]
        if modes.holder[leader] == 0:
            continue
        tangential = force[leader, 1]
        limit = friction_limit(leader, place, count, assembly, friction, modes.group)
        if limit > 0.0:
            for other in range(place, count):
                contact = candidate[other]
                if modes.group[contact] == leader:
                    share = friction[contact] * impulse[first[other]] / limit
                    force[contact, 1] = share * tangential


@kernel
def list_pressing(
    size: int, count: int, candidate: Integers, first: Integers, latched: Integers, rows: Rows,
    held: HeldRows,
) -> None:  # fmt: skip
    """Write to ``held.presses`` which unknown forces can press only.

    These are the normal forces but for those of latches that hold.
    """
    for k in range(size):
        place = held.place[k]
        held.presses[k] = 1 if held.row[k] == first[place] and place < count else 0
        if held.presses[k] == 1:
            contact = candidate[place]
            for latch in range(latched.shape[0]):
                if latched[latch] == 1 and rows.latch_stop[latch] == contact:
                    held.presses[k] = 0


@kernel
def hold_by_saddle_point(
    size: int, count: int, total: int, model: Model, rows: Rows, face: Integers, curvature: Floats,
    loop_bias: Floats, latched: Integers, candidate: Integers, first: Integers, jacobian: Floats,
    tree: Workspace, matrix: Floats, rate: Floats, answer: ContactAnswer, held: HeldRows,
    saddle: SaddlePoint,
) -> bool:  # fmt: skip
    """Contact forces that keep the modes, and the acceleration, from the full equations.

    What is no unknown has been written to the forces. Accelerations of the candidates' rows go to
    ``answer.velocity``. Returns whether the forces are ambiguous.
    """
    nv, impulse, velocity = model.nv, answer.impulse, answer.velocity
    state_accelerations(
        count, total, candidate, first, model, tree, rows, face, curvature, loop_bias, jacobian,
        saddle.bias,
    )  # fmt: skip
    mass_matrix(model, tree, matrix)
    write_equations(size, nv, matrix, jacobian, held, saddle.system)
    for i in range(nv):
        saddle.system[i, nv + size] = saddle.force[i]
    for k in range(size):
        saddle.system[nv + k, nv + size] = -saddle.bias[held.row[k]]
    rank = solve_saddle_point(nv + size, saddle)
    if rank < nv + size:
        shorten(
            nv, nv + size, rank, saddle.scale, held.friction_ratio, saddle.order, saddle.system,
            saddle.unknown,
        )  # fmt: skip
        list_pressing(size, count, candidate, first, latched, rows, held)
        raise_to_zero(nv, nv + size, rank, held.presses, saddle.system, saddle.unknown)
    saddle.needed = 1
    for i in range(nv):
        rate[i] = saddle.unknown[i]
    for k in range(size):
        row, force = held.row[k], saddle.unknown[nv + k]
        impulse[row] += force
        if held.friction_ratio[k] != 0.0:
            impulse[row + 1] += held.friction_ratio[k] * force
    for row in range(first[total]):
        velocity[row] = saddle.bias[row] + row_product(jacobian, row, rate)
    return rank < nv + size


@dissolved_kernel
def hold_closed(
    count: int, total: int, model: Model, rows: Rows, modes: Modes, friction: Floats, loops: Loops,
    equations: Equations, assembly: Assembly, held: HeldRows, saddle: SaddlePoint,
) -> bool:  # fmt: skip
    """Contact forces that keep the modes of the candidates, and the acceleration under them.

    Returns whether they are ambiguous.
    """
    candidate, free, impulse = assembly.candidate, assembly.problem.free, assembly.answer.impulse
    directions, jacobian = assembly.directions, assembly.directions.jacobian
    first, rate = assembly.problem.first, equations.rate
    free_gap_accelerations(
        count, candidate, first, model, equations.tree, rows, modes.face, modes.curvature, rate,
        jacobian, free,
    )  # fmt: skip
    free_loops(total, loops, rate, 1.0, assembly)
    for row in range(first[total]):
        impulse[row] = 0.0
    for place in range(count):
        if rows.kind[candidate[place]] == DRY_JOINT:
            impulse[first[place]] = assembly.problem.bound[place]
    size = list_unknowns(count, total, candidate, first, friction, modes, held)
    for i in range(size):
        held.system[i, size] = -free[held.row[i]]
    rank = solve_constraints(size, 1.0, assembly.problem.delassus, held)
    if is_delicate(size, rank, held.system):
        return hold_by_saddle_point(
            size, count, total, model, rows, modes.face, modes.curvature, loops.rows.bias,
            loops.held, candidate, first, jacobian, equations.tree, equations.mass_matrix, rate,
            assembly.answer, held, saddle,
        )  # fmt: skip
    if rank < size:
        shorten(
            0, size, rank, held.scale, held.friction_ratio, held.column, held.system, held.unknown
        )
        list_pressing(size, count, candidate, first, loops.held, rows, held)
        raise_to_zero(0, size, rank, held.presses, held.system, held.unknown)
    for i in range(size):
        impulse[held.row[i]] += held.unknown[i]
        if held.friction_ratio[i] != 0.0:
            impulse[held.row[i] + 1] += held.friction_ratio[i] * held.unknown[i]
    add_impulse(model, first[total], impulse, directions, equations, rate)
    return rank < size


@kernel
def observe_faces(
    state: Floats, model: Model, ground: GroundModel, tree: Workspace, rows: Rows, modes: Modes,
    surface: Surface,
) -> None:  # fmt: skip
    """Kinematics, velocities, contact points and gaps of a state (q, v)."""
    q, v = state[: model.nq], state[model.nq :]
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    locate(q, v, model, ground, tree, rows, modes, surface)


@kernel
def observe_rows(
    state: Floats, model: Model, ground: GroundModel, tree: Workspace, rows: Rows, modes: Modes,
    surface: Surface, loops: Loops,
) -> None:  # fmt: skip
    """The same, and the rows of the loops."""
    observe_faces(state, model, ground, tree, rows, modes, surface)
    if rows_of(loops) > 0:
        find_loops(model, state[: model.nq], state[model.nq :], tree, loops)


@kernel
def look(
    state: Floats, model: Model, ground: GroundModel, tree: Workspace, rows: Rows, modes: Modes,
    surface: Surface, watch: Watch,
) -> None:  # fmt: skip
    """Pose, contact points, and the event functions that need no forces, of a state (q, v)."""
    observe_faces(state, model, ground, tree, rows, modes, surface)
    watch_geometry(
        model, ground, tree, state[model.nq :], rows, modes.watched, modes.closed, modes.passing,
        modes.slide, modes.group, modes.face, watch.value, watch.rate,
    )  # fmt: skip


@kernel
def evaluate(
    scene: Scene, time: float, state: Floats, control: Control, memory: Memory, phase: Phase,
    slope: Floats,
) -> None:  # fmt: skip
    """Everything about a state (q, v) that the integration may visit.

    Pose, contact points, torque, slope (v, v̇), contact forces and all event functions. A continuous
    controller is asked without letting it remember.
    """
    modes, watch, forces, saddle = phase.modes, phase.watch, phase.forces, phase.saddle
    model, ground, rows, loops = scene.model, scene.ground, memory.rows, memory.loops
    q, v = state[: model.nq], state[model.nq :]
    equations, assembly, friction = memory.equations, memory.assembly, memory.surface.friction
    problem, directions = assembly.problem, assembly.directions
    tree, rate = equations.tree, equations.rate
    evaluate_equations(model, q, v, equations)
    locate(q, v, model, ground, tree, rows, modes, memory.surface)
    watch_geometry(
        model, ground, tree, v, rows, modes.watched, modes.closed, modes.passing, modes.slide,
        modes.group, modes.face, watch.value, watch.rate,
    )  # fmt: skip
    if control.continuous == 1:
        consult(scene.controller, time, q, v, model, tree, memory.contacts, control, memory.command)
    try_torque(model, control.voltage, q, v, memory.tally, memory.command, memory.torque)
    free_acceleration(
        model, state, memory.torque, rows, modes.slide, modes.breakaway, memory.pushes, equations,
        saddle.force,
    )  # fmt: skip
    if rows_of(loops) > 0:
        find_loops(model, q, v, tree, loops)
    count = list_closed(rows, modes, assembly.candidate, problem.first, problem.bound)
    write_candidates(
        count, assembly.candidate, model, tree, rows, problem.first, directions.leaf,
        directions.jacobian,
    )  # fmt: skip
    total = append_loops(count, loops, assembly)
    forces.count = count
    saddle.needed = 0
    if total > 0:
        assemble_delassus(model, total, equations, directions, problem)
        ambiguous = hold_closed(
            count, total, model, rows, modes, friction, loops, equations, assembly, phase.held,
            saddle,
        )  # fmt: skip
        forces.deficient = 1 if ambiguous else 0
    share_forces(count, assembly, friction, modes, forces.force)
    watch_forces(count, total, assembly, friction, modes, watch)
    if saddle.needed == 1:
        watch_slips(count, assembly, modes, watch.rate)
    trust_latches(loops.held, rows, modes.closed, watch.value)
    if count > 0 and forces.deficient == 1:
        share_redundant(
            count, loops, friction, memory.reaction.mode, rows, phase, assembly, memory.solver
        )
    for i in range(model.nv):
        slope[i] = v[i]
        slope[model.nq + i] = rate[i]
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        watch.rate[2 * dry + 1] = modes.slide[dry] * rate[rows.owner[dry]]
