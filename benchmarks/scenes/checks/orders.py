"""How the energy that nothing explains falls with the step of time stepping.

Each scene is run with the default scheme at STEPS, and at FURTHER ones if these do not show the
order that is asked for (what a step hits or misses scatters the drift), and judged by
:mod:`scenes.step_judge`: no solve of the contacts may add kinetic energy, but for what pushing a
point out of the ground asks for (`made`, the worst of all steps, relative to the data of its step).
What work over the steps leaves of the change of energy, relative to the energy in play, is `drift`;
its `order` is the slope of a line through the logarithms of drift and step, at the finest five
steps. Where the drift is below ROUNDING there is nothing to fall.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from heelstrike.errors import HeelstrikeError
from scenes.methods import Setting
from scenes.scene import random_scene

Words = dict[str, Any]

STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)
FURTHER = (3.125e-5, 1.5625e-5)
"""Steps (s)."""
FINEST = 5
"""So many of them show the order."""
ORDER = 0.9
"""Order that is asked for."""
MADE = 1e-7
"""Energy that the contacts of a step may make, relative to its data."""
ROUNDING = 1e-9
"""Drift (relative) that gaps of 1e-9 m, which count as touching, may leave at any step."""
SCHEME = "impact_resolved"
"""The default scheme."""


def order(steps: tuple[float, ...], drift: list[float]) -> float:
    """Slope of the line through the logarithms of steps and drifts; infinite without a drift."""
    if max(drift) <= ROUNDING:
        return float("inf")
    values = np.log(np.maximum(drift[-FINEST:], 1e-2 * ROUNDING))
    return float(np.polyfit(np.log(steps[-FINEST:]), values, 1)[0])


def orders_of_scene(check: str, seed: int, *, twins: bool = True) -> Words:
    """Measure one scene; `twins` says nothing here."""
    del twins
    began = time.process_time()
    setting = Setting.of(random_scene(seed))
    result: Words = {"method": check, "seed": seed, "kind": setting.scene.kind}
    drift, made, status, message = [], 0.0, "completed", ""
    slope = 0.0
    for count, step in enumerate(STEPS + FURTHER, start=1):
        if count > len(STEPS) and slope >= ORDER:
            break
        try:
            run = setting.run(SCHEME, rows=step)
        except HeelstrikeError as error:
            return result | {"status": "refused", "passes": False, "message": str(error)}
        if not run.completed:
            status, message = run.status.value, run.message
        found = setting.judge(SCHEME, run)
        drift.append(found.figures["energy drift"])
        made = max(made, found.worst["energy made in contact"])
        slope = order((STEPS + FURTHER)[:count], drift) if count > 1 else 0.0
    causes = []
    if status != "completed":
        causes.append(status)
    if made > MADE:
        causes.append("contacts make energy")
    if slope < ORDER:
        causes.append("low order")
    return result | {
        "status": status,
        "message": message,
        "passes": not causes,
        "cause": ", ".join(causes),
        "size": drift[0],
        "drift": drift,
        "order": slope if np.isfinite(slope) else None,
        "made": made,
        "seconds": time.process_time() - began,
    }
