"""A simulation in space: that of the plane, with what differs told."""

from __future__ import annotations

from functools import wraps
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
    controller, state, control_period, record_every, stop_when_fallen, on_error
        As for :class:`~heelstrike.Simulation`.
    method : TimeStepping
        Its scheme is ``IMPACT_RESOLVED`` or ``GAP_LINEARISED``.
    ground : SpatialGround or Ground
        A Ground without a profile is taken for all y.
    pushes : sequence of Push
        Their forces have three components (x, y, z).
    latched, braked, checked
        For the plane only.

    Raises
    ------
    SimulationError, ControllerError, RobotError
        If the arguments are not usable.
    """

    @wraps(Simulation.__init__)  # type: ignore[misc]  # help shows its signature
    def __init__(self, robot: SpatialRobot, *others: Any, **setup: Any) -> None:
        if not isinstance(robot, SpatialRobot):
            raise SimulationError(f"robot must be a SpatialRobot, got {type(robot).__name__}")
        super().__init__(robot, *others, **setup)
