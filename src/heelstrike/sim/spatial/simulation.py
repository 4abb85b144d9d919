"""A simulation in space: that of the plane, with what differs told."""

from __future__ import annotations

from typing import Any

from heelstrike.errors import SimulationError
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.simulation import Simulation


class SpatialSimulation(Simulation):
    """A robot in space on the ground under a controller, at some instant.

    ``Simulation(robot, ...)`` is one where the robot is one in space.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    *others, **setup
        As for :class:`~heelstrike.Simulation`: `method` is TimeStepping, its scheme
        ``IMPACT_RESOLVED`` or ``GAP_LINEARISED``; `ground` is a SpatialGround, or a Ground without
        a profile, which is taken for all y; pushes have forces (x, y, z). Latches, brakes and
        `checked` are for the plane.

    Raises
    ------
    SimulationError, ControllerError, RobotError
        If the arguments are not usable.
    """

    def __init__(self, robot: SpatialRobot, *others: Any, **setup: Any) -> None:
        if not isinstance(robot, SpatialRobot):
            raise SimulationError(f"robot must be a SpatialRobot, got {type(robot).__name__}")
        super().__init__(robot, *others, **setup)
