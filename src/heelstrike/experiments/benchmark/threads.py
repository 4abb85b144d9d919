"""How much a batch of walks gains from threads."""

from __future__ import annotations

import os
from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np

from heelstrike.experiments.benchmark import scenarios
from heelstrike.experiments.benchmark.peer import reason
from heelstrike.experiments.benchmark.scenarios import Scenario
from heelstrike.experiments.benchmark.stopwatch import best_of
from heelstrike.robot import State
from heelstrike.sim import RunStatus, TimeStepping, simulate_batch

STEP = 1e-3
DURATION = 7.0
"""Of a walk, in s; springs, dampers and a torque schedule keep the peer on its feet for 1 s."""


def measure_threads(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time a batch of walks from slightly different states, by number of threads."""
    count, duration = (64, 1.0) if quick else (1000, DURATION)
    scenario = scenarios.walking()
    assert scenario.own is not None
    rng = np.random.default_rng(0)
    v = scenario.state.v + 1e-3 * rng.standard_normal((count, scenario.robot.nv))
    state = State(np.broadcast_to(scenario.state.q, (count, scenario.robot.nq)), v)
    last: dict[int, Any] = {}

    def walk(threads: int) -> float:
        begin = perf_counter()
        last[threads] = simulate_batch(
            scenario.robot,
            scenario.own,
            state=state,
            duration=duration,
            method=TimeStepping(step=STEP),
            ground=scenario.ground,
            threads=threads,
            progress=False,
        )
        if any(status is RunStatus.INTERRUPTED for status in last[threads].status):
            raise KeyboardInterrupt
        return perf_counter() - begin

    numbers = _thread_numbers()
    works = {str(n): (lambda n=n: walk(n)) for n in numbers}
    best = best_of(works, seconds=0.5 if quick else 15.0, least=3)
    batch = last[numbers[0]]
    steps = int(batch.steps.sum())
    same = all(np.array_equal(last[n].position, batch.position) for n in numbers)
    result: dict[str, Any] = {
        "runs": count,
        "duration_s": duration,
        "steps": steps,
        "completed": int(batch.completed.sum()),
        "same_for_all_threads": same,
        "rows": [
            {
                "threads": n,
                "seconds": best[str(n)],
                "steps_per_s": steps / best[str(n)],
                "speed_up": best["1"] / best[str(n)],
            }
            for n in numbers
        ],
    }
    if "mujoco" in peers:
        try:
            result["mujoco"] = _mujoco(scenario, state, numbers, quick=quick)
        except Exception as error:  # of the peer must not lose what was measured
            result["mujoco_invalid"] = reason(error)
    return result


def _thread_numbers() -> list[int]:
    processors = os.cpu_count() or 1
    numbers = [1]
    while numbers[-1] * 2 <= processors:
        numbers.append(numbers[-1] * 2)
    return numbers if numbers[-1] == processors else [*numbers, processors]


def _mujoco(
    scenario: Scenario, state: State, numbers: Sequence[int], *, quick: bool
) -> list[dict[str, Any]]:
    from heelstrike.experiments.benchmark.mujoco_peer import MuJoCoPeer, Options

    peer = MuJoCoPeer(scenario, Options(step=STEP))
    batch = 16 if quick else 200  # its states of every step would fill the memory
    starts = [State(state.q[i], state.v[i]) for i in range(batch)]
    works = {str(n): peer.batch_work(starts, n) for n in numbers}
    best = best_of(works, seconds=0.5 if quick else 10.0, least=3)
    steps = batch * peer.steps
    return [
        {
            "threads": n,
            "seconds": best[str(n)],
            "steps_per_s": steps / best[str(n)],
            "speed_up": best["1"] / best[str(n)],
        }
        for n in numbers
    ]
