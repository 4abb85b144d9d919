"""Piecewise polynomials (paper eq. 41-43), and the instants at which a program looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.polynomial import Legendre, Polynomial, legendre
from numpy.polynomial.polynomial import polyder, polyval, polyvander

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers


def cubic(positions: Sequence[Floats], velocities: Sequence[Floats], duration: float) -> Floats:
    """Coefficients a0 … a3 of the cubics with given ends (paper eq. 43).

    Parameters
    ----------
    positions, velocities : two (n,) arrays
        Positions and velocities at t = 0 and t = `duration`.
    duration : float
        Length T of the interval, in s.

    Returns
    -------
    (4, n) array
        Coefficients, lowest first.
    """
    (start, end), (before, after) = positions, velocities
    slope = (end - start) / duration
    bend = (3.0 * slope - 2.0 * before - after) / duration
    return np.stack([start, before, bend, (before + after - 2.0 * slope) / duration**2])


@cache
def shape_functions(degree: int) -> Floats:
    """Coefficients, lowest first, of the functions that make up a piece on [0, 1], by columns.

    The first two go with the position and the velocity at the beginning. The others are Legendre
    polynomials integrated twice: they go with parts of the acceleration, so that no digits are
    lost between positions that are close to each other.

    Returns
    -------
    (degree + 1, degree + 1) array
    """
    matrix = np.eye(degree + 1)
    for order in range(degree - 1):
        part = Legendre.basis(order, domain=[0, 1]).convert(kind=Polynomial).integ(2)
        matrix[: part.coef.size, order + 2] = part.coef
    return matrix


def coefficients(values: Floats, duration: float) -> Floats:
    """Coefficients of pieces in the time since the beginning of each.

    Parameters
    ----------
    values : (..., d + 1, n) array
        Position and velocity at the beginning, and the parts of the acceleration, of n coordinates.
    duration : float
        Duration of a piece, in s.

    Returns
    -------
    (..., d + 1, n) array
        Coefficients, lowest first.
    """
    order = np.arange(values.shape[-2])[:, None]
    scaled = duration ** np.minimum(order, 2) * values
    result: Floats = (shape_functions(order.size - 1) @ scaled) / duration**order
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
    terms = np.moveaxis(polyder(pieces, order, axis=1), 1, 0)
    return np.asarray(polyval(local, terms[:, piece], tensor=False), np.float64)


@kernel
def place_in_step(time: float, latest: float, breakpoints: Floats) -> tuple[int, float, float]:
    """Where a law that follows pieces is in them: the piece, the time since its beginning, and 1.

    Or, beyond a latest time, where it stops, 0: nothing moves any more.
    """
    reached = latest if time > latest else time
    piece = 0
    while piece < breakpoints.shape[0] - 2 and reached >= breakpoints[piece + 1]:
        piece += 1
    return piece, reached - breakpoints[piece], 0.0 if time > latest else 1.0


@dissolved_kernel
def motion_in_piece(
    terms: Floats, joint: int, inside: float, moves: float
) -> tuple[float, float, float]:
    """Position, velocity and acceleration of a joint in a piece (terms, joints), lowest first.

    The latter two count `moves` times.
    """
    position, velocity, acceleration = 0.0, 0.0, 0.0
    for k in range(terms.shape[0] - 1, -1, -1):
        acceleration = acceleration * inside + 2.0 * velocity
        velocity = velocity * inside + position
        position = position * inside + terms[k, joint]
    return position, moves * velocity, moves * acceleration


@dataclass(frozen=True)
class Instants:
    """Instants of a step on a mesh of equal pieces."""

    pieces: int
    """Number of pieces."""
    piece: Integers
    """(N,) Piece in which an instant lies: at a joint of two, that whose end is meant."""
    share: Floats
    """(N,) Where in that piece, from 0 to 1."""
    weight: Floats
    """(N,) Quadrature weights for a step of duration 1; zero for instants at which constraints
    hold."""

    @classmethod
    def in_every_piece(cls, pieces: int, share: Floats, weight: Floats | None = None) -> Instants:
        """Return instants that are the same shares of each piece, whose weights there are given."""
        weights = np.zeros(share.size) if weight is None else weight / pieces
        places = np.repeat(np.arange(pieces), share.size)
        return cls(pieces, places, np.tile(share, pieces), np.tile(weights, pieces))

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

    def after(self, others: Instants) -> Instants | None:
        """Return those that were joined to others; None if these do not begin with the others."""
        count = others.share.size
        for name in ("piece", "share", "weight"):
            if not np.array_equal(getattr(self, name)[:count], getattr(others, name)):
                return None
        return Instants(self.pieces, self.piece[count:], self.share[count:], self.weight[count:])

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
