"""The regulator about a walk: its linear equations against simulation, its multipliers, mirrors."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control.gait_lqr.orbit import Orbit, orbit_of
from heelstrike.control.gait_lqr.transverse import Transverse
from heelstrike.errors import ControllerError

gait = walking.rabbit_phased


@cache
def law() -> Any:
    return hs.GaitLQR(gait())


@cache
def zero() -> hs.ZeroDynamics:
    return hs.zero_dynamics(gait())


@cache
def orbit() -> Orbit:
    return orbit_of(gait())


def test_the_walk_obeys_the_equations_of_motion() -> None:
    """Torques of the walk, between nodes, make its accelerations; its beginning is that known."""
    robot, walk = gait().robot, orbit()
    contact = robot.feet[gait().stance_foot].contacts[0]
    for part in (0.013, 0.37, 0.81):
        theta = walk.q.first + part * (walk.q.last - walk.q.first)
        q, v = walk.q(theta), walk.v(theta)
        linear = dynamics.linearize(robot, q, v, walk.torque(theta), contacts=[contact])
        expected = np.concatenate([v, linear.state_derivative[robot.nv :]])
        found = walk.slope_at(theta)
        size = robot.nv - 2
        np.testing.assert_allclose(found[:size], expected[2 : robot.nv], atol=1e-8)
        np.testing.assert_allclose(found[size:], expected[robot.nv + 2 :], atol=1e-5)
    start = zero().initial_state
    np.testing.assert_allclose(walk.q(walk.q.first), start.q, atol=1e-9)
    np.testing.assert_allclose(walk.v(walk.q.first), start.v, atol=1e-8)


def test_the_riccati_equation_is_that_of_the_least_cost() -> None:
    """Of a disturbance's whole cost over many steps no other gains make less.

    The cost of the regulator is compared with those of gains a little off, by integrating cost and
    disturbance over thirty steps.
    """
    across = Transverse.of(orbit())
    size = len(across.basis)
    cost, effort = np.diag(np.r_[np.full(size // 2, 1e6), np.full(size // 2, 1e3)]), np.eye(4)
    spline = across.regulator(cost, effort)

    def total(change: float) -> float:
        draw = np.random.default_rng(0)
        gains = spline(across.theta) + change * draw.normal(size=(4, size))
        within = gains @ across.basis
        closed = across.A - across.B @ within
        weight = across.basis.T @ cost @ across.basis + np.swapaxes(within, 1, 2) @ within
        w = draw.normal(size=size - 1) * 1e-2
        spent, width = 0.0, across.theta[1] - across.theta[0]
        for _ in range(12):
            for k in range(len(across.theta) - 1):
                pace = across.pace[k]
                spent += width * pace * w @ weight[k] @ w
                half = w + 0.5 * width * closed[k] @ w
                w = w + width * 0.5 * (closed[k] + closed[k + 1]) @ half
            w = across.jump @ w
        return spent

    least = total(0.0)
    for change in (30.0, -30.0):
        assert total(change) > least * (1.0 + 1e-4)


@pytest.mark.slow
def test_multipliers_are_those_of_the_closed_loop() -> None:
    """Of the walk as simulated, through its impacts, by flows and saltations."""
    found = hs.find_limit_cycle(gait().robot, zero().initial_state, law())
    assert abs(found.period - zero().period) < 1e-9
    predicted = law().multipliers
    assert len(predicted) == len(found.multipliers) == 2 * gait().robot.nv - 5
    largest = slice(0, 4)  # the others are less than 1e-3
    np.testing.assert_allclose(
        np.abs(found.multipliers[largest]), np.abs(predicted[largest]), atol=1e-6
    )
    assert np.abs(found.multipliers[4:]).max() < 1e-2
    # Better than virtual constraints, whose speed comes back by δ² a step.
    assert abs(predicted[0]) < 0.75 * zero().contraction


@pytest.mark.parametrize("mirrored", [False, True])
def test_it_walks_on_either_foot(mirrored: bool) -> None:
    start = zero().initial_state
    controller = law()
    if mirrored:
        start = gait().robot.mirrored(start)
        controller = hs.GaitLQR(gait())
        controller.memory["stance"] = 1 - gait().stance_foot
    run = hs.simulate(gait().robot, controller, state=start, duration=3.0)
    assert run.completed
    assert run.final_state.q[0] > 0.9
    part = run.log["phase"].values
    assert part.min() > -0.1
    assert part.max() < 1.1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"position_weight": -1.0}, "position_weight must be one number that is not negative"),
        ({"velocity_weight": [1.0, 2.0]}, "velocity_weight must be one number .* or 7 of them"),
        ({"torque_weight": 0.0}, "torque_weight must be positive"),
        ({"torque_weight": np.nan}, "torque_weight must be one number that is positive"),
    ],
)
def test_wrong_weights_are_named(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ControllerError, match=said):
        hs.GaitLQR(gait(), **options)


def test_a_gait_that_does_not_repeat_is_refused() -> None:
    changed = gait().coefficients.copy()
    changed[3] += 0.01
    with pytest.raises(ControllerError, match=r"hs\.make_invariant"):
        hs.GaitLQR(replace(gait(), coefficients=changed))


def test_a_gait_in_time_is_refused() -> None:
    in_time: Any = walking.gait()
    with pytest.raises(ControllerError, match=r"PhasedGait\.from_gait"):
        hs.GaitLQR(in_time)
