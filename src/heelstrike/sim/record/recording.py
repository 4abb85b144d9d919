"""What every way through time does around its step: limits, events, rows and worst values."""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground import GroundModel, ground_height
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.geometry import contact_velocity
from heelstrike.sim.memory import Memory, Tally
from heelstrike.sim.record.record import Record

TOUCHDOWN = int(EventKind.TOUCHDOWN)
LIFTOFF = int(EventKind.LIFTOFF)
SLIP = int(EventKind.SLIP)
STICK = int(EventKind.STICK)
JOINT_STOP = int(EventKind.JOINT_STOP)
JOINT_SLIP = int(EventKind.JOINT_SLIP)
JOINT_STICK = int(EventKind.JOINT_STICK)

# A contact point has left the ground when its gap exceeds this (m), and slips above this (m/s).
LIFTOFF_GAP = 1e-7
SLIP_SPEED = 1e-6
# A point that comes down faster than this (m/s) when the run begins touches down; others stand.
STANDING_SPEED = 1e-6
INFINITY = float("inf")


@dissolved_kernel
def limit_torque(model: Model, memory: Memory) -> bool:
    """Clip the torques to their limits; return whether all were finite."""
    for i in range(model.actuator_joint.shape[0]):
        wanted = memory.torque[i]
        if not abs(wanted) < INFINITY:
            memory.tally.bad_torque = i
            return False
        if wanted > model.torque_upper[i]:
            memory.torque[i] = model.torque_upper[i]
            memory.tally.saturations += 1
        elif wanted < model.torque_lower[i]:
            memory.torque[i] = model.torque_lower[i]
            memory.tally.saturations += 1
    return True


@kernel
def try_torque(model: Model, q: Floats, v: Floats, torque: Floats, memory: Memory) -> None:
    """Clip torques that a controller was asked for within a step, at a state that may be no good.

    Keeps in mind which of them was not finite when it was last asked at a state that was.
    """
    bad = 0
    for i in range(torque.shape[0]):
        if not abs(torque[i]) < INFINITY:
            bad = i + 1
        elif torque[i] > model.torque_upper[i]:
            torque[i] = model.torque_upper[i]
        elif torque[i] < model.torque_lower[i]:
            torque[i] = model.torque_lower[i]
    for i in range(v.shape[0]):
        if not (abs(q[i]) < INFINITY and abs(v[i]) < INFINITY):
            return
    memory.tally.bad_trial = bad


@kernel
def note_residual(residual: Floats, tally: Tally) -> None:
    """Keep the worst residuals of the run."""
    tally.complementarity = max(tally.complementarity, residual[0])
    tally.cone = max(tally.cone, residual[1])
    tally.non_penetration = max(tally.non_penetration, residual[2])


@kernel
def log_event(
    time: float, kind: int, place: int, normal: float, tangent: float, record: Record
) -> None:
    """Append an event at a contact point or joint, with its impulse."""
    event = record.events
    record.event_time[event] = time
    record.event_kind[event] = kind
    record.event_contact[event] = place
    record.event_impulse[event, 0] = normal
    record.event_impulse[event, 1] = tangent
    record.events = event + 1


@dissolved_kernel
def note_extremes(model: Model, memory: Memory) -> None:
    """Keep the worst penetration and residuals of the run."""
    tally = memory.tally
    for contact in range(model.contact_link.shape[0]):
        tally.penetration = max(tally.penetration, -memory.contacts.gap[contact])
    note_residual(memory.assembly.answer.residual, tally)


@kernel
def note_event(record: Record, time: float, kind: int, contact: int, memory: Memory) -> None:
    """Append an event; its impulse is that of the step it happened in."""
    force = memory.contacts.force
    log_event(time, kind, contact, force[contact, 0], force[contact, 1], record)


