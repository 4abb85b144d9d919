"""Weights of a quadratic cost: one for all, or one of each."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.errors import ControllerError


def weights_of(
    name: str, value: ArrayLike, size: int, *, positive: bool = False
) -> NDArray[np.float64]:
    """Return so many weights, (size,), of one for all or one of each.

    Raises
    ------
    ControllerError
        If they are not that many finite numbers from 0 on, or above 0.
    """
    weights = np.asarray(value, dtype=np.float64)
    fits = weights.ndim <= 1 and weights.size in (1, size)
    least = "positive" if positive else "not negative"
    if not fits or not np.all(np.isfinite(weights)) or np.any(weights < 0.0):
        raise ControllerError(
            f"{name} must be one number that is {least}, or {size} of them, got {value!r}"
        )
    if positive and np.any(weights == 0.0):
        raise ControllerError(f"{name} must be positive, got {value!r}")
    return np.broadcast_to(weights, (size,)).copy()
