"""The figure of an identified robot: numbers against the file, torques against the motion."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from heelstrike.experiments.identification.identify import COVERING, Identified
from heelstrike.view.style import BLUE, GREY, INK, VERMILION, new_figure, styled

WIDTH, ROW, LEAST, TORQUES = 9.0, 0.22, 2.0, 2.2
"""Inches: width, height of a number, least height of all numbers, height of a panel of torques."""
MOST_JOINTS = 6
"""Joints whose torques are drawn."""


def draw_identified(found: Identified) -> Figure:
    """Draw what a motion tells of a robot.

    Parameters
    ----------
    found : Identified
        What it tells.

    Returns
    -------
    Figure
        Above, how far each number that is told is from the file's, in parts of the larger of the
        two; below, torques that were measured and those that follow from the motion.
    """
    told = [each for each in found.numbers if each.told]
    joints = min(found.torque[0][1].shape[1], MOST_JOINTS)
    down = -(-joints // 2)
    heights = [max(LEAST, ROW * len(told)), *[TORQUES] * down]
    with styled():
        figure = new_figure(WIDTH, sum(heights))
        grid = figure.add_gridspec(1 + down, 2, height_ratios=heights)
        _numbers(figure.add_subplot(grid[0, :]), found)
        for k in range(joints):
            _torque(figure.add_subplot(grid[1 + k // 2, k % 2]), found, k)
    return figure


def _numbers(axes: Axes, found: Identified) -> None:
    """Draw how far each number is from the file's, in parts of its size."""
    told = [each for each in found.numbers if each.told]
    for place, each in enumerate(told):
        size = max(abs(each.assumed), abs(each.value), COVERING * each.deviation)
        ends = [100.0 * (end - each.assumed) / size for end in (each.low, each.high)]
        axes.plot(ends, (place, place), color=GREY, linewidth=1.4)
        axes.plot(100.0 * (each.value - each.assumed) / size, place, "o", color=BLUE, markersize=4)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    axes.set_yticks(range(len(told)), [each.name for each in told], parse_math=False)
    axes.set_xscale("symlog", linthresh=1.0)
    axes.set_xticks([-100, -10, -1, 0, 1, 10, 100], ["−100", "−10", "−1", "0", "1", "10", "100"])
    axes.set_xlim(-220.0, 220.0)
    axes.tick_params(axis="y", labelsize=8.0)
    axes.invert_yaxis()
    axes.set_title("difference from the file (%), with intervals that hold in 95 %", loc="left")


def _torque(axes: Axes, found: Identified, joint: int) -> None:
    for number, (time, measured, made) in enumerate(found.torque):
        words = ("measured", "from the motion") if number == 0 else (None, None)
        axes.plot(time, measured[:, joint], color=GREY, linewidth=2.2, label=words[0])
        axes.plot(time, made[:, joint], color=VERMILION, linewidth=1.0, label=words[1])
    name = found.joints[joint].replace("_", " ")
    axes.set_title(f"{name} (N m)", loc="left", parse_math=False)
    axes.set_xlabel("time (s)")
    if joint == 0:
        axes.legend(loc="best")
