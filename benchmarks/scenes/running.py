"""One scene under one method: run, judged and compared with its twins."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from heelstrike.errors import HeelstrikeError
from scenes.methods import Setting
from scenes.scene import Scene, random_scene
from scenes.space.running import SpaceSetting, run_space_scene
from scenes.space.scene import random_space_scene
from scenes.ties.scene import tied_scene
from scenes.twins import compare_twins

FAMILIES: dict[str, Callable[[int], Scene]] = {"free": random_scene, "tied": tied_scene}
"""Where scenes in the plane come from: without ties, and with loops, couplings, latches, brakes."""
SPACE = "space"
"""The family of scenes in space, for those methods that robots in space have."""

TWINS_EVERY = 3
"""Every so many seeds a scene is compared with its twins, which costs more than the scene."""
FINE = 1e-4
"""Longest step (s) of the second look at a scene whose forces change too fast for its rows: it has
a row at every step of the integrator, and these crowd where forces grow without bound."""
QUICK = 2.0
"""Processor time (s) of a scene that has time for that within the limit of a scene."""
BETWEEN_ROWS = {"balance", "energy", "teleport between rows"}
"""Laws of what happens between rows: these alone are what the second look is for."""
WARM = 1_000_000
"""Seed of the scene with which a worker compiles a method before any clock runs."""


def run_scene(
    method: str, seed: int, *, twins: bool = True, family: str = "free"
) -> dict[str, Any]:
    """Run, judge and compare one scene; everything in the result is numbers and text.

    Of the family `SPACE` that is done by :mod:`scenes.space`. Scenes with ties have no twins: of a
    state under time stepping the velocity is that of a chord, which does not fit the ties to the
    last digit.
    """
    if family == SPACE:
        return run_space_scene(method, seed, twins=twins and seed % TWINS_EVERY == 0)
    begin = time.process_time()
    scene = FAMILIES[family](seed)
    setting = Setting.of(scene)
    result: dict[str, Any] = {"method": method, "seed": seed, "kind": scene.kind, "family": family}
    try:
        run = setting.run(method)
    except HeelstrikeError as error:
        return result | {"status": "refused", "message": str(error)}
    result |= {"status": run.status.value, "message": run.message, "rows": len(run.time)}
    result |= {"end": float(run.time[-1]) if len(run.time) else 0.0}
    result["simulated_s"] = time.process_time() - begin
    found = setting.judge(method, run)
    quick = result["simulated_s"] < QUICK
    if method == "event_driven" and quick and BETWEEN_ROWS & set(found.broken()):
        again = setting.run(method, rows=None, max_step=FINE)
        if len(again.time) and again.time[-1] >= result["end"]:  # it says nothing of what it missed
            found.renew(BETWEEN_ROWS, setting.judge(method, again))
            result["fine"] = True
    result |= found.as_dict()
    if twins and family == "free" and run.completed and seed % TWINS_EVERY == 0:
        result["twins"] = compare_twins(setting, method, run).as_dict()
    result["seconds"] = time.process_time() - begin
    return result


def prepare(method: str, family: str = "free") -> None:
    """Compile a method, so that no scene has to wait for it."""
    with suppress(HeelstrikeError):
        if family == SPACE:
            SpaceSetting.of(random_space_scene(WARM)).run(method, duration=0.01)
            return
        Setting.of(random_scene(WARM)).run(method, duration=0.01)
