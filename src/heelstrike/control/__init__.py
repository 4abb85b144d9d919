"""Controllers: the stock ones, and how to write others."""

from heelstrike.control.computed_torque import ComputedTorque, Encoder
from heelstrike.control.preview import PreviewControl, preview_control
from heelstrike.control.virtual_constraints import VirtualConstraints
from heelstrike.sim.controller.law import ControllerFunction, Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

__all__ = [
    "ComputedTorque",
    "ControlState",
    "ControlledRobot",
    "ControllerFunction",
    "Encoder",
    "Law",
    "PreviewControl",
    "VirtualConstraints",
    "controller",
    "preview_control",
]
