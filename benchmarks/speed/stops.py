"""What a step costs where joints lie on their stops or are thrown about, beside standing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.experiments.engines import Scenario
from speed.scenarios import standing
from speed.stopwatch import best_of, timed

STEP = 2e-3
"""Step of the walker2d of Gymnasium (s)."""
SETTLED, RESTS = 2.4, 1.0
"""When a walker2d that is left alone lies still on its stops, and for how long it is timed (s)."""
THROW = 0.01
"""How long each of the random torques lasts (s)."""
TORQUE = 40.0
"""The largest of them (N m)."""


def left_alone() -> Scenario:
    """Return a walker2d without a law: it folds up until its stops carry it."""
    robot = hs.load_robot("walker2d")
    state = hs.State(robot.model.reference, np.zeros(robot.nv))
    return Scenario("walker2d at rest on its stops", robot, state, SETTLED + RESTS)


def thrown_about() -> Scenario:
    """Return a walker2d under torques drawn again every 10 ms."""
    alone = left_alone()
    times = THROW * np.arange(round(alone.duration / THROW))
    torque = np.random.default_rng(1).uniform(-TORQUE, TORQUE, (times.size, alone.robot.nu, 1))
    law = JointFeedback(alone.robot, 0.0, torque=torque, kp=0.0, kd=0.0, begins=times)
    return Scenario("walker2d under random torques", alone.robot, alone.state, alone.duration, law)


class Piece:
    """A piece of a simulation that is timed again and again."""

    def __init__(self, scenario: Scenario, begin: float) -> None:
        self._end = scenario.duration
        self._simulation = hs.Simulation(
            scenario.robot, scenario.feedback, state=scenario.state,
            method=hs.TimeStepping(step=STEP), ground=scenario.ground, record_every=2**62,
            stop_when_fallen=False,
        )  # fmt: skip
        self._simulation.advance(begin)
        self._begun = self._simulation.snapshot()
        self._steps = (self._end - begin) / STEP

    def __call__(self) -> float:
        """Run it; return the seconds a step took."""
        self._simulation.restore(self._begun)
        return timed(self._simulation.advance, self._end)[1] / self._steps


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:  # noqa: ARG001
    """Microseconds a step of 2 ms, and how many times as long as standing."""
    stands = standing("walker2d", duration=2.0)
    works = {
        stands.name: Piece(stands, 0.2),
        left_alone().name: Piece(left_alone(), SETTLED),
        thrown_about().name: Piece(thrown_about(), 0.2),
    }
    best = best_of(works, seconds=0.1 if quick else 5.0)
    return {
        "step_s": STEP,
        "rows": [
            {"scenario": name, "us": 1e6 * best[name], "times": best[name] / best[stands.name]}
            for name in works
        ],
    }
