"""The coefficients of the linearly implicit method against the conditions they must meet."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.sim.compliant import rosenbrock as rb


def test_order_conditions_for_any_jacobian() -> None:
    """Third order for a W-method; second for the embedded one (Hairer and Wanner, IV.7)."""
    a, g, b, low = rb.ALPHA, rb.GAMMAS, rb.WEIGHTS, rb.EMBEDDED
    at, gt = a.sum(axis=1), g.sum(axis=1)
    for weights in (b, low):
        assert weights.sum() == pytest.approx(1.0, abs=1e-14)
        assert weights @ at == pytest.approx(0.5, abs=1e-14)
        assert weights @ gt == pytest.approx(0.0, abs=1e-14)
    assert b @ at**2 == pytest.approx(1.0 / 3.0, abs=1e-14)
    assert b @ a @ at == pytest.approx(1.0 / 6.0, abs=1e-14)
    for product in (a @ gt, g @ at, g @ gt):
        assert b @ product == pytest.approx(0.0, abs=1e-14)


def test_stiffly_accurate_and_l_stable() -> None:
    """R(z) = 1 + z bᵀ (1 − z (α + γ))⁻¹ 1 is bounded by 1 on the left and vanishes far out."""
    beta = rb.ALPHA + rb.GAMMAS
    np.testing.assert_allclose(beta[-1], rb.WEIGHTS, atol=1e-15)

    def amplification(z: complex) -> complex:
        return 1.0 + z * (rb.WEIGHTS @ np.linalg.solve(np.eye(rb.STAGES) - z * beta, np.ones(4)))

    assert abs(amplification(-1e8)) < 1e-7
    for y in np.logspace(-3, 6, 200):
        assert abs(amplification(1j * y)) <= 1.0 + 1e-12
