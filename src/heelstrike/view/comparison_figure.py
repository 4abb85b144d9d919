"""How runs under different methods drift apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from heelstrike.robot import Robot
from heelstrike.robot.model import Floats
from heelstrike.view.style import (
    FOOT_COLORS,
    INK,
    figure_title,
    label_powers,
    legend_above,
    new_figure,
    styled,
)

PANELS = (
    ("position", "positions (rad, m)"),
    ("energy", "energy (J)"),
    ("zmp", "zero moment point (m)"),
)
COLORS = (*FOOT_COLORS, INK)
STROKES = ("-", "--", "-.", ":")
SMALLEST = 1e-16


def draw_comparison(
    robot: Robot,
    reference: str,
    times: Mapping[str, Floats],
    series: Mapping[str, Mapping[str, Floats]],
) -> Figure:
    """Draw absolute differences from the reference over time, one panel a quantity.

    Parameters
    ----------
    robot : Robot
        Whose runs they are.
    reference : str
        Name of the run they are held against; it is not drawn.
    times : mapping of str to (n,) float
        Instants in s, by method.
    series : mapping of str to mapping of str to (n,) float
        Differences by method and quantity (`position`, `energy`, `zmp`).
    """
    others = [name for name in series if name != reference]
    with styled():
        figure = new_figure(9.0, 7.0)
        panels = figure.subplots(len(PANELS), 1, sharex=True)
        for axes, (quantity, label) in zip(panels, PANELS, strict=True):
            for i, name in enumerate(others):
                values = np.abs(series[name][quantity])
                axes.semilogy(
                    times[name],
                    np.where(values > SMALLEST, values, np.nan),
                    color=COLORS[i % len(COLORS)],
                    linestyle=STROKES[i % len(STROKES)],
                    linewidth=1.0 + 0.35 * (len(others) - 1 - i),  # none hides another
                    label=name,
                )
            axes.set_ylabel(label)
            label_powers(axes.yaxis)
        panels[-1].set_xlabel("time (s)")
        figure_title(figure, robot, f"differences from {reference}")
        legend_above(panels[0])
    return figure
