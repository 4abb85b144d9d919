"""Laws that hold whatever the numbers of the robot: energy, skew symmetry, momentum, inversion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
import pytest
from robot_cases import ROBOTS, RobotCase

from heelstrike import dynamics
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols

# All of these compare two sums of a few hundred products of order one, so that 1e-10 relative to
# the largest entry leaves four orders of magnitude for rounding.
TOLERANCE = 1e-10

pytestmark = pytest.mark.parametrize("case", ROBOTS, ids=lambda case: case.name)


def test_kinetic_energy_is_half_v_m_v(case: RobotCase) -> None:
    robot = case.robot()
    for q, v in case.states(20):
        kinetic, _ = dynamics.energy(robot, q, v)
        assert 0.5 * v @ dynamics.mass_matrix(robot, q) @ v == pytest.approx(kinetic, rel=TOLERANCE)


def test_mass_matrix_is_symmetric_and_positive(case: RobotCase) -> None:
    robot = case.robot()
    for q, _ in case.states(20):
        matrix = dynamics.mass_matrix(robot, q)
        np.testing.assert_array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix)[0] > 0.0


def test_christoffel_matrix_makes_m_dot_minus_2c_skew(case: RobotCase) -> None:
    """C from the Christoffel symbols of M: Ṁ − 2C is skew and C v is the bias force.

    The symbols come from the traced mass matrix, differentiated exactly.
    """
    robot = case.robot()
    n = robot.nv
    q = casadi.SX.sym("q", n)
    matrix = expression(TracedDynamics(robot, symbols(q)).mass_matrix())
    derivative = casadi.Function("dM", [q], [casadi.jacobian(casadi.vec(matrix), q)])
    for position, v in case.states(5):
        # tensor[i, j, k] = ∂M_ij / ∂q_k (CasADi stacks columns).
        tensor = np.array(derivative(position)).reshape(n, n, n).transpose(1, 0, 2)
        christoffel = 0.5 * (tensor + tensor.transpose(0, 2, 1) - tensor.transpose(2, 1, 0))
        coriolis = christoffel @ v
        skew = tensor @ v - 2.0 * coriolis
        scale = np.abs(tensor).max() * np.abs(v).max() + 1.0
        assert np.abs(skew + skew.T).max() <= TOLERANCE * scale
        expected = dynamics.bias_force(robot, position, v) - dynamics.gravity_force(robot, position)
        assert np.abs(coriolis @ v - expected).max() <= TOLERANCE * scale * (1 + np.abs(v).max())


def test_inverse_dynamics_undoes_forward_dynamics(case: RobotCase) -> None:
    robot = case.robot()
    for q, v in case.states(20):
        force = np.sin(np.arange(robot.nv) + 1.0) * 30.0
        acceleration = dynamics.forward_dynamics(robot, q, v, force)
        back = dynamics.inverse_dynamics(robot, q, v, acceleration)
        scale = np.abs(dynamics.mass_matrix(robot, q)).max() * np.abs(acceleration).max() + 30.0
        assert np.abs(back - force).max() <= TOLERANCE * scale


def along_motion(case: RobotCase, quantity: Callable[[TracedDynamics], Any]) -> casadi.Function:
    """Exact rate (q, v, a) -> d/dt of a traced quantity."""
    robot = case.robot()
    q, v, a = (casadi.SX.sym(name, robot.nv) for name in "qva")
    value = quantity(TracedDynamics(robot, symbols(q), symbols(v)))
    return casadi.Function(
        "rate", [q, v, a], [casadi.jtimes(value, q, v) + casadi.jtimes(value, v, a)]
    )


def test_power_balances(case: RobotCase) -> None:
    """d(T + V)/dt = vᵀ force, where the force includes that of the springs within V."""
    robot = case.robot()
    rate = along_motion(case, lambda traced: sum(traced.energy()))
    for q, v in case.states(20):
        force = np.cos(np.arange(robot.nv) + 1.0) * 30.0
        springs = -robot.model.stiffness * (q - robot.model.rest)
        acceleration = dynamics.forward_dynamics(robot, q, v, force + springs)
        matrix = dynamics.mass_matrix(robot, q)
        scale = 1.0 + np.abs(v) @ np.abs(matrix) @ np.abs(acceleration)
        assert abs(float(rate(q, v, acceleration)) - v @ force) <= TOLERANCE * scale


def test_free_flight_conserves_momentum(case: RobotCase) -> None:
    """Internal forces change no momentum; gravity changes the linear one only."""
    robot = case.robot()
    if not robot.floating:
        pytest.skip("momentum of a robot fixed to the ground is not conserved")
    rate = along_motion(case, lambda traced: expression(traced.momentum()))
    force = np.zeros(robot.nv)
    force[3:] = 5.0 * np.sin(np.arange(robot.nv - 3))
    for q, v in case.states(20):
        acceleration = dynamics.forward_dynamics(robot, q, v, force)
        matrix = dynamics.mass_matrix(robot, q)
        scale = 1.0 + np.abs(matrix).max() * np.abs(acceleration).max()
        expected = np.append(robot.total_mass * robot.model.gravity, 0.0)
        error = np.array(rate(q, v, acceleration)).ravel() - expected
        assert np.abs(error).max() <= TOLERANCE * scale


def test_jacobian_is_the_derivative_of_position(case: RobotCase) -> None:
    robot = case.robot()
    local = np.array([0.1, -0.2])
    link = robot.nv - 1
    for q, v in case.states(10):
        jacobian = dynamics.point_jacobian(robot, q, link, local)
        bias = dynamics.point_bias_acceleration(robot, q, v, link, local)

        def pose(s: float, q: np.ndarray = q, v: np.ndarray = v) -> np.ndarray:
            poses = dynamics.link_poses(robot, q + s * v)
            angle = poses.angle[link]
            c, sine = np.cos(angle), np.sin(angle)
            x, z = local
            origin = poses.origin[link]
            return np.array([origin[0] + c * x + sine * z, origin[1] - sine * x + c * z, angle])

        h = 1e-3
        velocity = (8.0 * (pose(h) - pose(-h)) - (pose(2 * h) - pose(-2 * h))) / (12.0 * h)
        second = (-pose(2 * h) + 16 * pose(h) - 30 * pose(0.0) + 16 * pose(-h) - pose(-2 * h)) / (
            12.0 * h * h
        )
        scale = 1.0 + np.abs(v).max() ** 4
        assert np.abs(jacobian @ v - velocity).max() <= 1e-9 * scale
        assert np.abs(bias - second).max() <= 1e-6 * scale
