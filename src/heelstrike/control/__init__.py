"""Controllers: the stock ones, and how to write others."""

from heelstrike.control.actuation import Actuated
from heelstrike.control.computed_torque import ComputedTorque, Encoder
from heelstrike.control.estimation import Estimated
from heelstrike.control.sensing import Encoders, FootSensors, InertialUnit, Sensed
from heelstrike.sim.controller.law import ControllerFunction, Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

__all__ = [
    "Actuated",
    "ComputedTorque",
    "ControlState",
    "ControlledRobot",
    "ControllerFunction",
    "Encoder",
    "Encoders",
    "Estimated",
    "FootSensors",
    "InertialUnit",
    "Law",
    "Sensed",
    "controller",
]
