"""What a step of walking costs under the same law, as it is run in different ways."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba

import heelstrike as hs
from speed import users_law
from speed.race import STEP
from speed.scenarios import walk_gait
from speed.stopwatch import best_of, timed

STEPS = {True: 100, False: 1000}
"""Steps of a piece that is timed, of a law in Python and a compiled one: milliseconds of either."""
PIECES = 5
"""Pieces of a walk: what is looked at in Python at first is compiled after the first."""


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:  # noqa: ARG001
    """Microseconds a step, of the whole simulation, by how computed torque is run."""
    robot, gait = walk_gait()[:2]
    stock = hs.ComputedTorque(robot, gait)
    users = users_law.ComputedTorque(robot, gait)
    options = {"memory": users.memory, "robot": robot}
    by_numba = hs.controller(numba.njit(users_law.computed_torque.python))
    in_python = hs.controller(compile=False)(users_law.computed_torque.python)
    ways: dict[str, tuple[Any, bool]] = {
        "stock": (stock, False),
        "a user's": (users, False),
        "a user's, compiled by numba.njit": (by_numba(users.parameters, **options), False),
        "a user's, checked=True": (users, True),
        "a user's, compile=False": (in_python(users.parameters, **options), False),
    }

    def walk(law: Any, checked: bool) -> float:
        simulation = hs.Simulation(
            robot, law, state=gait.initial_state, method=hs.TimeStepping(step=STEP), checked=checked
        )
        steps = STEPS[checked or not law.function.compiles]
        times = []
        for piece in range(1, PIECES + 1):
            times.append(timed(simulation.advance, piece * steps * STEP)[1])
        return min(times[1:]) / steps

    works = {name: lambda law=law, checked=checked: walk(law, checked)
             for name, (law, checked) in ways.items()}  # fmt: skip
    best = best_of(works, seconds=0.1 if quick else 30.0, least=1)
    return {name: 1e6 * seconds for name, seconds in best.items()}
