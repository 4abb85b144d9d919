"""Rows and events of a run, as compiled loops fill them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import QUANTITIES


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


class Record(Bundle):
    """Rows of a run, filled by the compiled loop, one row an instant.

    Forces and torques of a row are those decided at its instant and acting over the step that
    follows. `rows` is how many are used. Every recorded quantity of a
    :class:`~heelstrike.Run` has an array by its name. `log` holds the words of what the controller
    logged, of the first `logged` rows.
    """

    rows: int = cell(int)
    told: Told = part(Told, flat=True)
    logged: int = cell(int)
    time: Floats = array("nt")
    vars().update({name: array("nt", *each.shape) for name, each in QUANTITIES.items()})
    log: Integers = array("nt", "words", of=int)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Floats: ...


def allocate_record(robot: Robot, rows: int, events: int, words: int = 0) -> Record:
    """Allocate a record of `rows` instants, with so many words of a log, and `events` events."""
    extents = robot.model.extents | ROW_EXTENTS | {"words": words}
    extents["constraints"] = len(robot.constraints)
    return Record.allocate(extents, nt=rows, ne=events)


ROW_EXTENTS = {"components": 2, "conditions": 3, "constraints": 0}
"""Extents of rows that no robot's model tells: so many constraints a robot has by itself."""
