"""Contact modes at the beginning of a smooth phase: the acceleration-level problem (eq. 15-19)."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.event_driven.dynamics import tangential_place
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Memory, Tally
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import log_event

TOUCHDOWN = int(EventKind.TOUCHDOWN)
LIFTOFF = int(EventKind.LIFTOFF)
SLIP = int(EventKind.SLIP)
STICK_EVENT = int(EventKind.STICK)
REVERSAL = int(EventKind.SLIP_REVERSAL)
JOINT_STOP = int(EventKind.JOINT_STOP)
JOINT_SLIP = int(EventKind.JOINT_SLIP)
JOINT_STICK = int(EventKind.JOINT_STICK)

# Two normals are one when the sine of the angle between them is below this.
PARALLEL = 1e-9


@kernel
def note_residual(residual: Floats, tally: Tally) -> None:
    """Keep the worst residuals of the run."""
    tally.complementarity = max(tally.complementarity, residual[0])
    tally.cone = max(tally.cone, residual[1])
    tally.non_penetration = max(tally.non_penetration, residual[2])


@kernel
def adopt_modes(
    count: int, candidate: Integers, found: Integers, mode: Integers, phase: Phase
) -> None:
    """Let every closed contact point do what the acceleration-level problem says."""
    dry = phase.closed.shape[0] - phase.dry_joint.shape[0]
    points = dry - phase.stop_joint.shape[0]
    for place in range(count):
        contact = candidate[place]
        mode[contact] = found[place]
        if found[place] == OPEN:
            phase.closed[contact] = 0
            phase.slide[contact] = 0
        elif points <= contact < dry:
            continue
        elif found[place] == SLIP_FORWARD:
            phase.slide[contact] = 1
        elif found[place] == SLIP_BACKWARD:
            phase.slide[contact] = -1


@kernel
def form_groups(
    model: Model,
    position: Floats,
    normal: Floats,
    friction: Floats,
    angle: Floats,
    phase: Phase,
) -> None:
    """Find which closed points hold the same constraints, and which of them carry the forces."""
    contacts = position.shape[0]
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    for stop in range(contacts, first):
        phase.group[stop] = stop
        phase.carrier[stop] = phase.closed[stop]
    for joint in range(first, phase.closed.shape[0]):
        sticks = 1 if phase.slide[joint] == 0 else 0
        phase.group[joint] = joint
        phase.holder[joint] = sticks
        if sticks == 1 and phase.stuck[joint] == 0:
            phase.anchor[joint] = phase.begin[phase.dry_joint[joint - first]]
        phase.stuck[joint] = sticks
    for contact in range(contacts):
        phase.group[contact] = contact
        phase.carrier[contact] = 0
        phase.holder[contact] = 0
        if phase.closed[contact] == 0:
            phase.stuck[contact] = 0
            continue
        for other in range(contact):
            turn = normal[other, 0] * normal[contact, 1] - normal[other, 1] * normal[contact, 0]
            if (
                phase.closed[other] == 1
                and phase.group[other] == other
                and model.contact_link[other] == model.contact_link[contact]
                and abs(turn) < PARALLEL
            ):
                phase.group[contact] = other
                phase.slide[contact] = phase.slide[other]
                break
    for leader in range(contacts):
        if phase.closed[leader] == 0 or phase.group[leader] != leader:
            continue
        first = leader
        last = leader
        low = position[leader, 0] * normal[leader, 1] - position[leader, 1] * normal[leader, 0]
        high = low
        for contact in range(leader + 1, contacts):
            if phase.closed[contact] == 1 and phase.group[contact] == leader:
                along = (
                    position[contact, 0] * normal[leader, 1]
                    - position[contact, 1] * normal[leader, 0]
                )
                if along < low:
                    low = along
                    first = contact
                if along > high:
                    high = along
                    last = contact
        phase.carrier[first] = 1
        phase.carrier[last] = 1
        if phase.slide[leader] == 0 and friction[leader] > 0.0:
            phase.holder[leader] = 1
    for contact in range(contacts):
        if phase.closed[contact] == 1 and phase.slide[contact] != 0:
            phase.stuck[contact] = 0
        elif phase.closed[contact] == 1 and phase.stuck[contact] == 0:
            phase.stuck[contact] = 1
            phase.anchor[contact] = tangential_place(
                position[contact],
                normal[contact],
                model.contact_radius[contact],
                angle[model.contact_link[contact]],
            )


@kernel
def report_modes(time: float, phase: Phase, memory: Memory, record: Record, starting: bool) -> None:
    """Append an event for every contact point whose mode is not the one reported last.

    Points that stand on the ground when the run begins do not touch down.
    """
    closed, was_closed = phase.closed, memory.closed
    dry = closed.shape[0] - phase.dry_joint.shape[0]
    points = dry - phase.stop_joint.shape[0]
    for contact in range(closed.shape[0]):
        now = phase.slide[contact]
        before = memory.slipping[contact]
        landed = closed[contact] == 1 and was_closed[contact] == 0
        if contact >= dry:
            if now != before:
                kind = JOINT_STICK if now == 0 else JOINT_SLIP
                log_event(record, time, kind, phase.dry_joint[contact - dry], 0.0, 0.0)
        elif contact >= points:
            if landed and not starting:
                log_event(record, time, JOINT_STOP, phase.stop_joint[contact - points], 0.0, 0.0)
        elif closed[contact] == 0 and was_closed[contact] == 1:
            log_event(record, time, LIFTOFF, contact, 0.0, 0.0)
        elif closed[contact] == 1:
            if landed:
                before = 0
                if not starting:
                    log_event(record, time, TOUCHDOWN, contact, 0.0, 0.0)
            if now != 0 and before == 0:
                log_event(record, time, SLIP, contact, 0.0, 0.0)
            elif now == 0 and before != 0:
                log_event(record, time, STICK_EVENT, contact, 0.0, 0.0)
            elif now != before:
                log_event(record, time, REVERSAL, contact, 0.0, 0.0)
        was_closed[contact] = closed[contact]
        memory.slipping[contact] = now if closed[contact] == 1 else 0
