"""The kernels traced by CasADi are the compiled ones."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from robot_cases import NAMED, RANDOM, RobotCase

from heelstrike import dynamics
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols

# Same operations in the same order; only the order of the sine's last bit may differ.
TOLERANCE = 1e-12


@pytest.mark.parametrize("case", [*NAMED, *RANDOM], ids=lambda case: case.name)
def test_traced_equals_compiled(case: RobotCase) -> None:
    robot = case.robot()
    n = robot.nv
    q, v, a = (casadi.SX.sym(name, n) for name in "qva")
    link, local = n - 1, np.array([0.1, -0.3])
    traced = TracedDynamics(robot, symbols(q), symbols(v))
    position = traced.point_position(link, local)
    function = casadi.Function(
        "traced",
        [q, v, a],
        [
            expression(traced.mass_matrix()),
            expression(traced.inverse_dynamics(symbols(a))),
            expression(traced.passive_force()),
            expression(traced.point_jacobian(link, position)),
            expression(traced.point_bias_acceleration(link, position)),
            casadi.vertcat(*traced.energy()),
        ],
    )
    for position_now, velocity_now in case.states(50):
        acceleration = np.cos(np.arange(n))
        results = function(position_now, velocity_now, acceleration)
        expected = [
            dynamics.mass_matrix(robot, position_now),
            dynamics.inverse_dynamics(robot, position_now, velocity_now, acceleration),
            dynamics.passive_force(robot, position_now, velocity_now),
            dynamics.point_jacobian(robot, position_now, link, local),
            dynamics.point_bias_acceleration(robot, position_now, velocity_now, link, local),
            np.array(dynamics.energy(robot, position_now, velocity_now)),
        ]
        for result, reference in zip(results, expected, strict=True):
            array = np.array(result).reshape(reference.shape)
            assert np.abs(array - reference).max() <= TOLERANCE * (1.0 + np.abs(reference).max())


def test_tracing_leaves_the_compiled_kernels_alone() -> None:
    case = NAMED[0]
    robot = case.robot()
    q, _ = next(iter(case.states(1)))
    before = dynamics.mass_matrix(robot, q)
    TracedDynamics(robot, symbols(casadi.SX.sym("q", robot.nv)))
    np.testing.assert_array_equal(dynamics.mass_matrix(robot, q), before)
