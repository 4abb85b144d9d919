"""Rows along chains: the factor of the mass matrix, Jacobians, Delassus matrix, change of velocity.

The oracle is dense linear algebra with the same mass matrix and Jacobian.
"""

from __future__ import annotations

import numpy as np
import pytest
from spatial_cases import FREE, RANDOM, SpatialCase

from heelstrike.dynamics import spatial
from heelstrike.dynamics.spatial import equations, rows
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.dynamics.spatial.queries.points import ON_LEVEL_GROUND

TOLERANCE = 1e-11
WITH_POINTS = [case for case in [*RANDOM, *FREE] if case.robot().nc > 1]


@pytest.mark.parametrize("case", WITH_POINTS[:10], ids=lambda case: case.name)
def test_delassus_matrix_and_change_of_velocity(case: SpatialCase) -> None:
    robot = case.robot()
    model = robot.model
    for q, v in case.states(3):
        at = SpatialEvaluation(robot, q, v)
        tree = at.tree()
        equations.mass_rows(model, at.work, tree.matrix)
        equations.factorize(model, tree)
        mass = spatial.mass_matrix(robot, q)
        contacts = range(min(robot.nc, 6))
        jacobian = spatial.contact_jacobian(robot, q, contacts).reshape(-1, robot.nv)
        alone = robot.nv // 2  # the row of one velocity, as a stop has it
        dense = np.vstack((jacobian, -np.eye(robot.nv)[alone]))

        size = len(dense)
        along = np.full((size, model.longest), np.nan)
        first = np.append(3 * np.arange(len(contacts) + 1), size)
        last = np.zeros(len(contacts) + 1, dtype=np.int64)
        for k, contact in enumerate(contacts):
            link = int(model.contact_link[contact])
            last[k] = model.last_velocity[link]
            point = rows.contact_point(model, at.work, contact, (0.0, 0.0, 1.0))
            rows.write_point_rows(model, at.work, link, point, ON_LEVEL_GROUND, 3 * k, along)
        last[-1] = alone
        rows.write_velocity_row(model, alone, -1.0, size - 1, along)

        result = np.zeros(size)
        for k in range(len(last)):
            rows.along_rows(
                model, int(last[k]), int(first[k]), int(first[k + 1] - first[k]), along, v, result
            )
        assert np.abs(result - dense @ v).max() <= TOLERANCE * (1.0 + np.abs(dense @ v).max())

        for k in range(len(last)):
            count = int(first[k + 1] - first[k])
            rows.whiten_rows(model, tree, int(last[k]), int(first[k]), count, along)
        delassus = np.zeros((size, size))
        rows.write_delassus(model, len(last), first, last, along, delassus)
        expected = dense @ np.linalg.solve(mass, dense.T)
        assert np.abs(delassus - expected).max() <= TOLERANCE * np.abs(expected).max()
        np.testing.assert_array_equal(delassus, delassus.T)

        impulse = np.cos(np.arange(size))
        change = np.zeros(robot.nv)
        rows.velocity_change(model, tree, len(last), first, last, along, impulse, change)
        expected = np.linalg.solve(mass, dense.T @ impulse)
        assert np.abs(change - expected).max() <= TOLERANCE * np.abs(expected).max()


@pytest.mark.parametrize("case", RANDOM[:6], ids=lambda case: case.name)
def test_the_factor_is_that_of_the_mass_matrix(case: SpatialCase) -> None:
    robot = case.robot()
    model = robot.model
    for q, _ in case.states(3):
        at = SpatialEvaluation(robot, q)
        tree = at.tree()
        equations.mass_rows(model, at.work, tree.matrix)
        equations.factorize(model, tree)
        lower, diagonal = np.eye(robot.nv), np.zeros(robot.nv)
        for k in range(robot.nv):
            depth = int(model.depth[k])
            lower[k, model.chain[k, :depth]] = tree.factor[k, :depth]
            diagonal[k] = 1.0 / tree.factor[k, depth]
        mass = spatial.mass_matrix(robot, q)
        assert np.abs(lower.T @ np.diag(diagonal) @ lower - mass).max() <= TOLERANCE * mass.max()
        np.testing.assert_allclose(tree.root**-2, diagonal, rtol=1e-14)
        x = np.cos(np.arange(robot.nv))
        solved = x.copy()
        equations.solve_factorized(model, tree, solved)
        assert np.abs(mass @ solved - x).max() <= 1e-10 * np.abs(mass).max() * np.abs(solved).max()
