"""Numbers and names as robot files have them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heelstrike.robot.assembly import LARGEST_NUMBER
from heelstrike.robot.model import PROPERTIES, Integers
from heelstrike.robot.robot import Robot

# What the formats want to be positive, where ours is zero.
POINT_RADIUS = 1e-12
SMALLEST_INERTIA = 2e-15

STANDARD_GRAVITY = (0.0, -9.81)


def unique(names: Iterable[str]) -> list[str]:
    """Names with numbers added to those that were there before."""
    taken: set[str] = set()
    result = []
    for name in names:
        new, count = name, 1
        while new in taken:
            count += 1
            new = f"{name}_{count}"
        taken.add(new)
        result.append(new)
    return result


def range_of(name: str, low: float, high: float) -> dict[str, str]:
    """Range as an attribute, nothing if it has no ends; a huge number stands for one missing."""
    if np.isinf(low) and np.isinf(high):
        return {}
    return {name: numbers((max(low, -LARGEST_NUMBER), min(high, LARGEST_NUMBER)))}


def number(value: float) -> str:
    """All digits of a number."""
    return repr(float(value) + 0.0)  # without the sign of zero


def joints_with(robot: Robot, name: str) -> Integers:
    """Return the joints that have a number which is not the default."""
    return np.flatnonzero(getattr(robot.model, name) != PROPERTIES[name].default)


def numbers(values: Iterable[float]) -> str:
    """All digits of several numbers."""
    return " ".join(number(value) for value in values)


def point(xz: Iterable[float]) -> str:
    """Text of a point of the plane."""
    x, z = xz
    return numbers((x, 0.0, z))
