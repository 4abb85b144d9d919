"""Chebyshev series of the joints on [−1, 1]: through functions, and near a motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial.chebyshev import chebmul, chebvander

from heelstrike.robot.model import Floats


def interpolated(function: Callable[[Floats], Floats], degree: int) -> Floats:
    """Coefficients (degree + 1, n) of the polynomial through a function at Chebyshev's points.

    Parameters
    ----------
    function : callable
        Of points (m,) in [−1, 1]; it returns values (m, n).
    degree : int
        Of the polynomial, which is the function if that is one of no higher degree.
    """
    nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    return np.asarray(np.linalg.solve(chebvander(nodes, degree), function(nodes)), np.float64)


def fitted(x: Floats, values: Floats, slopes: Floats, degree: int) -> Floats:
    """Coefficients (degree + 1, n) of least squared error that meet both ends, with their slopes.

    Parameters
    ----------
    x : (m,) float
        Points that rise from −1 to 1.
    values, slopes : (m, n) and (2, n) float
        Values at the points, and derivatives at the ends.
    degree : int
        Three or more.
    """
    middle, half = 0.5 * (values[0] + values[-1]), 0.5 * (values[-1] - values[0])
    # (1 − x²)(a + b x) mends the slopes, 2 (a − b) at −1 and −2 (a + b) at 1, of the line.
    a, b = 0.25 * (slopes[0] - slopes[1]), 0.5 * half - 0.25 * (slopes[0] + slopes[1])
    series = np.zeros((degree + 1, values.shape[1]))
    series[:4] = middle + 0.5 * a, half + 0.25 * b, -0.5 * a, -0.25 * b
    if degree > 3:
        # What is left vanishes at both ends with its slope: (1 − x²)² times a polynomial.
        window = (1.0 - x**2)[:, None] ** 2
        rest = values - chebvander(x, degree) @ series
        inner = np.linalg.lstsq(window * chebvander(x, degree - 4), rest)[0]
        in_series = (0.375, 0.0, -0.5, 0.0, 0.125)
        series += np.stack([chebmul(in_series, one) for one in inner.T], axis=1)
    return series
