"""Figures of curves over time, from a description of their panels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from heelstrike.errors import ViewError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.run import AnyRun, Run
from heelstrike.view.style import (
    BOUND,
    GREY,
    PALE,
    figure_title,
    legend_above,
    new_figure,
    time_axis,
)

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait


WIDTH = 9.0  # inches
# Points: each curve is wider than the one that is drawn over it, so that neither hides the other.
THIN, WIDER = 1.4, 0.6

ROWS_OF_AN_IMPACT = 3
"""An impact acts over the step in which a gap closes and the next, in which the point stops; the
controller sees its effect in the row after."""

NOTE = "impacts leave the scale"


def rows_within(run: AnyRun, span: tuple[float, float] | None) -> slice:
    """Return the rows of a run within a span of time, all if none is given.

    Raises
    ------
    ViewError
        If it is no span, or there are no rows in it.
    """
    if not len(run.time):
        raise ViewError(f"there is nothing to draw: the run has no rows ({run.message})")
    if span is None:
        return slice(0, len(run.time))
    try:
        start, end = (float(t) for t in span)
    except (TypeError, ValueError):
        raise ViewError(f"a span is a pair of times in s, got {span!r}") from None
    first, last = np.searchsorted(run.time, (start - 1e-9, end + 1e-9))
    if not last > first:
        raise ViewError(
            f"there is nothing to draw: the run has no rows from {start} s to {end} s; it lasts "
            f"from {run.time[0]:g} s to {run.time[-1]:g} s"
        )
    return slice(int(first), int(last))


@dataclass(frozen=True, eq=False)
class Excerpt:
    """Rows of a run that a figure shows, and the gait that the run followed."""

    run: Run
    rows: slice
    gait: Gait | None = None


@dataclass(frozen=True, eq=False)
class Curve:
    """Values (nt,) over all rows of a run, and how they are drawn."""

    values: Floats
    label: str = ""
    look: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves on common axes."""

    unit: str
    """Label of the y axis."""
    curves: Sequence[Curve]
    """Later ones are drawn over earlier ones."""
    title: str = ""
    remark: str = ""
    """title, remark: Words above, to the left and to the right."""
    bounds: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Levels that are drawn as limits, by what they are."""
    cone: Floats | None = None
    """(nt,) Half the width of a band about zero."""
    span: tuple[float, float] | None = None
    """Ends of the y axis; those of the curves by default."""
    impacts: bool = True
    """Whether the y axis holds impacts, or only what is between them."""
    height: float = 1.0
    """Compared with the other panels'."""


def draw_panels(
    excerpt: Excerpt,
    title: str,
    panels: Sequence[Panel],
    *,
    height: float,
    columns: int = 1,
    legends: bool = True,
    note: Callable[[bool], str] = lambda cut: NOTE if cut else "",
) -> Figure:
    """Draw panels, row by row.

    Parameters
    ----------
    excerpt : Excerpt
        What of the run.
    title : str
        What the figure shows.
    panels : sequence of Panel
        Their descriptions.
    height : float
        Of the figure, in inches.
    columns : int
        Panels side by side.
    legends : bool
        Whether every panel has a legend, or the first alone.
    note : callable
        Told whether impacts leave the scale, says what to write above.
    """
    run, rows = excerpt.run, excerpt.rows
    figure = new_figure(WIDTH, height)
    heights = [panel.height for panel in panels[::columns]]
    grid = figure.subplots(
        len(heights), columns, sharex=True, squeeze=False, height_ratios=heights
    ).ravel()
    for spare in grid[len(panels) :]:
        spare.set_visible(False)
    cut = False
    for number, (panel, axes) in enumerate(zip(panels, grid, strict=False)):
        time = run.time[rows]
        if panel.cone is not None:
            axes.fill_between(time, -panel.cone[rows], panel.cone[rows], color=PALE, linewidth=0.0)
        for below, curve in enumerate(panel.curves, start=1 - len(panel.curves)):
            look = {"linewidth": THIN - WIDER * below, "label": curve.label or None} | curve.look
            axes.plot(time, curve.values[rows], **look)
        if not panel.impacts:
            cut |= _scale_without_impacts(axes, excerpt, [each.values for each in panel.curves])
        span = panel.span or (None if panel.impacts else axes.get_ylim())
        for label, levels in panel.bounds.items():
            for k, level in enumerate(levels):
                axes.axhline(level, label=None if k else label, **BOUND)
        if span is not None:
            axes.set_ylim(*span)
        axes.set_title(panel.title, loc="left")
        axes.set_title(panel.remark, loc="right", fontsize=8.5, color=GREY)
        axes.set_ylabel(panel.unit)
        time_axis(axes, time, labelled=number + columns >= len(panels))
        if legends or number == 0:
            # To the right, where neither a title nor the factor of an axis stands.
            legend_above(axes, right=bool(panel.title) or not panel.remark)
    figure_title(figure, run.robot, title, note=note(cut))
    return figure


def _scale_without_impacts(axes: Axes, excerpt: Excerpt, curves: Sequence[Floats]) -> bool:
    """Scale the y axis to what curves (nt,) do between impacts; tell whether impacts leave it."""
    usual = ~impact_rows(excerpt.run)[excerpt.rows]
    shown = np.array([curve[excerpt.rows] for curve in curves])
    seen = shown[:, usual][np.isfinite(shown[:, usual])]
    if not seen.size:
        return False
    low, high = float(seen.min()), float(seen.max())
    room = 0.08 * max(high - low, 1e-9)
    axes.set_ylim(low - room, high + room)
    return bool(np.nanmax(shown) > high + room or np.nanmin(shown) < low - room)


def impact_rows(run: Run) -> NDArray[np.bool_]:
    """Tell which rows show an impact, (nt,): the step in which it happened and the rows after."""
    rows = np.zeros(len(run.time), dtype=bool)
    kinds = (EventKind.TOUCHDOWN, EventKind.IMPACT)
    times = np.array([e.time for e in run.events if e.kind in kinds])
    first = np.searchsorted(run.time, times - 1e-9) - 1
    for k in range(ROWS_OF_AN_IMPACT):
        rows[np.clip(first + k, 0, len(rows) - 1)] = True
    return rows
