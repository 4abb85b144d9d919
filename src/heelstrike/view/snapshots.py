"""A strip of the robot in the course of one step."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.support import walking_steps
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.run import Run
from heelstrike.view.arrows import Arrows, draw_scale
from heelstrike.view.drawing import body, extent, leg_labels
from heelstrike.view.panels import Excerpt, impact_rows
from heelstrike.view.style import FORCE_COLOR, PALE, figure_title, new_figure

POSES = 7


def draw_snapshots(excerpt: Excerpt) -> Figure:
    """The robot at equal times of one step, side by side, with the forces on it."""
    run = excerpt.run
    motion = run_motion(run)
    shape = body(run.robot)
    start, end = _middle_step(run, excerpt.rows)
    at = _usual_rows(run, np.linspace(start, end, POSES))
    segments = shape.segments(motion.link_origin[at], motion.link_angle[at])
    center = motion.center_of_mass[at, 0]
    height = float(run.ground.height(center[POSES // 2]))
    origin = np.column_stack((center, np.full(POSES, height)))
    low, high = extent(segments - origin[:, None, None])
    size = max(float(high[1]), 0.5 * float((high - low).max()), 1e-3)
    spacing = max(float(high[0] - low[0]), 0.3 * size) + 0.12 * size
    figure = new_figure(9.0, 3.6)
    axes = figure.add_subplot()
    shift = np.column_stack((spacing * np.arange(POSES), np.zeros(POSES))) - origin
    for i, row in enumerate(at):
        axes.add_collection(shape.drawn(segments[i] + shift[i], 0.55))
        surface = run.ground.outline(center[i] - 0.5 * spacing, center[i] + 0.5 * spacing)
        below = surface - [0.0, 0.02 * size]
        axes.fill(*(np.concatenate((surface, below[::-1])) + shift[i]).T, color=PALE, zorder=0)
        axes.annotate(
            f"{run.time[row]:.2f} s",
            (i * spacing, float(run.ground.height(center[i])) - height),
            xytext=(0.0, -10.0),
            textcoords="offset points",
            ha="center",
            va="top",
        )
    left = -0.5 * spacing
    if run.robot.nc:
        foot = (run.contact_point[at] + shift[:, None]).reshape(-1, 2)
        arrows = Arrows(axes, size, run.robot.weight, width=1.6)
        arrows.show(foot, run.world_force[at].reshape(-1, 2))
        left -= 0.25 * size
        place = np.array([left + 0.12 * size, 0.0])
        draw_scale(axes, place, size, run.robot.weight, width=1.6, fontsize=10.0)
    axes.set(
        xlim=(left, (POSES - 0.5) * spacing),
        ylim=(float(low[1]) - 0.14 * size, float(high[1]) + 0.05 * size),
        aspect="equal",
    )
    axes.set_axis_off()
    figure_title(figure, run.robot, f"from {start:.2f} s to {end:.2f} s")
    handles = [
        Line2D([], [], color=color, lw=3.0, label=label)
        for color, label in (*leg_labels(run.robot), (FORCE_COLOR, "contact force"))
    ]
    figure.legend(handles=handles, loc="upper right", ncols=len(handles))
    return figure


def _usual_rows(run: Run, times: Floats) -> Integers:
    """Rows at the given times, but the impacts' ones: after the first, before the last."""
    usual = np.flatnonzero(~impact_rows(run))
    if not len(usual):
        usual = np.arange(len(run.time))
    place = np.searchsorted(run.time[usual], times - 1e-9)
    last = np.searchsorted(run.time[usual], times[-1] + 1e-9) - 1
    return np.asarray(usual[np.clip(place, 0, max(last, 0))])


def _middle_step(run: Run, rows: slice) -> tuple[float, float]:
    """Start and end of the middle one of the steps that are no mere stumble.

    The steps are what touchdowns divide the rows into: all of them if there are none.
    """
    first, last = float(run.time[rows.start]), float(run.time[rows.stop - 1])
    inside = [s.touchdown for s in walking_steps(run) if first < s.touchdown < last]
    steps = list(pairwise((first, *inside, last)))
    longest = max(end - start for start, end in steps)
    lasting = [(start, end) for start, end in steps if end - start >= 0.5 * longest]
    return lasting[len(lasting) // 2]
