"""The picture of a run at one instant, redrawn frame by frame on a single canvas."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from heelstrike.analysis.intervals import mean_between
from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.support import on_ground
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.named_tree import NamedTree
from heelstrike.sim.run import AnyRun, Run
from heelstrike.view.arrows import Arrows, draw_scale
from heelstrike.view.canvas import Canvas
from heelstrike.view.drawing import body, extent, leg_labels
from heelstrike.view.milestones import Milestones
from heelstrike.view.style import (
    FORCE_COLOR,
    GREY,
    ORANGE,
    PALE,
    ZERO_MOMENT_POINT_COLOR,
)

FOLLOWS_WITHIN = 0.6
"""Seconds over which the camera evens out the motion of the centre of mass."""


@dataclass(frozen=True, eq=False)
class Frames:
    """What is to be seen in every frame of a film, in world axes."""

    time: Floats
    """(nf,) Time of each frame, in s."""
    row: Integers
    """(nf,) Row of the run that each frame shows."""
    segments: Floats
    """(nf, ns, 2, 2) The robot."""
    center: Floats
    """(nf, 2) Centre of mass, in m."""
    point: Floats
    """(nf, nc, 2) Contact points, in m."""
    force: Floats
    """(nf, nc, 2) Mean force on the robot at them since the frame before, in N, so that impacts,
    which last one step, are seen with their impulse and not missed between frames."""
    pressure: Floats
    """(nf, 2) Zero moment point of the mean forces, in m; NaN where nothing pushes."""


def frames(run: Run, interval: float) -> Frames:
    """Pick the instants of a run that a film shows, `interval` (s) apart."""
    time, row = instants(run, interval)
    motion = run_motion(run)
    acting = np.concatenate((run.world_force, run.contact_force[..., :1]), axis=-1)
    gained = acting[:-1] * np.diff(run.time)[:, None, None]
    mean = mean_between(run.time, gained, row, acting[row], since=True)
    force, normal = mean[..., :2], mean[..., 2]
    total = normal.sum(axis=1, keepdims=True)
    share = normal / np.where(total > 1e-6 * run.robot.weight, total, np.nan)
    return Frames(
        time=time,
        row=row,
        segments=body(run.robot).segments(motion.link_origin[row], motion.link_angle[row]),
        center=motion.center_of_mass[row],
        point=run.contact_point[row],
        force=force,
        pressure=np.einsum("fc,fck->fk", share, on_ground(run)[row]),
    )


def instants(run: AnyRun, interval: float) -> tuple[Floats, Integers]:
    """Times that are so far apart (s), and the row of the run at or before each."""
    count = int(np.floor((run.time[-1] - run.time[0]) / interval + 1e-9)) + 1
    time = run.time[0] + interval * np.arange(count)
    return time, np.maximum(np.searchsorted(run.time, time + 1e-9, side="right") - 1, 0)


def evened(place: Floats, interval: float) -> Floats:
    """Even out a coordinate (nf,) of what a camera follows, `interval` (s) from frame to frame."""
    reach = min(round(FOLLOWS_WITHIN / interval), len(place) - 1)
    # Straight continuation at both ends, so that the camera neither lags nor stops early.
    padded = np.pad(place, reach, mode="reflect", reflect_type="odd")
    window = np.hanning(2 * reach + 3)[1:-1]
    return np.convolve(padded, window / window.sum(), mode="valid")


def legend_of(
    robot: NamedTree, *, forces: bool, pressure: str = "zero moment point"
) -> list[Line2D]:
    """What the colours and dots of a picture mean, of which `pressure` is one's name."""
    lines, dots = leg_labels(robot), [("o", ORANGE, "centre of mass")]
    if forces:
        lines.append((FORCE_COLOR, "contact force"))
        dots.insert(0, ("D", ZERO_MOMENT_POINT_COLOR, pressure))
    handles = [
        Line2D([], [], color=color, lw=4.0, solid_capstyle="round", label=label)
        for color, label in lines
    ]
    return handles + [
        Line2D([], [], marker=marker, color=color, mec="white", ls="", ms=8, label=label)
        for marker, color, label in dots
    ]


