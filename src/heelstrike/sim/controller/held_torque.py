"""Torques that come from outside and are held until others come."""

from __future__ import annotations

from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle, array
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.law import Law, controller, per_actuator


class Command(Bundle):
    """What is commanded."""

    torque: Floats = array("nu")
    """Torque of each actuator (N m)."""


@controller
def held_torque(parameters: Command, torque: Floats) -> None:
    """Apply the torques that were commanded last."""
    for i in range(torque.shape[0]):
        torque[i] = parameters.torque[i]


class HeldTorque(Law):
    """Joint torques that are commanded from outside, and held until others are.

    Set ``simulation.parameters.torque[:]``, or ``batch.command[:]``, whenever a decision is made.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot.
    torque : float or (nu,) float
        Torques to begin with (N m).

    Raises
    ------
    ControllerError
        If the torques are not one finite number, or one an actuator.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> simulation = hs.Simulation(robot, hs.HeldTorque(robot), state=robot.reference_state())
    >>> simulation.parameters.torque[:] = 0.5
    >>> simulation.advance(0.01).value
    'completed'
    """

    commanded = "torque"

    @takes(ControllerError)
    def __init__(self, robot: Robot | SpatialRobot, torque: ArrayLike = 0.0) -> None:
        held = per_actuator("torque", torque, robot)
        super().__init__(held_torque, Command(torque=held))
