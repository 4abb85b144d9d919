"""Integrals over the rows of a record, from piece to smooth piece.

Each interval is integrated over the polynomial through the nearest rows of its own piece; where a
piece ends without a row, the polynomial goes on to its end.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

NODES = 8
"""Rows that a polynomial goes through."""


def weights(time: Array, low: Array, high: Array) -> Array:
    """Weights (m, k) of values at times (m, k) in the integrals from `low` to `high` (m,)."""
    unit = np.maximum(high - low, np.max(np.abs(time - low[:, None]), axis=1))
    powers = np.arange(time.shape[1])
    moments = unit[:, None] * ((high - low) / unit)[:, None] ** (powers + 1.0) / (powers + 1.0)
    places = ((time - low[:, None]) / unit[:, None])[:, None, :] ** powers[:, None]
    integrals: Array = np.linalg.solve(places, moments[..., None])[..., 0]
    return integrals


def _integrals(time: Array, values: Array, low: Array, high: Array, nodes: int) -> Array:
    """Integrals (m,) over the polynomials through so many of the nearest of some times (n,)."""
    nodes = min(nodes, len(time))
    middle = 0.5 * (low + high)
    first = np.searchsorted(time, middle) - nodes // 2
    first = np.clip(first, 0, len(time) - nodes)
    stencil = first[:, None] + np.arange(nodes)
    result: Array = np.sum(weights(time[stencil], low, high) * values[stencil], axis=1)
    return result


def integrate_piece(time: Array, values: Array, edges: Array) -> tuple[Array, Array]:
    """Integrals of a smooth function between neighbouring edges, and how far they may be wrong.

    Parameters
    ----------
    time, values : (n,) float
        Where it is known, n of at least one.
    edges : (m + 1,) float
        Ends of the intervals.

    Returns
    -------
    (m,) float, (m,) float
        Integrals, and what they change by if two rows fewer are looked at.
    """
    low, high = edges[:-1], edges[1:]
    whole = _integrals(time, values, low, high, NODES)
    if len(time) == 1:
        return whole, np.abs(whole)
    fewer = max(min(NODES, len(time)) - 2, 1)
    return whole, np.abs(whole - _integrals(time, values, low, high, fewer))
