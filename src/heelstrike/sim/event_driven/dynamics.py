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
from heelstrike.sim.contacts.rows import DRY_JOINT, LOOP, POINT, SECOND_FACE, STOP, Rows
from heelstrike.sim.controller.asking import consult
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.motors import try_torque
from heelstrike.sim.event_driven.candidates import free_acceleration, share_redundant
from heelstrike.sim.event_driven.faces import has_corners, locate, watch_corners
from heelstrike.sim.event_driven.gaps import free_gap_acceleration, gap_now, gap_rows
from heelstrike.sim.event_driven.phase import (
    Faces,
    HeldRows,
    Modes,
    Phase,
    SaddlePoint,
    Step,
    Watch,
)
from heelstrike.sim.event_driven.saddle_point import (
    is_delicate,
    solve_saddle_point,
    state_accelerations,
    write_equations,
)
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Equations, Loops, Memory, Surface
from heelstrike.sim.push import Pushes

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
    model: Model, angle: Floats, contacts: Contacts, contact: int, rows: Rows, seconds: Contacts,
    face: Integers,
) -> float:  # fmt: skip
    """Where a contact point is along the ground, less the length that its disc has rolled."""
    point = rows.owner[contact]
    its = seconds if rows.kind[contact] == SECOND_FACE else contacts
    position, normal, radius = its.position[point], its.normal[point], model.contact_radius[point]
    rolled = radius * angle[model.contact_link[point]]
    if face[contact] >= 0 and face[contact] % 2 == 1:
        # The way of the contact point round the disc that pivots on a corner.
        return radius * math.atan2(normal[0], normal[1]) - rolled
    return normal[1] * position[0] - normal[0] * position[1] - rolled


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
def friction_limit(
    leader: int, first: int, count: int, assembly: Assembly, friction: Floats, group: Integers
) -> float:
    """Largest tangential force of a group, under its normal forces."""
    limit = 0.0
    for place in range(first, count):
        contact = assembly.candidate[place]
        if group[contact] == leader:
            limit += friction[contact] * assembly.answer.impulse[2 * place]
    return limit


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
def watch_second_faces(
    model: Model, tree: Workspace, rows: Rows, seconds: Contacts, modes: Modes, watch: Watch
) -> None:
    """Event functions of the second faces: gaps to those that points on the ground could meet."""
    value, rate = watch.value, watch.rate
    for contact in range(rows.first[SECOND_FACE], rows.end[SECOND_FACE]):
        point = rows.owner[contact]
        value[2 * contact], value[2 * contact + 1] = 1.0, 1.0
        rate[2 * contact] = 0.0
        if modes.closed[point] == 0 or seconds.gap[point] == math.inf:
            continue
        normal, tangent = contact_velocity(model, tree, seconds, point)
        if modes.closed[contact] == 0:
            value[2 * contact] = seconds.gap[point]
            rate[2 * contact] = normal
        elif modes.slide[contact] != 0 and modes.group[contact] == contact:
            value[2 * contact + 1] = modes.slide[contact] * tangent


@kernel
def watch_geometry(
    model: Model, ground: GroundModel, tree: Workspace, contacts: Contacts, state: Floats,
    rows: Rows, seconds: Contacts, modes: Modes, faces: Faces, watch: Watch,
) -> None:  # fmt: skip
    """Event functions that need no forces: gaps of open points, speeds of what slides, corners.

    That of a point that is let pass below the ground is its depth. On ground with corners the
    second rate of an open point bounds how fast it moves, or the centre of its disc.
    """
    value, rate, corners = watch.value, watch.rate, has_corners(ground)
    if corners:
        watch_corners(model, ground, contacts, rows, modes, faces, value)
        if faces.paired == 1:
            watch_second_faces(model, tree, rows, seconds, modes, watch)
    table = rows
    for contact in range(table.first[DRY_JOINT], table.end[DRY_JOINT]):
        slide = modes.slide[contact]
        value[2 * contact + 1] = 1.0
        if slide != 0:
            value[2 * contact + 1] = slide * state[model.nq + table.owner[contact]]
    for contact in range(table.first[STOP], table.end[STOP]):
        if modes.closed[contact] == 0:
            joint, side = table.owner[contact], table.side[contact]
            value[2 * contact] = side * (state[joint] - table.limit[contact])
            rate[2 * contact] = side * state[model.nq + joint]
    for contact in range(model.nc):
        normal, tangent = contact_velocity(model, tree, contacts, contact)
        value[2 * contact + 1] = 1.0
        if modes.closed[contact] == 0:
            side = 1.0 - 2.0 * modes.passing[contact]
            value[2 * contact] = side * contacts.gap[contact]
            rate[2 * contact] = side * normal
            if corners:
                spin = tree.velocity[model.contact_link[contact], 0]
                rolls = abs(model.contact_radius[contact] * spin)
                rate[2 * contact + 1] = abs(normal) + abs(tangent) + rolls
        elif modes.slide[contact] != 0 and modes.group[contact] == contact:
            value[2 * contact + 1] = modes.slide[contact] * tangent


