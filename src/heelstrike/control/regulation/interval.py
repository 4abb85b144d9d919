"""An interval that is narrowed by one condition after the other, the most important first."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel

NO_SLOPE = 1e-9
"""A condition whose slope is less, in parts of its size, does not depend on the number."""


@kernel
def narrowed(lower: float, upper: float, value: float, slope: float) -> tuple[float, float, bool]:
    """Return the part of an interval in which value + slope x ≥ 0, and whether there is any.

    If there is none, the end that comes nearest to it is all that is left.
    """
    if abs(slope) <= NO_SLOPE * (1.0 + abs(value)):
        return lower, upper, value >= 0.0
    bound = -value / slope
    if slope > 0.0:
        return (max(lower, bound), upper, True) if bound <= upper else (upper, upper, False)
    return (lower, min(upper, bound), True) if bound >= lower else (lower, lower, False)
