"""The regulator about a gait on flat feet: its equations, its multipliers, what it refuses."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control.gait_lqr.flat import FlatOrbit


@cache
def law() -> Any:
    return hs.FlatGaitLQR(walking.bravo7(), walking.gait())


@cache
def orbit() -> FlatOrbit:
    return FlatOrbit(walking.bravo7(), walking.gait())


def test_its_torques_are_those_of_the_gait() -> None:
    """As computed torque finds them on the gait, in the middle of a step; the impact closes it."""
    run = hs.simulate(
        walking.bravo7(), hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state, duration=0.5 * walking.gait().step_duration,
        method=hs.EventDriven(),
    )  # fmt: skip
    (found,) = orbit().torques(run.time[-1:])
    np.testing.assert_allclose(found, run.torque[-1], atol=1e-6)
    assert orbit().misses < 1e-9


def test_orders_of_heel_and_toe_begin_the_step_alike() -> None:
    """The gait itself goes through either order to its beginning; errors do not."""
    heel, toe = orbit().jumps
    assert np.abs(heel - toe).max() > 1.0
    np.testing.assert_allclose(orbit().jump, 0.5 * (heel + toe))


@pytest.mark.parametrize(
    "method", [hs.TimeStepping(step=1e-3), hs.EventDriven()], ids=["stepped", "events"]
)
def test_multipliers_are_as_predicted(method: hs.Method) -> None:
    """By differences of the whole loop, between those of either order, which errors choose.

    Predicted 0.208 of their mean, 0.113 and 0.242 of one alone; 0.216 and 0.196 are measured.
    """
    found = hs.floquet_multipliers(
        walking.bravo7(), walking.gait().initial_state, law(), method=method, settling=4, returns=1
    )
    assert found.along == pytest.approx(1.0, abs=1e-6)
    assert found.largest < 1.05 * max(law().either)
    assert found.largest > 0.9 * min(law().either)
    assert min(law().either) < abs(law().multipliers[0]) < max(law().either)


def test_small_errors_leave_the_foot_flat() -> None:
    """Pushed by 1 N s; both ends of the stance sole are loaded in the middle of every step."""
    gait = walking.gait()
    push = hs.Push("trunk", force=(10.0, 0.0), start=0.3, duration=0.1)
    run = hs.simulate(walking.bravo7(), law(), state=gait.initial_state, duration=2.1, pushes=push)
    assert run.completed
    apart = run.position[-1, 0] - run.position[0, 0]
    assert apart == pytest.approx(3 * gait.step_length, abs=0.02)
    middle = np.abs(run.time % gait.step_duration - 0.5 * gait.step_duration) < 0.1
    loaded = (run.contact_force[middle, :, 0] > 0.0).sum(axis=1)
    assert np.all(loaded == 2)


def test_what_it_refuses() -> None:
    robot = hs.load_robot("rabbit")
    gait = hs.optimize_gait(
        robot, step_length=0.21, step_duration=0.58, clearance=0.02, friction=0.6, starts=1
    )
    with pytest.raises(hs.ControllerError, match=r"one flat foot .* hs\.GaitLQR"):
        hs.FlatGaitLQR(robot, gait)
    with pytest.raises(hs.ControllerError, match="torque_weight must be positive"):
        hs.FlatGaitLQR(walking.bravo7(), walking.gait(), torque_weight=0.0)
