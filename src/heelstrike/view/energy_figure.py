"""Where the energy of a run comes from and goes to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from heelstrike.analysis.energy import energy_balance
from heelstrike.sim.run import Run
from heelstrike.view.style import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    figure_title,
    legend_above,
    new_figure,
    time_axis,
)

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait


def draw_energy(run: Run, gait: Gait | None, rows: slice) -> Figure:  # noqa: ARG001
    """Energy above, the work done since the start below."""
    balance = energy_balance(run)
    figure = new_figure(9.0, 5.6)
    panels = list(figure.subplots(2, 1, sharex=True))
    time = run.time[rows]
    for axes, title, curves in (
        (
            panels[0],
            "change since the start",
            (
                ("kinetic", balance.kinetic - balance.kinetic[0], BLUE),
                ("potential", balance.potential - balance.potential[0], ORANGE),
                ("mechanical energy", balance.total - balance.total[0], INK),
            ),
        ),
        (
            panels[1],
            "work since the start",
            (
                ("actuators", balance.actuators, GREEN),
                ("ground", balance.contacts, VERMILION),
                ("dampers", balance.dampers, PURPLE),
                ("joint stops", balance.stops, SKY),
                ("dry friction", balance.dry_friction, ORANGE),
                ("pushes", balance.pushes, BLUE),
                ("residual", balance.residual, INK),
            ),
        ),
    ):
        for label, values, color in curves:
            if label not in ("dampers", "joint stops", "dry friction", "pushes") or values.any():
                axes.plot(time, values[rows], color=color, label=label)
        axes.set_title(title, loc="left")
        axes.set_ylabel("energy (J)")
        time_axis(axes, time, labelled=axes is panels[1])
        legend_above(axes, right=True)
    figure_title(figure, run.robot, "energy")
    return figure
