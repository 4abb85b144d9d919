"""Rows of loops against differences, and the dynamics that they hold."""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import four_bar, geared, parallel_ankles

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.robot import Robot

ROBOTS = [four_bar, lambda: geared((0.3, -1.5, 0.4, 0.2, -0.7)), parallel_ankles]
IDS = ["four_bar", "geared", "parallel_ankles"]


def any_state(robot: Robot) -> hs.State:
    """Return a state in which no loop is closed: the rows are what they are anywhere."""
    draw = np.random.default_rng(4)
    return hs.State(draw.normal(size=robot.nq), draw.normal(size=robot.nv))


@pytest.mark.parametrize("make", ROBOTS, ids=IDS)
def test_rows_are_derivatives_of_the_displacement(make: object) -> None:
    robot = make()  # type: ignore[operator]
    state, change = any_state(robot), 1e-6

    def rate(q: np.ndarray) -> np.ndarray:
        return dynamics.loop_jacobian(robot, q) @ state.v

    ends = [dynamics.loop_displacement(robot, state.q + s * change * state.v) for s in (1, -1)]
    np.testing.assert_allclose(rate(state.q), (ends[0] - ends[1]) / (2 * change), rtol=0, atol=1e-8)
    rates = [rate(state.q + s * change * state.v) for s in (1, -1)]
    np.testing.assert_allclose(
        dynamics.loop_bias_acceleration(robot, state.q, state.v),
        (rates[0] - rates[1]) / (2 * change),
        rtol=0,
        atol=1e-7,
    )


@pytest.mark.parametrize("make", ROBOTS, ids=IDS)
def test_forward_dynamics_and_its_derivatives_hold_the_loops(make: object) -> None:
    robot = make()  # type: ignore[operator]
    given = robot.state(velocity={robot.joint_names[-1]: 1.0})
    state = robot.closed(given)
    n, torque = robot.nv, np.linspace(1.0, 2.0, robot.nu)

    def rate(x: np.ndarray, gamma: np.ndarray = torque) -> np.ndarray:
        force = dynamics.applied_force(robot, x[:n], x[n:], gamma)
        return np.concatenate([x[n:], dynamics.forward_dynamics(robot, x[:n], x[n:], force)])

    x = np.concatenate([state.q, state.v])
    held = dynamics.loop_jacobian(robot, state.q) @ rate(x)[n:]
    bias = dynamics.loop_bias_acceleration(robot, state.q, state.v)
    np.testing.assert_allclose(held, -bias, rtol=0, atol=1e-9)
    found = dynamics.linearize(robot, state.q, state.v, torque)
    np.testing.assert_allclose(found.state_derivative, rate(x), rtol=0, atol=1e-9)
    h = 1e-6
    by_state = [(rate(x + h * e) - rate(x - h * e)) / (2 * h) for e in np.eye(2 * n)]
    np.testing.assert_allclose(found.A, np.array(by_state).T, rtol=1e-5, atol=1e-5)
    by_torque = [rate(x, torque + e) - rate(x) for e in np.eye(robot.nu)]
    np.testing.assert_allclose(found.B, np.reshape(by_torque, (robot.nu, 2 * n)).T, atol=1e-8)


@pytest.mark.parametrize("make", ROBOTS, ids=IDS)
def test_symbols_say_the_same(make: object) -> None:
    robot = make()  # type: ignore[operator]
    state, force = any_state(robot), np.linspace(-1.0, 1.0, robot.nv)
    symbolic = dynamics.CasadiDynamics(robot)
    for name, vectors in {
        "loop_displacement": (state.q,),
        "loop_jacobian": (state.q,),
        "loop_bias_acceleration": (state.q, state.v),
        "forward_dynamics": (state.q, state.v, force),
    }.items():
        expected = getattr(dynamics, name)(robot, *vectors)
        found = np.array(getattr(symbolic, name)()(*vectors)).reshape(expected.shape)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_a_robot_on_the_ground_with_loops() -> None:
    """Standing still: forces of the ground bear the weight, those of the loops are internal."""
    robot = parallel_ankles()
    state = robot.standing(hs.Ground())
    found = hs.contact_forward_dynamics(robot, state.q, state.v, np.zeros(robot.nu))
    assert found.certificate.valid
    bias = dynamics.loop_bias_acceleration(robot, state.q, state.v)
    held = dynamics.loop_jacobian(robot, state.q) @ found.acceleration + bias
    np.testing.assert_allclose(held, 0.0, atol=1e-9)
    jacobian = dynamics.contact_jacobian(robot, state.q).reshape(-1, robot.nv)
    push = dynamics.loop_jacobian(robot, state.q).T @ found.loop_force
    kinematics = hs.contact_kinematics(robot, state.q, state.v)
    push = push + kinematics.jacobian.reshape(jacobian.shape).T @ found.contact_force.ravel()
    total = dynamics.inverse_dynamics(robot, state.q, state.v, found.acceleration)
    np.testing.assert_allclose(push, total, rtol=0, atol=1e-8)
    assert np.abs(found.loop_force).max() > 0.1
    # As a simulation begins.
    run = hs.simulate(robot, state=state, duration=1e-3, method=hs.EventDriven())
    np.testing.assert_allclose(run.loop_force[0].ravel(), found.loop_force, rtol=1e-6, atol=1e-6)
    # In symbols, with a point of each foot.
    heels = [foot.contacts[0] for foot in robot.feet]
    solve = dynamics.CasadiDynamics(robot).contact_forward_dynamics(heels)
    rate = np.array(solve(state.q, state.v, np.zeros(robot.nu))[0]).ravel()
    linear = dynamics.linearize(robot, state.q, state.v, np.zeros(robot.nu), contacts=heels)
    np.testing.assert_allclose(linear.state_derivative[robot.nq :], rate, rtol=0, atol=1e-8)
