"""One look for all pictures: a palette that colour-blind readers can tell apart, readable sizes.

Nothing here touches matplotlib's global state: figures are made without pyplot and inside
:func:`styled`.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from heelstrike.errors import ViewError, WriteError
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.whole_file import check_target, write_whole

# Okabe and Ito's palette.
BLUE = "#0072B2"
VERMILION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
SKY = "#56B4E9"
ORANGE = "#E69F00"
INK = "#222222"
GREY = "#7A7A7A"
PALE = "#E8E8E4"

FOOT_COLORS = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE)
"""Colours of the feet and their legs in the order of ``robot.feet``, in all pictures."""

FORCE_COLOR = GREEN
ZERO_MOMENT_POINT_COLOR = PURPLE
BOUND: dict[str, Any] = {"color": INK, "linestyle": (0, (5, 3)), "linewidth": 1.0}
"""How limits are drawn."""

_STYLE: dict[str, Any] = {
    "font.size": 10.0,
    "axes.titlesize": 10.5,
    "axes.labelsize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": PALE,
    "grid.linewidth": 0.8,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    # Names come from files: what stands between two dollars in them is no formula.
    "text.parse_math": False,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "figure.dpi": 100.0,
    "savefig.dpi": 150.0,
    "savefig.facecolor": "white",
    "svg.hashsalt": "heelstrike",
}


LEGEND_COLUMNS = 6
"""Entries of a legend side by side."""

SHARPER = 2
"""Pixels of a picture in a notebook for each pixel of its place, for screens that have them."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Draw with heelstrike's look, whatever the caller's own settings are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams
        settings.update(_STYLE)
        yield


class Picture(Figure):
    """A figure that notebooks show by themselves, and that looks alike wherever it is drawn."""

    def draw(self, renderer: RendererBase) -> None:
        """Draw it in heelstrike's look: what matplotlib makes late, as ticks, takes it too."""
        with styled():
            super().draw(renderer)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Return what a notebook shows: a PNG, and its size in the pixels of a page.

        A notebook that shows all figures by itself, after ``%matplotlib inline``, does not ask for
        this.
        """
        picture = io.BytesIO()
        with styled():
            self.savefig(picture, format="png", dpi=SHARPER * self.dpi)
        width, height = (round(self.dpi * inches) for inches in self.get_size_inches())
        return picture.getvalue(), {"width": width, "height": height}


class PowersOfTen(LogFormatter):
    """Ticks of a logarithmic axis as plain text: 10⁻³, 2×10⁻³, 1, 10."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Word of the tick at x; none of one between powers, unless there are few of these."""
        word = super().__call__(x, pos)
        if not word or x <= 0.0:
            return word
        exponent = int(np.floor(np.log10(x) + 1e-9))
        if exponent in (0, 1):
            return f"{x:.3g}"
        times = f"{x / 10.0**exponent:.3g}"
        power = "10" + str(exponent).translate(_RAISED)
        return power if times == "1" else f"{times}×{power}"


def label_powers(axis: Axis) -> None:
    """Let the ticks of a logarithmic axis be plain text."""
    axis.set_major_formatter(PowersOfTen())
    axis.set_minor_formatter(PowersOfTen())


def foot_color(foot: int) -> str:
    """Colour of a foot and its leg, dark for what belongs to none (-1)."""
    return INK if foot < 0 else FOOT_COLORS[foot % len(FOOT_COLORS)]


def limits_in_words(limits: Sequence[float], unit: str = "") -> str:
    """Say which limits there are."""
    text = " … ".join(f"{limit:g}" for limit in limits).replace("-", "−")
    return f"limits {text} {unit}".rstrip() if limits else ""


def in_words(name: str) -> str:
    """Name of a joint, foot or contact point as people write it."""
    return name.replace("_", " ")


def new_figure(width: float, height: float) -> Picture:
    """Make a figure (inches) that belongs to no window and to no global list."""
    figure = Picture(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure; its kind follows from the name: .png, .pdf, .svg.

    Raises
    ------
    ViewError
        If matplotlib knows no such kind of picture, or the file cannot be written; an older one is
        as it was.
    """
    target = Path(path)
    kind = target.suffix.lstrip(".").lower()
    with view_errors():
        check_target(target)
        if kind not in figure.canvas.get_supported_filetypes():
            raise ViewError(
                f"cannot write {target}: the name of a picture ends in .png, .pdf or .svg"
            )
        picture = io.BytesIO()
        with styled():
            if kind == "png":
                save_png(figure, picture)
            else:
                figure.savefig(picture, format=kind)
        return write_whole(target, picture.getbuffer())


def save_png(figure: Figure, picture: io.BytesIO) -> None:
    """Draw a figure as PNG, once: matplotlib by itself draws it another time to lay it out."""
    engine, own, dpi = figure.get_layout_engine(), figure.dpi, matplotlib.rcParams["savefig.dpi"]
    try:
        if engine is not None:
            figure.dpi = dpi
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(picture, format="png", dpi=dpi)
    finally:
        figure.dpi = own
        figure.set_layout_engine(engine)


@contextlib.contextmanager
def view_errors() -> Iterator[None]:
    """Let what keeps a file from being written be an error of the view."""
    try:
        yield
    except WriteError as error:
        raise ViewError(str(error)) from error


def figure_title(figure: Figure, robot: Robot, title: str, *, note: str = "") -> None:
    """Write above a figure whose robot it shows and what of it; a note goes to the right."""
    figure.suptitle(f"{robot.name}: {title}", x=0.01, ha="left", fontsize=12)
    if note:
        figure.text(0.99, 0.985, note, ha="right", va="top", fontsize=8.5, color=GREY)


def time_axis(axes: Axes, time: Floats, *, labelled: bool = True) -> None:
    """Let the x axis show a span of time, without margins."""
    if time[-1] > time[0]:
        axes.set_xlim(time[0], time[-1])
    if labelled:
        axes.set_xlabel("time (s)")


def legend_above(axes: Axes, *, right: bool = False) -> None:
    """Put the legend above the axes, in rows, out of the way of the curves."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            handles,
            labels,
            loc="lower right" if right else "lower left",
            bbox_to_anchor=(1.0 if right else 0.0, 1.0),
            ncols=min(len(handles), LEGEND_COLUMNS),
            borderaxespad=0.1,
            columnspacing=1.5,
            handletextpad=0.5,
        )
