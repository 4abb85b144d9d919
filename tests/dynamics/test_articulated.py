"""Articulated bodies against the mass matrix: two roads to the same acceleration."""

from __future__ import annotations

import numpy as np
import pytest
from robot_cases import MANY, ROBOTS, RobotCase

from heelstrike.dynamics.articulated import ArticulatedBodies, articulate, solve_articulated
from heelstrike.dynamics.kernels import factorize, forward_kinematics, mass_matrix
from heelstrike.dynamics.workspace import Workspace

# Mass matrices of these trees have condition numbers up to 1e5: 1e-16 becomes 1e-11.
TOLERANCE = 1e-10


@pytest.mark.parametrize("implicit", [False, True], ids=["explicit", "implicit"])
@pytest.mark.parametrize("case", [*ROBOTS, *MANY[::10]], ids=lambda case: case.name)
def test_equals_the_factor_of_the_mass_matrix(case: RobotCase, implicit: bool) -> None:
    """A⁻¹ x and the D of A = Lᵀ D L, with and without a diagonal added to A."""
    model, nv = case.robot().model, case.robot().nv
    work, bodies = Workspace.allocate(model.extents), ArticulatedBodies.allocate(model.extents)
    matrix, factor = np.zeros((nv, nv)), np.zeros((nv, nv))
    draw = np.random.default_rng(7)
    for q, force in case.states(3):
        added = draw.random(nv) if implicit else np.zeros(nv)
        forward_kinematics(model, q, work)
        mass_matrix(model, work, matrix)
        matrix += np.diag(added)
        factorize(model, matrix, factor)
        articulate(model, work, added, bodies)
        np.testing.assert_allclose(bodies.inverse, np.diag(factor), rtol=TOLERANCE)
        expected = np.linalg.solve(matrix, force)
        found = force.copy()
        solve_articulated(model, bodies, work, found)
        np.testing.assert_allclose(found, expected, atol=TOLERANCE * np.abs(expected).max())
