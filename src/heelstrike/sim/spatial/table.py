"""What may hold a robot in space: one table of contact points, joint stops and dry friction."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL
from heelstrike.contact.spatial.modes import OPEN, STICK
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import BALL, HINGE, SLIDE
from heelstrike.robot.spatial.robot import SpatialRobot

POINT, STOP, BALL_STOP, DRY_JOINT, WALL = range(5)
"""Kinds of entries; a wall is a second or third face that a contact point may meet."""

WALLS = 2
"""How many walls a contact point may meet at once: with the face below it, those of a corner."""

NEVER_TOUCHED = -2
"""The step at whose end what has not touched did so."""


class BlockTable(Bundle):
    """All that may hold a robot: contact points, then their walls, stops, dry friction."""

    kind: Integers = array("entries", of=int)
    """What each entry is."""
    owner: Integers = array("entries", of=int)
    """Its contact point; its joint; or its velocity, of dry friction."""
    wall: Integers = array("entries", of=int)
    """Of a contact point the entry of its first wall, of that the entry of the second; −1 of all
    else, and where there are no walls."""
    face: Integers = array("entries", of=int)
    """Which face points and walls are at, where there are walls: what is kept of them is of it."""
    side: Floats = array("entries")
    """Of a stop 1 for the lower end of the range, −1 for the upper."""
    last: Integers = array("entries", of=int)
    """Last velocity of the chain that it acts on."""
    set: Integers = array("entries", of=int)
    """Where its impulses may lie."""
    size: Integers = array("entries", of=int)
    """How many rows it has."""
    friction: Floats = array("entries")
    restitution: Floats = array("entries")
    """friction, restitution: Of points those of the ground below them now."""
    gap: Floats = array("entries")
    """Distance (m, rad) to the ground or the end of the range; infinite of dry friction."""
    mode: Integers = array("entries", of=int)
    impulse: Floats = array("entries", 3)
    """mode, impulse: Of the last solve, where the next one begins."""
    force: Floats = array("entries", 3)
    """Mean force over the last step."""
    touching: Integers = array("entries", of=int)
    """The last step at whose end each entry touched."""
    called: Integers = array("entries", of=int)
    """What takes part although it seemed too far away."""


def lay_out_table(robot: SpatialRobot, *, walls: bool) -> BlockTable:
    """Return the table of a robot, with entries for walls at each contact point or without."""
    model = robot.model
    entries: list[tuple[int, int, float, int, int, int]] = [
        (kind, contact, 0.0, int(model.last_velocity[link]), CONE, 3)
        for kind in (POINT, *((WALL,) * WALLS if walls else ()))
        for contact, link in enumerate(model.contact_link.tolist())
    ]
    for joint, kind in enumerate(model.joint_kind.tolist()):
        last = int(model.last_velocity[joint])
        if kind in (HINGE, SLIDE):
            for side, limit in ((1.0, model.lower[joint]), (-1.0, model.upper[joint])):
                if np.isfinite(limit):
                    entries.append((STOP, joint, side, last, HALF_LINE, 1))
        elif kind == BALL and np.isfinite(model.upper[joint]):
            entries.append((BALL_STOP, joint, -1.0, last, HALF_LINE, 1))
    for k in np.flatnonzero(model.dry_friction > 0.0).tolist():
        entries.append((DRY_JOINT, k, 0.0, k, INTERVAL, 1))

    def column(place: int, dtype: type) -> Any:
        return np.array([entry[place] for entry in entries], dtype=dtype)

    kind, owner = column(0, np.int64), column(1, np.int64)
    wall = np.full(len(entries), -1)
    if walls:
        first, second = np.split(np.flatnonzero(kind == WALL), WALLS)
        wall[kind == POINT], wall[first] = first, second
    return BlockTable.allocate(
        entries=len(entries),
        kind=kind,
        owner=owner,
        wall=wall,
        face=np.full(len(entries), -1),
        side=column(2, np.float64),
        last=column(3, np.int64),
        set=column(4, np.int64),
        size=column(5, np.int64),
        gap=np.full(len(entries), np.inf),
        mode=np.where(kind == DRY_JOINT, STICK, OPEN).astype(np.int64),
        touching=np.full(len(entries), NEVER_TOUCHED),
    )


def most_rows_of(table: BlockTable) -> int:
    """How many rows all entries together have."""
    return int(np.sum(table.size))
