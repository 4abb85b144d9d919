"""What the two faces of a concave corner do to a point, told as one.

A record, an event and a controller know one force a contact point, in the frame of one normal. In a
corner that is the resultant of both faces, in the frame of the first; where a point meets a second
face, it is the frame of that one: that is the face that hits it. Events have the frame of the first
row of their instant.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.faces import move_to_line
from heelstrike.sim.contacts.rows import CONSTRAINT, STOP, Rows, second_of
from heelstrike.sim.event_driven.phase import Impact
from heelstrike.sim.event_driven.steps import shortest_step
from heelstrike.sim.record.record import Record, Told
from heelstrike.sim.record.recording import CONSTRAINT_HOLDS, JOINT_STOP, TOUCHDOWN, log_event

IMPACT = int(EventKind.IMPACT)


@kernel
def joined(
    point: int, second: int, force: Floats, normal: Floats, meets: Integers
) -> tuple[float, float]:
    """Resultant (normal, tangent) of the forces, or impulses, of both faces of a point.

    `force` and `normal` are numbered by the table of rows, `second` is the second face.
    """
    if meets[point] == 0 and force[second, 0] == 0.0 and force[second, 1] == 0.0:
        return force[point, 0], force[point, 1]
    own_x, own_z = out_of_frame(normal[point], (force[point, 0], force[point, 1]))
    x, z = out_of_frame(normal[second], (force[second, 0], force[second, 1]))
    frame = normal[second] if meets[point] == 1 else normal[point]
    return into_frame(frame, (own_x + x, own_z + z))


@kernel
def first_row(time: float, record: Record) -> int:
    """First of the rows of this instant, or the next to be written if it has none as yet."""
    row = record.rows
    while row > 0 and abs(record.time[row - 1] - time) <= 0.5 * shortest_step(time):
        row -= 1
    return row


@kernel
def log_impulse(
    kind: int, point: int, second: int, time: float, normal: Floats, impact: Impact, record: Record
) -> None:
    """Append the impulse on a point in this instant to the events.

    It is told in the frame of the first row of the instant: several impacts, jams and a bridge may
    follow each other there, and turn the point from face to face.
    """
    along, across = joined(point, second, impact.impulse, normal, impact.meets)
    frame = normal[second] if impact.meets[point] == 1 else normal[point]
    row = first_row(time, record)
    if row < record.rows:
        told = record.contact_normal[row, point]
        if told[0] != frame[0] or told[1] != frame[1]:
            along, across = into_frame(told, out_of_frame(frame, (along, across)))
    log_event(time, kind, point, along, across, record.told)


@kernel
def report_points(
    kind: int, time: float, seconds: int, normal: Floats, impact: Impact, closed: Integers,
    slipping: Integers, record: Record,
) -> int:  # fmt: skip
    """Append the impulses of contact points in this instant; return the one with the largest.

    They are of a kind of their own, or touchdowns where `kind` is ``IMPACT`` and the point was not
    on the ground. The second faces are the entries of the table from `seconds` on.
    """
    impulse, largest = impact.impulse, 0
    for point in range(impact.meets.shape[0]):
        second, told = seconds + point, kind
        largest = point if impulse[point, 0] > impulse[largest, 0] else largest
        if not (impulse[point, 0] > 0.0 or impulse[second, 0] > 0.0):
            continue
        if kind == IMPACT and closed[point] == 0:
            closed[point], slipping[point] = 1, 0
            told = TOUCHDOWN
        log_impulse(told, point, second, time, normal, impact, record)
    return largest


@kernel
def report_joints(time: float, rows: Rows, impulse: Floats, closed: Integers, told: Told) -> None:
    """Append the impulses of joint stops and constraints in this instant to the events."""
    for entry in range(rows.first[STOP], rows.end[CONSTRAINT]):
        normal = impulse[entry, 0]
        if normal != 0.0:  # it may pull, as a latch does
            holds = JOINT_STOP if rows.kind[entry] == STOP else CONSTRAINT_HOLDS
            closed[entry] = 1
            log_event(time, holds, rows.owner[entry], normal, 0.0, told)


@kernel
def show_forces(force: Floats, rows: Rows, meets: Integers, shown: Floats) -> None:
    """Let controllers see the forces of the contact points; what stands after them is of joints."""
    for point in range(meets.shape[0]):
        second = second_of(point, rows)
        pushed = force[second, 0] != 0.0 or force[second, 1] != 0.0
        shown[point, 0], shown[point, 1] = force[point, 0], force[point, 1]
        if pushed:
            shown[point, 0], shown[point, 1] = joined(point, second, force, rows.normal, meets)


@kernel
def record_corner(
    row: int, point: int, second: int, model: Model, normal: Floats, position: Floats,
    force: Floats, meets: Integers, record: Record,
) -> None:  # fmt: skip
    """Put the force of the second face of a point into a row, and the frame of one just met.

    About the centre of the disc only friction has a moment, r λ_t of either face; the resultant
    acts where its line leaves the disc.
    """
    own, other, met = force[point], force[second], meets[point] == 1
    if other[0] == 0.0 and other[1] == 0.0 and not met:
        return
    radius, place = model.contact_radius[point], record.contact_point[row, point]
    own_x, own_z = out_of_frame(normal[point], (own[0], own[1]))
    x, z = out_of_frame(normal[second], (other[0], other[1]))
    x, z = own_x + x, own_z + z
    moment = radius * (own[1] + other[1])
    if not move_to_line(x, z, moment, radius, normal[point], place) and met:
        place[0], place[1] = position[second, 0], position[second, 1]
    if met:
        for i in range(2):
            record.contact_normal[row, point, i] = normal[second, i]
    told = record.contact_force[row, point]
    told[0], told[1] = into_frame(normal[second] if met else normal[point], (x, z))
