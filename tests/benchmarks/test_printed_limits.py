"""The audit of runs against printed limits, by MuJoCo's inverse dynamics and made motions."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from closing import mechanics_of
from printed_limits import Exerted, audit
from printed_optima import GRAVITY, RUNNER, WEIGHT

LIGHT = 1e-7  # kg m², of a trunk that is to have none
STATES = 20
HIS = replace(RUNNER, ankle=0.05)


@pytest.mark.parametrize("stands", [[True, False], [False, True], [False, False]])
def test_forces_are_those_of_inverse_dynamics(stands: list[bool]) -> None:
    """With any accelerations: the foot that stands need not be at rest."""
    robot, draw = replace(RUNNER, inertia=LIGHT).robot(), np.random.default_rng(1)
    mechanics = mechanics_of(robot, 0.0)
    spread = np.array([1.0, 1.0, 0.5, 0.5, 0.1, 0.5, 0.1])
    q = spread * draw.standard_normal((STATES, 7)) - [0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.2]
    v, a = draw.standard_normal((2, STATES, 7)) * 3.0
    told = Exerted.by(HIS, [q, v, a], stands)
    for k in range(STATES):
        now = mechanics.at(q[k], v[k])
        needed = now.mass @ a[k] + now.force
        by_motors = needed.copy()
        if any(stands):
            ground = needed[[1, 0]]  # away from the ground, and along it
            by_motors -= now.jacobian[stands.index(True)].T @ ground
            assert told.ground[k] == pytest.approx(needed[:2], abs=1e-6)
        else:
            assert told.lacking[k] == pytest.approx(-needed[:2], abs=1e-6)
        assert told.axial[:, k] == pytest.approx(by_motors[[4, 6]], abs=1e-5)
        assert told.moment[:, k] == pytest.approx(-by_motors[[3, 5]], abs=1e-5)


def motion_of(fall: float, *, along: float = 0.0) -> Any:
    """A stance in which the hip moves with an acceleration away from the ground, and along it.

    The right leg is upright at first; the left one hangs beside it, shorter.
    """

    def coordinates(times: np.ndarray, order: int = 0) -> np.ndarray:
        power = [0.5 * times**2, times, 1.0 + 0.0 * times][order]
        still = 1.0 if order == 0 else 0.0
        rows = np.zeros((times.size, 7))
        rows[:, 0], rows[:, 1] = along * power, 0.9 * still + fall * power
        rows[:, 4], rows[:, 6] = fall * power - 0.1 * still, -0.2 * still
        return rows

    phase = SimpleNamespace(contacts=("right_foot",), duration=0.02, coordinates=coordinates)
    return SimpleNamespace(phases=[phase], distance=0.5)


def test_a_ground_that_pulls_is_told() -> None:
    told = audit(HIS, motion_of(-2.0 * GRAVITY)).missing
    # The hip and the left foot fall at twice gravity, the right foot rests.
    assert told["pulled"] * WEIGHT == pytest.approx((7.6 - 0.4) * GRAVITY)
    assert audit(HIS, motion_of(0.0)).missing["pulled"] == 0.0
    assert told["friction"] * WEIGHT == pytest.approx(0.8 * 7.2 * GRAVITY)


def test_too_much_friction_is_told() -> None:
    told = audit(HIS, motion_of(0.0, along=GRAVITY)).missing
    assert told["friction"] * WEIGHT > 1.0
    assert audit(HIS, motion_of(0.0, along=0.5 * GRAVITY)).missing["friction"] == 0.0
