"""Which events in space concern a contact point."""

from __future__ import annotations

from heelstrike.sim.spatial.record import SpatialEventKind

OF_POINTS = (
    SpatialEventKind.TOUCHDOWN,
    SpatialEventKind.LIFTOFF,
    SpatialEventKind.SLIP,
    SpatialEventKind.STICK,
)
"""Kinds that concern a contact point."""
