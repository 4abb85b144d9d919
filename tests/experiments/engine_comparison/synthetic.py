"""A comparison made up by hand: two engines, one of which falls, and one that is missing."""

from __future__ import annotations

import math
from dataclasses import replace

from heelstrike.experiments.engine_comparison import EngineComparison, EngineRow, WalkFigures
from heelstrike.experiments.engines.packages import PACKAGES

WALK = WalkFigures(
    walks=True, steps=3, ending="completed", tracking_rad=1e-3, position=2e-3, touchdown_s=1e-3,
    impulse_Ns=0.5, zmp_m=5e-3, slip_m=1e-4, penetration_m=1e-5, energy_J=math.nan, noise=1e-4,
    peak=20.0, step_us=30.0, computing_s=0.1,
)  # fmt: skip
FALL = replace(WALK, walks=False, steps=1, ending="fell: slipped at 0.100 s")


def made_up() -> EngineComparison:
    def row(engine: str, title: str, step: float, figures: WalkFigures | None) -> EngineRow:
        why = "" if figures else "ODE is not installed"
        return EngineRow(engine, title, "defaults", step, figures, why, "heelstrike compare")

    rows = []
    for step in (2e-3, 1e-3):
        rows += [
            row("heelstrike", "heelstrike", step, WALK),
            row("mujoco", "MuJoCo", step, FALL if step > 1e-3 else WALK),
            row("bullet", "Bullet", step, FALL),
            row("ode", "ODE", step, None),
        ]
    versions = dict.fromkeys(PACKAGES, "1.2.3") | {"ode": "not installed"}
    return EngineComparison("bravo7", 3, 2e-3, WALK, versions, tuple(rows), {"Vortex": "none"})
