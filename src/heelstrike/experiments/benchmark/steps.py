"""Microseconds a step, each engine in turn: standing, walking, falling."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from heelstrike.experiments.benchmark import own, scenarios
from heelstrike.experiments.benchmark.engines import PARTS_OF_STEPS, simulators
from heelstrike.experiments.benchmark.own import InvalidRunError
from heelstrike.experiments.benchmark.peer import Engine, Peer, check_flight, reason
from heelstrike.experiments.benchmark.scenarios import Scenario
from heelstrike.experiments.benchmark.stopwatch import Work, best_of, steps_in_slot
from heelstrike.sim import TimeStepping

STEP = 1e-3
ELSEWHERE = 0.1
"""How far from ours a peer may end a walk or a fall, in m and rad, for its times to count.

Soft contacts and steps of 1 ms lead up to 0.07 away; who falls, or meets no stops, is farther.
"""


def measure_steps(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time steps of 1 ms; returns one row a scenario."""
    engines = simulators(peers)
    return {
        "step_s": STEP,
        "engines": {name: engine.label for name, engine in engines.items()},
        "notes": {name: engine.note for name, engine in engines.items()},
        "rows": [_measure(each, engines, quick=quick, peers=peers) for each in _scenarios()],
    }


def _scenarios() -> list[Scenario]:
    return [
        scenarios.standing("bravo7", bent=False, duration=2.0),
        scenarios.standing("bravo7", duration=2.0),
        scenarios.standing("walker2d", duration=2.0),
        scenarios.walking(),
        scenarios.falling("bravo7"),
    ]


def _measure(
    scenario: Scenario, engines: dict[str, Engine], *, quick: bool, peers: Sequence[str]
) -> dict[str, Any]:
    row: dict[str, Any] = {"scenario": scenario.name, "controller": "none"}
    method = TimeStepping(step=STEP)
    has_own = scenario.own is not None
    if has_own:
        row["controller"] = "computed torque; precomputed for the others"
    elif scenario.feedback is not None:
        row["controller"] = "springs, dampers"
    try:
        row["heelstrike_check"] = own.check(scenario, step=STEP, own=has_own)
    except InvalidRunError as error:
        row["invalid"] = str(error)
        return row
    works: dict[str, Work] = {"heelstrike": own.work(scenario, method, own=has_own)}
    steps = {"heelstrike": row["heelstrike_check"]["steps"]}
    for name, engine in engines.items():
        peer = _checked(name, engine, scenario, row)
        if peer is not None:
            steps[name] = peer.steps
            if scenario.contacts is not None:  # it stands: all steps are alike
                steps[name] = steps_in_slot(peer.run() / peer.steps, most=peer.steps)
            works[name] = partial(peer.run, steps[name])
    for name in peers:
        if name in PARTS_OF_STEPS:
            part = _part(name, scenario, row)
            if part is not None:
                works[f"{name}_part"], steps[f"{name}_part"] = part, 1
    best = best_of(works, seconds=0.5 if quick else 4.0 + len(works), in_a_row=2)
    for name, seconds in best.items():
        row[f"{name}_us"] = 1e6 * seconds / steps[name]
    row["times_faster"] = {
        name: row[f"{name}_us"] / row["heelstrike_us"] for name in engines if f"{name}_us" in row
    }
    return row


def _checked(name: str, engine: Engine, scenario: Scenario, row: dict[str, Any]) -> Peer | None:
    """Peer of a scenario if its steps count; the row says why if they do not."""
    try:
        peer = engine.peer(scenario, STEP)
        flight = check_flight(engine, scenario.robot)
        if scenario.contacts is not None:
            peer.settle(peer.settling)
        check: dict[str, Any] = {**peer.check(), "flight_error": flight}
        if scenario.contacts is None:
            check["end_error"] = _end_error(peer, scenario)
        if peer.lacks:
            check["lacks"] = ", ".join(peer.lacks)
        row[f"{name}_check"] = check
    except Exception as error:  # of one engine must not lose what the others found
        row[f"{name}_invalid"] = reason(error)
        return None
    return peer


def _end_error(peer: Peer, scenario: Scenario) -> float:
    """How far from ours a peer has ended, in m and rad; too far is invalid."""
    ours = own.run(scenario, TimeStepping(step=peer.step)).position[-1]
    error = float(np.max(np.abs(peer.state().q - ours)))
    if not error <= ELSEWHERE:
        raise InvalidRunError(f"it ends {error:.2g} m or rad from where it should")
    return error


def _part(name: str, scenario: Scenario, row: dict[str, Any]) -> Work | None:
    from heelstrike.experiments.benchmark.pinocchio_peer import ForwardDynamics

    try:
        part = ForwardDynamics(scenario)
        row[f"{name}_part_check"] = part.check()
    except Exception as error:
        row[f"{name}_part_invalid"] = reason(error)
        return None
    return part.run
