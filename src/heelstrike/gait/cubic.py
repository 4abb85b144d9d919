"""One cubic polynomial a joint, fixed by its boundary positions and velocities (paper eq. 41-43).

The functions use plain arithmetic only, so that numbers, arrays and symbols all pass through them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def coefficients(
    start: Any, end: Any, start_velocity: Any, end_velocity: Any, duration: Any
) -> tuple[Any, Any, Any, Any]:
    """Coefficients of the cubic with the given ends (paper eq. 43).

    Parameters
    ----------
    start, end : (nu,) array
        Positions at t = 0 and t = `duration`.
    start_velocity, end_velocity : (nu,) array
        Velocities at t = 0 and t = `duration`.
    duration : scalar
        Length T of the interval, in s.

    Returns
    -------
    tuple of four (nu,) arrays
        a0, a1, a2, a3 of a0 + a1 t + a2 t² + a3 t³.
    """
    slope = (end - start) / duration
    return (
        start,
        start_velocity,
        (3.0 * slope - 2.0 * start_velocity - end_velocity) / duration,
        (start_velocity + end_velocity - 2.0 * slope) / duration**2,
    )


def position(coefficients: Sequence[Any], t: Any) -> Any:
    """Value of the cubic at time t (paper eq. 41, without its zero beyond T)."""
    a0, a1, a2, a3 = coefficients
    return a0 + t * (a1 + t * (a2 + t * a3))


def velocity(coefficients: Sequence[Any], t: Any) -> Any:
    """First derivative of the cubic at time t."""
    _, a1, a2, a3 = coefficients
    return a1 + t * (2.0 * a2 + t * (3.0 * a3))


def acceleration(coefficients: Sequence[Any], t: Any) -> Any:
    """Second derivative of the cubic at time t."""
    _, _, a2, a3 = coefficients
    return 2.0 * a2 + t * (6.0 * a3)
