"""Motion within a smooth phase: the acceleration when every contact point keeps its mode.

Closed points have no normal acceleration, sticking ones no tangential acceleration either, and
sliding ones feel friction μ λ_n against the direction of sliding. With the contact forces λ that
this takes (a small linear system in J A⁻¹ Jᵀ) the motion obeys eq. 1 of the paper.
"""

from __future__ import annotations

from typing import Any

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities, passive_force
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.dry_friction import dry_force
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    contact_velocity,
    evaluate_equations,
    locate_contacts,
    solve_mass_matrix,
    weigh,
)
from heelstrike.sim.controller.asking import consult
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.candidates import share_redundant
from heelstrike.sim.event_driven.gaps import free_gap_acceleration, gap_now, gap_rows
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Memory
from heelstrike.sim.push import add_pushes
from heelstrike.sim.record.recording import try_torque

RANK_TOLERANCE = 1e-11
"""Pivots below this, relative to the largest entry, count as zero: the forces are ambiguous."""


@kernel
def tangential_place(position: Floats, normal: Floats, radius: float, angle: float) -> float:
    """Where a contact point is along the ground, less the length that its disc has rolled."""
    return normal[1] * position[0] - normal[0] * position[1] - radius * angle


@kernel
def solve_system(size: int, system: Floats, column: Integers, unknown: Floats) -> int:
    """Solve linear equations, their right-hand side in the last column, by complete pivoting.

    Returns the rank; unknowns that the equations leave free are zero.
    """
    largest = 0.0
    for i in range(size):
        column[i] = i
        unknown[i] = 0.0
        for j in range(size):
            largest = max(largest, abs(system[i, j]))
    rank = size
    for k in range(size):
        best = RANK_TOLERANCE * largest
        row = -1
        place = -1
        for i in range(k, size):
            for j in range(k, size):
                if abs(system[i, j]) > best:
                    best = abs(system[i, j])
                    row = i
                    place = j
        if row < 0:
            rank = k
            break
        if row != k:
            for j in range(size + 1):
                system[k, j], system[row, j] = system[row, j], system[k, j]
        if place != k:
            column[k], column[place] = column[place], column[k]
            for i in range(size):
                system[i, k], system[i, place] = system[i, place], system[i, k]
        for i in range(k + 1, size):
            ratio = system[i, k] / system[k, k]
            if ratio != 0.0:
                for j in range(k + 1, size + 1):
                    system[i, j] -= ratio * system[k, j]
    for k in range(rank - 1, -1, -1):
        total = system[k, size]
        for j in range(k + 1, rank):
            total -= system[k, j] * unknown[column[j]]
        unknown[column[k]] = total / system[k, k]
    return rank


@kernel
def list_unknowns(
    count: int,
    candidate: Integers,
    carrier: Integers,
    holder: Integers,
    slide: Integers,
    friction: Floats,
    row: Integers,
    lean: Floats,
) -> int:
    """List the Jacobian rows along which closed points are held, and friction per normal force."""
    size = 0
    for place in range(count):
        contact = candidate[place]
        if carrier[contact] == 1:
            row[size] = 2 * place
            lean[size] = -slide[contact] * friction[contact]
            size += 1
        if holder[contact] == 1:
            row[size] = 2 * place + 1
            lean[size] = 0.0
            size += 1
    return size


@kernel
def constraint_matrix(
    size: int, row: Integers, lean: Floats, friction: float, delassus: Floats, system: Floats
) -> None:
    """Write the matrix of the equations of the contact forces, with friction (1) or without (0)."""
    for i in range(size):
        for j in range(size):
            entry = delassus[row[i], row[j]]
            if lean[j] != 0.0:
                entry += friction * lean[j] * delassus[row[i], row[j] + 1]
            system[i, j] = entry


@kernel
def share_forces(
    count: int,
    candidate: Integers,
    impulse: Floats,
    friction: Floats,
    group: Integers,
    holder: Integers,
    force: Floats,
) -> None:
    """Write the force of every contact point, that of a group split like its normal forces."""
    for contact in range(force.shape[0]):
        force[contact, 0] = 0.0
        force[contact, 1] = 0.0
    for place in range(count):
        force[candidate[place], 0] = impulse[2 * place]
        force[candidate[place], 1] = impulse[2 * place + 1]
    for place in range(count):
        leader = candidate[place]
        if holder[leader] == 0:
            continue
        tangential = force[leader, 1]
        limit = 0.0
        for other in range(place, count):
            if group[candidate[other]] == leader:
                limit += friction[candidate[other]] * impulse[2 * other]
        if limit > 0.0:
            for other in range(place, count):
                contact = candidate[other]
                if group[contact] == leader:
                    force[contact, 1] = friction[contact] * impulse[2 * other] / limit * tangential


