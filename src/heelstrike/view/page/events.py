"""What of an event is shown: where it happened, and the impulse that it took.

What the numbers of an event mean depends on its kind: its index may be one of a joint, and a bridge
has none, nor an impulse.
"""

from __future__ import annotations

import math
from typing import Any

from heelstrike.robot.robot import Robot
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.dimension import AnyRobot
from heelstrike.sim.run import Event
from heelstrike.view.page.rows import IMPACTS
from heelstrike.view.style import in_words

NOWHERE = (EventKind.BRIDGE,)
"""Kinds that concern no single contact point or joint."""


def described(event: Event, robot: AnyRobot) -> dict[str, Any]:
    """Return what the script of a page is told of an event."""
    impulse, unit = impulse_of(event, robot)
    return {
        "time": event.time,
        "kind": event.kind_in_words,
        "where": in_words(event.place(robot)),
        "contact": contact_of(event),
        "impulse": impulse,
        "unit": unit,
        "impact": event.kind in IMPACTS,
    }


def contact_of(event: Event) -> int:
    """Index of the contact point at which it happened, -1 if it was at none."""
    kind = event.kind
    return -1 if kind in NOWHERE or kind.of_joint or kind.of_constraint else event.contact


def impulse_of(event: Event, robot: AnyRobot) -> tuple[float, str]:
    """Impulse that it took, normal to the ground or on the joint, and its unit; 0 where unknown.

    Those on joints in space are not told.
    """
    size, of_joint = event.impulse[0], event.kind.of_joint
    planar = isinstance(robot, Robot)
    if event.kind in NOWHERE or not math.isfinite(size) or (of_joint and not planar):
        return 0.0, ""
    turns = of_joint and robot.model.axis[event.contact, 0] != 0.0
    return size, "N m s" if turns else "N s"
