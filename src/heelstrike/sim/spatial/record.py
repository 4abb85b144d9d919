"""Rows and events of a run in space, as the compiled loop fills them."""

from __future__ import annotations

import enum

from heelstrike.compiler.bundle import Bundle, array, cell
from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.spatial.memory import SpatialReported, SpatialTally
from heelstrike.sim.spatial.table import DRY_JOINT, POINT, WALL, BlockTable

GONE = 1e-7
"""A contact point has left the ground when its gap exceeds this (m)."""

SLIDING = 1e-6
"""It slides above this speed (m/s)."""


class SpatialEventKind(enum.IntEnum):
    """What happened in a run in space.

    ``TOUCHDOWN``, ``LIFTOFF``
        A contact point met the ground, with the impulse of the step; it left the ground.
    ``SLIP``, ``STICK``
        It began to slide; it came to rest.
    ``JOINT_STOP``
        A joint reached the end of its range; the event's `contact` is the index of the joint.
    ``JOINT_SLIP``, ``JOINT_STICK``
        A joint with dry friction began to move; it came to rest. The event's `contact` is the
        index of the velocity.
    ``ENERGY_GAIN``
        Restitution with friction made energy in an impact (Kane's paradox); `contact` is −1.
    ``UNCERTIFIED``
        A step went on although its contact problem is solved to 1e-6 only, not to 1e-9; `contact`
        is −1.
    """

    TOUCHDOWN = 0
    LIFTOFF = 1
    SLIP = 2
    STICK = 3
    JOINT_STOP = 4
    JOINT_SLIP = 5
    JOINT_STICK = 6
    ENERGY_GAIN = 7
    UNCERTIFIED = 8


TOUCHDOWN, LIFTOFF, SLIP, STICK, JOINT_STOP, JOINT_SLIP, JOINT_STICK, ENERGY_GAIN, UNCERTIFIED = (
    map(int, SpatialEventKind)
)

NO_IMPULSE = (0.0, 0.0, 0.0)
"""Impulse of an event that has none."""


class SpatialRecord(Bundle):
    """Rows of a run, one row an instant, and events."""

    rows: int = cell(int)
    events: int = cell(int)
    time: Floats = array("nt")
    position: Floats = array("nt", "nq")
    velocity: Floats = array("nt", "nv")
    torque: Floats = array("nt", "nu")
    stop_torque: Floats = array("nt", "nv")
    friction_torque: Floats = array("nt", "nv")
    contact_point: Floats = array("nt", "nc", 3)
    contact_normal: Floats = array("nt", "nc", 3)
    gap: Floats = array("nt", "nc")
    contact_force: Floats = array("nt", "nc", 3)
    slip: Floats = array("nt", "nc", 2)
    residual: Floats = array("nt")
    event_time: Floats = array("ne")
    event_kind: Integers = array("ne", of=int)
    event_contact: Integers = array("ne", of=int)
    event_impulse: Floats = array("ne", 3)


def allocate_spatial_record(robot: SpatialRobot, rows: int, events: int) -> SpatialRecord:
    """Allocate room for so many rows and events."""
    return SpatialRecord.allocate(robot.model.extents, nt=rows, ne=events)


@kernel
def begin_row(
    time: float, q: Floats, v: Floats, torque: Floats, contacts: Contacts, record: SpatialRecord
) -> None:
    """Write what is known of an instant before its step."""
    row = record.rows
    record.time[row] = time
    for i in range(q.shape[0]):
        record.position[row, i] = q[i]
    for i in range(v.shape[0]):
        record.velocity[row, i] = v[i]
    for i in range(torque.shape[0]):
        record.torque[row, i] = torque[i]
    for contact in range(contacts.gap.shape[0]):
        record.gap[row, contact] = contacts.gap[contact]
        for k in range(3):
            record.contact_point[row, contact, k] = contacts.position[contact, k]
            record.contact_normal[row, contact, k] = contacts.normal[contact, k]


@kernel
def finish_row(
    stop_torque: Floats, friction_torque: Floats, force: Floats, slip: Floats, residual: float,
    record: SpatialRecord,
) -> None:  # fmt: skip
    """Write the forces of the step that follows an instant."""
    row = record.rows
    for i in range(stop_torque.shape[0]):
        record.stop_torque[row, i] = stop_torque[i]
        record.friction_torque[row, i] = friction_torque[i]
    for contact in range(force.shape[0]):
        for k in range(3):
            record.contact_force[row, contact, k] = force[contact, k]
        for k in range(2):
            record.slip[row, contact, k] = slip[contact, k]
    record.residual[row] = residual
    record.rows = row + 1


@kernel
def log_spatial_event(
    time: float, kind: int, contact: int, impulse: tuple[float, float, float],
    record: SpatialRecord,
) -> None:  # fmt: skip
    """Append an event."""
    event = record.events
    record.event_time[event] = time
    record.event_kind[event] = kind
    record.event_contact[event] = contact
    for k in range(3):
        record.event_impulse[event, k] = impulse[k]
    record.events = event + 1


@kernel
def note_deepest(faces: int, gap: Floats, tally: SpatialTally) -> None:
    """Keep the deepest penetration of the run, of the first entries: points and walls."""
    for contact in range(faces):
        tally.penetration = max(tally.penetration, -gap[contact])


@kernel
def note_spatial_events(
    time: float, step: float, first_step: bool, v: Floats, slip: Floats, table: BlockTable,
    reported: SpatialReported, record: SpatialRecord,
) -> None:  # fmt: skip
    """Find what happened in a step that has been taken, to every entry of the table.

    What stands on the ground, or at a stop, as the run begins does not get there. Walls are not
    told of: a point at one is often on the ground already, or not yet.
    """
    closed, slipping = reported.closed, reported.slipping
    end = time + step
    for entry in range(table.kind.shape[0]):
        owner, kind = table.owner[entry], table.kind[entry]
        if kind == WALL:
            continue
        force = table.force[entry, 0], table.force[entry, 1], table.force[entry, 2]
        impulse = step * force[0], step * force[1], step * force[2]
        if kind == DRY_JOINT:
            moves = int(abs(v[owner]) > SLIDING)
            if not first_step and moves != slipping[entry]:
                log_spatial_event(
                    end, JOINT_SLIP if moves == 1 else JOINT_STICK, owner, impulse, record
                )  # fmt: skip
            slipping[entry] = moves
            continue
        pushed = force[0] > 0.0
        if closed[entry] == 0 and pushed:
            closed[entry] = 1
            slipping[entry] = 0
            if not (first_step and table.gap[entry] <= GONE):
                arrives = TOUCHDOWN if kind == POINT else JOINT_STOP
                log_spatial_event(end, arrives, owner, impulse, record)
        elif closed[entry] == 1 and not pushed and table.gap[entry] > GONE:
            closed[entry] = 0
            slipping[entry] = 0
            if kind == POINT:
                log_spatial_event(time, LIFTOFF, owner, impulse, record)
        if kind == POINT and closed[entry] == 1 and pushed:
            s, t = slip[owner, 0], slip[owner, 1]
            slides = int(s * s + t * t > SLIDING * SLIDING)
            if slides != slipping[entry]:
                slipping[entry] = slides
                log_spatial_event(end, SLIP if slides == 1 else STICK, owner, impulse, record)
