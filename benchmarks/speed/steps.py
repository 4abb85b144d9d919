"""Microseconds a step, each engine in turn: standing, walking, falling, lying."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from heelstrike.experiments.engines import Scenario, simulators
from speed import scenarios
from speed.race import STEP, race


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time steps of 1 ms; returns one row a scenario."""
    engines = simulators(peers)
    part = "pinocchio" in peers
    seconds = 0.1 if quick else 5.0 + len(engines) + part
    rows = []
    for scenario, controller, options in contests():
        control = "none" if scenario.feedback is None else "springs, dampers"
        if controller is not None:
            control = "computed torque; precomputed for the others"
        row = race(scenario, engines, part=part, seconds=seconds, controller=controller, **options)
        rows.append({"scenario": scenario.name, "controller": control, **row})
    return {
        "step_s": STEP,
        "engines": {name: engine.label for name, engine in engines.items()},
        "notes": {name: engine.note for name, engine in engines.items()},
        "rows": rows,
    }


def contests() -> list[tuple[Scenario, Any, dict[str, Any]]]:
    """Return the scenarios, what heelstrike does in each instead of the law of the others, and how.

    A robot that has fallen lies as it fell, in every engine another way.
    """
    lying = replace(scenarios.falling("bravo7", duration=3.0), name="bravo7 lying")
    return [
        (scenarios.standing("bravo7", bent=False, duration=2.0), None, {}),
        (scenarios.standing("bravo7", duration=2.0), None, {}),
        (scenarios.standing("walker2d", duration=2.0), None, {}),
        (scenarios.walking(), scenarios.walking_law(), {"begin": 0.1}),
        (scenarios.falling("bravo7"), None, {"begin": 0.1}),
        (lying, None, {"begin": 1.0, "same_end": False}),
    ]
