"""The judge of contact solves: the contact laws in exact arithmetic, and all solutions by force.

Nothing here is shared with the solvers or their certificates.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Floats = NDArray[np.float64]

OPEN, STICK, FORWARD, BACKWARD = range(4)


def exact_velocity(delassus: Floats, free: Floats, impulse: Floats) -> Floats:
    """``G impulse + free`` in whole numbers, without any rounding but that of the result."""
    matrix, matrix_shift = _whole(delassus)
    vector, vector_shift = _whole(impulse)
    offset, offset_shift = _whole(free)
    shift = max(matrix_shift + vector_shift, offset_shift, 0)
    total = [
        (
            sum(a * x for a, x in zip(row, vector, strict=True))
            << (shift - matrix_shift - vector_shift)
        )
        + (b << (shift - offset_shift))
        for row, b in zip(matrix, offset, strict=True)
    ]
    return np.array([entry / (1 << shift) for entry in total])


def _whole(values: Floats) -> tuple[Any, int]:
    """Write numbers as whole ones over a power of two; return them and the exponent."""
    mantissa, exponent = np.frexp(values)
    present = exponent[mantissa != 0.0]
    shift = 53 - int(present.min()) if present.size else 0

    def convert(m: Any, e: Any) -> Any:
        if np.ndim(m):
            return [convert(*pair) for pair in zip(m, e, strict=True)]
        return int(m * 2.0**53) << (int(e) - 53 + shift) if m else 0

    return convert(mantissa, exponent), shift


def size_of_data(delassus: Floats, free: Floats) -> float:
    """Largest free velocity, each over the root of its diagonal entry."""
    root = np.sqrt(np.diag(delassus))
    moved = root > 0.0
    return float(np.max(np.abs(free[moved]) / root[moved], initial=0.0))


def effort(delassus: Floats, free: Floats, impulse: Floats) -> float:
    """Largest sum of |G_ij lambda_j| of a row, in units of the data's velocities."""
    unit = np.sqrt(np.diag(delassus)) * size_of_data(delassus, free)
    cancelled = np.abs(delassus) @ np.abs(impulse)
    return float(np.max(cancelled[unit > 0.0] / unit[unit > 0.0], initial=0.0))


def residual(delassus: Floats, free: Floats, friction: Floats, impulse: Floats) -> float:
    """Largest relative violation of the contact laws, written down a second time and plainly.

    Velocities and cones are exact, and everything is set against the size of the data.
    """
    if not all(np.all(np.isfinite(values)) for values in (delassus, free, friction, impulse)):
        return np.inf
    velocity = exact_velocity(delassus, free, impulse)
    beta = size_of_data(delassus, free)
    root = np.sqrt(np.diag(delassus))

    def relative(speed: float, row: int) -> float:
        if speed == 0.0:
            return 0.0
        return float(speed / (root[row] * beta)) if root[row] * beta > 0.0 else np.inf * speed

    worst = 0.0
    for k, mu in enumerate(friction):
        n, t = 2 * k, 2 * k + 1
        wn, wt = relative(velocity[n], n), relative(velocity[t], t)
        ln, lt = impulse[n], impulse[t]
        if root[n] > 0.0:
            unit = root[n] / beta if beta > 0.0 else np.inf
            force = ln * unit if ln else 0.0
        else:
            unit, force = 0.0, np.sign(ln)
        worst = max(worst, -wn, -force, min(wn, force))
        if root[t] > 0.0:
            unit = root[t] / beta if beta > 0.0 else np.inf
        elif mu > 0.0 and unit > 0.0:
            unit /= mu
        else:
            size = mu * abs(ln) + abs(lt)
            unit = 1.0 / size if size > 0 else 0.0
        limit = Fraction(float(mu)) * Fraction(float(ln))
        excess = float(abs(Fraction(float(lt))) - limit)
        worst = max(worst, excess * unit if excess > 0.0 else 0.0)
        lacking = float(limit + Fraction(float(lt) if wt > 0 else -float(lt)))
        worst = max(worst, min(abs(wt), lacking * unit) if lacking > 0.0 and wt else 0.0)
    return float(worst)


