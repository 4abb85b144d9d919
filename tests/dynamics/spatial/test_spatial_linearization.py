"""The linear system of a robot in space: differences of its own equations of motion.

Differences of second order over 1e-5 leave some 1e-9 of the largest entries and of the
accelerations themselves, which they round; 1e-6 of them is asked for.
"""

from __future__ import annotations

import numpy as np
import pytest
from spatial_cases import FREE, NAMED, RANDOM, SpatialCase, in_space

from heelstrike import dynamics
from heelstrike.robot import SpatialRobot

STEP, TOLERANCE = 1e-5, 1e-6


def acceleration(
    robot: SpatialRobot, q: np.ndarray, v: np.ndarray, torque: np.ndarray
) -> np.ndarray:
    force = dynamics.applied_force(robot, q, v, torque)
    return np.asarray(dynamics.forward_dynamics(robot, q, v, force))


@pytest.mark.parametrize("case", [NAMED[0], *RANDOM[:5], *FREE[:2]], ids=lambda case: case.name)
def test_derivatives_are_those_of_the_equations_of_motion(case: SpatialCase) -> None:
    robot = case.robot()
    n = robot.nv
    torque = np.cos(np.arange(robot.nu))
    q, v = next(case.states(1))
    found = dynamics.linearize(robot, q, v, torque)
    assert found.A.shape == (2 * n, 2 * n)
    np.testing.assert_allclose(found.state_derivative[:n], v)
    a = acceleration(robot, q, v, torque)
    np.testing.assert_allclose(found.state_derivative[n:], a, rtol=1e-9, atol=1e-9 * abs(a).max())
    for k in range(n):
        aside = STEP * np.eye(n)[k]
        by_position = [
            acceleration(robot, dynamics.integrate(robot, q, aside, sign), v, torque)
            for sign in (1.0, -1.0)
        ]
        by_velocity = [acceleration(robot, q, v + sign * aside, torque) for sign in (1.0, -1.0)]
        for column, (plus, minus) in ((k, by_position), (n + k, by_velocity)):
            expected = (plus - minus) / (2.0 * STEP)
            scale = 1.0 + np.abs(expected).max() + np.abs(a).max()
            assert np.abs(found.A[n:, column] - expected).max() <= TOLERANCE * scale
    for k in range(robot.nu):
        more = acceleration(robot, q, v, torque + np.eye(robot.nu)[k]) - a
        scale = 1.0 + np.abs(more).max()
        assert np.abs(found.B[n:, k] - more).max() <= TOLERANCE * scale
    assert not found.B[:n].any()


@pytest.mark.parametrize("case", [RANDOM[1], FREE[0]], ids=lambda case: case.name)
def test_errors_are_carried_along_with_the_motion(case: SpatialCase) -> None:
    """The upper half: how the difference of two motions begins to change."""
    robot = case.robot()
    n = robot.nv
    q, v = next(case.states(1))
    found = dynamics.linearize(robot, q, v, np.zeros(robot.nu))
    small = STEP * np.cos(np.arange(2 * n))
    other = dynamics.integrate(robot, q, small[:n], 1.0)

    def apart(time: float) -> np.ndarray:
        here = dynamics.integrate(robot, q, v, time)
        there = dynamics.integrate(robot, other, v + small[n:], time)
        return np.asarray(dynamics.difference(robot, here, there))

    rate = (apart(1e-4) - apart(-1e-4)) / 2e-4
    expected = found.A[:n] @ small
    assert np.abs(rate - expected).max() <= 1e-4 * STEP * (1.0 + np.abs(v).max())


BALL = """<mujoco><worldbody><body name="ball" pos="0 0 0.1"><freejoint/>
<geom size="0.1" mass="2"/></body></worldbody></mujoco>"""
WHEEL = """<mujoco><worldbody><body name="wheel" pos="0 0 0.3"><freejoint/>
<geom type="cylinder" size="0.3" fromto="0 -0.05 0 0 0.05 0" mass="2"/></body></worldbody>
</mujoco>"""


def test_a_held_ball_rolls() -> None:
    """A ball of radius r that the ground holds rolls freely: its contact carries the weight."""
    robot = in_space(BALL)
    q = robot.reference_state().q
    roll = np.array([0.3, 0.0, 0.0, 0.0, 3.0, 0.0])  # v = ω r
    found = dynamics.linearize(robot, q, roll, [], contacts=[0])
    np.testing.assert_allclose(found.contact_force, [[2.0 * 9.81, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(found.state_derivative[6:], 0.0, atol=1e-12)
    assert np.abs(dynamics.contact_bias_acceleration(robot, q, roll)).max() == 0.0
    assert found.contact_force_state.shape == (1, 3, 12)


def test_bias_of_contacts_is_the_rate_of_their_velocity() -> None:
    """J̇ v by differences of J v along the motion, of spheres and of rims that lean and turn."""
    draw = np.random.default_rng(4)
    for text in (BALL, WHEEL):
        robot = in_space(text)
        for _ in range(5):
            q = np.append(draw.normal(size=3), draw.normal(size=4))
            q[3:] /= np.linalg.norm(q[3:])
            v = draw.normal(size=6)

            def moves(
                time: float, robot: SpatialRobot = robot, q: np.ndarray = q, v: np.ndarray = v
            ) -> np.ndarray:
                there = dynamics.integrate(robot, q, v, time)
                return np.asarray(dynamics.contact_jacobian(robot, there) @ v)

            expected = (moves(1e-5) - moves(-1e-5)) / 2e-5
            found = dynamics.contact_bias_acceleration(robot, q, v)
            assert np.abs(found - expected).max() <= 1e-7 * (1.0 + np.abs(expected).max())
