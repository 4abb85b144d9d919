"""Numbers of metres along the ground of a film.

Each number is drawn once and kept as a picture: matplotlib lays a text out again in every frame,
which takes as long as all else that moves.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from heelstrike.view.style import GREY


class Milestones(Artist):
    """What stands below the marks of whole metres.

    Parameters
    ----------
    fontsize : float
        Size of the numbers, in points.
    """

    def __init__(self, fontsize: float) -> None:
        super().__init__()
        self._fontsize = fontsize
        self._metres: NDArray[np.float64] = np.zeros(0)
        self._top: NDArray[np.float64] = np.zeros((0, 2))

    def show(self, metres: NDArray[np.float64], top: NDArray[np.float64]) -> None:
        """Stand there from now on: whole metres (n,), and where each begins below (n, 2), in m."""
        self._metres, self._top = metres, top

    def draw(self, renderer: Any) -> None:
        """Draw them."""
        canvas: Any = self.axes
        graphics = renderer.new_gc()
        for metre, (x, y) in zip(self._metres, canvas.transData.transform(self._top), strict=True):
            picture = self._picture(int(metre))
            height, width, _ = picture.shape
            renderer.draw_image(graphics, round(x - 0.5 * width), round(y - height), picture)
        graphics.restore()

    @cached_property
    def _kept(self) -> dict[int, NDArray[np.uint8]]:
        return {}

    def _picture(self, metre: int) -> NDArray[np.uint8]:
        """Return a number as (height, width, 4) red, green, blue, opacity; from the bottom up."""
        if metre not in self._kept:
            page = Figure(figsize=(12.0 * self._fontsize / 72.0,) * 2, dpi=self.figure.dpi)
            page.patch.set_alpha(0.0)
            canvas: Any = FigureCanvasAgg(page)
            text = f"{metre} m".replace("-", "−")
            drawn = page.text(0.5, 0.5, text, fontsize=self._fontsize, color=GREY)
            canvas.draw()
            box = drawn.get_window_extent()
            pixels = np.asarray(canvas.buffer_rgba())[::-1]
            rows, columns = (
                slice(int(low), int(np.ceil(high))) for low, high in (box.intervaly, box.intervalx)
            )
            self._kept[metre] = np.ascontiguousarray(pixels[rows, columns])
        return self._kept[metre]
