"""Obstacles that a robot steps over, as constraints of its motions.

A sole and a box do not meet if both ends of the sole are above the box where they are over it, and
both upper corners of the box beneath the sole where they are under it.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import GaitError
from heelstrike.gait.cost import Instant, OwnConstraint
from heelstrike.robot.robot import Robot

ROOM = 0.01
"""How far (m) the constraint is beneath the ground beside the obstacle, where the ground itself
says enough: what is zero while a foot stands leaves the optimiser no room."""


@takes(GaitError)
def over_obstacle(
    robot: Robot, *, place: float, height: float, half_width: float, edge: float = 0.03
) -> OwnConstraint:
    """Return the constraint that keeps all soles above a box on the ground.

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
    positions, soles = robot.model.contact_position, []
    for foot in robot.feet:
        ahead = sorted(foot.contacts, key=lambda i: positions[i][0])
        length = float(np.hypot(*(positions[ahead[-1]] - positions[ahead[0]])))
        soles.append((ahead[0], ahead[-1], length))

    def clear(above: Any, outside: Any) -> Any:
        """How much higher than asked what is over the box is; less is asked of it outside."""
        ramp = casadi.fmax(1.0 - (outside / edge) ** 2, 0.0) ** 3
        return above + height + ROOM - (height + ROOM) * ramp

    def heights(now: Instant) -> Any:
        found = []
        for heel, toe, length in soles:
            ends = [now.points[i, :].T for i in dict.fromkeys((heel, toe))]
            for end in ends:
                found.append(clear(end[1] - height, _outside(end[0] - place, half_width)))
            if length == 0.0:
                continue
            along = (ends[1] - ends[0]) / length
            for side in (-1.0, 1.0):
                away = ends[0] - casadi.DM([place + side * half_width, height])
                above = along[0] * away[1] - along[1] * away[0]
                under = -casadi.dot(along, away) - 0.5 * length
                found.append(clear(above, _outside(under, 0.5 * length)))
        return casadi.vertcat(*found)

    return heights


def _outside(place: Any, half_width: float) -> Any:
    """How far a place is outside of the interval from -half_width to half_width."""
    return casadi.fmax(place - half_width, 0.0) + casadi.fmax(-place - half_width, 0.0)