@kernel
def watch_geometry(
    model: Model, contacts: Contacts, tree: Workspace, phase: Phase, state: Floats
) -> None:
    """Event functions that need no forces: gaps of open points, speeds of what slides.

    That of a point that is let pass below the ground is its depth.
    """
    nv = state.shape[0] // 2
    points = contacts.gap.shape[0]
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    for dry in range(phase.dry_joint.shape[0]):
        slide = phase.slide[first + dry]
        phase.value[2 * (first + dry) + 1] = 1.0
        if slide != 0:
            phase.value[2 * (first + dry) + 1] = slide * state[nv + phase.dry_joint[dry]]
    for stop in range(phase.stop_joint.shape[0]):
        if phase.closed[points + stop] == 0:
            joint = phase.stop_joint[stop]
            side = phase.stop_side[stop]
            phase.value[2 * (points + stop)] = side * (state[joint] - phase.stop_limit[stop])
            phase.rate[2 * (points + stop)] = side * state[nv + joint]
    for contact in range(points):
        normal, tangent = contact_velocity(
            model.contact_link[contact], contacts.position[contact], contacts.normal[contact], tree
        )
        phase.value[2 * contact + 1] = 1.0
        if phase.closed[contact] == 0:
            side = 1.0 - 2.0 * phase.passing[contact]
            phase.value[2 * contact] = side * contacts.gap[contact]
            phase.rate[2 * contact] = side * normal
        elif phase.slide[contact] != 0 and phase.group[contact] == contact:
            phase.value[2 * contact + 1] = phase.slide[contact] * tangent


@kernel
def watch_forces(
    count: int,
    candidate: Integers,
    phase: Phase,
    friction: Floats,
    delassus: Floats,
    free: Floats,
    impulse: Floats,
) -> None:
    """Event functions of closed points: normal forces, and what is left to the friction limit."""
    for place in range(count):
        contact = candidate[place]
        phase.value[2 * contact] = 1.0
        if phase.carrier[contact] == 1:
            phase.value[2 * contact] = impulse[2 * place]
        if phase.holder[contact] == 1:
            limit = 0.0
            for other in range(count):
                if phase.group[candidate[other]] == contact:
                    limit += friction[candidate[other]] * impulse[2 * other]
            phase.value[2 * contact + 1] = limit - abs(impulse[2 * place + 1])
        elif phase.slide[contact] != 0 and phase.group[contact] == contact:
            acceleration = free[2 * place + 1]
            for column in range(2 * count):
                acceleration += delassus[2 * place + 1, column] * impulse[column]
            phase.rate[2 * contact + 1] = phase.slide[contact] * acceleration


@kernel
def free_acceleration(
    model: Model, memory: Memory, dry_joint: Integers, slide: Integers, state: Floats
) -> None:
    """Acceleration without contact, A⁻¹ (B Γ + passive + pushes − H), into ``memory.rate``.

    The equations of the state have been evaluated. Dry friction of the joints that move is one of
    the passive forces; `slide` ends with theirs.
    """
    nv = model.parent.shape[0]
    passive_force(model, state[:nv], state[nv:], memory.force)
    add_pushes(model, memory.tree, memory.pushes, memory.force)
    for i in range(model.actuator_joint.shape[0]):
        memory.force[model.actuator_joint[i]] += memory.torque[i]
    first = slide.shape[0] - dry_joint.shape[0]
    dry_force(dry_joint, slide[first:], model.dry_friction, memory.force)
    for i in range(nv):
        memory.rate[i] = memory.force[i] - memory.bias[i]
    solve_mass_matrix(model, memory, memory.rate)


@kernel
def gather_closed(model: Model, memory: Memory, phase: Phase) -> int:
    """Jacobian rows and Delassus matrix of the closed contacts; return their number.

    Dry joints that move are none of them: their friction is known.
    """
    count = 0
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    for contact in range(phase.closed.shape[0]):
        if phase.closed[contact] == 1 and (contact < first or phase.slide[contact] == 0):
            gap_rows(model, memory, phase, contact, count)
            memory.candidate[count] = contact
            count += 1
    if count > 0:
        assemble_delassus(model, memory, count)
    return count


