"""Any recorded quantity against time, as it is declared."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from heelstrike.errors import ViewError
from heelstrike.sim.files.dataset import DIMENSIONS, labels
from heelstrike.sim.run import QUANTITIES
from heelstrike.view.comparison_figure import COLORS, STROKES
from heelstrike.view.panels import THIN, Curve, Excerpt, Panel, draw_panels


def _look(number: int) -> dict[str, Any]:
    """Look of a curve: a colour of the palette, and other strokes when all have been used."""
    stroke = STROKES[number // len(COLORS) % len(STROKES)]
    return {"linewidth": THIN, "color": COLORS[number % len(COLORS)], "linestyle": stroke}


def draw_quantity(excerpt: Excerpt, name: str) -> Figure:
    """Draw a line for each coordinate, actuator or contact point, a panel for each component."""
    run, quantity = excerpt.run, QUANTITIES[name]
    along = [DIMENSIONS[extent] for extent in quantity.shape]
    names = [labels(run.robot)[dimension] for dimension in along]
    if not names[0]:
        raise ViewError(f"robot {run.robot.name!r} has no {along[0]}s: there is nothing to show")
    components = names[1] if len(names) > 1 else [""]
    values = getattr(run, name).reshape(len(run.time), len(names[0]), len(components))
    panels = [
        Panel(
            quantity.unit,
            [
                Curve(values[:, i, k], each.replace("_", " "), _look(i))
                for i, each in enumerate(names[0])
            ],
            title=component,
        )
        for k, component in enumerate(components)
    ]
    height = 1.2 + 2.6 * len(panels)
    return draw_panels(excerpt, quantity.label, panels, height=height, legends=False)
