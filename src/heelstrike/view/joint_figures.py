"""What the joints do: positions, velocities, torques (paper Figures 3 and 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from heelstrike.analysis.tracking import reference_motion
from heelstrike.errors import ViewError
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run
from heelstrike.view.drawing import legs
from heelstrike.view.impacts import NOTE, scale_without_impacts
from heelstrike.view.style import (
    BOUND,
    FOOT_COLORS,
    GREY,
    INK,
    figure_title,
    legend_above,
    new_figure,
    time_axis,
)

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

Floats = NDArray[np.float64]

REFERENCE: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 3)), "linewidth": 1.0}


def draw_tracking(run: Run, gait: Gait | None, rows: slice) -> Figure:
    """Joint positions and their references."""
    joints = run.robot.model.actuator_joint
    reference = None if gait is None else reference_motion(run, gait).position
    figure, panels = _panels(run.robot)
    figure_title(figure, run.robot, "joint positions")
    _draw_joints(run, panels, run.position[:, joints], reference, rows, ("rad", "m"))
    return figure


def draw_velocities(run: Run, gait: Gait | None, rows: slice) -> Figure:
    """Joint velocities and their references."""
    joints = run.robot.model.actuator_joint
    reference = None if gait is None else reference_motion(run, gait).velocity
    figure, panels = _panels(run.robot)
    figure_title(figure, run.robot, "joint velocities")
    _draw_joints(run, panels, run.velocity[:, joints], reference, rows, ("rad/s", "m/s"))
    return figure


def draw_torque(run: Run, gait: Gait | None, rows: slice) -> Figure:  # noqa: ARG001
    """Joint torques, held from row to row, and their limits."""
    model = run.robot.model
    figure, panels = _panels(run.robot)
    cut = False
    for i, axes in enumerate(panels):
        torque = run.torque[:, i]
        axes.plot(run.time[rows], torque[rows], color=_color(run.robot, i), drawstyle="steps-post")
        unit = "N m" if _turns(run.robot, i) else "N"
        axes.set_ylabel(unit)
        cut |= scale_without_impacts(axes, run, [torque], rows)
        limits = [
            float(bound[i])
            for bound in (model.torque_lower, model.torque_upper)
            if np.isfinite(bound[i])
        ]
        low, high = axes.get_ylim()
        for limit in limits:
            axes.axhline(limit, **BOUND)
        if limits:
            text = " … ".join(f"{limit:g}" for limit in limits).replace("-", "−")
            axes.set_title(f"limits {text} {unit}", loc="right", fontsize=8.5, color=GREY)
        axes.set_ylim(low, high)
    _finish(run, panels, rows)
    figure_title(figure, run.robot, "joint torques", note=NOTE if cut else "")
    return figure


def _panels(robot: Robot) -> tuple[Figure, list[Axes]]:
    """One panel a joint, a column a leg where the legs have the same joints."""
    count = robot.nu
    if not count:
        raise ViewError(f"robot {robot.name!r} has no actuators: there are no joints to show")
    leg = legs(robot)[robot.model.actuator_joint]
    columns = min(2, count)
    order = list(range(count))
    each = [np.flatnonzero(leg == foot).tolist() for foot in sorted(set(leg.tolist()))]
    if len(each) == 2 and len(each[0]) == len(each[1]) and -1 not in leg:
        order = [i for pair in zip(*each, strict=True) for i in pair]
    height = -(-count // columns)
    figure = new_figure(9.0, 1.2 + 1.9 * height)
    grid = figure.subplots(height, columns, sharex=True, squeeze=False).ravel()
    for spare in grid[count:]:
        spare.set_visible(False)
    panels: list[Axes] = [grid[order.index(i)] for i in range(count)]
    for i, axes in enumerate(panels):
        axes.set_title(robot.actuator_names[i].replace("_", " "), loc="left")
    return figure, panels


def _draw_joints(
    run: Run,
    panels: list[Axes],
    measured: Floats,
    reference: Floats | None,
    rows: slice,
    units: tuple[str, str],
) -> None:
    for i, axes in enumerate(panels):
        axes.plot(
            run.time[rows],
            measured[rows, i],
            color=_color(run.robot, i),
            linewidth=2.2,
            alpha=0.85,
            label="measured",
        )
        if reference is not None:
            axes.plot(run.time[rows], reference[rows, i], label="reference", **REFERENCE)
        axes.set_ylabel(units[0] if _turns(run.robot, i) else units[1])
    _finish(run, panels, rows)


def _finish(run: Run, panels: list[Axes], rows: slice) -> None:
    for axes in panels:
        place = axes.get_subplotspec()
        time_axis(axes, run.time[rows], labelled=place is None or place.is_last_row())
    legend_above(panels[0], right=True)


def _turns(robot: Robot, actuator: int) -> bool:
    return bool(robot.model.axis[robot.model.actuator_joint[actuator], 0] != 0.0)


def _color(robot: Robot, actuator: int) -> str:
    foot = int(legs(robot)[robot.model.actuator_joint[actuator]])
    return INK if foot < 0 else FOOT_COLORS[foot % len(FOOT_COLORS)]
