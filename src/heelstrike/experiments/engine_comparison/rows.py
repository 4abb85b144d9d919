"""A row of the comparison."""

from __future__ import annotations

from heelstrike.experiments.engine_comparison.figures import WalkFigures
from heelstrike.field_texts import dataclass


@dataclass(frozen=True)
class EngineRow:
    """A walk in an engine."""

    engine: str
    """Name of the row's engine, as commands have it."""
    title: str
    """What tables call it."""
    settings: str
    """``defaults`` or ``best``."""
    step_s: float
    """Step of the engine, in s."""
    figures: WalkFigures | None
    """What came of it; None if nothing did."""
    reason: str
    """Why nothing came of it."""
    command: str
    """What makes this row again."""
