"""What the joints do: positions, velocities, torques (paper Figures 3 and 4)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure

from heelstrike.analysis.tracking import reference_motion
from heelstrike.errors import ViewError
from heelstrike.robot.named_tree import legs
from heelstrike.view.panels import Curve, Excerpt, Panel, draw_panels
from heelstrike.view.style import INK, foot_color, in_words, limits_in_words

REFERENCE: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 3)), "linewidth": 1.0}


def _draw_motion(excerpt: Excerpt, what: Literal["position", "velocity"]) -> Figure:
    """Joint positions or velocities, and their references."""
    run = excerpt.run
    values = getattr(run, what)[:, run.robot.model.actuator_joint]
    units = ("rad", "m") if what == "position" else ("rad/s", "m/s")
    gait = excerpt.gait
    reference = None if gait is None else getattr(reference_motion(run, gait), what)

    def panel(joint: int, color: str, turns: bool) -> Panel:
        look = {"color": color, "linewidth": 2.2, "alpha": 0.85}
        curves = [Curve(values[:, joint], "simulated", look)]
        if reference is not None:
            curves.append(Curve(reference[:, joint], "reference", REFERENCE))
        return Panel(units[not turns], curves, in_words(run.robot.actuator_names[joint]))

    title = f"joint {'positions' if what == 'position' else 'velocities'}"
    return _draw_joints(excerpt, title, panel)


def draw_tracking(excerpt: Excerpt) -> Figure:
    """Joint positions with the gait's reference (paper Figure 3)."""
    return _draw_motion(excerpt, "position")


def draw_velocities(excerpt: Excerpt) -> Figure:
    """Joint velocities with the gait's reference (paper Figure 4)."""
    return _draw_motion(excerpt, "velocity")


def draw_torque(excerpt: Excerpt) -> Figure:
    """Joint torques with their limits, held from row to row."""
    run, model = excerpt.run, excerpt.run.robot.model

    def panel(joint: int, color: str, turns: bool) -> Panel:
        unit = "N m" if turns else "N"
        ends = np.array([model.torque_lower[joint], model.torque_upper[joint]])
        limits = ends[np.isfinite(ends)].tolist()
        return Panel(
            unit,
            [Curve(run.torque[:, joint], look={"color": color, "drawstyle": "steps-post"})],
            in_words(run.robot.actuator_names[joint]),
            remark=limits_in_words(limits, unit),
            bounds={"": limits},
            impacts=False,
        )

    return _draw_joints(excerpt, "joint torques", panel)


def _draw_joints(excerpt: Excerpt, title: str, panel: Callable[[int, str, bool], Panel]) -> Figure:
    """One panel a joint, a column a leg where the legs have the same joints."""
    robot = excerpt.run.robot
    joints = robot.model.actuator_joint
    if not robot.nu:
        raise ViewError(f"robot {robot.name!r} has no actuators: there are no joints to show")
    leg = legs(robot)[joints]
    order = np.arange(robot.nu)
    each = [np.flatnonzero(leg == foot) for foot in np.unique(leg)]
    if len(each) == 2 and len(each[0]) == len(each[1]) and -1 not in leg:
        order = np.column_stack(each).ravel()
    turns = robot.model.axis[joints, 0] != 0.0
    panels = [panel(int(i), foot_color(int(leg[i])), bool(turns[i])) for i in order]
    columns = min(2, robot.nu)
    height = 1.2 + 1.9 * -(-robot.nu // columns)
    return draw_panels(excerpt, title, panels, height=height, columns=columns, legends=False)
