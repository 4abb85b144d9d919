"""What of an event in space is shown: its kind in words, and where it happened."""

from __future__ import annotations

from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.spatial.record import SpatialEventKind
from heelstrike.sim.spatial.run import SpatialEvent
from heelstrike.view.style import in_words

OF_POINTS = (
    SpatialEventKind.TOUCHDOWN,
    SpatialEventKind.LIFTOFF,
    SpatialEventKind.SLIP,
    SpatialEventKind.STICK,
)
"""Kinds that concern a contact point."""
OF_VELOCITIES = (SpatialEventKind.JOINT_SLIP, SpatialEventKind.JOINT_STICK)
"""Kinds that concern dry friction, of a velocity."""


def kind_in_space(event: SpatialEvent) -> str:
    """Its kind as people write it."""
    return in_words(event.kind.name.lower())


def place_in_space(event: SpatialEvent, robot: SpatialRobot) -> str:
    """Name of the contact point, joint or velocity at which it happened; nothing if at none."""
    if event.kind in OF_POINTS:
        return in_words(robot.contact_names[event.contact])
    if event.kind is SpatialEventKind.JOINT_STOP:
        return in_words(robot.joint_names[event.contact])
    if event.kind in OF_VELOCITIES:
        return in_words(robot.velocity_names[event.contact])
    return ""
