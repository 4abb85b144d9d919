"""Stairs under a swing foot, smooth enough for an optimiser and nowhere below the real ones."""

from __future__ import annotations

from typing import Any

import casadi

BLUNTED = 0.03
"""Length (m) over which an edge is blunted, on the side of the lower tread."""


class Stairs:
    """Level treads as deep as a step is long, with a foothold in the middle of each.

    The tread of the stance foot is at height zero, and the others are higher by the rise each, or
    lower. Where there is no rise all are one plane.

    Parameters
    ----------
    tread : float or symbol
        Depth of a tread (m).
    rise : float or symbol
        By how much each is higher than the one before (m).
    """

    def __init__(self, tread: Any, rise: Any) -> None:
        self.tread = tread
        self.rise = rise

    def height(self, x: Any, z: Any) -> Any:
        """Height over the stairs of a point at x, z from the middle of the stance tread."""
        behind, before = (x + 0.5 * self.tread), (x - 0.5 * self.tread)
        return z - self.rise * (self._passed(behind) - 1.0 + self._passed(before))

    def _passed(self, beyond: Any) -> Any:
        """How much of an edge has been passed, from 0 to 1, so far beyond it.

        Up: all of it before the edge. Down: nothing of it before the edge.
        """
        share = beyond / BLUNTED + casadi.if_else(self.rise > 0.0, 1.0, 0.0)
        share = casadi.fmin(casadi.fmax(share, 0.0), 1.0)
        return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
