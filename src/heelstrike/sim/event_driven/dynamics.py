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
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    contact_velocity,
    evaluate_equations,
    row_product,
    weigh,
)
from heelstrike.sim.contacts.loops import append_loops, find_loops, free_loops, row_of, rows_of
from heelstrike.sim.contacts.rows import LOOP
from heelstrike.sim.controller.asking import consult
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.motors import try_torque
from heelstrike.sim.event_driven.candidates import free_acceleration, share_redundant
from heelstrike.sim.event_driven.faces import has_corners, locate, watch_corners
from heelstrike.sim.event_driven.gaps import free_gap_acceleration, gap_now, gap_rows
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.event_driven.saddle_point import (
    is_delicate,
    solve_saddle_point,
    state_accelerations,
    write_equations,
)
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Equations, Loops, Memory

# How far a projection may move a state, as a multiple of the error that a step may make: the end of
# a step, beyond which the motion has not kept its constraints, and a place on its dense output.
EXPLAINED, INTERPOLATED = 100.0, 1e4
# How far (m, rad) what is open may be beyond its limit to be put back on it: less is nothing, more
# is no rounding.
SHALLOW, DEEP = 2e-11, 1e-8
# How far (m, rad) and how fast (m/s, rad/s) a state may be off its constraints as it is.
PLACED, STILL = 5e-11, 1e-9


@kernel
def tangential_place(
    model: Model, tree: Workspace, contacts: Contacts, contact: int, phase: Phase
) -> float:
    """Where a contact point is along the ground, less the length that its disc has rolled."""
    its, point = contacts, contact
    if contact >= phase.first_second:
        its, point = phase.seconds, contact - phase.first_second
    position, normal, radius = its.position[point], its.normal[point], model.contact_radius[point]
    rolled = radius * tree.angle[model.contact_link[point]]
    if phase.face[contact] >= 0 and phase.face[contact] % 2 == 1:
        # The way of the contact point round the disc that pivots on a corner.
        return radius * math.atan2(normal[0], normal[1]) - rolled
    return normal[1] * position[0] - normal[0] * position[1] - rolled


@kernel
def list_unknowns(
    count: int, loops: int, candidate: Integers, friction: Floats, phase: Phase
) -> int:
    """List the Jacobian rows along which closed points are held, and friction per normal force.

    The rows of the loops, which come after the `count` contacts, are held always.
    """
    size = 0
    for place in range(count):
        contact = candidate[place]
        if phase.carrier[contact] == 1:
            phase.row[size] = 2 * place
            phase.lean[size] = -phase.slide[contact] * friction[contact]
            size += 1
        if phase.holder[contact] == 1:
            phase.row[size] = 2 * place + 1
            phase.lean[size] = 0.0
            size += 1
    for place in range(count, count + loops):
        phase.row[size] = 2 * place
        phase.lean[size] = 0.0
        size += 1
    return size


@kernel
def solve_constraints(size: int, friction: float, delassus: Floats, phase: Phase) -> int:
    """Solve the equations of the contact forces, with friction (1) or without (0); return the rank.

    Their right-hand side is there. A contact may be a million times heavier than another: only in
    units in which all weigh the same does the size of a pivot tell whether it is one.
    """
    row, lean, scale, system = phase.row, phase.lean, phase.scale, phase.system
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
    rank = solve_to_rank(size, system, phase.column, phase.unknown)
    for i in range(size):
        phase.unknown[i] *= scale[i]
    return rank


@dissolved_kernel
def friction_limit(
    leader: int, first: int, count: int, assembly: Assembly, friction: Floats, phase: Phase
) -> float:
    """Largest tangential force of a group, under its normal forces."""
    limit = 0.0
    for place in range(first, count):
        contact = assembly.candidate[place]
        if phase.group[contact] == leader:
            limit += friction[contact] * assembly.answer.impulse[2 * place]
    return limit


