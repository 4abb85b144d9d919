"""What planned walks cost beside the optimal gait."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from heelstrike.robot import Robot
from heelstrike.view.style import (
    FOOT_COLORS,
    figure_title,
    label_powers,
    legend_above,
    new_figure,
    styled,
)

PANELS = (
    ("torque_cost", "torque squared a metre (N²m s)", True),
    ("cost_of_transport", "cost of transport", False),
    ("peak_torque", "largest torque (N m)", False),
    ("zmp_margin", "margin of the zero moment point (m)", False),
)
STROKES = (("-", "o"), ("--", "s"), ("-.", "^"))


def draw_planners(robot: Robot, walks: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw costs and margins over the speed, one line a planner.

    Parameters
    ----------
    robot : Robot
        Who walks.
    walks : sequence of mapping
        Planner, speed (m/s) and figures of each walk; those that failed have none.
    """
    names = list(dict.fromkeys(walk["planner"] for walk in walks))
    with styled():
        figure = new_figure(9.0, 6.5)
        panels = figure.subplots(2, 2, sharex=True).ravel()
        for axes, (quantity, label, powers) in zip(panels, PANELS, strict=True):
            for i, name in enumerate(names):
                own = [walk for walk in walks if walk["planner"] == name]
                line, marker = STROKES[i % len(STROKES)]
                axes.plot(
                    [walk["speed"] for walk in own], [walk[quantity] for walk in own],
                    color=FOOT_COLORS[i % len(FOOT_COLORS)], linestyle=line, marker=marker,
                    markersize=4.0, label=name.replace("_", " "),
                )  # fmt: skip
            axes.set_ylabel(label)
            if powers:
                axes.set_yscale("log")
                label_powers(axes.yaxis)
            else:
                axes.set_ylim(bottom=0.0)
        for axes in panels[2:]:
            axes.set_xlabel("speed (m/s)")
        figure_title(figure, robot, "planned by the cart table, and optimal")
        legend_above(panels[0])
    return figure
