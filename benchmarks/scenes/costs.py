"""What a step of 1e-5 s costs beside one of 1e-3 s where contact problems are awkward.

Found among random scenes: in one, residuals lie between 1e-11 and 1e-9, as sharp as rounding lets
them be; in two, a robot wedges itself in, by less than rounding, and stays there.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

import heelstrike as hs
from scenes.methods import Setting
from scenes.running import FAMILIES

SHORT, LONG = 1e-5, 1e-3
"""Steps (s)."""
DURATION = 0.3
"""Seconds of each run."""
REPEATS = 5
"""Runs, of which the fastest counts."""
MIDDLE = (1e-11, 1e-9)
"""Residuals of answers that are certified, and not clean."""


@dataclass(frozen=True)
class Awkward:
    """A scene, and what is awkward about it."""

    name: str
    family: str
    seed: int


AWKWARD = (
    Awkward("residuals between", "tied", 12273),
    Awkward("wedge", "free", 12258),
    Awkward("wedge of many", "tied", 12541),
)


def run_awkward(one: Awkward, step: float, duration: float = DURATION) -> tuple[hs.Run, float]:
    """Run a scene; return its record, and the processor time of a step (µs) without set-up."""
    setting = Setting.of(FAMILIES[one.family](one.seed))
    scene, robot = setting.scene, setting.robot
    simulation = hs.Simulation(
        robot,
        scene.controller(robot),
        state=scene.state(robot),
        method=hs.TimeStepping(step=step),
        ground=scene.ground(restitution=True),
        pushes=scene.pushes(),
        stop_when_fallen=False,
    )
    simulation.step()
    begin = time.process_time()
    simulation.advance(duration)
    spent = time.process_time() - begin
    run = simulation.record
    return run, 1e6 * spent / run.steps


def share_between(run: hs.Run) -> float:
    """Share of the steps whose residual is certified, and not clean."""
    worst = run.residual.max(axis=1)
    return float(np.mean((worst > MIDDLE[0]) & (worst <= MIDDLE[1])))


def costs() -> list[dict[str, Any]]:
    """Measure all scenes: processor time of a step at both lengths, and what was counted."""
    rows = []
    for one in AWKWARD:
        run, short = min(
            (run_awkward(one, SHORT) for _ in range(REPEATS)), key=lambda each: each[1]
        )
        long = min(run_awkward(one, LONG)[1] for _ in range(REPEATS))
        rows.append(
            {
                "scene": one.name,
                "seed": f"{one.family} {one.seed}",
                "us_at_1e-5": round(short, 2),
                "us_at_1e-3": round(long, 2),
                "ratio": round(short / long, 2),
                "residuals_between": round(share_between(run), 2),
                "contact_problems": str(run.solver),
            }
        )
    return rows
