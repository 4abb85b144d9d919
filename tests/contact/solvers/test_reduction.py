"""The scaled problem that the solvers work on."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, SLIDING_BACKWARD, SLIDING_FORWARD
from heelstrike.contact.solvers.reduction import reduce_problem, scale_matrix
from heelstrike.contact.solvers.search import contact_workspace
from heelstrike.contact.workspace import CONE, MATRIX, NORMAL, OFFSET, SCALE, SOURCE, TANGENT


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_unit_diagonal_whatever_the_masses(size: float) -> None:
    """Three contacts, the second without friction; masses far apart."""
    draw = np.random.default_rng(2)
    rows = draw.normal(size=(6, 8)) * np.array([[1.0], [1.0], [1e3], [1.0], [1e-4], [1e-4]])
    delassus, free = size * rows @ rows.T, draw.normal(size=6)
    friction, work = np.array([0.5, 0.0, 0.8]), contact_workspace(3)
    mode = np.full(3, OPEN, np.int64)
    unknowns = uncompiled(reduce_problem)(3, delassus, free, friction, mode, work)
    assert unknowns == 5
    assert work.labels[SOURCE, :5].tolist() == [0, 1, 2, 4, 5]
    assert work.labels[NORMAL, :3].tolist() == [0, 2, 3]
    assert work.labels[TANGENT, :3].tolist() == [1, -1, 4]
    uncompiled(scale_matrix)(5, delassus, work)
    matrix, scale = work.squares[MATRIX, :5, :5], work.vectors[SCALE, :5]
    source = work.labels[SOURCE, :5]
    np.testing.assert_allclose(np.diag(matrix), 1.0, rtol=1e-14)
    unscaled = matrix / scale[:, None] / scale
    np.testing.assert_allclose(unscaled, delassus[np.ix_(source, source)], rtol=1e-12)
    np.testing.assert_allclose(work.vectors[OFFSET, :5] / scale, free[source], rtol=1e-14)
    # |λ_t| ≤ μ λ_n of λ = d x: the cone opens by the ratio of the scales.
    expected = [0.5 * scale[0] / scale[1], 0.0, 0.8 * scale[3] / scale[4]]
    np.testing.assert_allclose(work.vectors[CONE, :3], expected, rtol=1e-14)


@pytest.mark.parametrize(("mode", "lean"), [(SLIDING_FORWARD, -0.5), (SLIDING_BACKWARD, 0.5)])
def test_prescribed_sliding_is_part_of_the_matrix(mode: int, lean: float) -> None:
    """One unknown: w_n = (G_nn ∓ μ G_nt) λ_n + b_n."""
    delassus, work = np.array([[4.0, 1.0], [1.0, 2.0]]), contact_workspace(1)
    modes = np.array([mode])
    free, friction = np.array([-3.0, 1.0]), np.array([0.5])
    unknowns = uncompiled(reduce_problem)(1, delassus, free, friction, modes, work)
    uncompiled(scale_matrix)(unknowns, delassus, work)
    assert unknowns == 1
    assert work.squares[MATRIX, 0, 0] == pytest.approx((4.0 + lean) / 4.0)
    assert work.vectors[OFFSET, 0] == pytest.approx(-1.5)