@dissolved_kernel
def watch_forces(
    count: int, loop_rows: int, assembly: Assembly, friction: Floats, modes: Modes, watch: Watch
) -> None:
    """Event functions of closed points: normal forces, and what is left to the friction limit."""
    delassus, free = assembly.problem.delassus, assembly.problem.free
    impulse = assembly.answer.impulse
    for place in range(count):
        contact = assembly.candidate[place]
        watch.value[2 * contact] = 1.0
        if modes.carrier[contact] == 1:
            watch.value[2 * contact] = impulse[2 * place]
        if modes.holder[contact] == 1:
            limit = friction_limit(contact, 0, count, assembly, friction, modes.group)
            watch.value[2 * contact + 1] = limit - abs(impulse[2 * place + 1])
        elif modes.slide[contact] != 0 and modes.group[contact] == contact:
            acceleration = free[2 * place + 1]
            for column in range(2 * (count + loop_rows)):
                acceleration += delassus[2 * place + 1, column] * impulse[column]
            watch.rate[2 * contact + 1] = modes.slide[contact] * acceleration


@dissolved_kernel
def trust_latches(held: Integers, rows: Rows, closed: Integers, value: Floats) -> None:
    """Stops that hold their joint never open, whatever the sign of their force."""
    for latch in range(held.shape[0]):
        stop = rows.latch_stop[latch]
        if held[latch] == 1 and closed[stop] == 1:
            value[2 * stop] = 1.0


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


@kernel
def watch_slips(count: int, assembly: Assembly, modes: Modes, rate: Floats) -> None:
    """Rates of the sliding speeds, after :func:`hold_by_saddle_point`."""
    for place in range(count):
        contact = assembly.candidate[place]
        if modes.slide[contact] != 0 and modes.group[contact] == contact:
            acceleration = assembly.answer.velocity[2 * place + 1]
            rate[2 * contact + 1] = modes.slide[contact] * acceleration


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
    model: Model, ground: GroundModel, state: Floats, rows: Rows, modes: Modes, seconds: Contacts,
    faces: Faces, tree: Workspace, contacts: Contacts, surface: Surface,
) -> None:  # fmt: skip
    """Kinematics, velocities and contact points of a state (q, v)."""
    forward_kinematics(model, state[: model.nq], tree)
    link_velocities(model, state[model.nq :], tree)
    locate(model, ground, tree, rows, modes, seconds, faces, contacts, surface)


@kernel
def look(
    model: Model, ground: GroundModel, state: Floats, rows: Rows, modes: Modes, tree: Workspace,
    contacts: Contacts, surface: Surface, seconds: Contacts, faces: Faces, watch: Watch,
) -> None:  # fmt: skip
    """Pose, contact points, and the event functions that need no forces, of a state (q, v)."""
    observe_faces(model, ground, state, rows, modes, seconds, faces, tree, contacts, surface)
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


