"""What the two faces of a concave corner do to a point, told as one.

A record, an event and a controller know one force a contact point, in the frame of one normal. In a
corner that is the resultant of both faces, in the frame of the first; where a point meets a second
face, it is the frame of that one: that is the face that hits it. Events have the frame of the first
row of their instant.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.geometry import contact_velocity
from heelstrike.sim.contacts.rows import SECOND_FACE, Rows, second_of
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Impact
from heelstrike.sim.event_driven.steps import shortest_step
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import log_event


@kernel
def is_cornered(point: int, rows: Rows, paired: int, impact: Impact) -> bool:
    """Whether a second face acts on a point, or gives it its frame."""
    if paired == 0:
        return False
    second = second_of(point, rows)
    pushed = impact.impulse[second, 0] != 0.0 or impact.impulse[second, 1] != 0.0
    return pushed or impact.meets[point] == 1


@kernel
def joined(
    point: int, force: Floats, contacts: Contacts, rows: Rows, seconds: Contacts, meets: Integers
) -> tuple[float, float]:
    """Resultant (normal, tangent) of the forces, or impulses, of both faces of a point."""
    second, other = second_of(point, rows), seconds.normal[point]
    own_x, own_z = out_of_frame(contacts.normal[point], (force[point, 0], force[point, 1]))
    x, z = out_of_frame(other, (force[second, 0], force[second, 1]))
    frame = other if meets[point] == 1 else contacts.normal[point]
    return into_frame(frame, (own_x + x, own_z + z))


@kernel
def impulse_of(
    point: int, contacts: Contacts, rows: Rows, seconds: Contacts, paired: int, impact: Impact
) -> tuple[float, float]:
    """Impulse (normal, tangent) on a point in this instant, of both faces."""
    if is_cornered(point, rows, paired, impact):
        return joined(point, impact.impulse, contacts, rows, seconds, impact.meets)
    return impact.impulse[point, 0], impact.impulse[point, 1]


@kernel
def first_row(time: float, record: Record) -> int:
    """First of the rows of this instant, or the next to be written if it has none as yet."""
    row = record.rows
    while row > 0 and abs(record.time[row - 1] - time) <= 0.5 * shortest_step(time):
        row -= 1
    return row


@kernel
def log_impulse(
    kind: int, point: int, contacts: Contacts, rows: Rows, seconds: Contacts, paired: int,
    time: float, impact: Impact, record: Record,
) -> None:  # fmt: skip
    """Append the impulse on a point in this instant to the events.

    It is told in the frame of the first row of the instant: several impacts, jams and a bridge may
    follow each other there, and turn the point from face to face.
    """
    frame = contacts.normal[point]
    normal, tangent = impact.impulse[point, 0], impact.impulse[point, 1]
    if is_cornered(point, rows, paired, impact):
        normal, tangent = joined(point, impact.impulse, contacts, rows, seconds, impact.meets)
        if impact.meets[point] == 1:
            frame = seconds.normal[point]
    row = first_row(time, record)
    if row < record.rows:
        told = record.contact_normal[row, point]
        if told[0] != frame[0] or told[1] != frame[1]:
            normal, tangent = into_frame(told, out_of_frame(frame, (normal, tangent)))
    log_event(time, kind, point, normal, tangent, record)


@kernel
def is_struck(point: int, rows: Rows, paired: int, impulse: Floats) -> bool:
    """Whether an impulse acts on a point in this instant, of either face."""
    if impulse[point, 0] > 0.0:
        return True
    second = second_of(point, rows)
    return bool(paired == 1 and impulse[second, 0] > 0.0)


@kernel
def show_forces(
    force: Floats, rows: Rows, seconds: Contacts, watched: int, meets: Integers, contacts: Contacts
) -> None:
    """Let controllers see the forces of the contact points; what stands after them is of joints."""
    for contact in range(contacts.force.shape[0]):
        contacts.force[contact, 0] = force[contact, 0]
        contacts.force[contact, 1] = force[contact, 1]
    for second in range(rows.first[SECOND_FACE], watched):
        if force[second, 0] != 0.0 or force[second, 1] != 0.0:
            point = rows.owner[second]
            both = joined(point, force, contacts, rows, seconds, meets)
            contacts.force[point, 0], contacts.force[point, 1] = both


@kernel
def record_corner(
    row: int, point: int, model: Model, tree: Workspace, contacts: Contacts, seconds: Contacts,
    impact: Impact, record: Record,
) -> None:  # fmt: skip
    """Put the force of the second face of a point into a row, and the frame of one just met.

    The force of the first face is there. About the centre of the disc only friction has a moment,
    r λ_t of either face; the resultant acts where its line leaves the disc.
    """
    force, other = record.contact_force[row, point], seconds.force[point]
    meets = impact.meets[point] == 1
    if other[0] == 0.0 and other[1] == 0.0 and not meets:
        return
    radius, own = model.contact_radius[point], contacts.normal[point]
    own_x, own_z = out_of_frame(own, (force[0], force[1]))
    x, z = out_of_frame(seconds.normal[point], (other[0], other[1]))
    x, z = own_x + x, own_z + z
    place, moment = record.contact_point[row, point], radius * (force[1] + other[1])
    size = math.sqrt(x * x + z * z)
    normal = seconds.normal[point] if meets else own
    if size > 0.0:
        lever = moment / size
        depth = math.sqrt(max(radius * radius - lever * lever, 0.0))
        place[0] += radius * own[0] + (lever * z - depth * x) / size
        place[1] += radius * own[1] + (-lever * x - depth * z) / size
    elif meets:
        place[0], place[1] = seconds.position[point, 0], seconds.position[point, 1]
    if meets:
        record.gap[row, point] = seconds.gap[point]
        for i in range(2):
            record.contact_normal[row, point, i] = normal[i]
        _, record.slip_velocity[row, point] = contact_velocity(model, tree, seconds, point)
    force[0], force[1] = into_frame(normal, (x, z))
