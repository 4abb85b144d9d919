"""The judge of contact solves in space: the natural map with sixty digits.

Nothing here is shared with the solvers or their certificates. Data and impulse are taken as the
binary numbers that they are; sums of products are exact.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DIGITS = 60


def decimal_of(value: Fraction) -> Decimal:
    return Decimal(value.numerator) / Decimal(value.denominator)


def root_of(values: list[Decimal]) -> Decimal:
    return sum((value * value for value in values), Decimal(0)).sqrt()


def exact_velocities(delassus: Floats, free: Floats, impulse: Floats) -> list[Fraction]:
    """``W impulse + free`` without any rounding: all numbers as whole ones over a power of two."""

    def whole(values: Any) -> tuple[list[int], int]:
        flat = np.ravel(values)
        _, exponents = np.frexp(flat[flat != 0.0])
        shift = 53 - int(exponents.min()) if exponents.size else 0
        numbers = []
        for each in flat:
            top, bottom = float(each).as_integer_ratio()
            scaled = (top << shift) if shift >= 0 else (top >> -shift)
            assert scaled % bottom == 0
            numbers.append(scaled // bottom)
        return numbers, shift

    size = free.size
    matrix, first = whole(delassus)
    vector, second = whole(impulse)
    offset, third = whole(free)
    found = []
    for i in range(size):
        total = sum(matrix[i * size + j] * vector[j] for j in range(size) if vector[j])
        found.append(
            Fraction(total, 1) / Fraction(2) ** (first + second)
            + Fraction(offset[i], 1) / Fraction(2) ** third
        )
    return found


def natural_map(delassus: Floats, free: Floats, friction: Floats, impulse: Floats) -> float:
    """Largest ``|λ - P_K(λ - u - μ |u_t| n)|`` of a contact, each in units of the data."""
    if not all(np.all(np.isfinite(values)) for values in (delassus, free, friction, impulse)):
        return np.inf
    velocity = exact_velocities(delassus, free, impulse)
    with localcontext() as context:
        context.prec = DIGITS
        counts = range(friction.size)
        largest = [max(delassus[3 * k + i, 3 * k + i] for i in range(3)) for k in counts]
        weights = [1 / Decimal(float(each)).sqrt() if each > 0 else Decimal(0) for each in largest]
        counted = [Decimal(float(each)) for each in free]
        for k in counts:  # what opens counts a hundredth
            counted[3 * k] = max(-counted[3 * k], counted[3 * k] / 100)
        beta = max(abs(counted[3 * k + i]) * weights[k] for k in counts for i in range(3))
        worst = Decimal(0)
        for k in counts:
            mu = Decimal(float(friction[k]))
            forces = beta * weights[k]
            if forces == 0:
                assert not np.any(impulse[3 * k : 3 * k + 3])
                continue
            lam = [Decimal(float(impulse[3 * k + i])) / forces for i in range(3)]
            u = [decimal_of(velocity[3 * k + i]) * weights[k] / beta for i in range(3)]
            u[0] += mu * root_of(u[1:])
            point = [a - b for a, b in zip(lam, u, strict=True)]
            across = root_of(point[1:])
            if mu * across <= -point[0]:
                nearest = [Decimal(0)] * 3
            elif across <= mu * point[0]:
                nearest = point
            else:
                normal = (point[0] + mu * across) / (1 + mu * mu)
                nearest = [normal, *(mu * normal * each / across for each in point[1:])]
            worst = max(worst, root_of([a - b for a, b in zip(lam, nearest, strict=True)]))
        return float(worst)
