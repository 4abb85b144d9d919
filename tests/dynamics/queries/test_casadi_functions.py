"""The CasADi functions are the queries of the same name."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest
from robot_cases import NAMED, RANDOM, RobotCase

from heelstrike import dynamics

# The same operations in the same order; sines may differ in the last bit.
TOLERANCE = 1e-11


@pytest.mark.parametrize("case", [*NAMED, *RANDOM[1:3]], ids=lambda case: case.name)
def test_functions_equal_queries(case: RobotCase) -> None:
    robot = case.robot()
    functions = dynamics.CasadiDynamics(robot)
    link, local = robot.link_names[-1], (0.1, -0.2)
    contacts = range(robot.nc)

    def check(ours: Any, expected: Any) -> None:
        expected = np.asarray(expected, dtype=float)
        value = np.array(casadi.DM(ours)).reshape(expected.shape)
        assert np.abs(value - expected).max(initial=0.0) <= TOLERANCE * np.abs(expected).max(
            initial=1.0
        )

    of_q = ("mass_matrix", "gravity_force", "center_of_mass", "center_of_mass_jacobian")
    of_state = ("bias_force", "coriolis_force", "passive_force", "momentum", "kinetic_energy")
    of_state += ("angular_momentum", "center_of_mass_velocity", "energy")
    for q, v in case.states(2):
        a = np.cos(np.arange(robot.nv))
        torque = np.sin(np.arange(robot.nu))
        for name in (*of_q, "momentum_matrix", "potential_energy"):
            check(getattr(functions, name)()(q), getattr(dynamics, name)(robot, q))
        for name in of_state:
            check(getattr(functions, name)()(q, v), getattr(dynamics, name)(robot, q, v))
        for name in ("point_position", "point_jacobian"):
            expected = getattr(dynamics, name)(robot, q, link, local)
            check(getattr(functions, name)(link, local)(q), expected)
        for name in ("point_velocity", "point_bias_acceleration"):
            expected = getattr(dynamics, name)(robot, q, v, link, local)
            check(getattr(functions, name)(link, local)(q, v), expected)
        origin, angle = functions.link_poses()(q)
        check(origin, dynamics.link_poses(robot, q).origin)
        check(angle, dynamics.link_poses(robot, q).angle)
        check(functions.inverse_dynamics()(q, v, a), dynamics.inverse_dynamics(robot, q, v, a))
        check(functions.integrate(0.3)(q, v), dynamics.integrate(robot, q, v, 0.3))
        check(functions.difference()(q, v), dynamics.difference(robot, q, v))
        force = dynamics.applied_force(robot, q, v, torque)
        check(functions.applied_force()(q, v, torque), force)
        acceleration = dynamics.forward_dynamics(robot, q, v, force)
        check(functions.forward_dynamics()(q, v, force), acceleration)
        state = np.concatenate([q, v])
        check(functions.state_derivative()(state, torque), np.concatenate([v, acceleration]))
        linear = dynamics.linearize(robot, q, v, torque)
        for part, expected in zip(
            functions.linearization()(state, torque), (linear.A, linear.B), strict=True
        ):
            value, scale = np.array(casadi.DM(part)), np.abs(expected).max(initial=1.0)
            assert np.abs(value - expected).max(initial=0.0) <= 1e-8 * scale
        if robot.nc:
            rows = dynamics.contact_jacobian(robot, q).reshape(-1, robot.nv)
            drift = dynamics.contact_bias_acceleration(robot, q, v).ravel()
            check(functions.contact_jacobian()(q), rows)
            check(functions.contact_positions()(q), dynamics.contact_positions(robot, q))
            check(functions.contact_bias_acceleration()(q, v), drift)
            push = np.cos(np.arange(2 * robot.nc))
            residual = functions.contact_equations(contacts)(q, v, a, push, torque)
            motion = dynamics.inverse_dynamics(robot, q, v, a) - force - rows.T @ push
            check(residual, np.concatenate([motion, rows @ a + drift]))


def test_held_point_foot() -> None:
    robot = next(case for case in NAMED if case.name == "rabbit").robot()
    q, v = robot.model.reference + 0.1, np.linspace(-1.0, 1.0, robot.nv)
    torque = np.array([1.0, -2.0, 3.0, -4.0])
    functions = dynamics.CasadiDynamics(robot)
    acceleration, force = functions.contact_forward_dynamics([0])(q, v, torque)
    linear = dynamics.linearize(robot, q, v, torque, contacts=[0])
    np.testing.assert_allclose(np.array(acceleration).ravel(), linear.state_derivative[7:])
    np.testing.assert_allclose(np.array(force).ravel(), linear.contact_force.ravel())


def test_functions_serve_an_optimisation() -> None:
    """The lowest centre of mass with the knees bent: CasADi sees exact gradients."""
    robot = NAMED[0].robot()
    functions = dynamics.CasadiDynamics(robot)
    q = casadi.MX.sym("q", robot.nv)
    height = functions.center_of_mass()(q)[1]
    gradient = casadi.Function("gradient", [q], [casadi.gradient(height, q)])
    at, _ = next(iter(NAMED[0].states(1)))
    expected = dynamics.center_of_mass_jacobian(robot, at)[1]
    np.testing.assert_allclose(np.array(gradient(at)).ravel(), expected, atol=1e-12)
