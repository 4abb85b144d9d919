"""A canvas on which only what moves is drawn again.

It is wiped with a copy of its background, and a handful of artists whose data change are drawn over
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from heelstrike.view.style import INK

DPI = 100


class Canvas:
    """A figure without a frame, with a clock, that shows one frame of a run after the other.

    Parameters
    ----------
    size : (int, int)
        Width and height of the picture, in pixels.
    speed : float
        Simulated seconds a second.
    """

    def __init__(self, size: tuple[int, int], speed: float) -> None:
        self.scale = min(size) / 540.0
        self.font = 11.0 * self.scale
        self.figure = Figure(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI)
        self._canvas: Any = FigureCanvasAgg(self.figure)  # matplotlib leaves it without types
        self.axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()
        self._speed = "" if speed == 1.0 else f"   (speed × {speed:g})"

    def begin(self, moving: Sequence[Artist]) -> None:
        """Draw the background, once all is there; what moves is drawn over it in this order."""
        self._clock = self.axes.text(
            0.02, 0.97, "", transform=self.axes.transAxes, va="top", fontsize=1.3 * self.font,
            color=INK,
        )  # fmt: skip
        self._moving = [*moving, self._clock]
        for artist in self._moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self.figure.bbox)

    def drawn(self, time: float) -> memoryview:
        """Draw what moves at a time (s); return the pixels, four bytes each, valid until the next.

        What moves is where it is to be.
        """
        self._canvas.restore_region(self._background)
        self._clock.set_text(f"t = {time:.2f} s{self._speed}")
        renderer = self._canvas.get_renderer()
        for artist in self._moving:
            artist.draw(renderer)
        return memoryview(self._canvas.buffer_rgba())
