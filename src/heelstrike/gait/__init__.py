"""Gaits: how they are represented, saved, and found by optimisation."""

from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.file import load_gait
from heelstrike.gait.gait import Footing, Gait, Phase
from heelstrike.gait.margins import Margins
from heelstrike.gait.optimize import optimize_gait

__all__ = ["ClearanceProfile", "Footing", "Gait", "Margins", "Phase", "load_gait", "optimize_gait"]
