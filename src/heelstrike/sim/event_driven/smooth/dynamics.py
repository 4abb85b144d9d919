"""Motion within a smooth phase: the acceleration when every contact point keeps its mode.

Closed points have no normal acceleration, sticking ones no tangential acceleration either, and
sliding ones feel friction μ λ_n against the direction of sliding. With the contact forces λ that
this takes (a small linear system in J A⁻¹ Jᵀ) the motion obeys eq. 1 of the paper.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.dense import raise_to_zero, shorten, solve_to_rank
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.candidates import find_constraints
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
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.motors import try_torque
from heelstrike.sim.event_driven.phase import Faces, HeldRows, Modes, Phase, Watch
from heelstrike.sim.event_driven.smooth.candidates import free_acceleration, share_redundant
from heelstrike.sim.event_driven.smooth.faces import locate
from heelstrike.sim.event_driven.smooth.gaps import free_gap_acceleration, gap_rows
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
from heelstrike.sim.push import Pushes


@kernel
def list_unknowns(
    count: int, loop_rows: int, candidate: Integers, friction: Floats, modes: Modes, held: HeldRows
) -> int:
    """List the Jacobian rows along which closed points are held, and friction per normal force.

    The rows of the loops, which come after the `count` contacts, are held always.
    """
    size = 0
    for place in range(count):
        contact = candidate[place]
        if modes.carrier[contact] == 1:
            held.row[size] = 2 * place
            held.lean[size] = -modes.slide[contact] * friction[contact]
            size += 1
        if modes.holder[contact] == 1:
            held.row[size] = 2 * place + 1
            held.lean[size] = 0.0
            size += 1
    for place in range(count, count + loop_rows):
        held.row[size] = 2 * place
        held.lean[size] = 0.0
        size += 1
    return size


@kernel
def solve_constraints(size: int, friction: float, delassus: Floats, held: HeldRows) -> int:
    """Solve the equations of the contact forces, with friction (1) or without (0); return the rank.

    Their right-hand side is there. A contact may be a million times heavier than another: only in
    units in which all weigh the same does the size of a pivot tell whether it is one.
    """
    row, lean, scale, system = held.row, held.lean, held.scale, held.system
    for i in range(size):
        weight = delassus[row[i], row[i]]
        scale[i] = 1.0 / math.sqrt(weight) if weight > 0.0 else 1.0
    for i in range(size):
        for j in range(size):
            entry = delassus[row[i], row[j]]
            if lean[j] != 0.0:
                entry += friction * lean[j] * delassus[row[i], row[j] + 1]
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
    candidate, impulse = assembly.candidate, assembly.answer.impulse
    for contact in range(modes.watched):
        force[contact, 0] = 0.0
        force[contact, 1] = 0.0
    for place in range(count):
        force[candidate[place], 0] = impulse[2 * place]
        force[candidate[place], 1] = impulse[2 * place + 1]
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
                    force[contact, 1] = friction[contact] * impulse[2 * other] / limit * tangential


@kernel
def gather_closed(
    model: Model, contacts: Contacts, rows: Rows, seconds: Contacts, modes: Modes, loops: Loops,
    equations: Equations, assembly: Assembly,
) -> int:  # fmt: skip
    """Jacobian rows and Delassus matrix of the closed contacts; return their number.

    Dry joints that move are none of them: their friction is known. The rows of the loops come
    after those of the contacts and are not counted; they have been found for the state.
    """
    count = 0
    for contact in range(modes.watched):
        moves = rows.kind[contact] == DRY_JOINT and modes.slide[contact] != 0
        if modes.closed[contact] == 1 and not moves:
            gap_rows(model, equations.tree, contacts, rows, seconds, contact, count, assembly)
            assembly.candidate[count] = contact
            count += 1
    total = append_loops(count, loops, assembly)
    if total > 0:
        assemble_delassus(model, total, equations, assembly)
    return count


@kernel
def list_pressing(
    size: int, count: int, candidate: Integers, loops: Loops, rows: Rows, held: HeldRows
) -> None:
    """Write to ``held.presses`` which unknown forces can press only.

    These are the normal forces but for those of latches that hold.
    """
    for k in range(size):
        place = held.row[k] // 2
        held.presses[k] = 1 if held.row[k] % 2 == 0 and place < count else 0
        if held.presses[k] == 1:
            contact = candidate[place]
            for latch in range(loops.held.shape[0]):
                if loops.held[latch] == 1 and rows.latch_stop[latch] == contact:
                    held.presses[k] = 0


@kernel
def hold_by_saddle_point(
    size: int, count: int, model: Model, state: Floats, contacts: Contacts, loops: Loops,
    torque: Floats, rows: Rows, seconds: Contacts, equations: Equations, assembly: Assembly,
    pushes: Pushes, phase: Phase,
) -> None:  # fmt: skip
    """Contact forces that keep the modes, and the acceleration, from the full equations.

    What is no unknown has been written to the forces. Accelerations of the candidates' rows go to
    ``answer.velocity``.
    """
    held, forces = phase.held, phase.forces
    nv, saddle = model.nv, phase.saddle
    impulse, velocity, rate = assembly.answer.impulse, assembly.answer.velocity, equations.rate
    state_accelerations(
        count, model, state, contacts, loops, torque, rows, seconds, equations, assembly, pushes,
        phase,
    )  # fmt: skip
    write_equations(size, model, assembly.jacobian, held, equations, phase.saddle.system)
    for i in range(nv):
        saddle.system[i, nv + size] = saddle.force[i]
    for k in range(size):
        saddle.system[nv + k, nv + size] = -saddle.bias[held.row[k]]
    rank = solve_saddle_point(nv + size, saddle)
    forces.deficient = 1 if rank < nv + size else 0
    if forces.deficient == 1:
        shorten(
            nv, nv + size, rank, saddle.scale, held.lean, saddle.order, saddle.system,
            saddle.unknown,
        )  # fmt: skip
        list_pressing(size, count, assembly.candidate, loops, rows, held)
        raise_to_zero(nv, nv + size, rank, held.presses, saddle.system, saddle.unknown)
    saddle.needed = 1
    for i in range(nv):
        rate[i] = saddle.unknown[i]
    for k in range(size):
        row, force = held.row[k], saddle.unknown[nv + k]
        impulse[row] += force
        if held.lean[k] != 0.0:
            impulse[row + 1] += held.lean[k] * force
    for row in range(2 * (count + rows_of(loops))):
        velocity[row] = saddle.bias[row] + row_product(assembly.jacobian, row, rate)


@dissolved_kernel
def hold_closed(
    model: Model, count: int, state: Floats, friction: Floats, rows: Rows, seconds: Contacts,
    contacts: Contacts, loops: Loops, torque: Floats, phase: Phase, equations: Equations,
    assembly: Assembly, pushes: Pushes,
) -> None:  # fmt: skip
    """Contact forces that keep the modes of the candidates, and the acceleration under them."""
    held, forces = phase.held, phase.forces
    impulse = assembly.answer.impulse
    for place in range(count):
        contact = assembly.candidate[place]
        free_gap_acceleration(
            model, contacts, equations, contact, place, rows, seconds, phase.modes.breakaway,
            phase.faces, assembly,
        )  # fmt: skip
        impulse[2 * place] = 0.0
        impulse[2 * place + 1] = 0.0
        if rows.kind[contact] == DRY_JOINT:
            joint = rows.owner[contact]
            impulse[2 * place] = phase.modes.breakaway[joint]
    loop_rows = rows_of(loops)
    total = count + loop_rows
    free_loops(total, loops, equations.rate, 1.0, assembly)
    for row in range(2 * count, 2 * total):
        impulse[row] = 0.0
    size = list_unknowns(count, loop_rows, assembly.candidate, friction, phase.modes, held)
    for i in range(size):
        held.system[i, size] = -assembly.problem.free[held.row[i]]
    rank = solve_constraints(size, 1.0, assembly.problem.delassus, held)
    if is_delicate(size, rank, held.system):
        hold_by_saddle_point(
            size, count, model, state, contacts, loops, torque, rows, seconds, equations, assembly,
            pushes, phase,
        )  # fmt: skip
        return
    forces.deficient = 1 if rank < size else 0
    if forces.deficient == 1:
        shorten(0, size, rank, held.scale, held.lean, held.column, held.system, held.unknown)
        list_pressing(size, count, assembly.candidate, loops, rows, held)
        raise_to_zero(0, size, rank, held.presses, held.system, held.unknown)
    for i in range(size):
        impulse[held.row[i]] += held.unknown[i]
        if held.lean[i] != 0.0:
            impulse[held.row[i] + 1] += held.lean[i] * held.unknown[i]
    add_impulse(model, assembly, total, equations, equations.rate)


@kernel
def observe_faces(
    model: Model, ground: GroundModel, state: Floats, modes: Modes, rows: Rows, seconds: Contacts,
    faces: Faces, tree: Workspace, contacts: Contacts, surface: Surface,
) -> None:  # fmt: skip
    """Kinematics, velocities and contact points of a state (q, v)."""
    forward_kinematics(model, state[: model.nq], tree)
    link_velocities(model, state[model.nq :], tree)
    if rows.outside.kernel.shape[0] > 0:
        find_constraints(model, state[: model.nq], state[model.nq :], tree, rows)
    locate(model, ground, tree, rows, modes, seconds, faces, contacts, surface)


@kernel
def look(
    model: Model, ground: GroundModel, state: Floats, modes: Modes, rows: Rows, tree: Workspace,
    contacts: Contacts, surface: Surface, seconds: Contacts, faces: Faces, watch: Watch,
) -> None:  # fmt: skip
    """Pose, contact points, and the event functions that need no forces, of a state (q, v)."""
    observe_faces(model, ground, state, modes, rows, seconds, faces, tree, contacts, surface)
    watch_geometry(model, ground, tree, contacts, state, rows, seconds, modes, faces, watch)


@kernel
def evaluate(
    scene: Scene, time: float, state: Floats, control: Control, memory: Memory, phase: Phase,
    slope: Floats,
) -> None:  # fmt: skip
    """Everything about a state (q, v) that the integration may visit.

    Pose, contact points, torque, slope (v, v̇), contact forces and all event functions. A continuous
    controller is asked without letting it remember.
    """
    forces, saddle = phase.forces, phase.saddle
    model = scene.model
    q, v = state[: model.nq], state[model.nq :]
    equations, assembly, friction = memory.equations, memory.assembly, memory.surface.friction
    rate = equations.rate
    evaluate_equations(model, q, v, equations)
    if memory.rows.outside.kernel.shape[0] > 0:
        find_constraints(model, q, v, equations.tree, memory.rows)
    locate(
        model, scene.ground, equations.tree, memory.rows, phase.modes, memory.seconds, phase.faces,
        memory.contacts, memory.surface,
    )  # fmt: skip
    watch_geometry(
        model, scene.ground, equations.tree, memory.contacts, state, memory.rows, memory.seconds,
        phase.modes, phase.faces, phase.watch,
    )  # fmt: skip
    if control.continuous == 1:
        consult(scene.controller, time, q, v, model, memory, control, memory.command)
    try_torque(model, control, q, v, memory.tally, memory.command, memory.torque)
    free_acceleration(
        model, state, memory.torque, memory.rows, phase.modes, memory.pushes, equations
    )
    loop_rows = rows_of(memory.loops)
    if loop_rows > 0:
        find_loops(model, q, v, equations.tree, memory.loops)
    count = gather_closed(
        model, memory.contacts, memory.rows, memory.seconds, phase.modes, memory.loops, equations,
        assembly,
    )  # fmt: skip
    forces.count = count
    saddle.needed = 0
    if count + loop_rows > 0:
        hold_closed(
            model, count, state, friction, memory.rows, memory.seconds, memory.contacts,
            memory.loops, memory.torque, phase, equations, assembly, memory.pushes,
        )  # fmt: skip
    share_forces(count, assembly, friction, phase.modes, forces.force)
    watch_forces(count, loop_rows, assembly, friction, phase.modes, phase.watch)
    if saddle.needed == 1:
        watch_slips(count, assembly, phase.modes, phase.watch.rate)
    trust_latches(memory.loops.held, memory.rows, phase.modes.closed, phase.watch.value)
    if count > 0 and forces.deficient == 1:
        share_redundant(
            count, memory.loops, friction, memory.reaction.mode, memory.rows, phase, assembly,
            memory.solver,
        )  # fmt: skip
    for i in range(model.nv):
        slope[i] = v[i]
        slope[model.nq + i] = rate[i]
    for contact in range(memory.rows.first[DRY_JOINT], memory.rows.end[DRY_JOINT]):
        phase.watch.rate[2 * contact + 1] = (
            phase.modes.slide[contact] * rate[memory.rows.owner[contact]]
        )
