"""What a run says about walking: zero moment point, friction, slip, tracking, energy, steps."""

from heelstrike.analysis.actuation import (
    CostOfTransport,
    actuator_power,
    cost_of_transport,
    distance_travelled,
    torque_cost,
)
from heelstrike.analysis.diagnosis.changes import Change, Lever, Tried, changes
from heelstrike.analysis.diagnosis.falls import Fall, first_cause
from heelstrike.analysis.diagnosis.limits import Limit, limits
from heelstrike.analysis.diagnosis.measures import Measure, MotorLoad, measures, motor_loads
from heelstrike.analysis.diagnosis.symptoms import Cause, Symptom
from heelstrike.analysis.energy import EnergyBalance, energy_balance
from heelstrike.analysis.friction import FrictionUse, friction_use
from heelstrike.analysis.limit_cycle import LimitCycle, find_limit_cycle
from heelstrike.analysis.motion import Motion, run_motion
from heelstrike.analysis.penetration import penetration
from heelstrike.analysis.recovery import Recovery, recovery
from heelstrike.analysis.slip import max_slip, slip_distance
from heelstrike.analysis.stability.zero_dynamics import ZeroDynamics, zero_dynamics
from heelstrike.analysis.summary import Summary, summarize
from heelstrike.analysis.support import (
    Stance,
    SupportPhase,
    double_support_fraction,
    phase_time,
    single_support,
    stances,
    support_phases,
    walking_steps,
)
from heelstrike.analysis.tracking import (
    ReferenceMotion,
    TrackingError,
    reference_motion,
    tracking_error,
)
from heelstrike.analysis.wrenches import foot_wrenches
from heelstrike.analysis.zero_moment_point import (
    ZeroMomentPoint,
    zero_moment_point,
    zero_moment_point_limits,
)
from heelstrike.robot.sole import Sole, soles
from heelstrike.sim.linearized.step import Saltation

__all__ = [
    "Cause",
    "Change",
    "CostOfTransport",
    "EnergyBalance",
    "Fall",
    "FrictionUse",
    "Lever",
    "Limit",
    "LimitCycle",
    "Measure",
    "Motion",
    "MotorLoad",
    "Recovery",
    "ReferenceMotion",
    "Saltation",
    "Sole",
    "Stance",
    "Summary",
    "SupportPhase",
    "Symptom",
    "TrackingError",
    "Tried",
    "ZeroDynamics",
    "ZeroMomentPoint",
    "actuator_power",
    "changes",
    "cost_of_transport",
    "distance_travelled",
    "double_support_fraction",
    "energy_balance",
    "find_limit_cycle",
    "first_cause",
    "foot_wrenches",
    "friction_use",
    "limits",
    "max_slip",
    "measures",
    "motor_loads",
    "penetration",
    "phase_time",
    "recovery",
    "reference_motion",
    "run_motion",
    "single_support",
    "slip_distance",
    "soles",
    "stances",
    "summarize",
    "support_phases",
    "torque_cost",
    "tracking_error",
    "walking_steps",
    "zero_dynamics",
    "zero_moment_point",
    "zero_moment_point_limits",
]
