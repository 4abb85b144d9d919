"""The figure of the zoo: a panel a disturbance, a row a controller on a robot."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.ticker import LogLocator, NullLocator

from heelstrike.experiments.zoo.disturbances import Disturbance
from heelstrike.experiments.zoo.results import STANDS, Cell, Results
from heelstrike.experiments.zoo.table import columns, empty
from heelstrike.view.style import FOOT_COLORS, GREY, INK, PALE, new_figure, styled

COLORS = (*FOOT_COLORS, INK)
MARKERS = "os^DvPh*<>"
WIDTH, ROW, AROUND = 9.0, 0.11, 0.75
"""Inches: of the figure; of a row; round each panel."""

GAP = 0.8
"""Rows between two robots."""

CANNOT = ("needs ", "no ", "not on", "trunk is", "refused")
"""How words begin that say that a controller cannot drive a robot at all: it has no row."""

ARROW = Path([(-1, 0), (1, 0), (0.3, 0.5), (1, 0), (0.3, -0.5)], [1, 2, 1, 2, 2])
"""A marker of the legend; letters between dollars would be drawn as they are."""

Row = tuple[str, str]
"""Robot, controller."""


def draw_zoo(results: Results) -> Figure:
    """Draw what controllers withstand on robots.

    To the right is better: where less is, the axis is reversed. Every controller has a colour and a
    marker, which is at the size withstood in all trials; a line leads to the greatest of a trial.
    An arrow says that more was not tried, a cross that the walk fails undisturbed. Controllers that
    cannot drive a robot have no row.

    Parameters
    ----------
    results : Results
        What was found.

    Returns
    -------
    Figure
        One panel a disturbance.
    """
    controllers = list(dict.fromkeys(key[1] for key in results.cells))
    looks = {
        name: (COLORS[i % len(COLORS)], MARKERS[i % len(MARKERS)])
        for i, name in enumerate(controllers)
    }
    places, bands = _places(results)
    height = max((top for _, _, top in bands), default=1.0)
    shown = columns(results)
    across = min(2, len(shown))
    down = -(-len(shown) // across)
    with styled():
        figure = new_figure(WIDTH, down * (ROW * height + AROUND) + 0.8)
        grid = figure.subplots(down, across, sharey=True, squeeze=False).ravel()
        for axes, disturbance in zip(grid, shown, strict=False):
            _panel(axes, results, disturbance, places, bands, looks)
        for axes in grid[len(shown) :]:
            axes.set_axis_off()
        _legend(figure, looks, results)
    return figure


def _places(results: Results) -> tuple[dict[Row, float], list[tuple[str, float, float]]]:
    """Return the height of every row, and each robot with the span of its own."""
    places: dict[Row, float] = {}
    bands = []
    at = 0.0
    for animal, rows in results.robots():
        begin = at
        for controller, row in rows.items():
            if not empty(row).startswith(CANNOT):
                places[animal.robot, controller] = at + 0.5
                at += 1.0
        at = max(at, begin + 1.0)
        bands.append((animal.robot, begin - 0.5 * GAP, at + 0.5 * GAP))
        at += GAP
    return places, bands


def _panel(
    axes: Axes,
    results: Results,
    disturbance: Disturbance,
    places: dict[Row, float],
    bands: Sequence[tuple[str, float, float]],
    looks: dict[str, tuple[str, str]],
) -> None:
    for i, (_, begin, end) in enumerate(bands):
        if i % 2 == 0:
            axes.axhspan(begin, end, color=PALE, alpha=0.5, linewidth=0.0, zorder=0)
    for (robot, controller), y in places.items():
        cell = results.cells.get((robot, controller, disturbance.name))
        if cell is not None:
            _mark(axes, cell, y, disturbance, looks[controller])
    axes.set_yticks(
        [0.5 * (begin + end) for _, begin, end in bands], [robot for robot, _, _ in bands],
        parse_math=False,  # names of files are no formulas
    )  # fmt: skip
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(bands[-1][2], bands[0][1])
    axes.grid(visible=False, axis="y")
    axes.set_title(f"{disturbance.name.replace('-', ' ')} ({disturbance.unit})", loc="left")
    if disturbance.name == "price":
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:.0f}")
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.set_xlim(left=0.0)
    if disturbance.less:
        axes.invert_xaxis()


def _mark(
    axes: Axes, cell: Cell, y: float, disturbance: Disturbance, look: tuple[str, str]
) -> None:
    color, marker = look
    if cell.word:
        if cell.word != STANDS:
            left = axes.get_yaxis_transform()
            axes.plot(0.012, y, "x", transform=left, color=GREY, markersize=4.5, clip_on=False)
        return
    worst = cell.worst(less=disturbance.less)
    best = min(cell.withstood) if disturbance.less else max(cell.withstood)
    if not math.isclose(worst, best):
        axes.plot((worst, best), (y, y), color=color, linewidth=1.4, zorder=2)
    axes.plot(worst, y, marker=marker, color=color, markersize=5.0, clip_on=False, zorder=4)
    if any(math.isinf(each) for each in cell.failed):
        axes.annotate(
            "", (best, y), xytext=(12.0, 0.0), textcoords="offset points",
            arrowprops={"arrowstyle": "<-", "color": color}, annotation_clip=False,
        )  # fmt: skip


def _legend(figure: Figure, looks: dict[str, tuple[str, str]], results: Results) -> None:
    handles = [
        Line2D([], [], color=color, marker=marker, markersize=6.0, linestyle="-", label=name)
        for name, (color, marker) in looks.items()
    ]
    style = {"color": GREY, "linestyle": "none", "markersize": 6.0}
    handles += [
        Line2D([], [], marker=ARROW, label="more was not tried", **style),  # type: ignore[arg-type]
        Line2D([], [], marker="x", label="fails undisturbed", **style),  # type: ignore[arg-type]
    ]
    trials = results.settings.trials
    title = "To the right is better."
    if trials > 1:
        title += f" Marker: withstood in all trials; line: up to the best of {trials}."
    if any(cell.word == STANDS for cell in results.cells.values()):
        title += " Blank: one that stands does not come to it."
    figure.legend(handles=handles, loc="outside upper left", ncols=4, title=title, alignment="left")
