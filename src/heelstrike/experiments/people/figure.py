"""The figure of a mimicry: the person's angles beside those of the gait."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from heelstrike.experiments.people.mimicry import Mimicry
from heelstrike.view.style import (
    INK,
    figure_title,
    foot_color,
    in_words,
    legend_above,
    new_figure,
    styled,
)

WIDTH, HEIGHT = 9.0, 2.1
"""Inches: of the figure, and of a row of panels."""
ROOM = 0.9
"""Inches for the title and the axis below."""
FINE = 500
"""Points of a curve."""
PERSON: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 3)), "linewidth": 1.1}
"""How the person is drawn: as references are elsewhere."""


def draw_mimicry(found: Mimicry) -> Figure:
    """Draw the joints of a gait over a stride, in degrees, and the person's beside them.

    Parameters
    ----------
    found : Mimicry
        What :func:`~heelstrike.experiments.people.mimic` returned.

    Returns
    -------
    Figure
        A panel a joint of one leg, and one for the trunk's pitch. The other leg does the same half
        a stride later.
    """
    wanted, motion, robot = found.wanted, found.nearest.motion, found.robot
    time = np.linspace(0.0, wanted.duration, FINE)
    gait = np.rad2deg(motion.position(time)[:, 2:])
    person = np.rad2deg([wanted.position(float(t)) for t in time])
    shown = [*wanted.legs[0], 2]
    right = next(k for k, each in enumerate(robot.feet) if each.link == wanted.legs[0][-1])
    with styled():
        figure = new_figure(WIDTH, ROOM + HEIGHT * 2)
        panels = figure.subplots(2, 2, sharex=True).ravel()
        for axes, joint in zip(panels, shown, strict=True):
            color = foot_color(-1 if joint == 2 else right)
            axes.plot(
                time, gait[:, joint - 2], color=color, linewidth=2.2, alpha=0.85,
                label=f"gait of {robot.name}",
            )  # fmt: skip
            axes.plot(time, person[:, joint - 2], label="person", **PERSON)
            axes.set_title(in_words(robot.joint_names[joint]), loc="left")
            axes.set_ylabel("degrees")
            axes.set_xlim(0.0, wanted.duration)
        for axes in panels[2:]:
            axes.set_xlabel("time since the right foot came down (s)")
        legend_above(panels[1], right=True)
        away = f"{found.nearest.distance:.2g} degrees rms apart in the joints"
        figure_title(figure, robot, "a stride, and the person's", note=away)
    return figure
