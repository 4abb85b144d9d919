"""Putting a floating robot in space onto its ground, or above it."""

from __future__ import annotations

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.dynamics import spatial
from heelstrike.errors import SimulationError
from heelstrike.robot.spatial.robot import SpatialRobot, checked_state
from heelstrike.robot.state import State
from heelstrike.sim.spatial.space import SPACE


def placed_in_space(
    robot: SpatialRobot,
    ground: Ground | SpatialGround | None = None,
    *,
    above: float = 0.0,
    state: State | None = None,
) -> State:
    """Move a floating robot up or down until its lowest contact point is where it is to be.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    ground : SpatialGround or Ground, optional
        The ground, of which the plane counts; level by default.
    above : float
        How far above the plane of the ground, upwards, the lowest contact point is to be, in m.
    state : State, optional
        Its posture; at rest as in its file by default.

    Returns
    -------
    State
        The state, moved. One of a robot that does not float, or has no contact points, is as it
        was.

    Raises
    ------
    SimulationError
        If `above` is not a finite number from zero on.
    RobotError
        If the state does not fit the robot.
    """
    if not (np.isfinite(above) and above >= 0.0):
        raise SimulationError(f"above must be a height from zero on, in m, got {above}")
    begin = checked_state(robot, robot.reference_state() if state is None else state)
    if not (robot.floating and robot.nc):
        return begin
    plane = SPACE.checked_ground(ground)
    normal = np.asarray(plane.normal, dtype=np.float64)
    points = spatial.lowest_positions(robot, begin.q)
    below = plane.height - points[:, :2] @ normal[:2] / normal[2]
    q = begin.q.copy()
    q[2] += float((below - points[:, 2]).max()) + above
    return State(q, begin.v)
