"""Laws that hold whatever the numbers of a robot in space: energy, momentum, inversion, power.

Rates are differences of fourth order along a motion, over steps of 3e-5 s: what they round is some
1e-11 of what changes, and 1e-7 relative to the largest terms leaves room for that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from spatial_cases import FREE, NAMED, RANDOM, SpatialCase

from heelstrike import dynamics
from heelstrike.dynamics import spatial
from heelstrike.errors import RobotError
from heelstrike.robot import SpatialRobot

TOLERANCE = 1e-11
RATE = 1e-7
STEP = 3e-5

ALL = [*NAMED, *RANDOM[:8], *FREE]
each_robot = pytest.mark.parametrize("case", ALL, ids=lambda case: case.name)
each_free_one = pytest.mark.parametrize("case", FREE, ids=lambda case: case.name)


def rate(
    robot: SpatialRobot,
    q: np.ndarray,
    v: np.ndarray,
    a: np.ndarray,
    quantity: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> np.ndarray:
    """Rate of a quantity of (q, v) along a motion whose acceleration is `a`."""

    def after(time: float) -> np.ndarray:
        # Only the rates of position and velocity at the state itself matter.
        place = spatial.integrate(robot, q, v + 0.5 * time * a, time)
        return np.asarray(quantity(place, v + time * a))

    near, far = after(STEP) - after(-STEP), after(2.0 * STEP) - after(-2.0 * STEP)
    return (8.0 * near - far) / (12.0 * STEP)


def forces(robot: SpatialRobot, size: float = 30.0) -> np.ndarray:
    return size * np.sin(np.arange(robot.nv) + 1.0)


@each_robot
def test_kinetic_energy_is_half_v_m_v(case: SpatialCase) -> None:
    robot = case.robot()
    for q, v in case.states(10):
        kinetic, _ = spatial.energy(robot, q, v)
        expected = 0.5 * v @ spatial.mass_matrix(robot, q) @ v
        assert expected == pytest.approx(kinetic, rel=TOLERANCE)


@each_robot
def test_mass_matrix_is_symmetric_and_positive(case: SpatialCase) -> None:
    robot = case.robot()
    for q, _ in case.states(10):
        matrix = spatial.mass_matrix(robot, q)
        np.testing.assert_array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix)[0] > 0.0


@each_robot
def test_inverse_dynamics_undoes_forward_dynamics(case: SpatialCase) -> None:
    robot = case.robot()
    force = forces(robot)
    for q, v in case.states(10):
        acceleration = spatial.forward_dynamics(robot, q, v, force)
        back = spatial.inverse_dynamics(robot, q, v, acceleration)
        scale = np.abs(spatial.mass_matrix(robot, q)).max() * np.abs(acceleration).max() + 30.0
        assert np.abs(back - force).max() <= TOLERANCE * scale


@each_robot
def test_power_balances(case: SpatialCase) -> None:
    """d(T + V)/dt = vᵀ force, where the force includes that of the springs within V."""
    robot = case.robot()
    for q, v in case.states(5):
        force = forces(robot)
        springs = spatial.passive_force(robot, q, 0.0 * v)
        a = spatial.forward_dynamics(robot, q, v, force + springs)
        found = rate(robot, q, v, a, lambda q, v: np.sum(spatial.energy(robot, q, v)))
        scale = 1.0 + np.abs(v) @ np.abs(spatial.mass_matrix(robot, q)) @ np.abs(a)
        assert abs(found - v @ force) <= RATE * scale


@each_free_one
def test_free_flight_conserves_momentum(case: SpatialCase) -> None:
    """Internal forces change no momentum; gravity changes the linear one only."""
    robot = case.robot()
    assert robot.floating
    force = forces(robot, 5.0)
    force[:6] = 0.0
    # Rotors turn with the joints, not with the links, and are no part of the momentum.
    for q, v in case.states(5):
        a = spatial.forward_dynamics(robot, q, v, force)
        found = rate(robot, q, v, a, lambda q, v: spatial.momentum(robot, q, v))
        expected = np.concatenate((robot.total_mass * robot.model.gravity, np.zeros(3)))
        scale = 1.0 + np.abs(spatial.mass_matrix(robot, q)).max() * np.abs(a).max()
        assert np.abs(found - expected).max() <= RATE * scale


@each_robot
def test_momentum_matrix_and_center_of_mass(case: SpatialCase) -> None:
    robot = case.robot()
    for q, v in case.states(5):
        momentum = spatial.momentum(robot, q, v)
        scale = 1.0 + np.abs(momentum).max()
        assert np.abs(spatial.momentum_matrix(robot, q) @ v - momentum).max() <= TOLERANCE * scale
        jacobian = spatial.center_of_mass_jacobian(robot, q)
        moves = spatial.center_of_mass_velocity(robot, q, v)
        assert np.abs(jacobian @ v - moves).max() <= TOLERANCE * scale
        still = np.zeros(robot.nv)
        found = rate(robot, q, v, still, lambda q, v: spatial.center_of_mass(robot, q))
        assert np.abs(found - moves).max() <= RATE * scale
        found = rate(robot, q, v, still, lambda q, v: spatial.center_of_mass_velocity(robot, q, v))
        bias = spatial.center_of_mass_bias_acceleration(robot, q, v)
        assert np.abs(found - bias).max() <= RATE * (1.0 + np.abs(bias).max())


@each_robot
def test_jacobian_is_the_derivative_of_position(case: SpatialCase) -> None:
    robot = case.robot()
    link, local = robot.nl - 1, np.array([0.1, -0.2, 0.3])
    for q, v in case.states(5):
        still = np.zeros(robot.nv)
        moves = spatial.point_jacobian(robot, q, link, local) @ v
        assert np.abs(
            moves - spatial.point_velocity(robot, q, v, link, local)
        ).max() <= TOLERANCE * (1.0 + np.abs(moves).max())
        found = rate(robot, q, v, still, lambda q, v: spatial.point_position(robot, q, link, local))
        assert np.abs(found - moves[:3]).max() <= RATE * (1.0 + np.abs(moves).max())
        bias = spatial.point_bias_acceleration(robot, q, v, link, local)
        found = rate(
            robot, q, v, still, lambda q, v: spatial.point_velocity(robot, q, v, link, local)
        )
        assert np.abs(found - bias).max() <= RATE * (1.0 + np.abs(bias).max())


@each_robot
def test_difference_undoes_integrate(case: SpatialCase) -> None:
    robot = case.robot()
    for q, v in case.states(10):
        there = spatial.integrate(robot, q, v, 0.5)
        assert np.abs(spatial.difference(robot, q, there) - 0.5 * v).max() <= 1e-13
        # The other sign of a quaternion is the same orientation.
        assert np.abs(spatial.difference(robot, there, there)).max() <= 1e-13


@each_robot
def test_gravity_and_coriolis_forces_make_the_bias_force(case: SpatialCase) -> None:
    robot = case.robot()
    for q, v in case.states(3):
        bias = spatial.bias_force(robot, q, v)
        parts = spatial.gravity_force(robot, q) + spatial.coriolis_force(robot, q, v)
        assert np.abs(bias - parts).max() <= TOLERANCE * (1.0 + np.abs(bias).max())


def test_the_same_questions_are_asked_of_the_plane_and_of_space() -> None:
    """Those of `heelstrike.dynamics` are handed on; what space does not know yet is refused."""
    robot = NAMED[0].robot()
    q, v = next(NAMED[0].states(1))
    np.testing.assert_array_equal(dynamics.mass_matrix(robot, q), spatial.mass_matrix(robot, q))
    np.testing.assert_array_equal(dynamics.momentum(robot, q, v), spatial.momentum(robot, q, v))
    found = dynamics.point_position(robot, q, local=(0.0, 0.1, 0.0), link="right_foot")
    np.testing.assert_array_equal(
        found, spatial.point_position(robot, q, "right_foot", (0.0, 0.1, 0.0))
    )
    with pytest.raises(RobotError, match="loop_jacobian is asked of robots of the plane"):
        dynamics.loop_jacobian(robot, q)
    with pytest.raises(RobotError, match="must have 9 entries"):
        dynamics.bias_force(robot, q, v[:4])
