"""The points and discs of a robot that meet the ground."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import SCALES
from heelstrike.tolerances import ONE_POINT


@dataclass(frozen=True)
class ContactPoint:
    """A disc (or a point, of radius zero) fixed to a link."""

    link: int
    """Link that carries it."""
    x: float
    z: float
    """x, z: Its centre in the link frame (m)."""
    radius: float
    """Radius (m)."""
    friction: float
    """Sliding friction that the file gives its geom. The simulation takes friction from the ground;
    this number only serves to compare left and right."""
    friction_scale: float = 1.0
    restitution_scale: float = 1.0
    """friction_scale, restitution_scale: What friction and restitution of the ground are multiplied
    by under it."""


def of_model(points: list[ContactPoint]) -> dict[str, Any]:
    """Return contact points as a model has them."""
    return {
        "contact_link": [point.link for point in points],
        "contact_position": [(point.x, point.z) for point in points],
        "contact_radius": [point.radius for point in points],
        **{name: [getattr(point, name) for point in points] for name in SCALES},
    }


def _merged(points: Iterable[ContactPoint]) -> list[ContactPoint]:
    """Points without repetition; of two that coincide the first stays, with the larger numbers."""
    kept: list[ContactPoint] = []
    near: dict[tuple[int, float], list[int]] = {}  # by link and x in steps of `ONE_POINT`
    for point in points:
        step = point.x / ONE_POINT // 1.0
        for i in sorted(i for k in (-1, 0, 1) for i in near.get((point.link, step + k), ())):
            other = kept[i]
            apart = math.hypot(point.x - other.x, point.z - other.z)
            if max(apart, abs(point.radius - other.radius)) < ONE_POINT:
                larger = ("friction", *SCALES)
                most = {name: max(getattr(other, name), getattr(point, name)) for name in larger}
                kept[i] = replace(other, **most)
                break
        else:
            near.setdefault((point.link, step), []).append(len(kept))
            kept.append(point)
    return kept


def in_order(points: Iterable[ContactPoint]) -> list[ContactPoint]:
    """Contact points by link, then from back to front, then upwards; coinciding ones merged."""
    return sorted(_merged(points), key=lambda p: (p.link, round(p.x, 9), round(p.z, 9)))
