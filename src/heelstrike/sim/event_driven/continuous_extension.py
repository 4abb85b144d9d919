"""Places within a step that are nearly as exact as its end: for the rows of the record.

The dense output of a step is of order 7, its end of order 8. Slopes at places on the dense output
are wrong by O(h⁸), and so what they add to an integral over the step h by O(h⁹): the polynomial of
degree 8 that has both ends, the slopes there, and the slopes at five places between them, is as
exact as the end. (Bootstrapping: Enright, Jackson, Nørsett, Thomsen, ACM Trans. Math. Software 12
(1986) 193-218.) Where the dense output is far off, slopes on that polynomial make a better one.

Let u(θ) be the dense output, which has both ends and their slopes, and δ_j = f(u(c_j)) - u'(c_j)/h
its defects. Let ℓ_j be the Lagrange polynomials of all seven nodes, the ends among them, and N the
product of all θ - c_j. The polynomial is

    y(θ) = u(θ) + h Σ s_j(θ) δ_j,    s_j(θ) = ∫ ℓ_j - W(θ) ∫₀¹ ℓ_j,    W(θ) = ∫ N / ∫₀¹ N

with integrals from 0 on: that of what goes through the defects, and the one multiple of N that ends
at zero. It takes nodes for which ∫₀¹ N is not zero: those of no symmetric rule.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.sim.event_driven.dormand_prince import DENSE_ROWS, interpolate

Floats = NDArray[np.float64]

PLACES: Floats = np.array([1 / 16, 1 / 5, 2 / 5, 3 / 5, 4 / 5])
"""Where in a step slopes are evaluated: about Lobatto's nodes, less the last of these."""

BETWEEN = len(PLACES)
NODES: Floats = np.array([0.0, *PLACES, 1.0])
DEGREE = len(NODES) + 1


def _shares() -> Floats:
    """Coefficients of θ, θ², …, θ⁸ in what each defect adds."""
    nodal = Polynomial.fromroots(NODES).integ()
    shares = np.zeros((BETWEEN, DEGREE))
    for j in range(BETWEEN):
        others = Polynomial.fromroots(np.delete(NODES, j + 1))
        integral = (others / others(PLACES[j])).integ()
        shares[j] = (integral - nodal * (integral(1.0) / nodal(1.0))).coef[1:]
    return shares


def _dense_slopes() -> Floats:
    """How fast each row of the dense output changes at the places, over the step."""
    part, product, slopes = Polynomial([0.0, 1.0]), Polynomial([1.0]), []
    for k in range(DENSE_ROWS):
        product = product * (part if k % 2 == 0 else 1.0 - part)
        slopes.append(product.deriv()(PLACES))
    return np.array(slopes)


SHARES: Floats = _shares()
DENSE_SLOPES: Floats = _dense_slopes()


class Extension(Bundle):
    """What makes the dense output of a step more exact."""

    state: Floats = array(BETWEEN, "2 nv")
    slope: Floats = array(BETWEEN, "2 nv")
    """state, slope: States (q, v) at the places within the step, and the slopes there."""
    correction: Floats = array(DEGREE, "2 nv")
    """Coefficients of θ, θ², … in what is added to the dense output."""
    point: Floats = array("2 nv")
    """A place as it is corrected; scratch."""


@kernel
def fit_correction(step: float, dense: Floats, slope: Floats, correction: Floats) -> None:
    """Turn the slopes at the places into what the dense output lacks."""
    for i in range(dense.shape[1]):
        for k in range(DEGREE):
            correction[k, i] = 0.0
        for j in range(BETWEEN):
            defect = step * slope[j, i]
            for row in range(DENSE_ROWS):
                defect -= DENSE_SLOPES[row, j] * dense[row, i]
            for k in range(DEGREE):
                correction[k, i] += SHARES[j, k] * defect


@kernel
def interpolate_corrected(
    part: float, begin: Floats, dense: Floats, correction: Floats, point: Floats
) -> None:
    """State at the fraction `part` of a step."""
    interpolate(part, begin, dense, point)
    for i in range(begin.shape[0]):
        value = 0.0
        for k in range(DEGREE - 1, -1, -1):
            value = (value + correction[k, i]) * part
        point[i] += value


@kernel
def move_places(
    begin: Floats, end: Floats, dense: Floats, relative: float, absolute: float,
    extension: Extension,
) -> float:  # fmt: skip
    """Move the places as they are corrected; return how far at most, in tolerances of the step."""
    point, farthest = extension.point, 0.0
    for j in range(BETWEEN):
        interpolate_corrected(PLACES[j], begin, dense, extension.correction, point)
        for i in range(begin.shape[0]):
            scale = absolute + relative * max(abs(begin[i]), abs(end[i]))
            moved = abs(point[i] - extension.state[j, i]) / scale
            if not moved <= farthest:  # nor what is no number
                farthest = moved
            extension.state[j, i] = point[i]
    return farthest
