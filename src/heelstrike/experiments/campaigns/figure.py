"""The figure of a campaign: why trials failed, and how often they go well by each parameter."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heelstrike.experiments.campaigns.results import CampaignResults
from heelstrike.experiments.campaigns.verdict import influences, proportion, verdict
from heelstrike.view.style import FOOT_COLORS, GREY, INK, new_figure, styled

PARTS = 8
"""Parts of equally many trials that the values of a parameter are divided into."""
MOST_PANELS = 8
"""Parameters that are shown, the strongest."""
WIDTH, HEIGHT = 9.0, 2.2
"""Inches: of the figure, and of a row of panels."""


def draw_campaign(results: CampaignResults) -> Figure:
    """Draw a campaign.

    Parameters
    ----------
    results : CampaignResults
        What its trials came to.

    Returns
    -------
    Figure
        First causes with intervals, then a panel a parameter: the share that went well in parts of
        equally many trials.
    """
    names = [each.name for each in influences(results)][:MOST_PANELS]
    across, down = 3, -(-(len(names) + 1) // 3)
    with styled():
        figure = new_figure(WIDTH, down * HEIGHT)
        panels = figure.subplots(down, across, squeeze=False).ravel()
        _causes(panels[0], results)
        for axes, name in zip(panels[1:], names, strict=False):
            _parameter(axes, results, name)
        for axes in panels[1 + len(names) :]:
            axes.set_axis_off()
    return figure


def _causes(axes: Axes, results: CampaignResults) -> None:
    found = verdict(results)
    rows = [("walked on", found.success), *found.causes]
    for place, (_, each) in enumerate(rows):
        color = FOOT_COLORS[0] if place == 0 else GREY
        axes.barh(place, 100.0 * each.share, color=color, height=0.6)
        axes.plot((100.0 * each.low, 100.0 * each.high), (place, place), color=INK, linewidth=1.0)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows], parse_math=False)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 100.0)
    axes.set_title("of all trials (%)", loc="left")


def _parameter(axes: Axes, results: CampaignResults, name: str) -> None:
    plan, good = results.plan, results.success
    values = results.values[:, plan.names.index(name)]
    known = np.isfinite(values)
    x, good = values[known], good[known]
    if name in plan.texts or len(np.unique(x)) <= PARTS:
        parts = [x == each for each in np.unique(x)]
    else:
        ends = np.quantile(x, np.linspace(0.0, 1.0, PARTS + 1)[1:-1])
        place = np.searchsorted(ends, x, side="right")
        parts = [place == each for each in range(PARTS)]
    for part in parts:
        if part.any():
            each = proportion(int(good[part].sum()), int(part.sum()))
            middle = float(np.median(x[part]))
            axes.plot(
                (middle, middle), (100.0 * each.low, 100.0 * each.high), color=GREY, linewidth=1.4
            )
            axes.plot(middle, 100.0 * each.share, "o", color=FOOT_COLORS[0], markersize=4.0)
    if name in plan.texts:
        axes.set_xticks(range(len(plan.texts[name])), plan.texts[name], parse_math=False)
    axes.set_ylim(-3.0, 103.0)
    axes.set_title(f"walked on (%) by {name}", loc="left", parse_math=False)
