"""Certificates over a million walking steps with random pushes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.control.computed_torque import ComputedTorque
from heelstrike.gait import optimize_gait
from heelstrike.robot import load_robot
from heelstrike.sim import Push, RunStatus, TimeStepping, simulate_batch
from speed.race import STEP
from speed.scenarios import FRICTION

STEPS = 1_000_000
DURATION = 7.0
STRONGEST = 60.0
"""Of a push, in N, over 0.1 s, in any direction; some of the robots fall."""


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:  # noqa: ARG001
    """Walk bravo7 until there are a million steps in all."""
    robot = load_robot("bravo7")
    gait = optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.8 * FRICTION)
    rng = np.random.default_rng(0)
    wanted = STEPS // 50 if quick else STEPS
    total: dict[str, Any] = {
        "steps": 0,
        "runs": 0,
        "fell": 0,
        "failures": 0,
        "fallbacks": 0,
        "shortcuts": 0,
        "solves": 0,
        "complementarity": 0.0,
        "cone": 0.0,
        "non_penetration": 0.0,
        "penetration_m": 0.0,
        "unfinished": 0,
    }
    while total["steps"] < wanted:
        count = max(1, round((wanted - total["steps"]) * STEP / DURATION + 0.5))
        pushes = [
            [_push(rng, start) for start in np.arange(0.3, DURATION, 1.0)] for _ in range(count)
        ]
        batch = simulate_batch(
            robot,
            ComputedTorque(robot, gait),
            state=gait.initial_state,
            duration=DURATION,
            method=TimeStepping(step=STEP),
            ground=Ground(friction=FRICTION),
            pushes=pushes,
            progress=False,
        )
        if any(status is RunStatus.INTERRUPTED for status in batch.status):
            raise KeyboardInterrupt
        total["runs"] += count
        total["steps"] += int(batch.steps.sum())
        total["fell"] += sum(status is RunStatus.FELL for status in batch.status)
        total["unfinished"] += sum(
            status not in (RunStatus.FELL, RunStatus.COMPLETED) for status in batch.status
        )
        for name in ("failures", "fallbacks", "shortcuts", "solves"):
            total[name] += int(getattr(batch, name).sum())
        for name in ("complementarity", "cone", "non_penetration"):
            total[name] = max(total[name], float(getattr(batch, name).max()))
        total["penetration_m"] = max(total["penetration_m"], float(batch.penetration.max()))
    return total


def _push(rng: np.random.Generator, start: float) -> Push:
    angle, size = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, STRONGEST)
    force = (size * np.cos(angle), size * np.sin(angle))
    return Push("trunk", force=force, start=start + rng.uniform(0.0, 0.5), duration=0.1)