@dissolved_kernel
def share_forces(count: int, assembly: Assembly, friction: Floats, phase: Phase) -> None:
    """Write the force of every contact point, that of a group split like its normal forces."""
    candidate, impulse, force = assembly.candidate, assembly.answer.impulse, phase.force
    for contact in range(phase.watched):
        force[contact, 0] = 0.0
        force[contact, 1] = 0.0
    for place in range(count):
        force[candidate[place], 0] = impulse[2 * place]
        force[candidate[place], 1] = impulse[2 * place + 1]
    for place in range(count):
        leader = candidate[place]
        if phase.holder[leader] == 0:
            continue
        tangential = force[leader, 1]
        limit = friction_limit(leader, place, count, assembly, friction, phase)
        if limit > 0.0:
            for other in range(place, count):
                contact = candidate[other]
                if phase.group[contact] == leader:
                    force[contact, 1] = friction[contact] * impulse[2 * other] / limit * tangential


@kernel
def watch_second_faces(model: Model, tree: Workspace, phase: Phase) -> None:
    """Event functions of the second faces: gaps to those that points on the ground could meet."""
    value, rate, seconds = phase.value, phase.rate, phase.seconds
    for point in range(model.nc):
        contact = phase.first_second + point
        value[2 * contact], value[2 * contact + 1] = 1.0, 1.0
        rate[2 * contact] = 0.0
        if phase.closed[point] == 0 or seconds.gap[point] == math.inf:
            continue
        normal, tangent = contact_velocity(model, tree, seconds, point)
        if phase.closed[contact] == 0:
            value[2 * contact] = seconds.gap[point]
            rate[2 * contact] = normal
        elif phase.slide[contact] != 0 and phase.group[contact] == contact:
            value[2 * contact + 1] = phase.slide[contact] * tangent


@kernel
def watch_geometry(
    model: Model, ground: GroundModel, tree: Workspace, contacts: Contacts, state: Floats,
    phase: Phase,
) -> None:  # fmt: skip
    """Event functions that need no forces: gaps of open points, speeds of what slides, corners.

    That of a point that is let pass below the ground is its depth. On ground with corners the
    second rate of an open point bounds how fast it moves, or the centre of its disc.
    """
    value, rate, corners = phase.value, phase.rate, has_corners(ground)
    if corners:
        watch_corners(model, ground, contacts, phase, value)
        if phase.watched > phase.first_second:
            watch_second_faces(model, tree, phase)
    for dry in range(phase.dry_joint.shape[0]):
        contact = phase.first_dry + dry
        slide = phase.slide[contact]
        value[2 * contact + 1] = 1.0
        if slide != 0:
            value[2 * contact + 1] = slide * state[model.nq + phase.dry_joint[dry]]
    for stop in range(phase.stop_joint.shape[0]):
        contact = model.nc + stop
        if phase.closed[contact] == 0:
            joint = phase.stop_joint[stop]
            side = phase.stop_side[stop]
            value[2 * contact] = side * (state[joint] - phase.stop_limit[stop])
            rate[2 * contact] = side * state[model.nq + joint]
    for contact in range(model.nc):
        normal, tangent = contact_velocity(model, tree, contacts, contact)
        value[2 * contact + 1] = 1.0
        if phase.closed[contact] == 0:
            side = 1.0 - 2.0 * phase.passing[contact]
            value[2 * contact] = side * contacts.gap[contact]
            rate[2 * contact] = side * normal
            if corners:
                spin = tree.velocity[model.contact_link[contact], 0]
                rolls = abs(model.contact_radius[contact] * spin)
                rate[2 * contact + 1] = abs(normal) + abs(tangent) + rolls
        elif phase.slide[contact] != 0 and phase.group[contact] == contact:
            value[2 * contact + 1] = phase.slide[contact] * tangent


