"""Any recorded quantity against time, as it is declared."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from heelstrike.errors import ViewError
from heelstrike.sim.files.layout import IN_THE_PLANE
from heelstrike.sim.files.logs import dimensions
from heelstrike.sim.run import QUANTITIES
from heelstrike.view.comparison_figure import COLORS, STROKES
from heelstrike.view.panels import THIN, Curve, Excerpt, Panel, draw_panels


def look(number: int) -> dict[str, Any]:
    """Look of a curve: a colour of the palette, and other strokes when all have been used."""
    stroke = STROKES[number // len(COLORS) % len(STROKES)]
    return {"linewidth": THIN, "color": COLORS[number % len(COLORS)], "linestyle": stroke}


def draw_quantity(excerpt: Excerpt, name: str) -> Figure:
    """Draw a line for each coordinate, actuator or contact point, a panel for each component."""
    run = excerpt.run
    if name in QUANTITIES:
        quantity = QUANTITIES[name]
        shape, unit, label, values = (
            quantity.shape,
            quantity.unit,
            quantity.label,
            getattr(run, name),
        )
    else:
        told = run.log[name]
        shape, unit, label, values = told.extents, told.unit, told.label or name, told.values
    known = IN_THE_PLANE.labels(run.robot)
    along = dimensions(name, tuple(map(str, shape)), IN_THE_PLANE.extents)
    sizes = values.shape[1:]
    names = [
        known.get(each, [str(i) for i in range(size)])
        for each, size in zip(along, sizes, strict=True)
    ] or [[name]]
    if along:
        unit = IN_THE_PLANE.unit_along(run.robot, along[0], len(names[0]), unit)
    if not names[0]:
        raise ViewError(f"robot {run.robot.name!r} has no {along[0]}s: there is nothing to show")
    components = names[1] if len(names) > 1 else [""]
    values = values.reshape(len(run.time), len(names[0]), -1)[:, :, : len(components)]
    panels = [
        Panel(
            unit,
            [
                Curve(values[:, i, k], each.replace("_", " "), look(i))
                for i, each in enumerate(names[0])
            ],
            title=component,
        )
        for k, component in enumerate(components)
    ]
    height = 1.2 + 2.6 * len(panels)
    return draw_panels(excerpt, label, panels, height=height, legends=False)
