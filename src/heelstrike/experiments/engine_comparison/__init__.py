"""The same robot, gait and law of control in other engines, and what each gets right."""

from heelstrike.experiments.engine_comparison.comparison import (
    EngineComparison,
    compare_engines,
)
from heelstrike.experiments.engine_comparison.entries import ABSENT, ENTRIES, Entry
from heelstrike.experiments.engine_comparison.figures import WalkFigures
from heelstrike.experiments.engine_comparison.walking import walk_in

__all__ = [
    "ABSENT",
    "ENTRIES",
    "EngineComparison",
    "Entry",
    "WalkFigures",
    "compare_engines",
    "walk_in",
]
