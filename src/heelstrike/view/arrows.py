"""Forces as arrows."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from heelstrike.robot.model import Floats
from heelstrike.view.style import FORCE_COLOR

HEAD_LENGTH = 0.035
"""Length of an arrow's head as a fraction of the robot's size."""
HEAD_WIDTH = 0.022
WEIGHT_LENGTH = 0.35
"""Length of the arrow of one robot's weight as a fraction of the robot's size."""
LONGEST_ARROW = 1.3
"""Longest arrow as a fraction of the robot's size."""


class Arrows:
    """Arrows on axes, drawn again for every set of forces.

    Parameters
    ----------
    axes : Axes
        Where, with metres along both axes.
    size : float
        Size of the robot, in m.
    weight : float
        Weight of the robot, in N.
    width : float
        Line width in points.
    """

    def __init__(self, axes: Axes, size: float, weight: float, *, width: float = 2.5) -> None:
        self._size = size
        self._scale = WEIGHT_LENGTH * size / weight if weight > 0.0 else 0.0
        look: dict[str, Any] = {"color": FORCE_COLOR, "zorder": 5}
        self.shafts = LineCollection([], linewidths=width, capstyle="butt", **look)
        self.heads = PolyCollection([], linewidths=0.0, **look)
        axes.add_collection(self.shafts, autolim=False)
        axes.add_collection(self.heads, autolim=False)

    def show(self, foot: Floats, force: Floats) -> None:
        """Draw forces (n, 2), in N, as arrows that start at the points `foot` (n, 2), in m."""
        length = np.minimum(np.hypot(*force.T) * self._scale, LONGEST_ARROW * self._size)
        seen = length > 0.25 * HEAD_LENGTH * self._size
        start, along = foot[seen], force[seen] / np.hypot(*force[seen].T)[:, None]
        length = length[seen, None]
        head = np.minimum(HEAD_LENGTH * self._size, length)
        neck = start + (length - head) * along
        across = 0.5 * HEAD_WIDTH * self._size * along[:, ::-1] * [1.0, -1.0]
        self.shafts.set_segments(list(np.stack((start, neck), axis=1)))
        tip = start + length * along
        self.heads.set_verts(list(np.stack((neck - across, tip, neck + across), axis=1)))


def draw_scale(
    axes: Axes, place: Floats, size: float, weight: float, *, width: float, fontsize: float
) -> None:
    """Draw the arrow of a robot's weight (N) at a place (2,), in m, and say how much that is."""
    if weight > 0.0:
        Arrows(axes, size, weight, width=width).show(place[None], np.array([[0.0, weight]]))
        axes.annotate(
            f"{weight:.3g} N",
            (place[0], place[1]),
            xytext=(0.0, -fontsize),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=fontsize,
            color=FORCE_COLOR,
        )