@kernel
def evaluate(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    memory: Memory,
    phase: Phase,
    time: float,
    state: Floats,
    slope: Floats,
    forces: bool,
) -> None:
    """Everything about a state (q, v) that the integration may visit.

    Pose and contact geometry; then, if `forces` are asked for, torque, slope (v, v̇), contact forces
    and all event functions. A continuous controller is asked without letting it remember.
    """
    nv = model.parent.shape[0]
    contacts = memory.contacts
    if forces:
        evaluate_equations(model, state[:nv], state[nv:], memory)
    else:
        forward_kinematics(model, state[:nv], memory.tree)
        link_velocities(model, state[nv:], memory.tree)
    locate_contacts(model, ground, memory)
    watch_geometry(model, contacts, memory.tree, phase, state)
    if not forces:
        return
    if control.continuous == 1:
        consult(controller, control, time, state[:nv], state[nv:], model, memory, memory.torque)
        try_torque(model, state[:nv], state[nv:], memory.torque, memory)
    free_acceleration(model, memory, phase.dry_joint, phase.slide, state)
    count = gather_closed(model, memory, phase)
    phase.closed_count = count
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    for place in range(count):
        contact = memory.candidate[place]
        free_gap_acceleration(model, memory, phase, contact, place)
        memory.answer.impulse[2 * place] = 0.0
        memory.answer.impulse[2 * place + 1] = 0.0
        if contact >= first:
            memory.answer.impulse[2 * place] = model.dry_friction[phase.dry_joint[contact - first]]
    if count > 0:
        size = list_unknowns(
            count, memory.candidate, phase.carrier, phase.holder, phase.slide, memory.friction,
            phase.row, phase.lean,
        )  # fmt: skip
        constraint_matrix(size, phase.row, phase.lean, 1.0, memory.problem.delassus, phase.system)
        for i in range(size):
            phase.system[i, size] = -memory.problem.free[phase.row[i]]
        rank = solve_system(size, phase.system, phase.column, phase.unknown)
        phase.deficient = 1 if rank < size else 0
        for i in range(size):
            memory.answer.impulse[phase.row[i]] += phase.unknown[i]
            if phase.lean[i] != 0.0:
                memory.answer.impulse[phase.row[i] + 1] += phase.lean[i] * phase.unknown[i]
        add_impulse(model, memory, count, memory.rate)
    share_forces(
        count, memory.candidate, memory.answer.impulse, memory.friction, phase.group, phase.holder,
        phase.force,
    )  # fmt: skip
    watch_forces(
        count, memory.candidate, phase, memory.friction, memory.problem.delassus,
        memory.problem.free, memory.answer.impulse,
    )  # fmt: skip
    if count > 0 and phase.deficient == 1:
        share_redundant(count, memory, phase)
    for i in range(nv):
        slope[i] = state[nv + i]
        slope[nv + i] = memory.rate[i]
    for dry in range(phase.dry_joint.shape[0]):
        acceleration = memory.rate[phase.dry_joint[dry]]
        phase.rate[2 * (first + dry) + 1] = phase.slide[first + dry] * acceleration


@kernel
def project(model: Model, ground: GroundModel, memory: Memory, phase: Phase, state: Floats) -> None:
    """Put a state back on its contact constraints, along the shortest way that the masses allow.

    Closed points return to the ground, sticking ones (and joints) to where they began to stick, and
    their velocities along these directions vanish.
    """
    nv = model.parent.shape[0]
    contacts = memory.contacts
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    for attempt in range(5):
        forward_kinematics(model, state[:nv], memory.tree)
        link_velocities(model, state[nv:], memory.tree)
        weigh(model, memory)
        locate_contacts(model, ground, memory)
        count = gather_closed(model, memory, phase)
        if count == 0:
            return
        size = list_unknowns(
            count, memory.candidate, phase.carrier, phase.holder, phase.slide, memory.friction,
            phase.row, phase.lean,
        )  # fmt: skip
        worst = 0.0
        for i in range(size):
            contact = memory.candidate[phase.row[i] // 2]
            error = 0.0
            if phase.row[i] % 2 == 0:
                error = gap_now(contact, contacts, phase, state)
            elif contact >= first:
                error = state[phase.dry_joint[contact - first]] - phase.anchor[contact]
            elif phase.stuck[contact] == 1:
                error = -phase.anchor[contact] + tangential_place(
                    contacts.position[contact], contacts.normal[contact],
                    model.contact_radius[contact], memory.tree.angle[model.contact_link[contact]],
                )  # fmt: skip
            phase.system[i, size] = -error
            worst = max(worst, abs(error))
        positions = worst > 1e-14 and attempt < 4
        if not positions:
            for i in range(size):
                speed = 0.0
                for j in range(nv):
                    speed += memory.jacobian[phase.row[i], j] * state[nv + j]
                phase.system[i, size] = -speed
        constraint_matrix(size, phase.row, phase.lean, 0.0, memory.problem.delassus, phase.system)
        solve_system(size, phase.system, phase.column, phase.unknown)
        for i in range(2 * count):
            memory.answer.impulse[i] = 0.0
        for i in range(size):
            memory.answer.impulse[phase.row[i]] = phase.unknown[i]
        change = state[:nv] if positions else state[nv:]
        add_impulse(model, memory, count, change)
        if not positions:
            return
