"""Sequential quadratic programming for small programs that begin near an optimum.

Every step solves the quadratic program

    minimise ∇fᵀd + ½ dᵀWd    subject to    lower ≤ g + Jd ≤ upper

of the exact Hessian W of the Lagrangian, so that it converges quadratically: from nearby in 3 to 5
steps, where an interior point method takes 7 to 12. Its matrices are dense, of the size of the
unknowns. Equations are eliminated by their null space; what is left is a problem of least distance,
which becomes one of non-negative least squares (C. L. Lawson and R. J. Hanson, *Solving Least
Squares Problems*, 1974, chapter 23).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from heelstrike.robot.model import Floats

MOST_STEPS = 12
"""Steps after which the start was not near enough: from the neighbour of a gait it takes 4 to 6."""
STATIONARY = 1e-9
"""Size of the Lagrangian's gradient, relative to the cost's, that counts as zero."""
SATISFIED = 1e-10
"""Violation of a scaled constraint that counts as zero."""
DEARER_BY_ROUNDING = 1e-8
"""By how much more an optimum may cost than its start with what that breaks, relative to the sizes
of both: costs are rounded."""
NEARLY_DEPENDENT = 1e-10
"""Relative size of a diagonal entry of R from which on constraints depend on each other."""

Derivatives = tuple[Floats, Floats, Floats]


def optimum_near(
    start: Floats, multipliers: Floats, cost: Callable[[Floats], float],
    first: Callable[[Floats], Derivatives], second: Callable[[Floats, Floats], Floats],
    bounds: tuple[Floats, Floats],
) -> tuple[Floats, Floats] | None:  # fmt: skip
    """Find the optimum near a start, if Newton's method leads there.

    Parameters
    ----------
    start : (n,) array
        Unknowns to begin from.
    multipliers : (m,) array
        Nearly the multipliers of the constraints, positive at upper bounds; zeros if unknown.
    cost : callable
        Returns f at unknowns.
    first : callable
        Returns ∇f (n,), the constraints g (m,) and their Jacobian (m, n) at unknowns.
    second : callable
        Returns the Hessian (n, n) of f + λᵀg at unknowns and multipliers.
    bounds : two (m,) arrays
        Lower and upper bounds of the constraints, equal for equations.

    Returns
    -------
    tuple of two arrays, or None
        Unknowns (n,) and multipliers (m,) of a strict local minimum; None if none was reached, or
        one that is worse than the start: steps are not damped, and may lead over a hill. What the
        start breaks counts by the multipliers of the minimum, as in the exact penalty function of
        S.-P. Han, *A Globally Convergent Method for Nonlinear Programming*, 1977.
    """
    unknowns, priced, strict, begun = start, multipliers, False, np.zeros(0)
    lower, upper = bounds
    for step in range(MOST_STEPS + 1):
        slope, value, slopes = first(unknowns)
        if not all(np.isfinite(each).all() for each in (slope, value, slopes)):
            return None
        broken = np.maximum(np.maximum(lower - value, value - upper), 0.0)
        begun = broken if step == 0 else begun
        missed = broken.max(initial=0.0)
        apart = np.where(priced > 0.0, upper - value, value - lower)[priced != 0.0]
        rest = np.abs(slope + slopes.T @ priced).max() / max(1.0, np.abs(slope).max())
        if strict and max(missed, apart.max(initial=0.0)) <= SATISFIED and rest <= STATIONARY:
            before, allowed = cost(start), float(np.abs(priced) @ begun)
            most = before + allowed + DEARER_BY_ROUNDING * (abs(before) + allowed)
            return (unknowns, priced) if cost(unknowns) <= most else None  # None if it is NaN
        if step == MOST_STEPS:
            break
        bend = second(unknowns, priced)
        if not np.isfinite(bend).all():
            return None
        try:
            active = _active(slope, slopes, bend, (lower - value, upper - value))
            moved, priced, strict = _held(slope, slopes, bend, active)
        except (np.linalg.LinAlgError, RuntimeError):  # no minimum, or no such step
            return None
        unknowns = unknowns + moved
    return None


def _active(slope: Floats, slopes: Floats, bend: Floats, room: tuple[Floats, Floats]) -> Floats:
    """Return the change of every constraint that is held, and NaN for those that are not."""
    from scipy.optimize import nnls

    low, high = room
    exact = low == high
    held, free = _spaces(slopes[exact])
    begun = held @ low[exact]
    values, axes = np.linalg.eigh(free.T @ bend @ free)
    least = NEARLY_DEPENDENT * np.abs(values).max(initial=0.0)
    if values.size and not least > 0.0:
        raise np.linalg.LinAlgError("the Lagrangian has no curvature")
    wide = free @ (axes / np.sqrt(np.maximum(np.abs(values), least)))  # so that wideᵀ W wide = 1
    away = wide.T @ (slope + bend @ begun)
    rows = np.flatnonzero(~exact)
    sides = [(rows[np.isfinite(low[rows])], low, 1.0), (rows[np.isfinite(high[rows])], high, -1.0)]
    matrix = np.vstack([sign * slopes[at] @ wide for at, _, sign in sides])
    right = np.concatenate([sign * (ends[at] - slopes[at] @ begun) for at, ends, sign in sides])
    if not len(right):
        return np.where(exact, low, np.nan)
    # Least |u| with matrix u >= right + matrix away.
    right = right + matrix @ away
    scale = 1.0 / np.maximum(np.linalg.norm(matrix, axis=1), np.finfo(float).tiny)
    system = np.vstack([matrix.T * scale, right * scale])
    unit = np.zeros(len(system))
    unit[-1] = 1.0
    prices, _ = nnls(system, unit)
    held_at = np.where(exact, low, np.nan)
    first = len(sides[0][0])
    for (at, ends, _), price in zip(sides, (prices[:first], prices[first:]), strict=True):
        held_at[at[price > 0.0]] = ends[at[price > 0.0]]
    return held_at


def _held(
    slope: Floats, slopes: Floats, bend: Floats, active: Floats
) -> tuple[Floats, Floats, bool]:
    """Step that holds some constraints, their multipliers, and whether it leads to a minimum."""
    chosen = np.isfinite(active)
    rows = slopes[chosen]
    held, free = _spaces(rows)
    moved = held @ active[chosen]
    inner = free.T @ bend @ free
    moved = moved - free @ np.linalg.solve(inner, free.T @ (slope + bend @ moved))
    priced = np.zeros(len(slopes))
    priced[chosen] = -held.T @ (slope + bend @ moved)
    values = np.linalg.eigvalsh(inner)
    strict = values.min(initial=1.0) > NEARLY_DEPENDENT * np.abs(values).max(initial=0.0)
    return moved, priced, bool(strict)


def _spaces(rows: Floats) -> tuple[Floats, Floats]:
    """Right inverse (n, k) of constraints (k, n), and a basis of their null space (n, n - k)."""
    count = len(rows)
    if count > rows.shape[1]:
        raise np.linalg.LinAlgError("more constraints than unknowns")
    basis, factor = np.linalg.qr(rows.T, mode="complete")
    factor = factor[:count]
    size = np.abs(np.diag(factor))
    if count and size.min() < NEARLY_DEPENDENT * size.max():
        raise np.linalg.LinAlgError("constraints depend on each other")
    return basis[:, :count] @ np.linalg.inv(factor).T, basis[:, count:]