@dissolved_kernel
def watch_forces(
    count: int, loops: int, assembly: Assembly, friction: Floats, phase: Phase
) -> None:
    """Event functions of closed points: normal forces, and what is left to the friction limit."""
    delassus, free = assembly.problem.delassus, assembly.problem.free
    impulse = assembly.answer.impulse
    for place in range(count):
        contact = assembly.candidate[place]
        phase.value[2 * contact] = 1.0
        if phase.carrier[contact] == 1:
            phase.value[2 * contact] = impulse[2 * place]
        if phase.holder[contact] == 1:
            limit = friction_limit(contact, 0, count, assembly, friction, phase)
            phase.value[2 * contact + 1] = limit - abs(impulse[2 * place + 1])
        elif phase.slide[contact] != 0 and phase.group[contact] == contact:
            acceleration = free[2 * place + 1]
            for column in range(2 * (count + loops)):
                acceleration += delassus[2 * place + 1, column] * impulse[column]
            phase.rate[2 * contact + 1] = phase.slide[contact] * acceleration


@dissolved_kernel
def trust_latches(held: Integers, phase: Phase) -> None:
    """Stops that hold their joint never open, whatever the sign of their force."""
    for latch in range(held.shape[0]):
        stop = phase.latch_stop[latch]
        if held[latch] == 1 and phase.closed[stop] == 1:
            phase.value[2 * stop] = 1.0


@kernel
def gather_closed(
    model: Model, contacts: Contacts, phase: Phase, loops: Loops, equations: Equations,
    assembly: Assembly,
) -> int:  # fmt: skip
    """Jacobian rows and Delassus matrix of the closed contacts; return their number.

    Dry joints that move are none of them: their friction is known. The rows of the loops come
    after those of the contacts and are not counted; they have been found for the state.
    """
    count = 0
    for contact in range(phase.watched):
        moves = phase.first_dry <= contact < phase.first_second and phase.slide[contact] != 0
        if phase.closed[contact] == 1 and not moves:
            gap_rows(model, equations.tree, contacts, phase, contact, count, assembly)
            assembly.candidate[count] = contact
            count += 1
    total = append_loops(count, loops, assembly)
    if total > 0:
        assemble_delassus(model, total, equations, assembly)
    return count


@kernel
def list_pressing(size: int, count: int, memory: Memory, phase: Phase) -> None:
    """Write to ``phase.column`` which unknown forces can press only.

    These are the normal forces but for those of latches that hold.
    """
    for k in range(size):
        place = phase.row[k] // 2
        phase.column[k] = 1 if phase.row[k] % 2 == 0 and place < count else 0
        if phase.column[k] == 1:
            contact = memory.assembly.candidate[place]
            for latch in range(memory.loops.held.shape[0]):
                if memory.loops.held[latch] == 1 and phase.latch_stop[latch] == contact:
                    phase.column[k] = 0


@kernel
def hold_by_saddle_point(
    size: int, count: int, model: Model, state: Floats, memory: Memory, phase: Phase
) -> None:
    """Contact forces that keep the modes, and the acceleration, from the full equations.

    What is no unknown has been written to the forces. Accelerations of the candidates' rows go to
    ``answer.velocity``.
    """
    nv, saddle, assembly, equations = model.nv, phase.saddle, memory.assembly, memory.equations
    impulse, velocity, rate = assembly.answer.impulse, assembly.answer.velocity, equations.rate
    state_accelerations(count, model, state, memory, phase)
    write_equations(size, model, assembly, equations, phase)
    for i in range(nv):
        saddle.system[i, nv + size] = saddle.force[i]
    for k in range(size):
        saddle.system[nv + k, nv + size] = -saddle.bias[phase.row[k]]
    rank = solve_saddle_point(nv + size, saddle)
    phase.deficient = 1 if rank < nv + size else 0
    if phase.deficient == 1:
        shorten(
            nv, nv + size, rank, saddle.scale, phase.lean, saddle.order, saddle.system,
            saddle.unknown,
        )  # fmt: skip
        list_pressing(size, count, memory, phase)
        raise_to_zero(nv, nv + size, rank, phase.column, saddle.system, saddle.unknown)
    saddle.needed = 1
    for i in range(nv):
        rate[i] = saddle.unknown[i]
    for k in range(size):
        row, force = phase.row[k], saddle.unknown[nv + k]
        impulse[row] += force
        if phase.lean[k] != 0.0:
            impulse[row + 1] += phase.lean[k] * force
    for row in range(2 * (count + rows_of(memory.loops))):
        velocity[row] = saddle.bias[row] + row_product(assembly.jacobian, row, rate)


