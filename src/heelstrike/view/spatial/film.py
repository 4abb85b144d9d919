"""The picture of a run in space at one instant, redrawn frame by frame on a single canvas."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.analysis.spatial.links import link_motion
from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.view.arrows import draw_scale
from heelstrike.view.canvas import Canvas
from heelstrike.view.film import evened, instants, legend_of
from heelstrike.view.spatial.body import SpatialBody
from heelstrike.view.spatial.camera import FAR_AWAY, Camera
from heelstrike.view.spatial.forces import middle_of_pressure, shown_forces
from heelstrike.view.spatial.stage import Instant, Stage

LOOKED_AT = 60
"""Frames in which it is looked at how much room the robot takes."""


PRESSURE = "zero moment point, support"
"""What is told by the diamond and what lies about it."""


class SpatialFilm:
    """A canvas that shows one frame of a run in space after the other.

    The camera keeps its direction and follows the centre of mass along the ground.

    Parameters
    ----------
    run : SpatialRun
        The run.
    size : (int, int)
        Width and height of the picture, in pixels.
    fps : float
        Frames a second.
    speed : float
        Simulated seconds a second.
    """

    def __init__(self, run: SpatialRun, size: tuple[int, int], fps: float, speed: float) -> None:
        self.size = size
        interval = speed / fps
        self._time, rows = instants(run, interval)
        self._canvas = canvas = Canvas(size, speed)
        axes, scale, font = canvas.axes, canvas.scale, canvas.font
        self._stage = Stage(axes, run.robot, run.ground, width=scale)
        self._motion = link_motion(run, rows)
        self._support = spatial_zero_moment_point(run, rows).polygon
        self._forces = shown_forces(run, rows, since=True)
        self._pressure = middle_of_pressure(self._forces, run.robot.weight)
        self._cameras = self._follow(interval)
        self._frame_view(axes, size)
        before = set(axes.get_children())
        if run.robot.nc:
            (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
            place = np.array([left + 0.05 * (right - left), low + 0.12 * (high - low)])
            draw_scale(
                axes, place, self._stage.body.size, run.robot.weight, width=2.5 * scale,
                fontsize=0.85 * font,
            )  # fmt: skip
        scale_of_forces = [each for each in axes.get_children() if each not in before]
        canvas.figure.legend(
            handles=legend_of(run.robot, forces=run.robot.nc > 0, pressure=PRESSURE),
            loc="upper right", fontsize=0.85 * font, labelspacing=0.35, frameon=False,
        )  # fmt: skip
        canvas.begin([*self._stage.artists, *scale_of_forces])

    def __len__(self) -> int:
        return len(self._time)

    def draw(self, index: int) -> memoryview:
        """Draw a frame; return its pixels, four bytes each, valid until the next one."""
        self._stage.show(self._instant(index), self._cameras[index])
        return self._canvas.drawn(self._time[index])

    def _instant(self, index: int) -> Instant:
        motion = self._motion
        return Instant(
            corners=self._stage.body.placed(motion.origin[index], motion.rotation[index]),
            place=self._forces.place[index],
            force=self._forces.force[index],
            center=motion.center_of_mass[index],
            pressure=self._pressure[index],
            support=self._support[index],
        )

    def _follow(self, interval: float) -> list[Camera]:
        """One camera a frame, which looks at the middle of the robot above the ground."""
        center = self._motion.center_of_mass
        size = self._stage.body.size
        target = self._stage.below(
            np.stack([evened(center[:, k], interval) for k in range(3)], axis=1)
        )
        highest = float(np.nanmax(center[:, 2] - target[:, 2]))
        target[:, 2] += min(0.8 * highest, 0.55 * size)
        return [Camera(place, FAR_AWAY * size) for place in target]

    def _frame_view(self, axes: Any, size: tuple[int, int]) -> None:
        """Choose limits that hold the robot in all frames."""
        body: SpatialBody = self._stage.body
        every = max(1, len(self) // LOOKED_AT)
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for index in range(0, len(self), every):
            corners = body.placed(self._motion.origin[index], self._motion.rotation[index])
            seen, _ = self._cameras[index].seen(corners)
            if len(seen):
                low, high = np.fmin(low, seen.min(axis=0)), np.fmax(high, seen.max(axis=0))
        if not np.all(np.isfinite(np.append(low, high))):
            low, high = -np.ones(2), np.ones(2)
        room = 0.16 * body.size
        aspect = size[0] / size[1]
        height = max(
            float(high[1] - low[1]) + 2.0 * room,
            2.2 * float(np.abs((low, high))[:, 0].max()) / aspect,
        )
        middle = 0.5 * float(low[1] + high[1])
        axes.set(
            xlim=(-0.5 * height * aspect, 0.5 * height * aspect),
            ylim=(middle - 0.5 * height, middle + 0.5 * height),
        )
