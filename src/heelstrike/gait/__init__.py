"""Gaits: how they are represented, saved, and found by optimisation."""

from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.file import load_gait
from heelstrike.gait.gait import Gait
from heelstrike.gait.margins import Margins
from heelstrike.gait.optimize import optimize_gait
from heelstrike.gait.piecewise import PiecewiseGait

__all__ = ["ClearanceProfile", "Gait", "Margins", "PiecewiseGait", "load_gait", "optimize_gait"]
