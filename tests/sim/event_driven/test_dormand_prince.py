"""The coefficients of the method of order 8 against the conditions that they must meet."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853
from single_steps import exact, one_step, swinging

from heelstrike.compiler.compilation import uncompiled
from heelstrike.sim.event_driven import dormand_prince as dp

error_norm = uncompiled(dp.error_norm)
interpolate = uncompiled(dp.interpolate)


def test_coefficients_are_those_of_scipy() -> None:
    """To the last bit."""
    np.testing.assert_array_equal(dp.NODES, [*DOP853.C, 1.0, *DOP853.C_EXTRA])
    np.testing.assert_array_equal(dp.WEIGHTS[: dp.STAGES, : dp.STAGES], DOP853.A)
    np.testing.assert_array_equal(dp.WEIGHTS[dp.STAGES, : dp.STAGES], DOP853.B)
    np.testing.assert_array_equal(dp.WEIGHTS[dp.STAGES + 1 :], DOP853.A_EXTRA)
    np.testing.assert_array_equal(dp.ERROR[:, : dp.STAGES + 1], [DOP853.E5, DOP853.E3])
    np.testing.assert_array_equal(dp.DENSE, DOP853.D)


def test_every_stage_is_at_its_node() -> None:
    """Time itself, y' = 1, is right in every stage; so is t²/2 in all but the second."""
    weights, nodes = dp.WEIGHTS, dp.NODES
    np.testing.assert_allclose(weights.sum(axis=1), nodes, atol=1e-13)
    rows = np.arange(len(nodes)) != 1
    np.testing.assert_allclose((weights @ nodes)[rows], 0.5 * nodes[rows] ** 2, atol=1e-13)
    np.testing.assert_array_equal(np.triu(weights), 0.0)  # explicit


@pytest.mark.parametrize(
    ("weights", "order"),
    [(dp.WEIGHTS[dp.STAGES], 8), (dp.ERROR[0], 5), (dp.ERROR[1], 3)],
    ids=["result", "fifth", "third"],
)
def test_quadrature(weights: np.ndarray, order: int) -> None:
    """Σ b cᵏ = 1/(k + 1) below the order; differences of two rules vanish to the lower order."""
    for power in range(order):
        exact = 1.0 / (power + 1) if order == 8 else 0.0
        assert weights @ dp.NODES**power == pytest.approx(exact, abs=1e-12)
    if order < 8:
        assert abs(weights @ dp.NODES**order) > 1e-6


def errors(h: float) -> tuple[float, float]:
    """Errors of one step of length h, at its end and within it."""
    begin = exact(0.0)
    _, end, dense = one_step(swinging, begin, h)
    inside, point = 0.0, np.zeros(4)
    for part in (0.15, 0.4, 0.65, 0.9):
        interpolate(part, begin, dense, point)
        inside = max(inside, float(np.abs(point - exact(part * h)).max()))
    return float(np.abs(end - exact(h)).max()), inside


def test_order_of_the_step_and_of_what_is_within() -> None:
    """Errors of one step fall with h⁹ at its end and, for short steps, with h⁸ within."""
    at = {h: errors(h) for h in (0.8, 0.4, 0.2, 0.1)}
    assert np.log2(at[0.8][0] / at[0.4][0]) >= 8.5
    assert np.log2(at[0.2][1] / at[0.1][1]) >= 7.3
    assert at[0.4][0] < 2e-8
    assert at[0.4][1] < 1e-6


def test_dense_output_begins_and_ends_where_the_step_does() -> None:
    begin = exact(0.0)
    _, end, dense = one_step(swinging, begin, 0.3)
    point = np.zeros(4)
    for part, there in ((0.0, begin), (1.0, end)):
        interpolate(part, begin, dense, point)
        np.testing.assert_allclose(point, there, atol=1e-14)


def test_estimate_of_the_error() -> None:
    """As DOP853 has it: h e₅² / √((e₅² + e₃²/100) n), with errors over their tolerances."""
    begin = exact(0.0)
    h, relative, absolute = 0.4, 1e-6, 1e-8
    slopes, end, _ = one_step(swinging, begin, h)
    scale = absolute + relative * np.maximum(np.abs(begin), np.abs(end))
    five, three = ((row[: dp.STAGES + 1] @ slopes[: dp.STAGES + 1]) / scale for row in dp.ERROR)
    expected = h * (five @ five) / np.sqrt((five @ five + 0.01 * three @ three) * 4)
    found = error_norm(h, begin, end, slopes, relative, absolute)
    # The errors are small differences of large slopes.
    assert found == pytest.approx(expected, rel=1e-9)
    assert error_norm(-h, begin, end, slopes, relative, absolute) == found
    assert error_norm(h, begin, end, np.zeros_like(slopes), relative, absolute) == 0.0
