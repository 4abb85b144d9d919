"""A ground shape from outside: bowls and waves, in a user's file.

No line of the package knows of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import heelstrike as hs
from heelstrike.sim import kernel


@dataclass(frozen=True)
class Bowl(hs.GroundShape):
    """A parabola that is open above: z = c x² / 2."""

    curvature: float = 1.0

    @kernel
    def height(self, x: float) -> tuple[float, float, float]:
        return 0.5 * self.curvature * x * x, self.curvature * x, self.curvature


@dataclass(frozen=True)
class Waves(hs.GroundShape):
    """Hills and valleys: z = a sin(k x)."""

    amplitude: float = 0.02
    number: float = 6.0

    @kernel
    def height(self, x: float) -> tuple[float, float, float]:
        a, k = self.amplitude, self.number
        return a * sin(k * x), a * k * cos(k * x), -a * k * k * sin(k * x)
