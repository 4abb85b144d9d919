"""Walking robots on exact hard contact.

Load a robot, design a gait, simulate it under a controller, look at what the feet did::

    import heelstrike as hs

    robot = hs.load_robot("bravo7")
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    run = hs.simulate(
        robot,
        hs.ComputedTorque(robot, gait),
        state=gait.initial_state,
        duration=7.0,
        method=hs.TimeStepping(step=1e-3),
        ground=hs.Ground(friction=0.75),
    )
    print(run.summary())

Each public name is listed once, here, and imported when it is first used: ``import heelstrike``
itself is quick and loads neither the compiler nor the plotting and optimisation libraries.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import heelstrike.compiler.plain_code as _plain_code

if _plain_code.is_asked_for():  # before anything else is imported
    _plain_code.select()

if TYPE_CHECKING:
    from heelstrike.analysis.limit_cycle import LimitCycle as LimitCycle
    from heelstrike.analysis.limit_cycle import find_limit_cycle as find_limit_cycle
    from heelstrike.analysis.stability.floquet import Floquet as Floquet
    from heelstrike.analysis.stability.floquet import floquet_multipliers as floquet_multipliers
    from heelstrike.analysis.stability.largest import Largest as Largest
    from heelstrike.analysis.stability.largest import largest_ground_step as largest_ground_step
    from heelstrike.analysis.stability.largest import largest_push as largest_push
    from heelstrike.analysis.stability.largest import largest_roughness as largest_roughness
    from heelstrike.analysis.stability.largest import largest_slope as largest_slope
    from heelstrike.analysis.stability.monodromy import Monodromy as Monodromy
    from heelstrike.analysis.stability.monodromy import monodromy as monodromy
    from heelstrike.analysis.stability.response import DisturbanceResponse as DisturbanceResponse
    from heelstrike.analysis.stability.response import (
        disturbance_response as disturbance_response,
    )
    from heelstrike.analysis.stability.sensitivity import (
        gait_sensitivity_norm as gait_sensitivity_norm,
    )
    from heelstrike.analysis.stability.trial import Trial as Trial
    from heelstrike.analysis.stability.zero_dynamics import ZeroDynamics as ZeroDynamics
    from heelstrike.analysis.stability.zero_dynamics import zero_dynamics as zero_dynamics
    from heelstrike.compiler.bundle import Bundle as Bundle
    from heelstrike.compiler.bundle import array as array
    from heelstrike.compiler.bundle import cell as cell
    from heelstrike.compiler.bundle import number as number
    from heelstrike.compiler.bundle import part as part
    from heelstrike.contact import ActiveContacts as ActiveContacts
    from heelstrike.contact import Box as Box
    from heelstrike.contact import ForceDistribution as ForceDistribution
    from heelstrike.contact import Ground as Ground
    from heelstrike.contact import GroundShape as GroundShape
    from heelstrike.contact import SpatialGround as SpatialGround
    from heelstrike.contact import contact_forward_dynamics as contact_forward_dynamics
    from heelstrike.contact import contact_inverse_dynamics as contact_inverse_dynamics
    from heelstrike.contact import contact_kinematics as contact_kinematics
    from heelstrike.contact import linearize_contact as linearize_contact
    from heelstrike.contact import linearize_impact as linearize_impact
    from heelstrike.contact import saltation_matrix as saltation_matrix
    from heelstrike.contact import solve_contact as solve_contact
    from heelstrike.control import Actuated as Actuated
    from heelstrike.control import ComputedTorque as ComputedTorque
    from heelstrike.control import Encoder as Encoder
    from heelstrike.control import Encoders as Encoders
    from heelstrike.control import Estimated as Estimated
    from heelstrike.control import Feedforward as Feedforward
    from heelstrike.control import FlatGaitLQR as FlatGaitLQR
    from heelstrike.control import FootSensors as FootSensors
    from heelstrike.control import FootstepFeedback as FootstepFeedback
    from heelstrike.control import GaitLQR as GaitLQR
    from heelstrike.control import InertialUnit as InertialUnit
    from heelstrike.control import JointPD as JointPD
    from heelstrike.control import MotionLQR as MotionLQR
    from heelstrike.control import MotionTracking as MotionTracking
    from heelstrike.control import Policy as Policy
    from heelstrike.control import Sensed as Sensed
    from heelstrike.control import StandingLQR as StandingLQR
    from heelstrike.control import SteppingConstraints as SteppingConstraints
    from heelstrike.control import VirtualConstraints as VirtualConstraints
    from heelstrike.control import WholeBody as WholeBody
    from heelstrike.control import ZeroMomentPointRegulation as ZeroMomentPointRegulation
    from heelstrike.control import controller as controller
    from heelstrike.control import solve_quadratic_program as solve_quadratic_program
    from heelstrike.control.spatial.hold_balance import HoldBalance as HoldBalance
    from heelstrike.control.spatial.hold_posture import HoldPosture as HoldPosture
    from heelstrike.errors import ContactProblemError as ContactProblemError
    from heelstrike.errors import ControllerError as ControllerError
    from heelstrike.errors import GaitError as GaitError
    from heelstrike.errors import GaitNotFoundError as GaitNotFoundError
    from heelstrike.errors import HeelstrikeError as HeelstrikeError
    from heelstrike.errors import InfeasibleGaitError as InfeasibleGaitError
    from heelstrike.errors import LimitCycleError as LimitCycleError
    from heelstrike.errors import RobotError as RobotError
    from heelstrike.errors import RunFileError as RunFileError
    from heelstrike.errors import SimulationError as SimulationError
    from heelstrike.errors import ViewError as ViewError
    from heelstrike.errors import WriteError as WriteError
    from heelstrike.experiments.campaigns import Campaign as Campaign
    from heelstrike.experiments.campaigns import CampaignResults as CampaignResults
    from heelstrike.experiments.comparison import compare as compare
    from heelstrike.experiments.engine_comparison import compare_engines as compare_engines
    from heelstrike.experiments.identification import identify as identify
    from heelstrike.experiments.people import mimic as mimic
    from heelstrike.experiments.planners import PlannerComparison as PlannerComparison
    from heelstrike.experiments.planners import compare_planners as compare_planners
    from heelstrike.experiments.spring_mass import SpringMass as SpringMass
    from heelstrike.gait import ContactPhase as ContactPhase
    from heelstrike.gait import Gait as Gait
    from heelstrike.gait import GaitFamily as GaitFamily
    from heelstrike.gait import GaitWarning as GaitWarning
    from heelstrike.gait import Motion as Motion
    from heelstrike.gait import PhasedGait as PhasedGait
    from heelstrike.gait import Planner as Planner
    from heelstrike.gait import Repeat as Repeat
    from heelstrike.gait import StepFamily as StepFamily
    from heelstrike.gait import gait_family as gait_family
    from heelstrike.gait import load_gait as load_gait
    from heelstrike.gait import load_gait_family as load_gait_family
    from heelstrike.gait import load_motion as load_motion
    from heelstrike.gait import make_invariant as make_invariant
    from heelstrike.gait import optimize_gait as optimize_gait
    from heelstrike.gait import optimize_motion as optimize_motion
    from heelstrike.gait import over_obstacle as over_obstacle
    from heelstrike.gait import plan_motion as plan_motion
    from heelstrike.robot import Robot as Robot
    from heelstrike.robot import RobotBuilder as RobotBuilder
    from heelstrike.robot import RobotWarning as RobotWarning
    from heelstrike.robot import SpatialRobot as SpatialRobot
    from heelstrike.robot import State as State
    from heelstrike.robot import builtin_robots as builtin_robots
    from heelstrike.robot import inspect_robot as inspect_robot
    from heelstrike.robot import load_robot as load_robot
    from heelstrike.robot.human import human as human
    from heelstrike.sim import Batch as Batch
    from heelstrike.sim import BatchResult as BatchResult
    from heelstrike.sim import Compliant as Compliant
    from heelstrike.sim import Constraint as Constraint
    from heelstrike.sim import ControllerWarning as ControllerWarning
    from heelstrike.sim import EndOfRun as EndOfRun
    from heelstrike.sim import EventDriven as EventDriven
    from heelstrike.sim import HeldTorque as HeldTorque
    from heelstrike.sim import HuntCrossley as HuntCrossley
    from heelstrike.sim import ImpulseSet as ImpulseSet
    from heelstrike.sim import KelvinVoigt as KelvinVoigt
    from heelstrike.sim import Push as Push
    from heelstrike.sim import Run as Run
    from heelstrike.sim import RunStatus as RunStatus
    from heelstrike.sim import Scheme as Scheme
    from heelstrike.sim import Simulation as Simulation
    from heelstrike.sim import SimulationWarning as SimulationWarning
    from heelstrike.sim import Snapshot as Snapshot
    from heelstrike.sim import TimeStepping as TimeStepping
    from heelstrike.sim import constrained as constrained
    from heelstrike.sim import load_run as load_run
    from heelstrike.sim import load_snapshot as load_snapshot
    from heelstrike.sim import simulate as simulate
    from heelstrike.sim import simulate_batch as simulate_batch
    from heelstrike.sim.linearized.derivatives import Gradient as Gradient
    from heelstrike.sim.linearized.derivatives import RunDerivatives as RunDerivatives
    from heelstrike.sim.linearized.derivatives import StepDerivatives as StepDerivatives
    from heelstrike.sim.linearized.derivatives import run_derivatives as run_derivatives
    from heelstrike.sim.linearized.derivatives import step_derivatives as step_derivatives
    from heelstrike.sim.linearized.mode_changes import ModeChange as ModeChange
    from heelstrike.view.live import watch as watch
    from heelstrike.view.report import report as report

__version__ = "0.1.0"

# Public name -> the package that defines it. The imports above repeat this for type checkers,
# which cannot follow `__getattr__`; a test keeps the two alike.
_HOME = {
    "ActiveContacts": "heelstrike.contact",
    "Actuated": "heelstrike.control",
    "Batch": "heelstrike.sim",
    "BatchResult": "heelstrike.sim",
    "Box": "heelstrike.contact",
    "Bundle": "heelstrike.compiler.bundle",
    "Campaign": "heelstrike.experiments.campaigns",
    "CampaignResults": "heelstrike.experiments.campaigns",
    "Compliant": "heelstrike.sim",
    "ComputedTorque": "heelstrike.control",
    "Constraint": "heelstrike.sim",
    "ContactPhase": "heelstrike.gait",
    "ContactProblemError": "heelstrike.errors",
    "ControllerError": "heelstrike.errors",
    "ControllerWarning": "heelstrike.sim",
    "DisturbanceResponse": "heelstrike.analysis.stability.response",
    "Encoder": "heelstrike.control",
    "Encoders": "heelstrike.control",
    "EndOfRun": "heelstrike.sim",
    "Estimated": "heelstrike.control",
    "EventDriven": "heelstrike.sim",
    "Feedforward": "heelstrike.control",
    "FlatGaitLQR": "heelstrike.control",
    "Floquet": "heelstrike.analysis.stability.floquet",
    "FootSensors": "heelstrike.control",
    "FootstepFeedback": "heelstrike.control",
    "ForceDistribution": "heelstrike.contact",
    "Gait": "heelstrike.gait",
    "GaitError": "heelstrike.errors",
    "GaitFamily": "heelstrike.gait",
    "GaitLQR": "heelstrike.control",
    "GaitNotFoundError": "heelstrike.errors",
    "GaitWarning": "heelstrike.gait",
    "Gradient": "heelstrike.sim.linearized.derivatives",
    "Ground": "heelstrike.contact",
    "GroundShape": "heelstrike.contact",
    "HeelstrikeError": "heelstrike.errors",
    "HeldTorque": "heelstrike.sim",
    "HoldBalance": "heelstrike.control.spatial.hold_balance",
    "HoldPosture": "heelstrike.control.spatial.hold_posture",
    "HuntCrossley": "heelstrike.sim",
    "ImpulseSet": "heelstrike.sim",
    "InertialUnit": "heelstrike.control",
    "InfeasibleGaitError": "heelstrike.errors",
    "JointPD": "heelstrike.control",
    "KelvinVoigt": "heelstrike.sim",
    "Largest": "heelstrike.analysis.stability.largest",
    "LimitCycle": "heelstrike.analysis.limit_cycle",
    "LimitCycleError": "heelstrike.errors",
    "ModeChange": "heelstrike.sim.linearized.mode_changes",
    "Monodromy": "heelstrike.analysis.stability.monodromy",
    "Motion": "heelstrike.gait",
    "MotionLQR": "heelstrike.control",
    "MotionTracking": "heelstrike.control",
    "PhasedGait": "heelstrike.gait",
    "Planner": "heelstrike.gait",
    "PlannerComparison": "heelstrike.experiments.planners",
    "Policy": "heelstrike.control",
    "Push": "heelstrike.sim",
    "Repeat": "heelstrike.gait",
    "Robot": "heelstrike.robot",
    "RobotBuilder": "heelstrike.robot",
    "RobotError": "heelstrike.errors",
    "RobotWarning": "heelstrike.robot",
    "Run": "heelstrike.sim",
    "RunDerivatives": "heelstrike.sim.linearized.derivatives",
    "RunFileError": "heelstrike.errors",
    "RunStatus": "heelstrike.sim",
    "Scheme": "heelstrike.sim",
    "Sensed": "heelstrike.control",
    "Simulation": "heelstrike.sim",
    "SimulationError": "heelstrike.errors",
    "SimulationWarning": "heelstrike.sim",
    "Snapshot": "heelstrike.sim",
    "SpatialGround": "heelstrike.contact",
    "SpatialRobot": "heelstrike.robot",
    "SpringMass": "heelstrike.experiments.spring_mass",
    "StandingLQR": "heelstrike.control",
    "State": "heelstrike.robot",
    "StepDerivatives": "heelstrike.sim.linearized.derivatives",
    "StepFamily": "heelstrike.gait",
    "SteppingConstraints": "heelstrike.control",
    "TimeStepping": "heelstrike.sim",
    "Trial": "heelstrike.analysis.stability.trial",
    "ViewError": "heelstrike.errors",
    "VirtualConstraints": "heelstrike.control",
    "WholeBody": "heelstrike.control",
    "WriteError": "heelstrike.errors",
    "ZeroDynamics": "heelstrike.analysis.stability.zero_dynamics",
    "ZeroMomentPointRegulation": "heelstrike.control",
    "array": "heelstrike.compiler.bundle",
    "builtin_robots": "heelstrike.robot",
    "cell": "heelstrike.compiler.bundle",
    "compare": "heelstrike.experiments.comparison",
    "compare_engines": "heelstrike.experiments.engine_comparison",
    "compare_planners": "heelstrike.experiments.planners",
    "constrained": "heelstrike.sim",
    "contact_forward_dynamics": "heelstrike.contact",
    "contact_inverse_dynamics": "heelstrike.contact",
    "contact_kinematics": "heelstrike.contact",
    "controller": "heelstrike.control",
    "disturbance_response": "heelstrike.analysis.stability.response",
    "find_limit_cycle": "heelstrike.analysis.limit_cycle",
    "floquet_multipliers": "heelstrike.analysis.stability.floquet",
    "gait_family": "heelstrike.gait",
    "gait_sensitivity_norm": "heelstrike.analysis.stability.sensitivity",
    "human": "heelstrike.robot.human",
    "identify": "heelstrike.experiments.identification",
    "inspect_robot": "heelstrike.robot",
    "largest_ground_step": "heelstrike.analysis.stability.largest",
    "largest_push": "heelstrike.analysis.stability.largest",
    "largest_roughness": "heelstrike.analysis.stability.largest",
    "largest_slope": "heelstrike.analysis.stability.largest",
    "linearize_contact": "heelstrike.contact",
    "linearize_impact": "heelstrike.contact",
    "load_gait": "heelstrike.gait",
    "load_gait_family": "heelstrike.gait",
    "load_motion": "heelstrike.gait",
    "load_robot": "heelstrike.robot",
    "load_run": "heelstrike.sim",
    "load_snapshot": "heelstrike.sim",
    "make_invariant": "heelstrike.gait",
    "mimic": "heelstrike.experiments.people",
    "monodromy": "heelstrike.analysis.stability.monodromy",
    "number": "heelstrike.compiler.bundle",
    "optimize_gait": "heelstrike.gait",
    "optimize_motion": "heelstrike.gait",
    "over_obstacle": "heelstrike.gait",
    "part": "heelstrike.compiler.bundle",
    "plan_motion": "heelstrike.gait",
    "report": "heelstrike.view.report",
    "run_derivatives": "heelstrike.sim.linearized.derivatives",
    "saltation_matrix": "heelstrike.contact",
    "simulate": "heelstrike.sim",
    "simulate_batch": "heelstrike.sim",
    "solve_contact": "heelstrike.contact",
    "solve_quadratic_program": "heelstrike.control",
    "step_derivatives": "heelstrike.sim.linearized.derivatives",
    "watch": "heelstrike.view.live",
    "zero_dynamics": "heelstrike.analysis.stability.zero_dynamics",
}


def __getattr__(name: str) -> Any:
    home = _HOME.get(name)
    if home is None:
        # With a name and without an object Python adds no guess of its own to the same line.
        raise AttributeError(
            f"module {__name__!r} has no attribute {name!r}{_meant(name)}", name=name
        )
    value = getattr(importlib.import_module(home), name)
    globals()[name] = value  # the next look-up does not come here
    return value


def _meant(name: str) -> str:
    """Guess which public name somebody means who writes another."""
    if name.startswith("_"):
        return ""
    import difflib

    lower = {each.lower().replace("_", ""): each for each in _HOME}
    near = difflib.get_close_matches(name.lower().replace("_", ""), lower, n=1, cutoff=0.7)
    return f". Did you mean {lower[near[0]]!r}?" if near else ""


def __dir__() -> list[str]:
    return sorted([*_HOME, *(name for name in globals() if name.startswith("__"))])