@dissolved_kernel
def note_events(model: Model, record: Record, time: float, step: float, memory: Memory) -> None:
    """Find touchdowns, lift-offs and changes between stick and slip of this step.

    An impulse closes a contact by the end of the step; a gap opens it at the start of a step.
    Points that already stand on the ground when the run begins do not touch down, and joints that
    rest at a stop do not reach it. Joints with dry friction come to rest, or begin to move.
    """
    for contact in range(model.contact_link.shape[0]):
        pushed = memory.contacts.force[contact, 0] > 0.0
        first = record.events
        if memory.reported.closed[contact] == 0 and pushed:
            memory.reported.closed[contact] = 1
            memory.reported.slipping[contact] = 0
            stood = memory.tally.steps == 0 and memory.contacts.gap[contact] <= LIFTOFF_GAP
            if stood:
                normal, _ = contact_velocity(model, memory.equations.tree, memory.contacts, contact)
                stood = normal >= -STANDING_SPEED
            if not stood:
                note_event(record, time + step, TOUCHDOWN, contact, memory)
        elif (
            memory.reported.closed[contact] == 1
            and not pushed
            and memory.contacts.gap[contact] > LIFTOFF_GAP
        ):
            memory.reported.closed[contact] = 0
            memory.reported.slipping[contact] = 0
            note_event(record, time, LIFTOFF, contact, memory)
        if memory.reported.closed[contact] == 1 and pushed:
            slips = abs(memory.reaction.slip[contact]) > SLIP_SPEED
            if slips and memory.reported.slipping[contact] == 0:
                memory.reported.slipping[contact] = 1
                note_event(record, time + step, SLIP, contact, memory)
            elif not slips and memory.reported.slipping[contact] == 1:
                memory.reported.slipping[contact] = 0
                note_event(record, time + step, STICK, contact, memory)
        for place in range(first, record.events):
            record.event_impulse[place, 0] *= step
            record.event_impulse[place, 1] *= step
    for joint in range(model.parent.shape[0]):
        pushed = memory.reaction.stop_torque[joint] != 0.0
        if not pushed and memory.reported.stopped[joint] == 0:
            continue
        way = min(memory.q[joint] - model.lower[joint], model.upper[joint] - memory.q[joint])
        stood = (
            memory.tally.steps == 0
            and way <= LIFTOFF_GAP
            and abs(memory.v[joint]) <= STANDING_SPEED
        )
        if pushed and memory.reported.stopped[joint] == 0 and not stood:
            impulse = abs(memory.reaction.stop_torque[joint]) * step
            log_event(time + step, JOINT_STOP, joint, impulse, 0.0, record)
        if pushed:
            memory.reported.stopped[joint] = 1
        elif way > LIFTOFF_GAP:
            memory.reported.stopped[joint] = 0
    for dry in range(memory.dry_joint.shape[0]):
        rests = abs(memory.next_v[memory.dry_joint[dry]]) <= SLIP_SPEED
        if memory.reported.resting[dry] == -1:
            memory.reported.resting[dry] = (
                1 if abs(memory.v[memory.dry_joint[dry]]) <= SLIP_SPEED else 0
            )
        if rests != (memory.reported.resting[dry] == 1):
            kind = JOINT_STICK if rests else JOINT_SLIP
            log_event(time + step, kind, memory.dry_joint[dry], 0.0, 0.0, record)
            memory.reported.resting[dry] = 1 if rests else 0


@dissolved_kernel
def note_row(record: Record, time: float, memory: Memory) -> None:
    """Append the state now and what acts on it to the record."""
    row = record.rows
    record.time[row] = time
    for i in range(memory.v.shape[0]):
        record.q[row, i] = memory.q[i]
        record.v[row, i] = memory.v[i]
        record.stop_torque[row, i] = memory.reaction.stop_torque[i]
        record.friction_torque[row, i] = memory.reaction.friction_torque[i]
    for i in range(memory.torque.shape[0]):
        record.torque[row, i] = memory.torque[i]
    contacts = memory.contacts
    for i in range(memory.reaction.slip.shape[0]):
        for k in range(2):
            record.point[row, i, k] = contacts.position[i, k]
            record.normal[row, i, k] = contacts.normal[i, k]
            record.force[row, i, k] = contacts.force[i, k]
        record.gap[row, i] = contacts.gap[i]
        record.slip[row, i] = memory.reaction.slip[i]
    for k in range(3):
        record.residual[row, k] = memory.assembly.answer.residual[k]
    record.rows = row + 1


@kernel
def note_row_when_due(record: Record, memory: Memory, clock: Clock) -> int:
    """Append a row if one is due, every so many steps and at the end; return which, or -1."""
    if clock.index % clock.record_every != 0 and clock.finishing == 0:
        return -1
    note_row(record, clock.time, memory)
    return int(record.rows - 1)


@dissolved_kernel
def center_height(model: Model, ground: GroundModel, memory: Memory) -> float:
    """Height of the centre of mass above the ground below it."""
    tree = memory.equations.tree
    mass = 0.0
    x = 0.0
    z = 0.0
    for i in range(model.parent.shape[0]):
        mass += tree.inertia[i, 0]
        x += tree.inertia[i, 1]
        z += tree.inertia[i, 2]
    below = ground_height(ground, tree.pivot[0] + x / mass)
    return tree.pivot[1] + z / mass - below


@dissolved_kernel
def sound(memory: Memory) -> bool:
    """Whether the state is finite and not absurd."""
    for i in range(memory.v.shape[0]):
        if not (abs(memory.q[i]) < 1e9 and abs(memory.v[i]) < 1e6):
            return False
    return True
