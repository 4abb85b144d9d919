"""What happens between feet and ground (paper Figures 5 and 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from heelstrike.analysis.friction import friction_coefficient, friction_use
from heelstrike.analysis.support import pushing_feet
from heelstrike.analysis.zero_moment_point import zero_moment_point, zero_moment_point_limits
from heelstrike.errors import ViewError
from heelstrike.sim.run import Run
from heelstrike.view.impacts import NOTE, scale_without_impacts
from heelstrike.view.style import (
    BOUND,
    FOOT_COLORS,
    PALE,
    figure_title,
    legend_above,
    new_figure,
    time_axis,
)

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

Floats = NDArray[np.float64]


def draw_zero_moment_point(run: Run, gait: Gait | None, rows: slice) -> Figure:  # noqa: ARG001
    """Zero moment point of the foot that carries the robot alone, in its frame."""
    _need_feet(run)
    zmp = zero_moment_point(run)
    alone = np.where(zmp.single_support[:, None], zmp.foot, np.nan)[rows]
    heel, toe = zero_moment_point_limits(run.robot)
    figure = new_figure(9.0, 3.8)
    axes = figure.add_subplot()
    for i, foot in enumerate(run.robot.feet):
        axes.plot(run.time[rows], alone[:, i], color=_color(i), label=_name(foot.name))
    axes.axhline(heel, label="heel and toe", **BOUND)
    axes.axhline(toe, **BOUND)
    reach = max(toe - heel, 1e-3)
    axes.set_ylim(heel - 0.15 * reach, toe + 0.15 * reach)
    axes.set_ylabel("ahead of the ankle (m)")
    time_axis(axes, run.time[rows])
    figure_title(figure, run.robot, "zero moment point of the stance foot in single support")
    legend_above(axes)
    return figure


def draw_friction(run: Run, gait: Gait | None, rows: slice) -> Figure:  # noqa: ARG001
    """Tangential force of each foot while it pushes, and what friction allows."""
    _need_feet(run)
    allowed = friction_coefficient(run) * run.contact_force[..., 0]
    figure, panels = _foot_panels(run)
    pushes = pushing_feet(run)
    time = run.time[rows]
    cut = False
    for i, (foot, axes) in enumerate(zip(run.robot.feet, panels, strict=True)):
        contacts = list(foot.contacts)
        cone = np.where(pushes[:, i], allowed[:, contacts].sum(axis=1), np.nan)
        force = np.where(pushes[:, i], run.contact_force[:, contacts, 1].sum(axis=1), np.nan)
        axes.fill_between(time, -cone[rows], cone[rows], color=PALE, linewidth=0.0)
        axes.plot(time, cone[rows], label="cone ±μFₙ", **BOUND)
        axes.plot(time, -cone[rows], **BOUND)
        axes.plot(time, force[rows], color=_color(i), label="Fₜ")
        axes.set_title(_name(foot.name), loc="left")
        axes.set_ylabel("force (N)")
        cut |= scale_without_impacts(axes, run, (cone, -cone, force), rows)
        time_axis(axes, time, labelled=axes is panels[-1])
        legend_above(axes, right=True)
    figure_title(
        figure,
        run.robot,
        "tangential force of the ground on the feet",
        note=_cone_note(run, rows, cut),
    )
    return figure


def _cone_note(run: Run, rows: slice, cut: bool) -> str:
    """Say how much of the cone is used at most, impacts included."""
    used = friction_use(run).foot[rows]
    used = used[np.isfinite(used)]
    if not used.size:
        return NOTE if cut else ""
    bound = np.ceil(100.0 * float(used.max()) - 1e-9) / 100.0
    return f"|Fₜ| ≤ {bound:.2f} μFₙ" + (
        f", {NOTE} but not the cone" if cut and bound <= 1.0 else ""
    )


def draw_forces(run: Run, gait: Gait | None, rows: slice) -> Figure:  # noqa: ARG001
    """Normal and tangential force on each foot."""
    _need_feet(run)
    figure = new_figure(9.0, 5.4)
    panels = list(figure.subplots(2, 1, sharex=True, height_ratios=(3, 2)))
    time = run.time[rows]
    cut = False
    for component, (axes, title) in enumerate(
        zip(panels, ("normal", "tangential, positive forward"), strict=True)
    ):
        forces = [
            run.contact_force[:, list(foot.contacts), component].sum(axis=1)
            for foot in run.robot.feet
        ]
        for i, foot in enumerate(run.robot.feet):
            axes.plot(time, forces[i][rows], color=_color(i), label=_name(foot.name))
        if component == 0:
            axes.axhline(run.robot.weight, label="weight of the robot", **BOUND)
        axes.set_title(title, loc="left")
        axes.set_ylabel("force (N)")
        cut |= scale_without_impacts(axes, run, forces, rows)
        time_axis(axes, time, labelled=component == 1)
    legend_above(panels[0], right=True)
    figure_title(figure, run.robot, "force of the ground on the feet", note=NOTE if cut else "")
    return figure


def draw_gaps(run: Run, gait: Gait | None, rows: slice) -> Figure:  # noqa: ARG001
    """Heights of the contact points above the ground."""
    _need_feet(run)
    figure, panels = _foot_panels(run)
    figure_title(figure, run.robot, "height of the contact points above the ground")
    styles = ("solid", (0, (4, 2)), (0, (1, 1.5)), (0, (5, 1, 1, 1)))
    for i, (foot, axes) in enumerate(zip(run.robot.feet, panels, strict=True)):
        for k, contact in enumerate(foot.contacts):
            axes.plot(
                run.time[rows],
                run.gap[rows, contact],
                color=_color(i),
                linestyle=styles[k % len(styles)],
                label=_name(run.robot.contact_names[contact].removeprefix(f"{foot.name}_")),
            )
        axes.set_title(_name(foot.name), loc="left")
        axes.set_ylabel("height (m)")
        time_axis(axes, run.time[rows], labelled=axes is panels[-1])
        legend_above(axes, right=True)
    return figure


def _foot_panels(run: Run) -> tuple[Figure, list[Axes]]:
    count = len(run.robot.feet)
    figure = new_figure(9.0, 0.9 + 2.3 * count)
    panels = list(figure.subplots(count, 1, sharex=True, squeeze=False).ravel())
    return figure, panels


def _need_feet(run: Run) -> None:
    if not run.robot.feet:
        raise ViewError(f"robot {run.robot.name!r} has no feet: there is nothing to show")


def _color(foot: int) -> str:
    return FOOT_COLORS[foot % len(FOOT_COLORS)]


def _name(name: str) -> str:
    return name.replace("_", " ")