class Film:
    """A canvas that shows one frame after the other.

    Parameters
    ----------
    run : Run
        The run.
    size : (int, int)
        Width and height of the picture, in pixels.
    fps : float
        Frames a second.
    speed : float
        Simulated seconds a second.
    """

    def __init__(self, run: Run, size: tuple[int, int], fps: float, speed: float) -> None:
        self.frames = frames(run, speed / fps)
        self.size = size
        self._ground = run.ground
        self._camera = self._follow(1.0 / fps * speed)
        self._canvas = canvas = Canvas(size, speed)
        axes, scale, font = canvas.axes, canvas.scale, canvas.font
        self._frame_view(size)
        axes.set(xlim=self._x, ylim=self._z)
        self._body = body(run.robot)
        self._soil = Polygon(np.zeros((1, 2)), closed=True, facecolor=PALE, edgecolor=GREY, lw=1.0)
        axes.add_patch(self._soil)
        self._marks = LineCollection([], colors=GREY, linewidths=1.0)
        self._robot = self._body.drawn(np.zeros((0, 2, 2)), scale)
        for collection in (self._marks, self._robot):
            axes.add_collection(collection, autolim=False)
        self._arrows = Arrows(axes, self._size, run.robot.weight, width=2.5 * scale)
        if run.robot.nc:
            place = np.array([0.9 * self._x[0] + 0.1 * self._x[1], 0.45 * self._z[1]])
            weight = run.robot.weight
            draw_scale(axes, place, self._size, weight, width=2.5 * scale, fontsize=0.85 * font)
        (self._pressure,) = axes.plot(
            [], [], "D", color=ZERO_MOMENT_POINT_COLOR, mec="white", ms=9.0 * scale
        )
        (self._center,) = axes.plot([], [], "o", color=ORANGE, mec="white", ms=7.0 * scale)
        self._metres = Milestones(0.9 * font)
        axes.add_artist(self._metres)
        handles = legend_of(run.robot, forces=run.robot.nc > 0)
        canvas.figure.legend(
            handles=handles, loc="upper right", fontsize=0.85 * font, labelspacing=0.35
        )
        canvas.begin([
            self._soil, self._marks, self._metres, self._robot, self._arrows.shafts,
            self._arrows.heads, self._center, self._pressure,
        ])  # fmt: skip

    def __len__(self) -> int:
        return len(self.frames.time)

    def draw(self, index: int) -> memoryview:
        """Draw a frame; return its pixels, four bytes each, valid until the next one."""
        frames, camera = self.frames, self._camera[index]
        self._draw_ground(camera)
        self._body.move(self._robot, frames.segments[index] - camera)
        self._arrows.show(frames.point[index] - camera, frames.force[index])
        for marker, place in (
            (self._pressure, frames.pressure[index] - camera),
            (self._center, frames.center[index] - camera),
        ):
            marker.set_data(place[:1], place[1:])
        return self._canvas.drawn(frames.time[index])

    def _follow(self, interval: float) -> Floats:
        """Place of the camera in the world, (nf, 2): on the ground, ahead with the robot."""
        x = evened(self.frames.center[:, 0], interval)
        return np.column_stack((x, np.asarray(self._ground.height(x))))

    def _frame_view(self, size: tuple[int, int]) -> None:
        """Choose limits that hold the robot in all frames."""
        seen = self.frames.segments - self._camera[:, None, None]
        low, high = extent(seen)
        self._size = max(float(high[1]), float(high[1] - low[1]), 1e-3)
        bottom, top = min(-0.15 * self._size, float(low[1]) - 0.05 * self._size), 1.22 * high[1]
        half = 1.05 * max(abs(float(low[0])), abs(float(high[0])))
        aspect = size[0] / size[1]
        height = max(float(top) - bottom, 2.0 * half / aspect)
        self._z = (bottom, bottom + height)
        self._x = (-0.5 * height * aspect, 0.5 * height * aspect)

    def _draw_ground(self, camera: Floats) -> None:
        left, right = self._x
        outline = self._ground.outline(left + camera[0], right + camera[0]) - camera
        below = self._z[0] - 1.0
        self._soil.set_xy(np.concatenate((outline, [[right, below], [left, below]])))
        marks = np.arange(np.ceil(2.0 * (left + camera[0])), 2.0 * (right + camera[0])) / 2.0
        tall = np.where(marks == np.round(marks), 0.03, 0.015) * self._size
        height = np.asarray(self._ground.height(marks)) - camera[1]
        top = np.column_stack((marks - camera[0], height))
        self._marks.set_segments(list(np.stack((top, top - np.outer(tall, [0.0, 1.0])), axis=1)))
        whole = marks == np.round(marks)
        self._metres.show(marks[whole], top[whole] - [0.0, 0.035 * self._size])
