"""Rows and events of a run in space, as the compiled loop fills them."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.record.record import RowsAndEvents, Told, rows_of_quantities
from heelstrike.sim.record.recording import (
    JOINT_SLIP,
    JOINT_STICK,
    JOINT_STOP,
    LIFTOFF,
    LIFTOFF_GAP,
    SLIP,
    SLIP_SPEED,
    STICK,
    TOUCHDOWN,
    row_writer,
    when_due,
)
from heelstrike.sim.spatial.memory import SpatialReported, SpatialTally
from heelstrike.sim.spatial.run import RECORDED
from heelstrike.sim.spatial.table import DRY_JOINT, POINT, WALL, BlockTable

SpatialEventKind = EventKind
"""What happens in space is among what may happen in the plane."""

NO_IMPULSE = (0.0, 0.0, 0.0)
"""Impulse of an event that has none."""


class SpatialRecord(RowsAndEvents):
    """Rows of a run in space, an array for each of its recorded quantities."""

    vars().update(rows_of_quantities(RECORDED))


note_row_when_due = when_due(row_writer(RECORDED, __name__))


@kernel
def log_spatial_event(
    time: float, kind: int, contact: int, impulse: tuple[float, float, float],
    told: Told,
) -> None:  # fmt: skip
    """Append an event."""
    event = told.events
    told.event_time[event] = time
    told.event_kind[event] = kind
    told.event_contact[event] = contact
    for k in range(3):
        told.event_impulse[event, k] = impulse[k]
    told.events = event + 1


@kernel
def note_deepest(faces: int, gap: Floats, tally: SpatialTally) -> None:
    """Keep the deepest penetration of the run, of the first entries: points and walls."""
    for contact in range(faces):
        tally.penetration = max(tally.penetration, -gap[contact])


@kernel
def note_spatial_events(
    time: float, end: float, step: float, first_step: bool, v: Floats, slip: Floats,
    table: BlockTable, told: Told, reported: SpatialReported,
) -> None:  # fmt: skip
    """Find what happened in a step that ends at `end`, to every entry of the table.

    What stands on the ground, or at a stop, as the run begins does not get there. Walls are not
    told of: a point at one is often on the ground already, or not yet.
    """
    closed, slipping = reported.closed, reported.slipping
    for entry in range(table.kind.shape[0]):
        owner, kind = table.owner[entry], table.kind[entry]
        if kind == WALL:
            continue
        force = table.force[entry, 0], table.force[entry, 1], table.force[entry, 2]
        impulse = step * force[0], step * force[1], step * force[2]
        if kind == DRY_JOINT:
            moves = int(abs(v[owner]) > SLIP_SPEED)
            if not first_step and moves != slipping[entry]:
                log_spatial_event(
                    end, JOINT_SLIP if moves == 1 else JOINT_STICK, owner, impulse, told
                )  # fmt: skip
            slipping[entry] = moves
            continue
        pushed = force[0] > 0.0
        if closed[entry] == 0 and pushed:
            closed[entry] = 1
            slipping[entry] = 0
            if not (first_step and table.gap[entry] <= LIFTOFF_GAP):
                arrives = TOUCHDOWN if kind == POINT else JOINT_STOP
                log_spatial_event(end, arrives, owner, impulse, told)
        elif closed[entry] == 1 and not pushed and table.gap[entry] > LIFTOFF_GAP:
            closed[entry] = 0
            slipping[entry] = 0
            if kind == POINT:
                log_spatial_event(time, LIFTOFF, owner, impulse, told)
        if kind == POINT and closed[entry] == 1 and pushed:
            s, t = slip[owner, 0], slip[owner, 1]
            slides = int(s * s + t * t > SLIP_SPEED * SLIP_SPEED)
            if slides != slipping[entry]:
                slipping[entry] = slides
                log_spatial_event(end, SLIP if slides == 1 else STICK, owner, impulse, told)
