"""Obstacles that a robot steps over, as constraints of its motions."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import GaitError
from heelstrike.gait.cost import Instant, OwnConstraint
from heelstrike.robot.robot import Robot

PLACES = 5
"""Places along a sole that are kept clear, both ends among them."""
ROOM = 0.01
"""How far (m) the constraint is beneath the ground beside the obstacle, where the ground itself
says enough: what is zero while a foot stands leaves the optimiser no room."""


@takes(GaitError)
def over_obstacle(
    robot: Robot, *, place: float, height: float, half_width: float, edge: float = 0.03
) -> OwnConstraint:
    """Return the constraint that keeps five places of every sole above a box on the ground.

    Between these places a tilted sole may dip a little beneath the edges of the box: give it a
    greater height then.

    Parameters
    ----------
    robot : Robot
        The robot.
    place : float
        Where the middle of the box is along the ground (m).
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
        If a number makes no sense.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> hurdle = hs.over_obstacle(robot, place=0.15, height=0.1, half_width=0.02)
    """
    sizes = {"height": height, "half_width": half_width, "edge": edge}
    for name, value in sizes.items():
        if not (np.isfinite(value) and value > 0.0):
            raise GaitError(f"{name} of an obstacle must be positive (m), got {value!r}")
    if not np.isfinite(place):
        raise GaitError(f"place of an obstacle must be a number (m), got {place!r}")
    soles = []
    for foot in robot.feet:
        ahead = sorted(foot.contacts, key=lambda i: robot.model.contact_position[i][0])
        soles.append((ahead[0], ahead[-1]))

    def heights(now: Instant) -> Any:
        above = []
        for heel, toe in soles:
            for share in np.linspace(0.0, 1.0, PLACES if heel != toe else 1):
                point = (1.0 - share) * now.points[heel, :] + share * now.points[toe, :]
                away = point[0] - place
                beside = casadi.fmax(away - half_width, 0.0) + casadi.fmax(-away - half_width, 0.0)
                ramp = casadi.fmax(1.0 - (beside / edge) ** 2, 0.0) ** 3
                above.append(point[1] + ROOM - (height + ROOM) * ramp)
        return casadi.vertcat(*above)

    return heights
