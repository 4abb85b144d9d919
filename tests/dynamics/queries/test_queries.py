"""Queries check what they are given, and far from the origin they lose nothing."""

from __future__ import annotations

import numpy as np
import pytest
from robot_cases import NAMED

from heelstrike import dynamics
from heelstrike.errors import RobotError


def test_wrong_length_names_the_coordinates() -> None:
    robot = NAMED[0].robot()
    with pytest.raises(RobotError, match="root_pitch"):
        dynamics.mass_matrix(robot, np.zeros(8))


def test_dynamics_do_not_depend_on_where_the_robot_is() -> None:
    """Ten kilometres from the origin the mass matrix keeps all but the digits of the position."""
    robot = NAMED[0].robot()
    q, v = next(iter(NAMED[0].states(1)))
    far = q.copy()
    far[0] += 10_000.0
    np.testing.assert_allclose(
        dynamics.mass_matrix(robot, far), dynamics.mass_matrix(robot, q), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        dynamics.bias_force(robot, far, v), dynamics.bias_force(robot, q, v), rtol=0, atol=1e-8
    )


def test_tree_factor_has_no_fill_in() -> None:
    from heelstrike.dynamics import kernels

    robot = NAMED[0].robot()
    q, _ = next(iter(NAMED[0].states(1)))
    matrix = dynamics.mass_matrix(robot, q)
    factor = np.zeros_like(matrix)
    kernels.factorize(robot.model, matrix, factor)
    unit = np.tril(factor, -1) + np.eye(robot.nv)
    np.testing.assert_allclose(unit.T @ np.diag(1.0 / np.diag(factor)) @ unit, matrix, atol=1e-12)
    # The legs do not know of each other.
    assert np.all(factor[6:, 3:6] == 0.0)
