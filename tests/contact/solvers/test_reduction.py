"""The scaled problem that the solvers work on."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, SLIDING_BACKWARD, SLIDING_FORWARD
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.reduction import reduce_problem, scale_matrix
from heelstrike.contact.workspace import Floats, Integers, ReducedProblem, contact_problem


def reduced_to(delassus: Floats, free: Floats, friction: Floats, mode: Integers) -> ReducedProblem:
    """Write the scaled problem with its matrix."""
    count, work = len(friction), contact_workspace(len(friction))
    problem = contact_problem(count, count=count, delassus=delassus, free=free, friction=friction)
    uncompiled(reduce_problem)(problem, mode, work.scaling.slope, work.reduced)
    uncompiled(scale_matrix)(problem, work.scaling.slope, work.reduced)
    return work.reduced


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_unit_diagonal_whatever_the_masses(size: float) -> None:
    """Three contacts, the second without friction; masses far apart."""
    draw = np.random.default_rng(2)
    rows = draw.normal(size=(6, 8)) * np.array([[1.0], [1.0], [1e3], [1.0], [1e-4], [1e-4]])
    delassus, free = size * rows @ rows.T, draw.normal(size=6)
    friction = np.array([0.5, 0.0, 0.8])
    reduced = reduced_to(delassus, free, friction, np.full(3, OPEN, np.int64))
    assert reduced.unknowns == 5
    assert reduced.source[:5].tolist() == [0, 1, 2, 4, 5]
    assert reduced.normal[:3].tolist() == [0, 2, 3]
    assert reduced.tangent[:3].tolist() == [1, -1, 4]
    matrix, scale = reduced.matrix[:5, :5], reduced.scale[:5]
    source = reduced.source[:5]
    np.testing.assert_allclose(np.diag(matrix), 1.0, rtol=1e-14)
    unscaled = matrix / scale[:, None] / scale
    np.testing.assert_allclose(unscaled, delassus[np.ix_(source, source)], rtol=1e-12)
    np.testing.assert_allclose(reduced.offset[:5] / scale, free[source], rtol=1e-14)
    # |λ_t| ≤ μ λ_n of λ = d x: the cone opens by the ratio of the scales.
    expected = [0.5 * scale[0] / scale[1], 0.0, 0.8 * scale[3] / scale[4]]
    np.testing.assert_allclose(reduced.cone[:3], expected, rtol=1e-14)


@pytest.mark.parametrize(("mode", "lean"), [(SLIDING_FORWARD, -0.5), (SLIDING_BACKWARD, 0.5)])
def test_prescribed_sliding_is_part_of_the_matrix(mode: int, lean: float) -> None:
    """One unknown: w_n = (G_nn ∓ μ G_nt) λ_n + b_n."""
    delassus = np.array([[4.0, 1.0], [1.0, 2.0]])
    free, friction = np.array([-3.0, 1.0]), np.array([0.5])
    reduced = reduced_to(delassus, free, friction, np.array([mode]))
    assert reduced.unknowns == 1
    assert reduced.matrix[0, 0] == pytest.approx((4.0 + lean) / 4.0)
    assert reduced.offset[0] == pytest.approx(-1.5)


def test_rows_without_a_diagonal_are_scaled_by_their_largest_entry() -> None:
    """Of the row or the column, whichever is larger; by one where there is none."""
    delassus = np.array([[0.0, 2.0, 0.0], [9.0, -1.0, 0.0], [0.0, 0.0, 0.0]])
    matrix = np.zeros((6, 6))
    matrix[::2, ::2] = delassus
    reduced = reduced_to(matrix, np.ones(6), np.zeros(3), np.full(3, OPEN, np.int64))
    np.testing.assert_allclose(reduced.scale[:3], [1.0 / 3.0, 1.0 / 3.0, 1.0])
