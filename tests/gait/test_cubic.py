"""Cubic polynomials through given ends (paper eq. 41-43)."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.gait import cubic

ENDS = np.random.default_rng(3).normal(size=(4, 6))
DURATION = 0.7


@pytest.fixture
def coefficients() -> tuple[np.ndarray, ...]:
    return cubic.coefficients(*ENDS, DURATION)


def test_ends_are_met(coefficients: tuple[np.ndarray, ...]) -> None:
    start, end, start_velocity, end_velocity = ENDS
    np.testing.assert_allclose(cubic.position(coefficients, 0.0), start, atol=1e-15)
    np.testing.assert_allclose(cubic.position(coefficients, DURATION), end, atol=1e-14)
    np.testing.assert_allclose(cubic.velocity(coefficients, 0.0), start_velocity, atol=1e-15)
    np.testing.assert_allclose(cubic.velocity(coefficients, DURATION), end_velocity, atol=1e-14)


def test_coefficients_are_those_of_the_papers_matrix(
    coefficients: tuple[np.ndarray, ...],
) -> None:
    T = DURATION
    printed = np.array(
        [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [-3.0 / T**2, 3.0 / T**2, -2.0 / T, -1.0 / T],
            [2.0 / T**3, -2.0 / T**3, 1.0 / T**2, 1.0 / T**2],
        ]
    )
    np.testing.assert_allclose(np.stack(coefficients), printed @ ENDS, rtol=1e-13, atol=1e-13)


def test_derivatives_are_those_of_the_polynomial(coefficients: tuple[np.ndarray, ...]) -> None:
    # A complex step has no difference to lose digits in.
    for t in (0.0, 0.123, 0.7, 1.9):
        shifted = t + 1e-30j
        np.testing.assert_allclose(
            cubic.velocity(coefficients, t), cubic.position(coefficients, shifted).imag / 1e-30
        )
        np.testing.assert_allclose(
            cubic.acceleration(coefficients, t), cubic.velocity(coefficients, shifted).imag / 1e-30
        )


def test_straight_motion_has_no_acceleration() -> None:
    slope = np.array([0.3, -2.0])
    line = cubic.coefficients(np.zeros(2), slope * DURATION, slope, slope, DURATION)
    np.testing.assert_allclose(cubic.acceleration(line, 0.31), 0.0, atol=1e-14)
    np.testing.assert_allclose(cubic.position(line, 0.31), slope * 0.31, atol=1e-15)
