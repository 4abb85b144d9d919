"""The regulator about a gait on flat feet: its equations, its multipliers, what it refuses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control.gait_lqr.flat import FlatOrbit, _sampled
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.held import HeldRobot

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

Floats = NDArray[np.float64]


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


SMALL = 1e-6
"""Disturbance (rad, rad/s) of central differences, whose error is its square and 1e-16 over it."""


def differences(function: Callable[[Floats], Floats], x: Floats) -> Floats:
    columns = [(function(x + e) - function(x - e)) / (2.0 * SMALL) for e in SMALL * np.eye(len(x))]
    return np.array(columns).T


def accelerations(q: Floats, v: Floats, torque: Floats, points: Sequence[int]) -> Floats:
    """Accelerations (nv,) while contact points stay in place, by elimination."""
    robot = walking.bravo7()
    force = dynamics.applied_force(robot, q, v, torque) - dynamics.bias_force(robot, q, v)
    return HeldRobot.on(Evaluation(robot, q, v), points).accelerated(force)[0]


@pytest.mark.parametrize("place", [3, 40])
def test_linear_equations_are_those_of_the_robot_on_its_foot(place: int) -> None:
    stance, torque = orbit().stance, orbit().torque[place]
    joints, rates, wanted = orbit().joints(orbit().time[place])

    def rate(x: Floats, torque: Floats = torque) -> Floats:
        q, v = stance.state(*np.split(x, 2))
        return accelerations(q, v, torque, stance.foot.contacts)[stance.driven]

    x = np.concatenate([joints, rates])
    A, B = orbit().linear[place]
    np.testing.assert_allclose(rate(x), wanted, atol=1e-8)
    np.testing.assert_allclose(A[stance.robot.nu :], differences(rate, x), rtol=1e-6, atol=1e-4)
    pushed = np.transpose([rate(x, torque + e) - rate(x) for e in np.eye(stance.robot.nu)])
    np.testing.assert_allclose(B[stance.robot.nu :], pushed, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("first", [0, -1])
def test_a_touchdown_is_that_of_heel_and_toe_one_after_the_other(first: int) -> None:
    """Each when it is down, to first order; the clock starts again with the first."""
    stance, robot = orbit().stance, walking.bravo7()
    points, mirror = list(stance.swing.contacts), robot.mirror
    one, other = (points[0], points[-1]) if first == 0 else (points[-1], points[0])
    assert mirror is not None
    driven = mirror.among(stance.driven)
    after = driven.sign * orbit().torque[0][driven.joint]
    begin, end = (orbit().joints(s) for s in (0.0, walking.gait().step_duration))

    def moved(
        q: Floats, v: Floats, torque: Floats, on: Sequence[int], point: int
    ) -> tuple[float, Floats, Floats]:
        """Go on, with `on` in place, until a point is down."""
        height = dynamics.contact_positions(robot, q)[point, 1]
        until = -height / (dynamics.contact_jacobian(robot, q)[point, 0] @ v)
        return until, q + until * v, v + until * accelerations(q, v, torque, on)

    def through(x: Floats) -> Floats:
        q, v = stance.state(*np.split(x, 2))
        _, q, v = moved(q, v, orbit().torque[-1], stance.foot.contacts, one)
        v, _ = HeldRobot.on(Evaluation(robot, q), [one]).stopped(v)
        until, q, v = moved(q, v, after, [one], other)
        v, _ = HeldRobot.on(Evaluation(robot, q), points).stopped(v)
        landed = np.concatenate([mirror.position(q), mirror.velocity(v)])[stance.rows]
        return landed - until * np.concatenate(begin[1:])

    by_differences = differences(through, np.concatenate(end[:2]))
    jump = orbit().jumps[first]
    np.testing.assert_allclose(jump, by_differences, atol=1e-7 * np.abs(jump).max())


@pytest.mark.parametrize(
    "method", [hs.TimeStepping(step=1e-3), hs.EventDriven()], ids=["stepped", "events"]
)
def test_multipliers_are_as_predicted(method: hs.Method) -> None:
    """By differences of the whole loop, between those of either order, which errors choose.

    Predicted 0.208 of their mean, 0.113 and 0.242 of one alone; 0.216 and 0.194 are measured.
    """
    found = hs.floquet_multipliers(
        walking.bravo7(), walking.gait().initial_state, law(), method=method, settling=4, returns=1
    )
    assert found.along == pytest.approx(1.0, abs=1e-6)
    assert found.largest < 1.05 * max(law().either)
    assert found.largest > 0.9 * min(law().either)
    assert min(law().either) < abs(law().multipliers[0]) < max(law().either)


def test_multipliers_of_torques_that_are_held_are_as_predicted() -> None:
    """Called every 5 ms: 0.207 is predicted, 0.216 found."""
    gait, held = walking.gait(), hs.FlatGaitLQR(walking.bravo7(), walking.gait(), period=5e-3)
    found = hs.floquet_multipliers(
        walking.bravo7(), gait.initial_state, held, settling=4, returns=1
    )
    assert found.largest == pytest.approx(abs(held.multipliers[0]), rel=0.1)


def test_what_is_held_is_paid_for_as_it_adds_up() -> None:
    """Moves and costs of an interval, against sums over many short ones."""
    draw = np.random.default_rng(5)
    A, B = draw.normal(size=(4, 4)), draw.normal(size=(4, 2))
    price = np.diag([3.0, 2.0, 0.5, 0.1, 0.2, 0.3])
    grown, pushed, cost = _sampled(A, B, price, 0.3)
    x, u = draw.normal(size=4), draw.normal(size=2)
    count = 2000
    state, total, width = x.copy(), 0.0, 0.3 / count
    for _ in range(count):
        middle = state + 0.5 * width * (A @ state + B @ u)
        both = np.concatenate([middle, u])
        total += width * both @ price @ both
        state = state + width * (A @ middle + B @ u)
    np.testing.assert_allclose(grown @ x + pushed @ u, state, rtol=1e-6)
    both = np.concatenate([x, u])
    assert both @ cost @ both == pytest.approx(total, rel=1e-6)


def test_it_knows_how_long_torques_are_held() -> None:
    """Called every 5 ms the law that acts at once throws the swing foot about, and falls."""
    robot, gait = walking.bravo7(), walking.gait()
    steps: dict[float | None, float] = {}
    for period in (None, 5e-3):
        held = law() if period is None else hs.FlatGaitLQR(robot, gait, period=period)
        run = hs.simulate(
            robot, held, state=gait.initial_state, duration=3.0 * gait.step_duration,
            control_period=5e-3 if period is None else None,
        )  # fmt: skip
        way = run.position[-1, 0] - run.position[0, 0]
        steps[period] = way / gait.step_length if run.completed else 0.0
        assert held.period == period
    assert steps[None] < 1.0
    assert steps[5e-3] == pytest.approx(3.0, abs=0.05)
    # The gains are others, and no worse: torques that are held do nearly as well.
    assert abs(held.multipliers[0]) == pytest.approx(abs(law().multipliers[0]), rel=0.05)


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
    robot, gait = walking.rabbit(), walking.rabbit_gait()
    with pytest.raises(hs.ControllerError, match=r"one flat foot .* hs\.GaitLQR"):
        hs.FlatGaitLQR(robot, gait)
    with pytest.raises(hs.ControllerError, match="torque_weight must be positive"):
        hs.FlatGaitLQR(walking.bravo7(), walking.gait(), torque_weight=0.0)
    with pytest.raises(hs.ControllerError, match=r"period must be a positive number, got -0\.001"):
        hs.FlatGaitLQR(walking.bravo7(), walking.gait(), period=-1e-3)
    with pytest.raises(hs.ControllerError, match=r"period of 0\.05 s is too long .* 20 times"):
        hs.FlatGaitLQR(walking.bravo7(), walking.gait(), period=0.05)
