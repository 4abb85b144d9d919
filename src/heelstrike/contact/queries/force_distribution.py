"""How the ground shares a load among contact points where mechanics alone does not say."""

from __future__ import annotations

import enum
from collections.abc import Callable

import numpy as np

from heelstrike.contact.workspace import Floats

INFEASIBLE = 1e-9
"""Residual of the dual least-squares problem, of unit right-hand side, below which there is no
point in the cones."""
HIGHEST_USE = 1e6
"""Friction coefficients beyond this are not considered."""
HALVINGS = 60


class ForceDistribution(enum.Enum):
    """Which contact forces to choose of all that have the same effect on the robot.

    ``LEAST_NORM`` minimises the sum of squared forces, inside the friction cones if any forces
    there will do. ``LEAST_FRICTION_USE`` minimises the largest |tangential| / (μ · normal) of any
    contact, and of the forces that reach this minimum takes those of least norm.
    """

    LEAST_NORM = "least_norm"
    LEAST_FRICTION_USE = "least_friction_use"


def distribute(
    effect: Floats, load: Floats, friction: Floats, distribution: ForceDistribution
) -> tuple[Floats, bool]:
    """Choose contact forces λ with ``effect @ λ = load``, as nearly as that can be.

    Parameters
    ----------
    effect : (m, 2k) float
        Generalised forces of unit contact forces n₀ t₀ n₁ t₁ …
    load : (m,) float
        What they have to make up.
    friction : (k,) float
        Coefficients of friction.
    distribution : ForceDistribution
        The choice.

    Returns
    -------
    forces : (k, 2) float
        (normal, tangent). If no forces in the cones will do, those of least norm outside.
    inside : bool
        Whether they are in the cones.

    Notes
    -----
    The least-norm forces under the inequalities are a least-distance problem in the directions
    that have no effect; its dual is a non-negative least-squares problem (C. L. Lawson and R. J.
    Hanson, *Solving Least Squares Problems*, 1974, chapter 23). The least use is found by
    bisection, as forces for one use will do for any greater one.
    """
    count = friction.size
    if count == 0:
        return np.zeros((0, 2)), True
    unit = float(np.abs(load).max(initial=0.0)) or 1.0
    shortest = np.asarray(np.linalg.lstsq(effect, load / unit, rcond=None)[0], np.float64)
    _, values, rows = np.linalg.svd(effect)
    rank = int(np.sum(values > max(effect.shape) * np.finfo(float).eps * values.max(initial=0.0)))
    free = rows[rank:].T

    def in_cones(use: float) -> Floats | None:
        return _least_distance(shortest, free, _edges(use * friction))

    found = in_cones(1.0)
    if distribution is ForceDistribution.LEAST_FRICTION_USE:
        found = _least_use(in_cones, found)
    inside = found is not None and bool(np.all(_edges(friction) @ found >= -INFEASIBLE))
    chosen = shortest if found is None else found
    return unit * chosen.reshape(count, 2), inside


def _edges(friction: Floats) -> Floats:
    """Rows c with c @ λ ≥ 0 inside the cones, of unit length: two edges, and the normal."""
    rows = np.zeros((3 * friction.size, 2 * friction.size))
    for i, mu in enumerate(friction):
        length = np.hypot(1.0, mu)
        rows[3 * i, 2 * i : 2 * i + 2] = mu / length, 1.0 / length
        rows[3 * i + 1, 2 * i : 2 * i + 2] = mu / length, -1.0 / length
        rows[3 * i + 2, 2 * i] = 1.0
    return rows


def _least_distance(shortest: Floats, free: Floats, edges: Floats) -> Floats | None:
    """Point of least norm of ``shortest + free @ z`` with all edges ≥ 0, or None."""
    from scipy.optimize import nnls  # takes half a second to import

    slack = edges @ shortest
    if np.all(slack >= -1e-14 * np.abs(shortest).max(initial=0.0)):
        return shortest
    if not free.size:
        return None
    dual = np.vstack([(edges @ free).T, -slack])
    target = np.zeros(dual.shape[0])
    target[-1] = 1.0
    weights, distance = nnls(dual, target)
    if distance < INFEASIBLE:
        return None
    residual = dual @ weights - target
    point: Floats = shortest - free @ (residual[:-1] / residual[-1])
    return point


def _least_use(in_cones: Callable[[float], Floats | None], found: Floats | None) -> Floats | None:
    """Forces that use friction least, by bisection on the share of the cones."""
    high = 1.0
    while found is None and high < HIGHEST_USE:
        high *= 4.0
        found = in_cones(high)
    if found is None:
        return None
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        closer = in_cones(middle)
        if closer is None:
            low = middle
        else:
            high, found = middle, closer
    return found
