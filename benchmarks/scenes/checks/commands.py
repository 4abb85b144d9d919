"""The checks by name, and how many scenes are put through one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from scenes.campaign import Task, campaign, results_in
from scenes.checks.bridges import bridges_of_scene
from scenes.checks.energy import energy_of_scene
from scenes.checks.orders import SCHEME, orders_of_scene
from scenes.checks.summary import summary
from scenes.checks.twins import twins_of_scene
from scenes.running import prepare

CHECKS = {
    "energy": (energy_of_scene, "does work explain the energy of event-driven runs?"),
    "twins": (twins_of_scene, "do event-driven twins agree 50 ms after events?"),
    "orders": (orders_of_scene, "does the energy that time stepping loses fall with the step?"),
    "bridges": (bridges_of_scene, "does the estimate of a bridge cover its error?"),
}
"""What each does with a scene, and what it asks."""

LIMIT = 120.0
"""Processor time (s) after which a scene hangs: it is simulated several times over."""


def prepare_check(name: str) -> None:
    """Compile what a check simulates with."""
    prepare(SCHEME if name == "orders" else "event_driven")


def check(name: str, seeds: Sequence[int], out: Path, workers: int) -> None:
    """Put the question of a check to scenes: print what is new, then what all of them add up to."""
    task = Task(CHECKS[name][0], prepare_check, limit=LIMIT)
    for one in campaign(out, (name,), seeds, workers=workers, task=task):
        print(json.dumps(one), flush=True)
    asked = set(seeds)
    mine = [one for one in results_in(out) if one["method"] == name and one["seed"] in asked]
    print(summary(name, mine))
