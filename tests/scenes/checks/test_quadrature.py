"""Integrals over rows: exact for polynomials, and their doubt tells when they are not."""

from __future__ import annotations

import numpy as np
import pytest
from scenes.checks.quadrature import NODES, integrate_piece


def test_polynomials_are_integrated_exactly_beyond_the_last_row() -> None:
    time = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, size=12))
    edges = np.concatenate(([-0.05], time[2:9], [1.1]))
    powers = np.polynomial.Polynomial(np.linspace(1.0, -2.0, NODES))
    got, doubt = integrate_piece(time, powers(time), edges)
    whole = powers.integ()
    np.testing.assert_allclose(got, whole(edges[1:]) - whole(edges[:-1]), atol=1e-8)
    assert np.all(doubt > 0.0)


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_few_rows_are_in_doubt(rows: int) -> None:
    time = np.linspace(0.0, 0.1, 3)[:rows]
    got, doubt = integrate_piece(time, np.exp(time), np.array([0.0, 0.2]))
    error = abs(got[0] - (np.exp(0.2) - 1.0))
    assert error < 0.15
    assert doubt[0] > 0.3 * error