@kernel
def watch_slips(count: int, assembly: Assembly, phase: Phase) -> None:
    """Rates of the sliding speeds, after :func:`hold_by_saddle_point`."""
    for place in range(count):
        contact = assembly.candidate[place]
        if phase.slide[contact] != 0 and phase.group[contact] == contact:
            acceleration = assembly.answer.velocity[2 * place + 1]
            phase.rate[2 * contact + 1] = phase.slide[contact] * acceleration


@dissolved_kernel
def hold_closed(
    model: Model, count: int, state: Floats, friction: Floats, phase: Phase, memory: Memory
) -> None:
    """Contact forces that keep the modes of the candidates, and the acceleration under them."""
    assembly, impulse = memory.assembly, memory.assembly.answer.impulse
    for place in range(count):
        contact = assembly.candidate[place]
        free_gap_acceleration(
            model, memory.contacts, memory.equations, contact, place, phase, assembly
        )
        impulse[2 * place] = 0.0
        impulse[2 * place + 1] = 0.0
        if phase.first_dry <= contact < phase.first_second:
            joint = phase.dry_joint[contact - phase.first_dry]
            impulse[2 * place] = phase.breakaway[joint]
    loops = rows_of(memory.loops)
    total = count + loops
    free_loops(total, memory.loops, memory.equations.rate, 1.0, assembly)
    for row in range(2 * count, 2 * total):
        impulse[row] = 0.0
    size = list_unknowns(count, loops, assembly.candidate, friction, phase)
    for i in range(size):
        phase.system[i, size] = -assembly.problem.free[phase.row[i]]
    rank = solve_constraints(size, 1.0, assembly.problem.delassus, phase)
    if is_delicate(size, rank, phase.system):
        hold_by_saddle_point(size, count, model, state, memory, phase)
        return
    phase.deficient = 1 if rank < size else 0
    if phase.deficient == 1:
        shorten(0, size, rank, phase.scale, phase.lean, phase.column, phase.system, phase.unknown)
        list_pressing(size, count, memory, phase)
        raise_to_zero(0, size, rank, phase.column, phase.system, phase.unknown)
    for i in range(size):
        impulse[phase.row[i]] += phase.unknown[i]
        if phase.lean[i] != 0.0:
            impulse[phase.row[i] + 1] += phase.lean[i] * phase.unknown[i]
    add_impulse(model, assembly, total, memory.equations, memory.equations.rate)


@kernel
def observe_faces(
    model: Model, ground: GroundModel, state: Floats, phase: Phase, memory: Memory
) -> None:
    """Kinematics, velocities and contact points of a state (q, v)."""
    tree = memory.equations.tree
    forward_kinematics(model, state[: model.nq], tree)
    link_velocities(model, state[model.nq :], tree)
    locate(model, ground, tree, phase, memory.contacts, memory.surface)


@kernel
def look(model: Model, ground: GroundModel, state: Floats, memory: Memory, phase: Phase) -> None:
    """Pose, contact points, and the event functions that need no forces, of a state (q, v)."""
    observe_faces(model, ground, state, phase, memory)
    watch_geometry(model, ground, memory.equations.tree, memory.contacts, state, phase)


