"""Piecewise polynomials, each fixed by the positions and velocities at its ends (paper eq. 41-43).

A piece of degree three is fixed by its ends alone. Of a higher degree, the rest is free: multiples
of functions that vanish with their slopes at both ends, so that pieces always join smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import Legendre, Polynomial, legendre
from numpy.polynomial.polynomial import polyder, polyvander
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@cache
def shape_functions(degree: int) -> Floats:
    """Coefficients, lowest first, of the functions that make up a piece on [0, 1], by columns.

    The first four go with the position and velocity at the beginning and with those at the end
    (eq. 43 with T = 1). The others are (u (1 - u))² times a Legendre polynomial.

    Returns
    -------
    (degree + 1, degree + 1) array
    """
    columns = [[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]]
    functions = [Polynomial(column) for column in columns]
    for order in range(degree - 3):
        factor = Legendre.basis(order, domain=[0, 1]).convert(kind=Polynomial)
        functions.append(Polynomial([0, 1, -1]) ** 2 * factor)
    matrix = np.zeros((degree + 1, degree + 1))
    for k, function in enumerate(functions):
        matrix[: len(function.coef), k] = function.coef
    return matrix


def coefficients(values: Floats, duration: float) -> Floats:
    """Coefficients of pieces in the time since the beginning of each (paper eq. 43).

    Parameters
    ----------
    values : (..., d + 1, n) array
        Position and velocity at the beginning, position and velocity at the end, and the multiples
        of the remaining shape functions, as accelerations, of n coordinates.
    duration : float
        Duration of a piece, in s.

    Returns
    -------
    (..., d + 1, n) array
        Coefficients, lowest first.
    """
    size = values.shape[-2]
    scale = np.ones((size, 1))
    scale[[1, 3]], scale[4:] = duration, duration**2
    powers = duration ** np.arange(size)[:, None]
    result: Floats = (shape_functions(size - 1) @ (scale * values)) / powers
    return result


def evaluated(pieces: Floats, breakpoints: Floats, t: Floats, order: int) -> Floats:
    """Value, or a derivative, of piecewise polynomials at times of any shape, (..., n).

    Beyond either end the piece there goes on.

    Parameters
    ----------
    pieces : (K, d + 1, n) array
        Coefficients, lowest first, in the time since the beginning of each piece.
    breakpoints : (K + 1,) array
        Times between which one piece holds.
    t : array
        Times.
    order : int
        Order of the derivative.
    """
    piece = np.searchsorted(breakpoints, t, side="right") - 1
    piece = np.clip(piece, 0, len(pieces) - 1)
    local = (t - breakpoints[piece])[..., None]
    value: Floats = np.zeros((1,))
    for coefficient in np.moveaxis(polyder(pieces, order, axis=1), 1, 0)[::-1]:
        value = value * local + coefficient[piece]
    return value


@dataclass(frozen=True)
class Instants:
    """Instants of a step on a mesh of equal pieces.

    Attributes
    ----------
    pieces : int
        Number of pieces.
    piece : (N,) int
        Piece in which an instant lies: at a joint of two, that whose end is meant.
    share : (N,) float
        Where in that piece, from 0 to 1.
    weight : (N,) float
        Quadrature weights for a step of duration 1; zero for instants at which constraints hold.
    """

    pieces: int
    piece: Integers
    share: Floats
    weight: Floats

    @property
    def phases(self) -> Floats:
        """Share of the step that has gone by, (N,)."""
        phases: Floats = (self.piece + self.share) / self.pieces
        return phases

    def joined(self, others: Instants) -> Instants:
        """Return these instants and others."""
        names = ("piece", "share", "weight")
        parts = (np.concatenate([getattr(self, n), getattr(others, n)]) for n in names)
        return Instants(self.pieces, *parts)

    def matrix(self, degree: int, order: int) -> Floats:
        """Derivatives of all shape functions of all pieces, ((degree + 1) pieces, N).

        In units of the duration of a piece; the pieces of the first shape function come first.
        """
        shapes = polyder(shape_functions(degree), order)
        values = polyvander(self.share, degree - order) @ shapes
        matrix = np.zeros((degree + 1, self.pieces, self.share.size))
        matrix[:, self.piece, np.arange(self.share.size)] = values.T
        return matrix.reshape(-1, self.share.size)


def lobatto(intervals: int) -> tuple[Floats, Floats]:
    """Nodes on [0, 1], ends included, and weights of Gauss-Lobatto quadrature.

    The rule is exact for polynomials of degree ``2 * intervals - 1``, and its nodes are densest at
    the ends of the step, where the clearance of the swing foot is decided.
    """
    last = np.zeros(intervals + 1)
    last[-1] = 1.0
    inner = np.sort(legendre.Legendre(last).deriv().roots().real)
    inner = 0.5 * (inner - inner[::-1])  # symmetric to the last digit
    nodes = np.concatenate([[-1.0], inner, [1.0]])
    weights = 2.0 / (intervals * (intervals + 1) * legendre.legval(nodes, last) ** 2)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def gauss(points: int) -> tuple[Floats, Floats]:
    """Nodes on [0, 1] and weights of Gauss quadrature, exact to degree ``2 * points - 1``."""
    nodes, weights = legendre.leggauss(points)
    return 0.5 * (nodes + 1.0), 0.5 * weights
