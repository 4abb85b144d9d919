"""Impacts: the velocity-level problem with restitution (paper eq. 20-22), and where bounces end."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import SOLVED
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    evaluate_equations,
    locate_contacts,
)
from heelstrike.sim.event_driven.candidates import solve_candidates
from heelstrike.sim.event_driven.dynamics import (
    free_acceleration,
    gather_closed,
)
from heelstrike.sim.event_driven.gaps import free_gap_acceleration, gap_rows, gap_velocity
from heelstrike.sim.event_driven.modes import note_residual
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Memory
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import log_event

TOUCHDOWN = int(EventKind.TOUCHDOWN)
IMPACT = int(EventKind.IMPACT)
ENERGY_GAIN = int(EventKind.ENERGY_GAIN)
JOINT_STOP = int(EventKind.JOINT_STOP)

# Velocities (m/s) up to which a point on the ground is at rest.
REST = 1e-9
# Energy counts as made when it exceeds this part of the energy that went through the contacts.
NOTICEABLE = 1e-9
# Bounces shorter than this (s) are not followed: their limit is computed.
SHORTEST_BOUNCE = 1e-6
# Ratio of successive bounces beyond which there is no limit in sight.
PERPETUAL = 0.999999


@kernel
def row_velocity(row: int, jacobian: Floats, state: Floats) -> float:
    """Velocity along a Jacobian row."""
    nv = jacobian.shape[1]
    total = 0.0
    for j in range(nv):
        total += jacobian[row, j] * state[nv + j]
    return total


@kernel
def heading(speed: float) -> int:
    """Whether something slides, and where to: -1, 0 or 1."""
    if speed > REST:
        return 1
    return -1 if speed < -REST else 0


@kernel
def collide(
    model: Model, memory: Memory, phase: Phase, state: Floats, nudge: float
) -> tuple[bool, float]:
    """Let the points on the ground, and those that reach it now, change the velocities of `state`.

    The equations of `state` have been evaluated. Normal velocities w and impulses p obey
    ``w⁺ + e w⁻ ≥ 0 ⟂ p ≥ 0``, tangential ones Coulomb's law. All points are taken to approach the
    ground faster by `nudge`: where zero impulse is one solution of several, that singles out
    another. Dry friction of the joints is a finite force, and takes no part.

    Returns whether it was solved, and the energy it made relative to what went through the
    contacts. The impulses go to ``phase.impulse``; ``phase.closed`` and ``phase.slide`` become
    those after the impact.
    """
    nv = model.parent.shape[0]
    count = 0
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    for contact in range(first):
        phase.impulse[contact, 0] = 0.0
        phase.impulse[contact, 1] = 0.0
        if phase.closed[contact] == 0 and phase.hit[contact] == 0:
            continue
        gap_rows(model, memory, phase, contact, count)
        normal = row_velocity(2 * count, memory.jacobian, state)
        if normal < 0.0 and phase.plastic[contact] == 0:
            normal += memory.restitution[contact] * normal
        memory.problem.free[2 * count] = normal - nudge
        memory.problem.free[2 * count + 1] = row_velocity(2 * count + 1, memory.jacobian, state)
        memory.candidate[count] = contact
        count += 1
    if count == 0:
        return True, 0.0
    assemble_delassus(model, memory, count)
    status = solve_candidates(count, memory, phase.slide, False, phase.order)
    note_residual(memory.answer.residual, memory.tally)
    made = 0.0
    through = 0.0
    for row in range(2 * count):
        work = memory.answer.impulse[row] * row_velocity(row, memory.jacobian, state)
        made += work
        through += abs(work)
    add_impulse(model, memory, count, state[nv:])
    for place in range(count):
        contact = memory.candidate[place]
        row = 2 * place
        normal = row_velocity(row, memory.jacobian, state)
        tangent = row_velocity(row + 1, memory.jacobian, state)
        made += memory.answer.impulse[row] * normal + memory.answer.impulse[row + 1] * tangent
        through += abs(memory.answer.impulse[row] * normal) + abs(
            memory.answer.impulse[row + 1] * tangent
        )
        phase.impulse[contact, 0] = memory.answer.impulse[row]
        phase.impulse[contact, 1] = memory.answer.impulse[row + 1]
        phase.closed[contact] = 0
        phase.slide[contact] = 0
        if normal <= REST or phase.plastic[contact] == 1:
            phase.closed[contact] = 1
            phase.slide[contact] = heading(tangent)
    for dry in range(phase.dry_joint.shape[0]):
        phase.slide[first + dry] = heading(state[nv + phase.dry_joint[dry]])
    return status == SOLVED, made / through if through > 0.0 else 0.0


@kernel
def short_bounces(
    model: Model, ground: GroundModel, memory: Memory, phase: Phase, state: Floats
) -> bool:
    """Mark the points that would come down again too soon to follow; return whether there are any.

    Their bounces are taken to go on shrinking in the ratio of the next to the last; the geometric
    series gives the time at which they end.
    """
    nv = model.parent.shape[0]
    time = phase.time
    evaluate_equations(model, state[:nv], state[nv:], memory)
    locate_contacts(model, ground, memory)
    free_acceleration(model, memory, phase.dry_joint, phase.slide, state)
    count = gather_closed(model, memory, phase)
    for place in range(count):
        free_gap_acceleration(model, memory, phase, memory.candidate[place], place)
    if count > 0:
        solve_candidates(count, memory, phase.slide, True, phase.order)
        add_impulse(model, memory, count, memory.rate)
    found = False
    for contact in range(phase.closed.shape[0]):
        touched = phase.hit[contact] == 1 or memory.closed[contact] == 1
        if phase.closed[contact] == 1 or not touched:
            continue
        gap_rows(model, memory, phase, contact, count)
        free_gap_acceleration(model, memory, phase, contact, count)
        normal, _ = gap_velocity(contact, model, memory.contacts, memory.tree, phase, state)
        pull = -memory.problem.free[2 * count]
        if not (pull > 0.0 and 2.0 * normal <= SHORTEST_BOUNCE * pull):
            continue
        bounce = 2.0 * normal / pull
        last = time - phase.last_blow
        if memory.closed[contact] == 0:
            last = time - phase.last_impact[contact]
        ratio = bounce / last
        if not ratio < PERPETUAL:
            ratio = min(memory.restitution[contact], PERPETUAL)
        phase.plastic[contact] = 1
        phase.accumulation[contact] = time + bounce / (1.0 - ratio)
        found = True
    return found


@kernel
def strike(model: Model, ground: GroundModel, memory: Memory, record: Record, phase: Phase) -> bool:
    """Let the points in ``phase.hit`` meet the ground now, and report it; return success.

    The equations of now have been evaluated. ``memory.closed`` and ``memory.slipping`` still hold
    the modes from before.
    """
    state, before = phase.begin, phase.end
    contacts = phase.closed.shape[0] - phase.dry_joint.shape[0]
    points = contacts - phase.stop_joint.shape[0]
    time = phase.time
    for i in range(state.shape[0]):
        before[i] = state[i]
    made = 0.0
    for attempt in range(2):
        solved, made = collide(model, memory, phase, state, 0.0)
        if not solved:
            return False
        if attempt == 1 or not short_bounces(model, ground, memory, phase, state):
            break
        for i in range(state.shape[0]):
            state[i] = before[i]
        for contact in range(contacts):
            phase.closed[contact] = memory.closed[contact]
            phase.slide[contact] = memory.slipping[contact]
    phase.last_blow = time
    largest = 0
    for contact in range(contacts):
        normal = phase.impulse[contact, 0]
        tangent = phase.impulse[contact, 1]
        phase.plastic[contact] = 0
        if phase.hit[contact] == 1:
            phase.last_impact[contact] = time
        if contact >= points:
            if normal > 0.0:
                memory.closed[contact] = 1
                joint = phase.stop_joint[contact - points]
                log_event(record, time, JOINT_STOP, joint, normal, 0.0)
            continue
        if normal > phase.impulse[largest, 0]:
            largest = contact
        if normal > 0.0 and memory.closed[contact] == 0:
            memory.closed[contact] = 1
            memory.slipping[contact] = 0
            log_event(record, time, TOUCHDOWN, contact, normal, tangent)
        elif normal > 0.0:
            log_event(record, time, IMPACT, contact, normal, tangent)
    if made > NOTICEABLE:
        log_event(
            record, time, ENERGY_GAIN, largest, phase.impulse[largest, 0],
            phase.impulse[largest, 1],
        )  # fmt: skip
    return True