@kernel
def evaluate(
    scene: Scene, time: float, state: Floats, control: Control, memory: Memory, phase: Phase,
    slope: Floats,
) -> None:  # fmt: skip
    """Everything about a state (q, v) that the integration may visit.

    Pose, contact points, torque, slope (v, v̇), contact forces and all event functions. A continuous
    controller is asked without letting it remember.
    """
    model = scene.model
    q, v = state[: model.nq], state[model.nq :]
    equations, assembly, friction = memory.equations, memory.assembly, memory.surface.friction
    rate = equations.rate
    evaluate_equations(model, q, v, equations)
    locate(model, scene.ground, equations.tree, phase, memory.contacts, memory.surface)
    watch_geometry(model, scene.ground, equations.tree, memory.contacts, state, phase)
    if control.continuous == 1:
        consult(scene.controller, time, q, v, model, memory, control, memory.command)
    try_torque(model, control, q, v, memory.tally, memory.command, memory.torque)
    free_acceleration(model, state, memory.torque, phase, memory.pushes, equations)
    loops = rows_of(memory.loops)
    if loops > 0:
        find_loops(model, q, v, equations.tree, memory.loops)
    count = gather_closed(model, memory.contacts, phase, memory.loops, equations, assembly)
    phase.closed_count = count
    phase.saddle.needed = 0
    if count + loops > 0:
        hold_closed(model, count, state, friction, phase, memory)
    share_forces(count, assembly, friction, phase)
    watch_forces(count, loops, assembly, friction, phase)
    if phase.saddle.needed == 1:
        watch_slips(count, assembly, phase)
    trust_latches(memory.loops.held, phase)
    if count > 0 and phase.deficient == 1:
        share_redundant(count, memory.loops, friction, memory.reaction.mode, phase, assembly)
    for i in range(model.nv):
        slope[i] = v[i]
        slope[model.nq + i] = rate[i]
    for dry in range(phase.dry_joint.shape[0]):
        contact = phase.first_dry + dry
        phase.rate[2 * contact + 1] = phase.slide[contact] * rate[phase.dry_joint[dry]]


