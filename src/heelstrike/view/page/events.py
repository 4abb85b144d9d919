"""What of an event is shown: where it happened, and the impulse that it took.

What the numbers of an event mean depends on its kind: its index may be one of a joint, and a bridge
has none, nor an impulse.
"""

from __future__ import annotations

import math

from heelstrike.robot.robot import Robot
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.run import Event
from heelstrike.view.style import in_words

NOWHERE = (EventKind.BRIDGE,)
"""Kinds that concern no single contact point or joint."""


def kind_in_words(event: Event) -> str:
    """Its kind as people write it."""
    return event.kind_in_words


def contact_of(event: Event) -> int:
    """Index of the contact point at which it happened, -1 if it was at none."""
    kind = event.kind
    return -1 if kind in NOWHERE or kind.of_joint or kind.of_constraint else event.contact


def place_of(event: Event, robot: Robot) -> str:
    """Name of the joint or contact point at which it happened; nothing if it was at none."""
    return in_words(event.place(robot))


def impulse_of(event: Event, robot: Robot) -> tuple[float, str]:
    """Impulse that it took, normal to the ground or on the joint, and its unit; 0 where unknown."""
    size = event.impulse[0]
    if event.kind in NOWHERE or not math.isfinite(size):
        return 0.0, ""
    turns = event.kind.of_joint and robot.model.axis[event.contact, 0] != 0.0
    return size, "N m s" if turns else "N s"