@kernel
def displacement(
    row: int, model: Model, angle: Floats, contacts: Contacts, candidate: Integers, loops: Loops,
    rows: Rows, seconds: Contacts, modes: Modes, face: Integers, state: Floats,
) -> float:  # fmt: skip
    """How far a candidate is along its row from where its constraint wants it."""
    contact = candidate[row // 2]
    if rows.kind[contact] >= LOOP:
        return loops.rows.displacement[row_of(contact, loops)]
    if row % 2 == 0:
        return gap_now(contact, rows, state)
    if rows.kind[contact] == DRY_JOINT:
        return state[rows.owner[contact]] - modes.anchor[contact]
    if modes.stuck[contact] == 1:
        return -modes.anchor[contact] + tangential_place(
            model, angle, contacts, contact, rows, seconds, face
        )
    return 0.0


@kernel
def move_by_saddle_point(
    size: int, model: Model, jacobian: Floats, equations: Equations, held: HeldRows,
    saddle: SaddlePoint, along: Floats,
) -> None:  # fmt: skip
    """Change positions, or velocities, by as little as the masses allow for the rows to come right.

    What each row is wrong by is in ``saddle.bias``.
    """
    for k in range(size):
        held.lean[k] = 0.0
    write_equations(size, model, jacobian, held, equations, saddle.system)
    for i in range(model.nv):
        saddle.system[i, model.nv + size] = 0.0
    for k in range(size):
        saddle.system[model.nv + k, model.nv + size] = -saddle.bias[k]
    solve_saddle_point(model.nv + size, saddle)
    for i in range(model.nv):
        along[i] += saddle.unknown[i]


@kernel
def gather_sunk(
    count: int, model: Model, contacts: Contacts, state: Floats, rows: Rows, seconds: Contacts,
    modes: Modes, fired: Integers, loops: Loops, equations: Equations, assembly: Assembly,
) -> int:  # fmt: skip
    """Append the open contacts that are beyond the ground, or their range, by rounding.

    After those that are closed, and before the loops. What reaches the ground in this instant is
    none of them: it is the instant that is corrected. Returns how many there are.
    """
    sunk = 0
    for contact in range(rows.end[STOP]):
        if modes.closed[contact] == 1 or fired[2 * contact] == 1:
            continue
        if rows.kind[contact] == POINT and modes.passing[contact] == 1:
            continue
        if -DEEP < gap_now(contact, rows, state) < -SHALLOW:
            place = count + sunk
            gap_rows(model, equations.tree, contacts, rows, seconds, contact, place, assembly)
            assembly.candidate[place] = contact
            sunk += 1
    if sunk > 0:
        total = append_loops(count + sunk, loops, assembly)
        assemble_delassus(model, total, equations, assembly)
    return sunk


@kernel
def list_sunk(size: int, count: int, sunk: int, loop_rows: int, held: HeldRows) -> int:
    """List the rows of what :func:`gather_sunk` found after the `size` others; return how many."""
    for k in range(size - loop_rows, size):  # those of the loops have been listed in their place
        held.row[k] += 2 * sunk
    for place in range(count, count + sunk):
        held.row[size] = 2 * place
        held.lean[size] = 0.0
        size += 1
    return size


@kernel
def project(
    model: Model, ground: GroundModel, rows: Rows, equations: Equations, contacts: Contacts,
    surface: Surface, assembly: Assembly, loops: Loops, seconds: Contacts, phase: Phase,
    state: Floats,
) -> tuple[float, float, float]:  # fmt: skip
    """Put a state back on its contact constraints, along the shortest way that the masses allow.

    Closed points return to the ground, sticking ones (and joints) to where they began to stick,
    ends of loops to each other, and their velocities along these directions vanish. What is open
    and a little beyond its limit is put there, too.

    Returns how far (m) the worst is left from its place - constraints that say the same twice need
    not agree - and how far it was off, and how fast (m/s), to begin with.
    """
    held = phase.held
    q, v = state[: model.nq], state[model.nq :]
    system, row, loop_rows = held.system, held.row, rows_of(loops)
    strayed, fastest = 0.0, 0.0
    for attempt in range(5):
        observe_faces(
            model, ground, state, rows, phase.modes, seconds, phase.faces, equations.tree, contacts,
            surface,
        )  # fmt: skip
        weigh(model, equations)
        if loop_rows > 0:
            find_loops(model, q, v, equations.tree, loops)
        count = gather_closed(
            model, contacts, rows, seconds, phase.modes, loops, equations, assembly
        )
        sunk = 0
        if attempt < 4:
            sunk = gather_sunk(
                count, model, contacts, state, rows, seconds, phase.modes, phase.watch.fired, loops,
                equations, assembly,
            )  # fmt: skip
        total = count + sunk + loop_rows
        if total == 0:
            return 0.0, strayed, 0.0
        size = list_unknowns(
            count, loop_rows, assembly.candidate, surface.friction, phase.modes, held
        )
        if sunk > 0:
            size = list_sunk(size, count, sunk, loop_rows, held)
        worst = 0.0
        for i in range(size):
            error = displacement(
                row[i], model, equations.tree.angle, contacts, assembly.candidate, loops, rows,
                seconds, phase.modes, phase.faces.face, state,
            )  # fmt: skip
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
        rank = solve_constraints(size, 0.0, assembly.problem.delassus, held)
        if is_delicate(size, rank, system):
            move_by_saddle_point(
                size, model, assembly.jacobian, equations, held, phase.saddle, q if positions else v
            )
        else:
            for i in range(2 * total):
                assembly.answer.impulse[i] = 0.0
            for i in range(size):
                assembly.answer.impulse[row[i]] = held.unknown[i]
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
def explained(before: Floats, after: Floats, times: float, step: Step) -> bool:
    """Whether some multiple of the error that a step may make explains how far a state moved."""
    size = before.shape[0]
    total = 0.0
    for i in range(size):
        scale = step.absolute + step.relative * max(abs(before[i]), abs(after[i]))
        total += ((after[i] - before[i]) / scale) ** 2
    return bool(total <= size * times**2)
