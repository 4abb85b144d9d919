"""The same robot, gait and law of control in other engines, and what each gets right."""

from heelstrike.experiments.engine_comparison.comparison import EngineComparison, compare_engines
from heelstrike.experiments.engine_comparison.compass_table import (
    CompassRow,
    CompassTable,
    compare_compass,
)
from heelstrike.experiments.engine_comparison.figures import WalkFigures
from heelstrike.experiments.engine_comparison.guards import Guards, guard
from heelstrike.experiments.engine_comparison.pushes import PushRow, PushTable, compare_pushes
from heelstrike.experiments.engine_comparison.rows import EngineRow
from heelstrike.experiments.engine_comparison.scene_table import (
    SceneRow,
    SceneTable,
    compare_scenes,
)
from heelstrike.experiments.engine_comparison.walking import walk_in

__all__ = [
    "CompassRow",
    "CompassTable",
    "EngineComparison",
    "EngineRow",
    "Guards",
    "PushRow",
    "PushTable",
    "SceneRow",
    "SceneTable",
    "WalkFigures",
    "compare_compass",
    "compare_engines",
    "compare_pushes",
    "compare_scenes",
    "guard",
    "walk_in",
]
