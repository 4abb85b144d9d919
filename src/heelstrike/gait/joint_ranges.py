"""Ranges that the joints of a gait keep to: the robot's own, or narrower ones where asked for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError
from heelstrike.robot.robot import Robot

Floats = NDArray[np.float64]

JointRanges = Mapping[str, tuple[float, float]]
"""Lowest and highest position (rad, m for a slide) of joints by name."""


def ranges_kept(robot: Robot, asked: JointRanges | None) -> tuple[Floats, Floats]:
    """Lowest and highest position of every coordinate, (nv,) each: the robot's ranges and `asked`.

    Every step of a gait mirrors the one before, so that what is asked of a joint holds for its
    counterpart on the other side, too.

    Parameters
    ----------
    robot : Robot
        A robot with a mirror map.
    asked : mapping of str to (float, float), optional
        Ranges by the names of joints (rad, m for a slide); an infinite end leaves the robot's own.

    Raises
    ------
    GaitError
        If there is no joint of that name, or if a range is none or has no part in the robot's.
    """
    model, mirror = robot.model, robot.mirror
    assert mirror is not None
    lower, upper = model.lower.copy(), model.upper.copy()
    joints = {name: j for j, name in enumerate(robot.joint_names) if j > 2}
    for name, ends in _named(asked).items():
        if name not in joints:
            raise GaitError(
                f"joint_ranges: robot {robot.name!r} has no joint {name!r}; its joints are "
                f"{', '.join(joints)}."
            )
        j, (low, high) = joints[name], _ends(name, ends)
        lower[j], upper[j] = max(lower[j], low), min(upper[j], high)
        # Where its counterpart is when this joint is at either end of what is asked.
        other = int(np.flatnonzero(mirror.joint == j)[0])
        seen = sorted(
            model.reference[other] + mirror.sign[other] * (end - model.reference[j])
            for end in (low, high)
        )
        lower[other], upper[other] = max(lower[other], seen[0]), min(upper[other], seen[1])
        if lower[j] >= upper[j] or lower[other] >= upper[other]:
            raise GaitError(
                f"joint_ranges: {name!r} from {low:g} to {high:g} has no part in the range that "
                f"robot {robot.name!r} gives it, {model.lower[j]:g} to {model.upper[j]:g}, or in "
                "what is asked of its counterpart."
            )
    return lower, upper


def _named(asked: JointRanges | None) -> dict[str, object]:
    try:
        return dict(asked or {})
    except (TypeError, ValueError):
        raise GaitError(
            f"joint_ranges must give ranges by the names of joints, got {asked!r}"
        ) from None


def _ends(name: str, ends: object) -> tuple[float, float]:
    try:
        low, high = (float(end) for end in ends)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        low, high = np.nan, np.nan
    if not low < high:
        raise GaitError(
            f"joint_ranges: {name!r} needs its lowest and highest position, two numbers in rising "
            f"order (rad; m for a slide), got {ends!r}"
        )
    return low, high
