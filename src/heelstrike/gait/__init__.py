"""Gaits: how they are represented, saved, and found by optimisation."""

from heelstrike.gait.cart_table.center_of_mass import Planner
from heelstrike.gait.cart_table.plan import plan_motion
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.cost import Cost, Instant
from heelstrike.gait.family import GaitFamily, gait_family, load_gait_family
from heelstrike.gait.file import load_gait
from heelstrike.gait.gait import Footing, Gait, Phase
from heelstrike.gait.margins import Margins
from heelstrike.gait.motion.file import load_motion
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.obstacle import over_obstacle
from heelstrike.gait.motion.optimize import GaitWarning, optimize_motion
from heelstrike.gait.motion.phases import ContactPhase
from heelstrike.gait.motion.request import Repeat
from heelstrike.gait.optimize import optimize_gait
from heelstrike.gait.phased.family import StepFamily
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.gait.phased.surface import Touchdown, make_invariant

__all__ = [
    "ClearanceProfile",
    "ContactPhase",
    "Cost",
    "Footing",
    "Gait",
    "GaitFamily",
    "GaitWarning",
    "Instant",
    "Margins",
    "Motion",
    "MotionPhase",
    "Phase",
    "PhasedGait",
    "Planner",
    "Repeat",
    "StepFamily",
    "Touchdown",
    "gait_family",
    "load_gait",
    "load_gait_family",
    "load_motion",
    "make_invariant",
    "optimize_gait",
    "optimize_motion",
    "over_obstacle",
    "plan_motion",
]
