"""Rows and events of a run, as compiled loops fill them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.dimension import dimension_of
from heelstrike.sim.run import QUANTITIES, Quantity


class Told(Bundle):
    """The events of a run, as far as they are known."""

    events: int = cell(int)
    """How many there are."""
    event_time: Floats = array("ne")
    event_kind: Integers = array("ne", of=int)
    event_contact: Integers = array("ne", of=int)
    event_impulse: Floats = array("ne", "components")
    """event_time, event_kind, event_contact, event_impulse: When each was (s), what, of which
    contact point, joint or constraint, and its impulse (N s)."""


class RowsAndEvents(Bundle):
    """What every record has: how much of it is used, times, logs and events.

    `rows` is the number of rows used. `log` holds the words of what the controller
    logged, of the first `logged` rows.
    """

    rows: int = cell(int)
    told: Told = part(Told, flat=True)
    logged: int = cell(int)
    time: Floats = array("nt")
    log: Integers = array("nt", "words", of=int)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Floats: ...


def rows_of_quantities(quantities: Mapping[str, Quantity]) -> dict[str, Floats]:
    """Declare an array for each recorded quantity, a row an instant."""
    return {name: array("nt", *each.shape) for name, each in quantities.items()}


class Record(RowsAndEvents):
    """Rows of a run, filled by the compiled loop, one row an instant.

    Forces and torques of a row are those decided at its instant and acting over the step that
    follows. Every recorded quantity of a :class:`~heelstrike.Run` has an array by its name.
    """

    vars().update(rows_of_quantities(QUANTITIES))


def allocate_record(
    robot: Robot | SpatialRobot, rows: int, events: int, words: int = 0
) -> RowsAndEvents:
    """Allocate a record of `rows` instants, with so many words of a log, and `events` events."""
    dimension = dimension_of(robot)
    extents = robot.model.extents | dimension.row_extents(robot) | {"words": words}
    return dimension.record.allocate(extents, nt=rows, ne=events)


ROW_EXTENTS = {"components": 2, "conditions": 3, "constraints": 0}
"""Extents of rows that no planar robot's model tells: so many constraints a robot has by itself."""
