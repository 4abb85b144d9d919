"""Contact modes at the beginning of a smooth phase: the acceleration-level problem (eq. 15-19)."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.dynamics import tangential_place
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Assembly, Reaction, Reported
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import (
    JOINT_SLIP,
    JOINT_STICK,
    JOINT_STOP,
    LIFTOFF,
    SLIP,
    STICK,
    TOUCHDOWN,
    log_event,
)

REVERSAL = int(EventKind.SLIP_REVERSAL)

# Two normals are one when the sine of the angle between them is below this, and two points are on
# one line along them when they are no further (m) apart across it.
PARALLEL = 1e-9
ALIGNED = 1e-8


@kernel
def adopt_modes(
    model: Model, count: int, assembly: Assembly, phase: Phase, reaction: Reaction
) -> None:
    """Let every closed contact point do what the acceleration-level problem says."""
    for place in range(count):
        contact, found = assembly.candidate[place], assembly.answer.mode[place]
        reaction.mode[contact] = found
        if found == OPEN:
            phase.closed[contact] = 0
            phase.slide[contact] = 0
        elif model.nc <= contact < phase.first_dry:
            continue
        elif found == SLIP_FORWARD:
            phase.slide[contact] = 1
        elif found == SLIP_BACKWARD:
            phase.slide[contact] = -1


@kernel
def form_groups(
    model: Model, tree: Workspace, contacts: Contacts, friction: Floats, phase: Phase
) -> None:
    """Find which closed contacts hold the same constraints, and which of them carry the forces."""
    for contact in range(phase.watched):
        phase.group[contact] = contact
        phase.carrier[contact] = 0
        phase.holder[contact] = 0
        if model.nc <= contact < phase.first_dry:
            phase.carrier[contact] = phase.closed[contact]
        elif phase.first_dry <= contact < phase.first_second:
            sticks = 1 if phase.closed[contact] == 1 and phase.slide[contact] == 0 else 0
            phase.holder[contact] = sticks
            if sticks == 1 and phase.stuck[contact] == 0:
                joint = phase.dry_joint[contact - phase.first_dry]
                phase.anchor[contact] = phase.begin[joint]
            phase.stuck[contact] = sticks
        elif phase.closed[contact] == 1:
            join_group(model, contacts, contact, phase)
    for leader in range(phase.watched):
        if model.nc <= leader < phase.first_second:
            continue
        if phase.closed[leader] == 1 and phase.group[leader] == leader:
            find_carriers(model, contacts, leader, phase)
            if agree(leader, friction, phase) and phase.slide[leader] == 0:
                phase.holder[leader] = 1
    for contact in range(phase.watched):
        if model.nc <= contact < phase.first_second:
            continue
        sticks = phase.closed[contact] == 1 and phase.slide[contact] == 0
        if sticks and phase.stuck[contact] == 0:
            phase.anchor[contact] = tangential_place(model, tree, contacts, contact, phase)
        phase.stuck[contact] = 1 if sticks else 0


@kernel
def normal_of(contact: int, contacts: Contacts, phase: Phase) -> tuple[float, float]:
    """Normal of the face that a contact point is on."""
    if contact >= phase.first_second:
        normal = phase.seconds.normal[contact - phase.first_second]
        return normal[0], normal[1]
    return contacts.normal[contact, 0], contacts.normal[contact, 1]


@kernel
def link_of(contact: int, model: Model, phase: Phase) -> int:
    """Link of a contact point."""
    point = contact - phase.first_second if contact >= phase.first_second else contact
    return int(model.contact_link[point])


@kernel
def join_group(model: Model, contacts: Contacts, contact: int, phase: Phase) -> None:
    """Let a closed point join the group of its link and line, if there is one before it.

    Points on two steps of a stair move alike too, but a tangential force acts on another line.
    """
    x, z = normal_of(contact, contacts, phase)
    height = place_along(contact, -z, x, contacts, phase)
    link = link_of(contact, model, phase)
    for other in range(contact):
        if phase.closed[other] == 0 or phase.group[other] != other:
            continue
        if model.nc <= other < phase.first_second or link_of(other, model, phase) != link:
            continue
        its_x, its_z = normal_of(other, contacts, phase)
        if abs(its_x * z - its_z * x) > PARALLEL or its_x * x + its_z * z < 0.0:
            continue
        if abs(place_along(other, -z, x, contacts, phase) - height) < ALIGNED:
            phase.group[contact] = other
            return


@kernel
def place_along(contact: int, x: float, z: float, contacts: Contacts, phase: Phase) -> float:
    """Where a contact point is along the face with a normal."""
    if contact >= phase.first_second:
        position = phase.seconds.position[contact - phase.first_second]
        return float(position[0] * z - position[1] * x)
    return float(contacts.position[contact, 0] * z - contacts.position[contact, 1] * x)


@kernel
def find_carriers(model: Model, contacts: Contacts, leader: int, phase: Phase) -> None:
    """Let the outermost points of a group carry its normal forces."""
    x, z = normal_of(leader, contacts, phase)
    first = leader
    last = leader
    low = place_along(leader, x, z, contacts, phase)
    high = low
    for contact in range(leader + 1, phase.watched):
        if model.nc <= contact < phase.first_second:
            continue
        if phase.closed[contact] == 1 and phase.group[contact] == leader:
            along = place_along(contact, x, z, contacts, phase)
            if along < low:
                low = along
                first = contact
            if along > high:
                high = along
                last = contact
    phase.carrier[first] = 1
    phase.carrier[last] = 1


@kernel
def agree(leader: int, friction: Floats, phase: Phase) -> bool:
    """Let a group slide as its first point does; return whether one that carries it has friction.

    What a point without friction does of itself says nothing of the others.
    """
    slide = phase.slide[leader]
    rubs = friction[leader] > 0.0 and phase.carrier[leader] == 1
    known = friction[leader] > 0.0
    for contact in range(leader + 1, phase.watched):
        carries = phase.group[contact] == leader and phase.carrier[contact] == 1
        if carries and friction[contact] > 0.0:
            slide = slide if known else phase.slide[contact]
            rubs, known = True, True
    for contact in range(leader + 1, phase.watched):
        if phase.closed[contact] == 1 and phase.group[contact] == leader:
            phase.slide[contact] = slide
    phase.slide[leader] = slide
    return rubs


@kernel
def report_modes(
    model: Model, time: float, starting: bool, phase: Phase, reported: Reported, record: Record
) -> None:
    """Append an event for every contact point whose mode is not the one reported last.

    Points that stand on the ground when the run begins do not touch down.
    """
    closed, was_closed = phase.closed, reported.closed
    for contact in range(phase.watched):
        now = phase.slide[contact]
        before = reported.slipping[contact]
        landed = closed[contact] == 1 and was_closed[contact] == 0
        if contact >= phase.first_second:
            pass  # its point is on the ground with the first face
        elif contact >= phase.first_dry:
            if now != before and closed[contact] == 1:
                kind = JOINT_STICK if now == 0 else JOINT_SLIP
                joint = phase.dry_joint[contact - phase.first_dry]
                log_event(time, kind, joint, 0.0, 0.0, record)
        elif contact >= model.nc:
            if landed and not starting:
                joint = phase.stop_joint[contact - model.nc]
                log_event(time, JOINT_STOP, joint, 0.0, 0.0, record)
        elif closed[contact] == 0 and was_closed[contact] == 1:
            log_event(time, LIFTOFF, contact, 0.0, 0.0, record)
        elif closed[contact] == 1:
            if landed:
                before = 0
                if not starting:
                    log_event(time, TOUCHDOWN, contact, 0.0, 0.0, record)
            if now != before:
                kind = SLIP if before == 0 else STICK if now == 0 else REVERSAL
                log_event(time, kind, contact, 0.0, 0.0, record)
        was_closed[contact] = closed[contact]
        reported.slipping[contact] = now if closed[contact] == 1 else 0