def solutions(
    delassus: Floats, free: Floats, friction: Floats, bound: Floats | None = None
) -> list[Floats]:
    """All velocities that solve the problem, one for each that differs from the others."""
    found: list[Floats] = []
    unit = np.abs(free).max() or 1.0
    for impulse in enumerated(delassus, free, friction, bound):
        velocity = delassus @ impulse + free
        if not any(np.allclose(velocity, other, atol=1e-7 * unit) for other in found):
            found.append(velocity)
    return found


def enumerated(
    delassus: Floats, free: Floats, friction: Floats, bound: Floats | None = None
) -> Iterator[Floats]:
    """Impulses that solve the problem, by force: one for each combination of modes that has some.

    Where `bound` (nc,) is positive, the tangential impulse is in the interval up to it, and there
    is no normal one.

    Every combination is a linear program, feasible to 1e-10 of the data's velocities. The equations
    among its conditions are then met by least squares as sharply as they can be.
    """
    count = friction.size
    diagonal = np.diag(delassus)
    scale = np.where(diagonal > 0, 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 1.0)
    G = scale[:, None] * delassus * scale
    size = np.abs(scale * free).max() or 1.0
    b = scale * free / size
    width = np.zeros(count) if bound is None else np.asarray(bound)
    for modes in itertools.product(*(range(STICK if w > 0.0 else OPEN, 4) for w in width)):
        equal, inequal, offset_equal, offset_inequal = [], [], [], []

        def demand(row: Floats, offset: float, rows: list, offsets: list) -> None:
            rows.append(row)
            offsets.append(-offset)

        for k, mode in enumerate(modes):
            n, t = 2 * k, 2 * k + 1
            en, et = np.eye(2 * count)[n] * scale[n], np.eye(2 * count)[t] * scale[t]
            if width[k] > 0.0:
                side = {STICK: 0.0, FORWARD: 1.0, BACKWARD: -1.0}[mode]
                limit = width[k] / size
                demand(en, 0.0, equal, offset_equal)
                if mode == STICK:
                    demand(G[t], b[t], equal, offset_equal)
                    demand(et, -limit, inequal, offset_inequal)
                    demand(-et, -limit, inequal, offset_inequal)
                else:
                    demand(et, side * limit, equal, offset_equal)
                    demand(-side * G[t], -side * b[t], inequal, offset_inequal)
                continue
            if mode == OPEN:
                demand(en, 0.0, equal, offset_equal)
                demand(et, 0.0, equal, offset_equal)
                demand(-G[n], -b[n], inequal, offset_inequal)
                continue
            demand(G[n], b[n], equal, offset_equal)
            demand(-en, 0.0, inequal, offset_inequal)
            if mode == STICK:
                demand(G[t], b[t], equal, offset_equal)
                demand(et - friction[k] * en, 0.0, inequal, offset_inequal)
                demand(-et - friction[k] * en, 0.0, inequal, offset_inequal)
            else:
                side = 1.0 if mode == FORWARD else -1.0
                demand(et + side * friction[k] * en, 0.0, equal, offset_equal)
                demand(-side * G[t], -side * b[t], inequal, offset_inequal)
        result = linprog(
            np.zeros(2 * count),
            A_ub=np.array(inequal) if inequal else None,
            b_ub=np.array(offset_inequal) if inequal else None,
            A_eq=np.array(equal),
            b_eq=np.array(offset_equal),
            bounds=(None, None),
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10},
        )
        if result.status == 0:
            equations, right = np.array(equal), np.array(offset_equal)
            rest = np.linalg.lstsq(equations, right - equations @ result.x)[0]
            yield scale * (result.x + rest) * size
