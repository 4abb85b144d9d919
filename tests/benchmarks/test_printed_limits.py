"""The audit of runs against printed limits, by MuJoCo's inverse dynamics and made motions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from closing import mechanics_of
from printed_limits import (
    Exerted,
    Stored,
    audit,
    integrated,
    rates_stored,
    stored,
    stored_phase,
)
from printed_optima import GRAVITY, RUNNER, WALKER, WEIGHT
from scipy.io import savemat

LIGHT = 1e-7  # kg m², of a trunk that is to have none
STATES = 20
HIS = RUNNER


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
            assert told.ground[stands.index(True)][k] == pytest.approx(needed[:2], abs=1e-6)
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


def test_two_feet_share_the_hip() -> None:
    """Without torques, forces along both legs move the hip, and the ground bears the rest."""
    draw = np.random.default_rng(2)
    q = draw.standard_normal((STATES, 7)) * 0.1 - [0.0, 0.0, 0.0, 0.5, 0.1, -0.5, 0.1]
    v, a = draw.standard_normal((2, STATES, 7))
    told = Exerted.by(WALKER, [q, v, a], [True, True])
    masses, gravity = (WALKER.hip, WALKER.foot, WALKER.foot), np.array([0.0, GRAVITY])
    moved = (a[:, :2], *(leg.acceleration for leg in told.legs))
    momentum = sum(m * (each + gravity) for m, each in zip(masses, moved, strict=True))
    assert told.ground.sum(axis=0) == pytest.approx(momentum)
    pushed = sum(f[:, None] * leg.along for f, leg in zip(told.axial, told.legs, strict=True))
    assert pushed == pytest.approx(-WALKER.hip * (a[:, :2] + gravity))
    assert told.moment == pytest.approx(0.0, abs=1e-9)


PUSH, LASTS = 150.0, 0.1  # N, s
TIMES = np.linspace(0.0, LASTS, 21)


def pushed_up() -> tuple[dict[str, np.ndarray], list[np.ndarray]]:
    """A hip is pushed up from rest on an upright leg; the other one hangs, and its foot falls."""
    rise, nothing = PUSH / RUNNER.hip - GRAVITY, 0.0 * TIMES
    values = {
        "th1": nothing, "th2": nothing, "dth1": nothing, "dth2": nothing,
        "L1": 0.8 + 0.5 * rise * TIMES**2, "dL1": rise * TIMES,
        "L2": 0.7 + 0.5 * (rise + GRAVITY) * TIMES**2, "dL2": (rise + GRAVITY) * TIMES,
    }  # fmt: skip
    return values, [nothing + PUSH, nothing, nothing, nothing]


def test_forces_are_integrated_in_his_equations() -> None:
    values, forces = pushed_up()
    phase = stored_phase("S", TIMES, values, forces, RUNNER)
    missed, spent = integrated(RUNNER, Stored([phase], 0.5))
    rise = PUSH / RUNNER.hip - GRAVITY
    assert spent == pytest.approx(PUSH * 0.5 * rise * LASTS**2 / (WEIGHT * 0.5), rel=1e-6)
    # The feet are to change places; the right one is 0.1 m below the left one, and stays.
    assert missed == pytest.approx(max(GRAVITY * LASTS, rise * LASTS), rel=1e-6)


def test_rates_of_stored_forces_are_told() -> None:
    """One leg gains two weights in 0.8 s, of four that it may gain; the hip four times its most."""
    values, forces = pushed_up()
    forces[0] = 2.0 * WEIGHT * TIMES / 0.8
    forces[3] = -4.0 * 0.5 * WEIGHT * TIMES / 0.8
    phase = stored_phase("S", TIMES, values, forces, RUNNER)
    told = rates_stored(RUNNER, Stored([phase], 0.5))
    assert told == pytest.approx({"rate of leg": 0.5, "rate of ankle": 0.0, "rate of hip": 4.0})


def test_stored_solutions_are_read(tmp_path: Path) -> None:
    """Both kinds of file tell the same."""
    values, forces = pushed_up()
    names = ("th1", "th2", "L1", "L2", "dth1", "dth2", "dL1", "dL2")
    states = np.stack([*(values[name] for name in names), *forces], axis=1)
    by_points = {"phase": "S", "time": TIMES, "state": values, "step": {"distance": 0.5}}
    by_points["control"] = dict(zip(("F1", "F2", "T1", "Thip"), forces, strict=True))
    of_result = {
        "solution": {"parameter": 0.5},
        "setup": {"auxdata": {"phase": np.array(["S", "S"], object)}},
        "interpsolution": {"phase": np.array([{"time": TIMES, "state": states}] * 2, object)},
    }  # fmt: skip
    savemat(tmp_path / "a.mat", {"plotInfo": {"data": np.array([by_points] * 2, object)}})
    savemat(tmp_path / "b.mat", {"outputPrev": {"result": of_result}})
    first, second = (stored(tmp_path / f"{name}.mat", RUNNER) for name in "ab")
    assert first.distance == second.distance == 0.5
    for one, two in zip(first.phases, second.phases, strict=True):
        assert one.contacts == two.contacts == ("right_foot",)
        assert one.forces == pytest.approx(two.forces)
        assert one.moved[0] == pytest.approx(two.moved[0])
        assert two.moved[1] == pytest.approx(
            stored_phase("S", TIMES, values, forces, RUNNER).moved[1]
        )
