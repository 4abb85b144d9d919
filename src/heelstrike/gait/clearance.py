"""How high the swing foot must be at every phase of a step (the paper's P_swnᵈ, eq. 12)."""

from __future__ import annotations

import enum

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.robot.model import Floats

ROUNDED = 0.04
"""Share of the step, at either end, over which the parabola is rounded off."""


class ClearanceProfile(enum.Enum):
    """Shape of the least height of the swing foot over the phase s = t/T of the step.

    ``PARABOLA`` is 4 s (1 − s). A foot that follows it leaves the ground with a velocity, so the
    first and last 4 % of the step are rounded to slope zero.

    ``SMOOTH`` is (4 s (1 − s))², flat at both ends, for a foot that can only lift from rest: one
    that lands without impact, or whose toe the impact of the other foot would drive down.
    """

    PARABOLA = "parabola"
    SMOOTH = "smooth"

    @property
    def corners(self) -> tuple[float, ...]:
        """Phases at which the curvature of the profile jumps."""
        return (ROUNDED, 1.0 - ROUNDED) if self is ClearanceProfile.PARABOLA else ()

    def height(self, phase: ArrayLike) -> Floats:
        """Share of the greatest height at phases, (...), from 0 to 1.

        Parameters
        ----------
        phase : array
            Share of the step that is over, from 0 to 1, of any shape.

        Returns
        -------
        array of the same shape
            Shares.

        Examples
        --------
        >>> ClearanceProfile.PARABOLA.height([0.0, 0.25, 0.5]).tolist()
        [0.0, 0.75, 1.0]
        """
        s = np.asarray(phase, dtype=np.float64)
        hump: Floats = 4.0 * s * (1.0 - s)
        if self is ClearanceProfile.SMOOTH:
            return hump**2
        from_end = np.minimum(s, 1.0 - s)
        rounding: Floats = 1.0 - np.maximum(1.0 - from_end / ROUNDED, 0.0) ** 2
        return hump * rounding
