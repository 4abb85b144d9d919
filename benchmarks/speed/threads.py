"""How much a batch of walks gains from threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from heelstrike.robot import State
from heelstrike.sim import RunStatus, TimeStepping, simulate_batch
from speed import scenarios
from speed.race import STEP, reason
from speed.stopwatch import Work, best_of, timed

DURATION = 7.0
"""Of a walk, in s; springs, dampers and a torque schedule keep the peer on its feet for 1 s."""


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time a batch of walks from slightly different states, by number of threads."""
    count, duration = (16, 1.0) if quick else (1000, DURATION)
    scenario, law = scenarios.walking(), scenarios.walking_law()
    rng = np.random.default_rng(0)
    v = scenario.state.v + 1e-3 * rng.standard_normal((count, scenario.robot.nv))
    state = State(np.broadcast_to(scenario.state.q, (count, scenario.robot.nq)), v)
    last: dict[int, Any] = {}

    def walk(threads: int) -> float:
        last[threads], seconds = timed(
            simulate_batch,
            scenario.robot,
            law,
            state=state,
            duration=duration,
            method=TimeStepping(step=STEP),
            ground=scenario.ground,
            threads=threads,
            progress=False,
        )
        if any(status is RunStatus.INTERRUPTED for status in last[threads].status):
            raise KeyboardInterrupt
        return seconds

    rows = _rows(lambda threads: partial(walk, threads), seconds=0.1 if quick else 15.0)
    batch = last[1]
    steps = int(batch.steps.sum())
    result: dict[str, Any] = {
        "runs": count,
        "duration_s": duration,
        "steps": steps,
        "completed": int(batch.completed.sum()),
        "same_for_all_threads": all(
            np.array_equal(other.position, batch.position) for other in last.values()
        ),
        "rows": _with_rates(rows, steps),
    }
    if "mujoco" in peers:
        from heelstrike.experiments.engines.mujoco_peer import MuJoCoPeer

        try:
            peer = MuJoCoPeer(scenario, STEP)
            number = 16 if quick else 200  # its states of every step would fill the memory
            starts = [State(state.q[i], state.v[i]) for i in range(number)]
            rows = _rows(partial(peer.batch_work, starts), seconds=0.1 if quick else 10.0)
            result["mujoco"] = _with_rates(rows, number * peer.steps)
        except Exception as error:  # of the peer must not lose what was measured
            result["mujoco_invalid"] = reason(error)
    return result


def _rows(work: Callable[[int], Work], *, seconds: float) -> dict[int, float]:
    """Best time by number of threads: 1, 2, 4, ... and as many as there are processors."""
    processors = os.cpu_count() or 1
    numbers = {2**k for k in range(processors.bit_length())} | {processors}
    works = {str(n): work(n) for n in sorted(numbers)}
    return {int(n): s for n, s in best_of(works, seconds=seconds, least=3).items()}


def _with_rates(best: dict[int, float], steps: int) -> list[dict[str, Any]]:
    return [
        {"threads": n, "seconds": s, "steps_per_s": steps / s, "speed_up": best[1] / s}
        for n, s in best.items()
    ]
