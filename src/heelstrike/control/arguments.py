"""What controllers are made of: a robot, a gait of it, numbers; or in words why that is none."""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from heelstrike import arguments
from heelstrike.arguments import are_numbers, refusal, shown
from heelstrike.errors import ControllerError, GaitError
from heelstrike.gait.gait import Gait
from heelstrike.gait.motion.motion import Motion
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.law import per_actuator


def must_be(kind: type, name: str, value: object) -> None:
    """Refuse an argument of another kind.

    Raises
    ------
    ControllerError
        That says what is wanted, what was given, and what makes one.
    """
    if not isinstance(value, kind):
        raise ControllerError(refusal(name, value, (kind.__name__,)))


def check_gait(robot: Robot, gait: Gait | Motion) -> None:
    """Refuse a gait of another robot.

    A robot with other numbers than the gait was designed for will do, as long as it is called the
    same: a law may know its robot wrongly.

    Raises
    ------
    ControllerError
        That names the robots, or the joints.
    """
    must_be(Robot, "robot", robot)
    if isinstance(gait, Motion):
        raise ControllerError(
            "this law stands on one foot at a time, all of a step, and follows a Gait of "
            "optimize_gait. A Motion of any phases is followed by hs.ComputedTorque, hs.MotionLQR, "
            "hs.WholeBody and hs.FootstepFeedback"
        )
    must_be(Gait, "gait", gait)
    try:
        gait.check_joints(robot)
    except GaitError as error:
        raise ControllerError(str(error)) from None
    if gait.robot != robot.name:
        raise ControllerError(
            f"this gait is one of robot {gait.robot!r}, not of {robot.name!r}, which has the same "
            "joint names. Design one for it with optimize_gait; if it is the same robot with "
            f"other numbers, give it the same name: dataclasses.replace(robot, name={gait.robot!r})"
        )


def number_of(name: str, value: object) -> float:
    """Return a number, which need not be finite.

    Raises
    ------
    ControllerError
        If it is none.
    """
    found = (
        value.item() if isinstance(value, (np.ndarray, np.generic)) and value.size == 1 else value
    )
    if isinstance(found, bool) or not isinstance(found, Real):
        raise ControllerError(f"{name} must be a number, got {shown(value)}")
    return float(found)


def positive(name: str, value: object) -> float:
    """Return a positive, finite number.

    Raises
    ------
    ControllerError
        If it is none.
    """
    return arguments.positive(name, number_of(name, value), ControllerError)


def numbers_of(name: str, value: ArrayLike) -> Floats:
    """Return an array of numbers.

    Raises
    ------
    ControllerError
        If there is another thing among them.
    """
    if not are_numbers(value):
        raise ControllerError(f"{name} must be numbers, got {shown(value)}")
    return np.array(value, dtype=np.float64)


def gains_of(name: str, value: ArrayLike, robot: Robot | SpatialRobot) -> Floats:
    """Return gains of each actuator, (nu,), that are not negative, of one for all or for each.

    Raises
    ------
    ControllerError
        If they are none.
    """
    gains = per_actuator(name, value, robot)
    if np.any(gains < 0.0):
        raise ControllerError(f"{name} must not be negative, got {value!r}")
    return gains


def weights_of(name: str, value: ArrayLike, size: int, *, positive: bool = False) -> Floats:
    """Return so many weights of a quadratic cost, (size,), of one for all or one of each.

    Raises
    ------
    ControllerError
        If they are not that many finite numbers from 0 on, or above 0.
    """
    weights = numbers_of(name, value)
    fits = weights.ndim <= 1 and weights.size in (1, size)
    least = "positive" if positive else "not negative"
    if not fits or not np.all(np.isfinite(weights)) or np.any(weights < 0.0):
        raise ControllerError(
            f"{name} must be one number that is {least}, or {size} of them, got {value!r}"
        )
    if positive and np.any(weights == 0.0):
        raise ControllerError(f"{name} must be positive, got {value!r}")
    return np.broadcast_to(weights, (size,)).copy()
