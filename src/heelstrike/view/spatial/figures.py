"""plot_in_space(): the figures of a run in space by their names."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point
from heelstrike.arguments import takes
from heelstrike.errors import ViewError
from heelstrike.robot.model import Floats
from heelstrike.sim.files.spatial import IN_SPACE
from heelstrike.sim.run import Run
from heelstrike.sim.spatial.run import RECORDED, SpatialRun
from heelstrike.view.figures import unknown_figure
from heelstrike.view.panels import Curve, Excerpt, Panel, draw_panels, rows_within
from heelstrike.view.quantity_figure import look
from heelstrike.view.style import foot_color, in_words, save_figure, styled

AXES = ("x", "y", "z")
COMPONENTS = {
    "axis": AXES,
    "component": ("normal", "t1", "t2"),
    "tangent": ("t1", "t2"),
}
"""Names of the numbers that a contact point has of a quantity."""


def _forces(run: SpatialRun) -> tuple[str, list[Panel]]:
    """Contact force on each foot along world x, y and z."""
    if not run.robot.nc:
        raise ViewError(f"robot {run.robot.name!r} has no contact points: there is nothing to show")
    force, feet = run.world_force, run.robot.feet
    of_feet = [
        (in_words(foot.name), force[:, list(foot.contacts)].sum(axis=1), foot_color(i))
        for i, foot in enumerate(feet)
    ]
    others = np.setdiff1d(np.arange(run.robot.nc), [i for foot in feet for i in foot.contacts])
    if len(others):
        name = "all else" if feet else "robot"
        of_feet.append((name, force[:, others].sum(axis=1), foot_color(-1)))
    panels = [
        Panel(
            f"force along {axis} (N)",
            [Curve(total[:, k], name, {"color": color}) for name, total, color in of_feet],
        )
        for k, axis in enumerate(AXES)
    ]
    return "contact forces on the robot", panels


def _gaps(run: SpatialRun) -> tuple[str, list[Panel]]:
    """Distance of the contact points to the ground; of many points, the lowest of each link."""
    robot = run.robot
    if robot.nc <= MOST_NAMED:
        return _quantity(run, "gap")
    links = robot.model.contact_link
    label, unit = RECORDED["gap"].label, RECORDED["gap"].unit
    curves = [
        Curve(
            np.nanmin(run.gap[:, links == link], axis=1),
            in_words(robot.link_names[link]),
            look(number),
        )
        for number, link in enumerate(np.unique(links).tolist())
    ]
    panels = [
        Panel(unit, curves[first : first + OF_A_PANEL])
        for first in range(0, len(curves), OF_A_PANEL)
    ]
    return f"{label}, the lowest point of each link", panels


def _zero_moment_point(run: SpatialRun) -> tuple[str, list[Panel]]:
    """Zero moment point in the world, and how far inside the support polygon it is."""
    found = spatial_zero_moment_point(run)
    panels = [
        Panel("m", [Curve(found.total[:, k])], title=f"zero moment point along {AXES[k]}")
        for k in range(2)
    ]
    panels.append(
        Panel(
            "m",
            [Curve(found.margin)],
            title="distance to the edges of the support polygon",
            bounds={"edge": (0.0,)},
        )
    )
    return "zero moment point", panels


_DRAWINGS: dict[str, Callable[[SpatialRun], tuple[str, list[Panel]]]] = {
    "forces": _forces,
    "zmp": _zero_moment_point,
    "gap": _gaps,
}

FIGURES = tuple(_DRAWINGS)
"""Names of the figures beside what is recorded."""


@takes(ViewError)
def plot_in_space(
    run: SpatialRun,
    what: str,
    *,
    path: str | os.PathLike[str] | None = None,
    span: tuple[float, float] | None = None,
) -> Figure:
    """Draw a figure of a run in space.

    Parameters
    ----------
    run : SpatialRun
        The run.
    what : str
        ``"forces"`` or ``"zmp"``, or the name of an array of the run, such as ``"torque"``, which
        is drawn as it is.
    path : str or path, optional
        File to write: .png, .pdf or .svg.
    span : tuple of float, optional
        First and last time to show, in s; all of the run by default.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, which belongs to no window.

    Raises
    ------
    ViewError
        If there is no such figure, nothing to show, or the file cannot be written.
    """
    if what not in _DRAWINGS and what not in RECORDED:
        raise unknown_figure(what, "figure of a run in space", _DRAWINGS, RECORDED)
    rows = rows_within(run, span)
    with styled():
        drawing = _DRAWINGS.get(what)
        title, panels = _quantity(run, what) if drawing is None else drawing(run)
        # Of a run panels ask for its time and the name of its robot.
        excerpt = Excerpt(cast(Run, run), rows)
        height = 1.2 + 2.6 * len(panels)
        figure = draw_panels(excerpt, title, panels, height=height, legends=True)
        for axes in figure.axes:
            _name_curves(axes)
    if path is not None:
        save_figure(figure, path)
    return figure


OF_A_PANEL = 8
"""Curves that a panel has at most: there are more panels instead."""

MOST_NAMED = 48
"""Curves of a quantity up to which they have names, and panels of `OF_A_PANEL` each."""


def _name_curves(axes: Axes) -> None:
    """Name the curves of a panel to its right, where there is room for long names."""
    above = axes.get_legend()
    if above is not None:
        above.remove()
    handles, labels = axes.get_legend_handles_labels()
    if 1 < len(handles) <= OF_A_PANEL:
        axes.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8.0)


def _quantity(run: SpatialRun, name: str) -> tuple[str, list[Panel]]:
    """Return title and panels of what is recorded: a curve for each, a panel a component."""
    quantity = RECORDED[name]
    names: dict[str, tuple[str, ...]] = {
        "q": run.robot.position_names,
        "v": run.robot.velocity_names,
        "actuator": run.robot.actuator_names,
        "contact": run.robot.contact_names,
    }
    values = getattr(run, name)
    dims = [IN_SPACE.extents[each] for each in quantity.shape]
    if not dims:
        return quantity.label, [Panel(quantity.unit, [Curve(values, quantity.label)])]
    along = names[dims[0]]
    if not along:
        raise ViewError(f"robot {run.robot.name!r} has no {dims[0]}s: there is nothing to show")
    unit = IN_SPACE.unit_along(run.robot, dims[0], len(along), quantity.unit)
    components = COMPONENTS[dims[1]] if len(dims) > 1 else ("",)
    table: Floats = values.reshape(len(run.time), len(along), -1)
    together = OF_A_PANEL if len(along) <= MOST_NAMED else len(along)
    panels = [
        Panel(
            unit,
            [
                Curve(table[:, i, k], in_words(along[i]), look(i - first))
                for i in range(first, min(first + together, len(along)))
            ],
            title=component,
        )
        for k, component in enumerate(components)
        for first in range(0, len(along), together)
    ]
    return quantity.label, panels
