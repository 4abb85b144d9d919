"""What no robot may be."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.robot.assembly import _mass_matrix


@pytest.mark.parametrize("name", hs.builtin_robots())
def test_the_mass_matrix_that_masses_are_judged_by_is_the_one_of_the_kernels(name: str) -> None:
    """Two ways to one matrix, which agree to rounding."""
    robot = hs.load_robot(name)
    turn = np.random.default_rng(3).normal(size=robot.nj)
    turn[robot.model.axis[:, 0] == 0.0] = 0.0  # the slides stay
    expected = dynamics.mass_matrix(robot, robot.model.reference + turn)
    found = _mass_matrix(robot.model, turn)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
