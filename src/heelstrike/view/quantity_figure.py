"""Any recorded quantity against time, as it is declared."""

from __future__ import annotations

from matplotlib.figure import Figure

from heelstrike.errors import ViewError
from heelstrike.sim.files.dataset import DIMENSIONS, labels
from heelstrike.sim.run import QUANTITIES, Run
from heelstrike.view.style import figure_title, new_figure, time_axis


def draw_quantity(run: Run, name: str, rows: slice) -> Figure:
    """Draw a line for each coordinate, actuator or contact point, a panel for each component."""
    quantity = QUANTITIES[name]
    along = [DIMENSIONS[extent] for extent in quantity.shape]
    names = [labels(run.robot)[dimension] for dimension in along]
    if not names[0]:
        raise ViewError(f"robot {run.robot.name!r} has no {along[0]}s: there is nothing to show")
    components = names[1] if len(names) > 1 else [""]
    values = getattr(run, name)[rows].reshape(-1, len(names[0]), len(components))
    figure = new_figure(9.0, 1.2 + 2.6 * len(components))
    panels = figure.subplots(len(components), 1, sharex=True, squeeze=False).ravel()
    for k, axes in enumerate(panels):
        for i, line in enumerate(names[0]):
            axes.plot(run.time[rows], values[:, i, k], label=line.replace("_", " "))
        axes.set_title(components[k], loc="left")
        axes.set_ylabel(quantity.unit)
        time_axis(axes, run.time[rows], labelled=axes is panels[-1])
    panels[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure_title(figure, run.robot, quantity.label)
    return figure
