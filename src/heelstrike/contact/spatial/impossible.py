"""Proofs that a contact problem has no solution.

All contacts must end without penetrating, ``(W λ + b)_n ≥ 0``, by impulses that push. Weights y ≥ 0
of the normal rows with ``W y = 0`` and ``y·b < 0`` show that no impulse whatever does that: for any
λ, ``y·(W λ + b) = y·b < 0`` (Farkas). Two walls that close on a body are such a case.
"""

from __future__ import annotations

import numpy as np

from heelstrike.contact.spatial.workspace import Floats

WITHOUT_EFFECT = 1e-12
"""Velocity, per unit of weights and of the matrix's size, that counts as none."""

CLOSING = 1e-6
"""Part of the data's velocities by which the weighted contacts must close."""


def proof_of_none(delassus: Floats, free: Floats) -> Floats | None:
    """Return weights of the contacts that prove that none of their impulses helps.

    Parameters
    ----------
    delassus : (nc * 3, nc * 3) float
        Delassus matrix, symmetric and positive semidefinite.
    free : (nc * 3,) float
        Free velocity.

    Returns
    -------
    (nc,) float or None
        Weights y ≥ 0 of the normal rows, of sum one; None if none are found.
    """
    from scipy.optimize import linprog

    normal = np.arange(0, free.size, 3)
    if normal.size == 0:
        return None
    root = np.sqrt(np.diag(delassus))
    heavy = np.where(root > 0.0, root, 1.0)
    # In scaled units: W y = 0 and sum y = 1, with b·y as small as can be.
    matrix = (delassus / heavy[:, None])[:, normal] / heavy[normal]
    speed = free[normal] / heavy[normal]
    size = np.max(np.abs(free / heavy), initial=0.0)
    if size == 0.0:
        return None
    found = linprog(
        speed / size,
        A_ub=np.vstack([matrix, -matrix]),
        b_ub=np.full(2 * free.size, WITHOUT_EFFECT),
        A_eq=np.ones((1, normal.size)),
        b_eq=[1.0],
        options={"primal_feasibility_tolerance": 1e-10},
    )
    if found.status != 0 or not found.fun < -CLOSING:
        return None
    weights: Floats = found.x / heavy[normal]
    return weights / np.sum(weights)
