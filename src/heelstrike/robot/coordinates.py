"""Joints by their names, and numbers of a state that fit them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from heelstrike.arguments import refusal
from heelstrike.errors import RobotError
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State
from heelstrike.wording import meant

if TYPE_CHECKING:
    from heelstrike.robot.named_tree import NamedTree
    from heelstrike.robot.robot import Robot

Spread = float | Mapping[str | int, float]
"""One standard deviation for all coordinates, or one for each that is named."""


def index_of(robot: NamedTree, what: str, names: tuple[str, ...], given: str | int) -> int:
    """Return the index of something of a robot, given by its name or index.

    Raises
    ------
    RobotError
        If the robot has nothing of that name or index; the message lists what it has.
    """
    if isinstance(given, str):
        if given in names:
            return names.index(given)
    elif (
        isinstance(given, int | np.integer)
        and not isinstance(given, bool)
        and -len(names) <= given < len(names)
    ):
        return int(given) % len(names)
    guess = meant(str(given), names)
    known = ", ".join(dict.fromkeys(names)) or "none"
    raise RobotError(
        f"robot {robot.name!r} has no {what} {given!r}.{guess} It has {known}"
        + (f" (0 to {len(names) - 1})." if names else ".")
    )


def checked(robot: NamedTree, state: State) -> State:
    """Return a copy of a state that fits a robot.

    Raises
    ------
    RobotError
        If it is none, or has not nq positions and nv velocities, all finite.
    """
    if not isinstance(state, State):
        raise RobotError(refusal("state", state, ["State"]))
    for what, vector, size in (("q", state.q, robot.nq), ("v", state.v, robot.nv)):
        if vector.shape != (size,) or not np.all(np.isfinite(vector)):
            names = robot.position_names if what == "q" else robot.velocity_names
            raise RobotError(
                f"{what} of a state of robot {robot.name!r} must be {size} finite numbers "
                f"({', '.join(names)}), got {vector!r}."
            )
    return State(state.q, state.v)


def spread_of(robot: Robot, what: str, spread: Spread) -> Floats:
    """Return the standard deviation of every coordinate."""
    values = spread if isinstance(spread, Mapping) else dict.fromkeys(range(robot.nv), spread)
    result = np.zeros(robot.nv)
    for joint, value in values.items():
        index = index_of(robot, "joint", robot.joint_names, joint)
        result[index] = finite(robot, f"spread of the {what}", robot.joint_names[index], value)
    if np.any(result < 0.0):
        raise RobotError(f"the spread of a {what} is a standard deviation: it is not negative.")
    return result


def finite(robot: Robot, what: str, joint: str, value: float) -> float:
    """Return a number of a joint, or raise a `RobotError` that names both."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise RobotError(
            f"the {what} of joint {joint!r} of robot {robot.name!r} must be a finite number, got "
            f"{value!r}."
        )
    return number