@kernel
def displacement(
    row: int, model: Model, tree: Workspace, contacts: Contacts, memory: Memory, phase: Phase,
    state: Floats,
) -> float:  # fmt: skip
    """How far a candidate is along its row from where its constraint wants it."""
    contact = memory.assembly.candidate[row // 2]
    if memory.rows.kind[contact] >= LOOP:
        return memory.loops.rows.displacement[row_of(contact, memory.loops)]
    if row % 2 == 0:
        return gap_now(contact, contacts, phase, state)
    if phase.first_dry <= contact < phase.first_second:
        return state[phase.dry_joint[contact - phase.first_dry]] - phase.anchor[contact]
    if phase.stuck[contact] == 1:
        return -phase.anchor[contact] + tangential_place(model, tree, contacts, contact, phase)
    return 0.0


@kernel
def move_by_saddle_point(
    size: int, model: Model, memory: Memory, phase: Phase, along: Floats
) -> None:
    """Change positions, or velocities, by as little as the masses allow for the rows to come right.

    What each row is wrong by is in ``saddle.bias``.
    """
    saddle = phase.saddle
    for k in range(size):
        phase.lean[k] = 0.0
    write_equations(size, model, memory.assembly, memory.equations, phase)
    for i in range(model.nv):
        saddle.system[i, model.nv + size] = 0.0
    for k in range(size):
        saddle.system[model.nv + k, model.nv + size] = -saddle.bias[k]
    solve_saddle_point(model.nv + size, saddle)
    for i in range(model.nv):
        along[i] += saddle.unknown[i]


@kernel
def gather_sunk(
    count: int, model: Model, contacts: Contacts, state: Floats, phase: Phase, memory: Memory
) -> int:
    """Append the open contacts that are beyond the ground, or their range, by rounding.

    After those that are closed, and before the loops. What reaches the ground in this instant is
    none of them: it is the instant that is corrected. Returns how many there are.
    """
    assembly, sunk = memory.assembly, 0
    for contact in range(phase.first_dry):
        if phase.closed[contact] == 1 or phase.fired[2 * contact] == 1:
            continue
        if contact < model.nc and phase.passing[contact] == 1:
            continue
        if -DEEP < gap_now(contact, contacts, phase, state) < -SHALLOW:
            place = count + sunk
            gap_rows(model, memory.equations.tree, contacts, phase, contact, place, assembly)
            assembly.candidate[place] = contact
            sunk += 1
    if sunk > 0:
        total = append_loops(count + sunk, memory.loops, assembly)
        assemble_delassus(model, total, memory.equations, assembly)
    return sunk


@kernel
def list_sunk(size: int, count: int, sunk: int, loops: int, phase: Phase) -> int:
    """List the rows of what :func:`gather_sunk` found after the `size` others; return how many."""
    for k in range(size - loops, size):  # those of the loops have been listed in their place
        phase.row[k] += 2 * sunk
    for place in range(count, count + sunk):
        phase.row[size] = 2 * place
        phase.lean[size] = 0.0
        size += 1
    return size


@kernel
def project(
    model: Model, ground: GroundModel, memory: Memory, phase: Phase, state: Floats
) -> tuple[float, float, float]:
    """Put a state back on its contact constraints, along the shortest way that the masses allow.

    Closed points return to the ground, sticking ones (and joints) to where they began to stick,
    ends of loops to each other, and their velocities along these directions vanish. What is open
    and a little beyond its limit is put there, too.

    Returns how far (m) the worst is left from its place - constraints that say the same twice need
    not agree - and how far it was off, and how fast (m/s), to begin with.
    """
    q, v = state[: model.nq], state[model.nq :]
    contacts, equations, assembly = memory.contacts, memory.equations, memory.assembly
    system, row, loops = phase.system, phase.row, rows_of(memory.loops)
    strayed, fastest = 0.0, 0.0
    for attempt in range(5):
        observe_faces(model, ground, state, phase, memory)
        weigh(model, equations)
        if loops > 0:
            find_loops(model, q, v, equations.tree, memory.loops)
        count = gather_closed(model, contacts, phase, memory.loops, equations, assembly)
        sunk = 0
        if attempt < 4:
            sunk = gather_sunk(count, model, contacts, state, phase, memory)
        total = count + sunk + loops
        if total == 0:
            return 0.0, strayed, 0.0
        size = list_unknowns(count, loops, assembly.candidate, memory.surface.friction, phase)
        if sunk > 0:
            size = list_sunk(size, count, sunk, loops, phase)
        worst = 0.0
        for i in range(size):
            error = displacement(row[i], model, equations.tree, contacts, memory, phase, state)
            system[i, size] = -error
            worst = max(worst, abs(error))
        if attempt == 0:
            strayed = worst
        positions = worst > 1e-14 and attempt < 4
        if not positions:
            for i in range(size):
                speed = row_product(assembly.jacobian, row[i], v)
                system[i, size] = -speed
                fastest = max(fastest, abs(speed))
        for i in range(size):
            phase.saddle.bias[i] = -system[i, size]
        rank = solve_constraints(size, 0.0, assembly.problem.delassus, phase)
        if is_delicate(size, rank, system):
            move_by_saddle_point(size, model, memory, phase, q if positions else v)
        else:
            for i in range(2 * total):
                assembly.answer.impulse[i] = 0.0
            for i in range(size):
                assembly.answer.impulse[row[i]] = phase.unknown[i]
            add_impulse(model, assembly, total, equations, q if positions else v)
        if not positions:
            return worst, strayed, fastest
    return math.inf, strayed, fastest


@kernel
def is_in_place(strayed: float, fastest: float) -> bool:
    """Whether a state off its constraints by so much (m, m/s) need not be put there.

    Beside a singular pose, as of straight legs that coincide, the rounding of a gap is worth a
    large move of the joints, which nothing asks for.
    """
    return strayed <= PLACED and fastest <= STILL


@kernel
def explained(before: Floats, after: Floats, times: float, phase: Phase) -> bool:
    """Whether some multiple of the error that a step may make explains how far a state moved."""
    size = before.shape[0]
    total = 0.0
    for i in range(size):
        scale = phase.absolute + phase.relative * max(abs(before[i]), abs(after[i]))
        total += ((after[i] - before[i]) / scale) ** 2
    return bool(total <= size * times**2)
