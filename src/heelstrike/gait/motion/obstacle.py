"""Obstacles that a robot steps over, as constraints of its motions."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import casadi
import numpy as np

from heelstrike.arguments import positive, takes
from heelstrike.errors import GaitError
from heelstrike.gait.cost import Instant, OwnConstraint
from heelstrike.robot.robot import Robot

UPRIGHT = 1e-3
"""Share of its length that a sole covers along the ground at least, where this divides."""
ROOM = 0.01
"""How far (m) the constraint is beneath the ground beside the obstacle, where the ground itself
says enough: what is zero while a foot stands leaves the optimiser no room."""


@takes(GaitError)
def over_obstacle(
    robot: Robot, *, place: float, height: float, half_width: float, edge: float = 0.03
) -> OwnConstraint:
    """Return the constraint that keeps every sole above a box on the ground.

    A sole is the straight line from each contact point of a foot to the next. Its lowest place over
    the box is a contact point, or is above an edge of the box: these are kept clear. Shanks and all
    else are not looked at, and of a disc only its lowest point is.

    Parameters
    ----------
    robot : Robot
        The robot.
    place : float
        Where the middle of the box is (m), along the ground from the origin of the world. Motions
        that repeat begin with the trunk at x = 0.
    height : float
        How high it is (m).
    half_width : float
        Half of its width (m).
    edge : float
        Distance (m) beside the box within which feet keep above a smooth ramp to its edge: the
        optimiser needs derivatives. They may stand beyond.

    Returns
    -------
    function
        For ``optimize_motion(constraint=...)``.

    Raises
    ------
    GaitError
        If a number makes no sense, or the robot has no feet.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> hurdle = hs.over_obstacle(robot, place=0.15, height=0.1, half_width=0.02)
    """
    for name, value in {"height": height, "half_width": half_width, "edge": edge}.items():
        positive(f"{name} of an obstacle", value, GaitError, "m")
    if not np.isfinite(place):
        raise GaitError(f"place of an obstacle must be a number (m), got {place!r}")
    if not robot.feet:
        raise GaitError(
            f"robot {robot.name!r} has no feet to keep above an obstacle: give it contact points, "
            "or write a constraint of your own, as a function of an hs.gait.Instant"
        )
    model = robot.model
    feet = [
        sorted(foot.contacts, key=lambda i: model.contact_position[i][0]) for foot in robot.feet
    ]
    lines = [
        (i, j, UPRIGHT * float(np.linalg.norm(np.subtract(*model.contact_position[[i, j]]))))
        for foot in feet
        for i, j in pairwise(foot)
    ]

    def heights(now: Instant) -> Any:
        places = [now.points[i, :] for foot in feet for i in foot]
        for i, j, least in lines:
            one, way = now.points[i, :], now.points[j, :] - now.points[i, :]
            ahead, back = casadi.fmax(way[0], least), casadi.fmin(way[0], -least)
            along = casadi.if_else(way[0] < 0.0, back, ahead)
            for side in (-half_width, half_width):
                share = casadi.fmin(casadi.fmax((place + side - one[0]) / along, 0.0), 1.0)
                places.append(one + share * way)
        above = []
        for at in places:
            away = at[0] - place
            beside = casadi.fmax(away - half_width, 0.0) + casadi.fmax(-away - half_width, 0.0)
            ramp = casadi.fmax(1.0 - (beside / edge) ** 2, 0.0) ** 3
            above.append(at[1] + ROOM - (height + ROOM) * ramp)
        return casadi.vertcat(*above)

    return heights
