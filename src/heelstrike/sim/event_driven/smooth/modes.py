"""Contact modes at the beginning of a smooth phase: the acceleration-level problem (eq. 15-19)."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.rows import (
    CONSTRAINT,
    DRY_JOINT,
    SECOND_FACE,
    STOP,
    Rows,
    is_of_ground,
)
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Modes
from heelstrike.sim.event_driven.smooth.projection import tangential_place
from heelstrike.sim.memory import Assembly, Reported
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import (
    CONSTRAINT_HOLDS,
    CONSTRAINT_LETS_GO,
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
def adopt_modes(count: int, assembly: Assembly, rows: Rows, modes: Modes, mode: Integers) -> None:
    """Let every closed contact point do what the acceleration-level problem says."""
    for place in range(count):
        contact, found = assembly.candidate[place], assembly.answer.mode[place]
        mode[contact] = found
        if found == OPEN:
            modes.closed[contact] = 0
            modes.slide[contact] = 0
        elif rows.kind[contact] in (STOP, CONSTRAINT):
            continue
        elif found == SLIP_FORWARD:
            modes.slide[contact] = 1
        elif found == SLIP_BACKWARD:
            modes.slide[contact] = -1


@kernel
def form_groups(
    model: Model, angle: Floats, contacts: Contacts, friction: Floats, rows: Rows,
    seconds: Contacts, face: Integers, begin: Floats, modes: Modes,
) -> None:  # fmt: skip
    """Find which closed contacts hold the same constraints, and which of them carry the forces."""
    for contact in range(modes.watched):
        modes.group[contact] = contact
        modes.carrier[contact] = 0
        modes.holder[contact] = 0
        if rows.kind[contact] in (STOP, CONSTRAINT):
            modes.carrier[contact] = modes.closed[contact]
        elif rows.kind[contact] == DRY_JOINT:
            sticks = 1 if modes.closed[contact] == 1 and modes.slide[contact] == 0 else 0
            modes.holder[contact] = sticks
            if sticks == 1 and modes.stuck[contact] == 0:
                joint = rows.owner[contact]
                modes.anchor[contact] = begin[joint]
            modes.stuck[contact] = sticks
        elif modes.closed[contact] == 1:
            join_group(model, contacts, contact, rows, seconds, modes)
    for leader in range(modes.watched):
        if not is_of_ground(leader, rows):
            continue
        if modes.closed[leader] == 1 and modes.group[leader] == leader:
            find_carriers(contacts, leader, rows, seconds, modes)
            if agree(leader, friction, modes) and modes.slide[leader] == 0:
                modes.holder[leader] = 1
    for contact in range(modes.watched):
        if not is_of_ground(contact, rows):
            continue
        sticks = modes.closed[contact] == 1 and modes.slide[contact] == 0
        if sticks and modes.stuck[contact] == 0:
            modes.anchor[contact] = tangential_place(
                model, angle, contacts, contact, rows, seconds, face
            )
        modes.stuck[contact] = 1 if sticks else 0


@kernel
def normal_of(
    contact: int, contacts: Contacts, rows: Rows, seconds: Contacts
) -> tuple[float, float]:
    """Normal of the face that a contact point is on."""
    if rows.kind[contact] == SECOND_FACE:
        normal = seconds.normal[rows.owner[contact]]
        return normal[0], normal[1]
    return contacts.normal[contact, 0], contacts.normal[contact, 1]


@kernel
def link_of(contact: int, model: Model, rows: Rows) -> int:
    """Link of a contact point."""
    return int(model.contact_link[rows.owner[contact]])


@kernel
def join_group(
    model: Model, contacts: Contacts, contact: int, rows: Rows, seconds: Contacts, modes: Modes
) -> None:
    """Let a closed point join the group of its link and line, if there is one before it.

    Points on two steps of a stair move alike too, but a tangential force acts on another line.
    """
    x, z = normal_of(contact, contacts, rows, seconds)
    height = place_along(contact, -z, x, contacts, rows, seconds)
    link = link_of(contact, model, rows)
    for other in range(contact):
        if modes.closed[other] == 0 or modes.group[other] != other:
            continue
        if not is_of_ground(other, rows) or link_of(other, model, rows) != link:
            continue
        its_x, its_z = normal_of(other, contacts, rows, seconds)
        if abs(its_x * z - its_z * x) > PARALLEL or its_x * x + its_z * z < 0.0:
            continue
        if abs(place_along(other, -z, x, contacts, rows, seconds) - height) < ALIGNED:
            modes.group[contact] = other
            return


@kernel
def place_along(
    contact: int, x: float, z: float, contacts: Contacts, rows: Rows, seconds: Contacts
) -> float:
    """Where a contact point is along the face with a normal."""
    if rows.kind[contact] == SECOND_FACE:
        position = seconds.position[rows.owner[contact]]
        return float(position[0] * z - position[1] * x)
    return float(contacts.position[contact, 0] * z - contacts.position[contact, 1] * x)


@kernel
def find_carriers(
    contacts: Contacts, leader: int, rows: Rows, seconds: Contacts, modes: Modes
) -> None:
    """Let the outermost points of a group carry its normal forces."""
    x, z = normal_of(leader, contacts, rows, seconds)
    first = leader
    last = leader
    low = place_along(leader, x, z, contacts, rows, seconds)
    high = low
    for contact in range(leader + 1, modes.watched):
        if not is_of_ground(contact, rows):
            continue
        if modes.closed[contact] == 1 and modes.group[contact] == leader:
            along = place_along(contact, x, z, contacts, rows, seconds)
            if along < low:
                low = along
                first = contact
            if along > high:
                high = along
                last = contact
    modes.carrier[first] = 1
    modes.carrier[last] = 1


@kernel
def agree(leader: int, friction: Floats, modes: Modes) -> bool:
    """Let a group slide as its first point does; return whether one that carries it has friction.

    What a point without friction does of itself says nothing of the others.
    """
    slide = modes.slide[leader]
    rubs = friction[leader] > 0.0 and modes.carrier[leader] == 1
    known = friction[leader] > 0.0
    for contact in range(leader + 1, modes.watched):
        carries = modes.group[contact] == leader and modes.carrier[contact] == 1
        if carries and friction[contact] > 0.0:
            slide = slide if known else modes.slide[contact]
            rubs, known = True, True
    for contact in range(leader + 1, modes.watched):
        if modes.closed[contact] == 1 and modes.group[contact] == leader:
            modes.slide[contact] = slide
    modes.slide[leader] = slide
    return rubs


@kernel
def report_modes(
    time: float, starting: bool, rows: Rows, modes: Modes, reported: Reported, record: Record
) -> None:
    """Append an event for every contact point whose mode is not the one reported last.

    Points that stand on the ground when the run begins do not touch down.
    """
    closed, was_closed = modes.closed, reported.closed
    for contact in range(modes.watched):
        now = modes.slide[contact]
        before = reported.slipping[contact]
        landed = closed[contact] == 1 and was_closed[contact] == 0
        kind = rows.kind[contact]
        if kind == SECOND_FACE:
            pass  # its point is on the ground with the first face
        elif kind == DRY_JOINT:
            if now != before and closed[contact] == 1:
                told = JOINT_STICK if now == 0 else JOINT_SLIP
                joint = rows.owner[contact]
                log_event(time, told, joint, 0.0, 0.0, record)
        elif kind == STOP:
            if landed and not starting:
                joint = rows.owner[contact]
                log_event(time, JOINT_STOP, joint, 0.0, 0.0, record)
        elif kind == CONSTRAINT:
            number = rows.owner[contact]
            if landed and not starting:
                log_event(time, CONSTRAINT_HOLDS, number, 0.0, 0.0, record)
            elif closed[contact] == 0 and was_closed[contact] == 1:
                log_event(time, CONSTRAINT_LETS_GO, number, 0.0, 0.0, record)
        elif closed[contact] == 0 and was_closed[contact] == 1:
            log_event(time, LIFTOFF, contact, 0.0, 0.0, record)
        elif closed[contact] == 1:
            if landed:
                before = 0
                if not starting:
                    log_event(time, TOUCHDOWN, contact, 0.0, 0.0, record)
            if now != before:
                told = SLIP if before == 0 else STICK if now == 0 else REVERSAL
                log_event(time, told, contact, 0.0, 0.0, record)
        was_closed[contact] = closed[contact]
        reported.slipping[contact] = now if closed[contact] == 1 else 0
