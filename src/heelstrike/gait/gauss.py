"""Collocation of second-order equations at Gauss points.

On every interval the accelerations at the Gauss points make a polynomial, and positions and
velocities are its integrals. With s points the positions at the ends of the intervals are accurate
to order 2s (U. M. Ascher, R. M. M. Mattheij and R. D. Russell, *Numerical Solution of Boundary
Value Problems for Ordinary Differential Equations*, 1995, section 5.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class GaussScheme:
    """Collocation on the unit interval.

    Attributes
    ----------
    nodes, weights : (s,) float
        Gauss points and quadrature weights on [0, 1].
    velocity, position : (s + 1, s) float
        Change of velocity and position from the beginning of the interval to every Gauss point,
        and to its end in the last row, per unit acceleration at each Gauss point.
    powers : (s, s) float
        Coefficients, lowest first, of the polynomials that are 1 at one Gauss point and 0 at the
        others; one row a point.
    """

    nodes: Floats
    weights: Floats
    velocity: Floats
    position: Floats
    powers: Floats


def gauss_scheme(points: int) -> GaussScheme:
    """Make the scheme with a number of Gauss points."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    powers = np.asarray(np.linalg.inv(np.vander(nodes, increasing=True)).T, np.float64)
    at = np.append(nodes, 1.0)
    cardinal = [Polynomial(row) for row in powers]
    velocity = np.column_stack([p.integ()(at) for p in cardinal])
    position = np.column_stack([p.integ(2)(at) for p in cardinal])
    return GaussScheme(nodes, weights, velocity, position, powers)
