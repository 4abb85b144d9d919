"""An engineer's trajectory before it reaches hardware: what is wrong with it, and a walk of it."""

from heelstrike.experiments.checking.check import Check, check_motion
from heelstrike.experiments.checking.findings import Finding

__all__ = ["Check", "Finding", "check_motion"]
