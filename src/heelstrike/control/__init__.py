"""Controllers: the stock ones, and how to write others."""

from heelstrike.control.actuation import Actuated
from heelstrike.control.balance.controllers import FootstepFeedback, WholeBody
from heelstrike.control.computed_torque import ComputedTorque, Encoder
from heelstrike.control.estimation import Estimated
from heelstrike.control.gait_lqr.flat_law import FlatGaitLQR
from heelstrike.control.gait_lqr.law import GaitLQR
from heelstrike.control.gait_lqr.phases_law import MotionLQR
from heelstrike.control.joint_pd import Feedforward, JointPD
from heelstrike.control.motion_tracking import MotionTracking
from heelstrike.control.noise import RandomNumbers
from heelstrike.control.policy.law import Policy
from heelstrike.control.policy.network import Layer, Network, load_network
from heelstrike.control.policy.reference import Reference
from heelstrike.control.quadratic.dual_active_set import solve_or_relax
from heelstrike.control.quadratic.program import Program
from heelstrike.control.quadratic.solution import QuadraticSolution, solve_quadratic_program
from heelstrike.control.regulation.controller import ZeroMomentPointRegulation
from heelstrike.control.sensing import Encoders, FootSensors, InertialUnit, Sensed
from heelstrike.control.standing_lqr import StandingLQR
from heelstrike.control.stepping_constraints import SteppingConstraints
from heelstrike.control.virtual_constraints import VirtualConstraints
from heelstrike.dynamics.dense import LinearEquations
from heelstrike.gait.cart_table.preview import PreviewControl, preview_control
from heelstrike.sim.controller.law import ControllerFunction, Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState, controlled_robot

__all__ = [
    "Actuated",
    "ComputedTorque",
    "ControlState",
    "ControlledRobot",
    "ControllerFunction",
    "Encoder",
    "Encoders",
    "Estimated",
    "Feedforward",
    "FlatGaitLQR",
    "FootSensors",
    "FootstepFeedback",
    "GaitLQR",
    "InertialUnit",
    "JointPD",
    "Law",
    "Layer",
    "LinearEquations",
    "MotionLQR",
    "MotionTracking",
    "Network",
    "Policy",
    "PreviewControl",
    "Program",
    "QuadraticSolution",
    "RandomNumbers",
    "Reference",
    "Sensed",
    "StandingLQR",
    "SteppingConstraints",
    "VirtualConstraints",
    "WholeBody",
    "ZeroMomentPointRegulation",
    "controlled_robot",
    "controller",
    "load_network",
    "preview_control",
    "solve_or_relax",
    "solve_quadratic_program",
]
