"""Contact modes at the beginning of a smooth phase: the acceleration-level problem (eq. 15-19)."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, POINT, STOP, Rows, is_of_ground
from heelstrike.sim.event_driven.phase import Modes
from heelstrike.sim.event_driven.smooth.projection import tangential_place
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
def adopt_modes(
    count: int, candidate: Integers, found: Integers, rows: Rows, closed: Integers,
    slide: Integers, guess: Integers,
) -> None:  # fmt: skip
    """Let every closed contact point do what the acceleration-level problem says."""
    for place in range(count):
        contact, mode = candidate[place], found[place]
        guess[contact] = mode
        if mode == OPEN:
            closed[contact] = 0
            slide[contact] = 0
        elif rows.kind[contact] in (STOP, CONSTRAINT):
            continue
        elif mode == SLIP_FORWARD:
            slide[contact] = 1
        elif mode == SLIP_BACKWARD:
            slide[contact] = -1


@kernel
def form_groups(
    model: Model, angle: Floats, q: Floats, friction: Floats, rows: Rows, modes: Modes
) -> None:
    """Find which closed contacts hold the same constraints, and which of them carry the forces."""
    closed, slide, stuck = modes.closed, modes.slide, modes.stuck
    for contact in range(modes.watched):
        modes.group[contact] = contact
        modes.carrier[contact] = 0
        modes.holder[contact] = 0
        if rows.kind[contact] in (STOP, CONSTRAINT):
            modes.carrier[contact] = closed[contact]
        elif rows.kind[contact] == DRY_JOINT:
            modes.holder[contact] = 1 if closed[contact] == 1 and slide[contact] == 0 else 0
        elif closed[contact] == 1:
            join_group(contact, model, rows, modes)
    for leader in range(modes.watched):
        if not is_of_ground(leader, rows):
            continue
        if closed[leader] == 1 and modes.group[leader] == leader:
            find_carriers(leader, rows, modes)
            if agree(leader, friction, modes) and slide[leader] == 0:
                modes.holder[leader] = 1
    for contact in range(modes.watched):
        if rows.kind[contact] in (STOP, CONSTRAINT):
            continue
        sticks = closed[contact] == 1 and slide[contact] == 0
        if sticks and stuck[contact] == 0:
            modes.anchor[contact] = tangential_place(contact, model, angle, q, rows, modes.face)
        stuck[contact] = 1 if sticks else 0


@kernel
def join_group(contact: int, model: Model, rows: Rows, modes: Modes) -> None:
    """Let a closed point join the group of its link and line, if there is one before it.

    Points on two steps of a stair move alike too, but a tangential force acts on another line.
    """
    x, z = rows.normal[contact, 0], rows.normal[contact, 1]
    height = place_along(contact, -z, x, rows)
    link = model.contact_link[rows.owner[contact]]
    for other in range(contact):
        if modes.closed[other] == 0 or modes.group[other] != other:
            continue
        if not is_of_ground(other, rows):
            continue
        its_x, its_z = rows.normal[other, 0], rows.normal[other, 1]
        if model.contact_link[rows.owner[other]] != link:
            continue
        if abs(its_x * z - its_z * x) > PARALLEL or its_x * x + its_z * z < 0.0:
            continue
        if abs(place_along(other, -z, x, rows) - height) < ALIGNED:
            modes.group[contact] = other
            return


@kernel
def place_along(contact: int, x: float, z: float, rows: Rows) -> float:
    """Where a contact point is along the face with a normal."""
    return float(rows.position[contact, 0] * z - rows.position[contact, 1] * x)


@kernel
def find_carriers(leader: int, rows: Rows, modes: Modes) -> None:
    """Let the outermost points of a group carry its normal forces."""
    x, z = rows.normal[leader, 0], rows.normal[leader, 1]
    first = last = leader
    low = high = place_along(leader, x, z, rows)
    for contact in range(leader + 1, modes.watched):
        if modes.closed[contact] == 1 and modes.group[contact] == leader:
            along = place_along(contact, x, z, rows)
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
    time: float, starting: bool, watched: int, kind: Integers, owner: Integers, closed: Integers,
    slide: Integers, was_closed: Integers, slipping: Integers, record: Record,
) -> None:  # fmt: skip
    """Append an event for every contact whose mode is not the one reported last.

    `kind` and `owner` are those of the table. Points that stand on the ground when the run begins
    do not touch down. A second face is no news: its point is on the ground with the first.
    """
    for contact in range(watched):
        now, before = slide[contact], slipping[contact]
        touches = closed[contact] == 1
        landed = touches and was_closed[contact] == 0
        if kind[contact] == DRY_JOINT:
            if now != before and touches:
                told = JOINT_STICK if now == 0 else JOINT_SLIP
                log_event(time, told, owner[contact], 0.0, 0.0, record.told)
        elif kind[contact] == STOP:
            if landed and not starting:
                log_event(time, JOINT_STOP, owner[contact], 0.0, 0.0, record.told)
        elif kind[contact] == CONSTRAINT:
            if landed and not starting:
                log_event(time, CONSTRAINT_HOLDS, owner[contact], 0.0, 0.0, record.told)
            elif was_closed[contact] == 1 and not touches:
                log_event(time, CONSTRAINT_LETS_GO, owner[contact], 0.0, 0.0, record.told)
        elif kind[contact] == POINT:
            if was_closed[contact] == 1 and not touches:
                log_event(time, LIFTOFF, contact, 0.0, 0.0, record.told)
            if landed and not starting:
                log_event(time, TOUCHDOWN, contact, 0.0, 0.0, record.told)
            before = 0 if landed else before
            if touches and now != before:
                told = SLIP if before == 0 else STICK if now == 0 else REVERSAL
                log_event(time, told, contact, 0.0, 0.0, record.told)
        was_closed[contact] = closed[contact]
        slipping[contact] = now if touches else 0
