"""Microseconds a step, each engine in turn: standing, walking, falling."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from heelstrike.experiments.benchmark import own, scenarios
from heelstrike.experiments.benchmark.own import InvalidRunError
from heelstrike.experiments.benchmark.scenarios import Scenario
from heelstrike.experiments.benchmark.stopwatch import best_of
from heelstrike.sim import TimeStepping

STEP = 1e-3
SETTLING = 3.0
"""How long a robot sinks into soft ground before it is timed, in s."""


def measure_steps(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time steps of 1 ms; returns one row a scenario."""
    return {
        "step_s": STEP,
        "rows": [_measure(each, quick=quick, peers=peers) for each in _scenarios(quick=quick)],
    }


def _scenarios(*, quick: bool) -> list[Scenario]:
    duration = 2.0 if quick else 5.0
    return [
        scenarios.standing("bravo7", bent=False, duration=duration),
        scenarios.standing("bravo7", duration=duration),
        scenarios.standing("walker2d", duration=duration),
        scenarios.walking(),
        scenarios.falling("bravo7"),
    ]


def _measure(scenario: Scenario, *, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    row: dict[str, Any] = {"scenario": scenario.name, "controller": "none"}
    method = TimeStepping(step=STEP)
    works = {}
    has_own = scenario.own is not None
    if has_own:
        row["controller"] = "computed torque (heelstrike), precomputed (peers)"
    elif scenario.feedback is not None:
        row["controller"] = "springs and dampers on the joints"
    try:
        row["heelstrike_check"] = own.check(scenario, step=STEP, own=has_own)
        works["heelstrike"] = own.work(scenario, method, own=has_own)
        steps = {"heelstrike": row["heelstrike_check"]["steps"]}
    except InvalidRunError as error:
        row["invalid"] = f"heelstrike: {error}"
        return row
    if "mujoco" in peers:
        from heelstrike.experiments.benchmark.mujoco_peer import MuJoCoPeer, Options

        peer = MuJoCoPeer(scenario, Options(step=STEP))
        if scenario.contacts is not None:
            peer.settle(SETTLING)
        try:
            row["mujoco_check"] = peer.check()
            works["mujoco"] = peer.work
            steps["mujoco"] = peer.steps
        except InvalidRunError as error:
            row["mujoco_invalid"] = str(error)
    best = best_of(works, seconds=0.5 if quick else 5.0)
    for name, seconds in best.items():
        row[f"{name}_us"] = 1e6 * seconds / steps[name]
    if "mujoco_us" in row:
        row["times_faster"] = row["mujoco_us"] / row["heelstrike_us"]
    return row
