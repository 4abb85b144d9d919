"""A picture of a robot in space, standing as in its file."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D

from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.dynamics import spatial
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.view.film import legend_of
from heelstrike.view.spatial.camera import FAR_AWAY, Camera
from heelstrike.view.spatial.stage import Instant, Stage
from heelstrike.view.style import INK, new_figure, save_figure, styled

WIDTH, HEIGHT = 5.6, 6.4  # inches
SHARE = 0.8
"""Of the height and width of the picture that the robot may take."""
FEW = 60
"""Contact points up to which each has a mark of the usual size."""


def portrait_in_space(
    robot: SpatialRobot, path: str | os.PathLike[str], *, state: State | None = None
) -> Path:
    """Write a picture of a robot in space; see :func:`heelstrike.view.robot_picture`.

    Parameters
    ----------
    robot : SpatialRobot
        The robot. One that floats is put onto level ground.
    path : str or path
        Picture to write: .png, .pdf or .svg.
    state : State, optional
        How it stands; as in its file by default.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ViewError
        If the file cannot be written.
    """
    q = (robot.reference_state() if state is None else state).q.copy()
    points = spatial.lowest_positions(robot, q)
    if robot.floating and robot.nc and state is None:
        q[2] -= points[:, 2].min()
        points = spatial.lowest_positions(robot, q)
    poses = spatial.link_poses(robot, q)
    with styled():
        page = new_figure(WIDTH, HEIGHT)
        page.set_layout_engine(None)
        axes = page.add_axes((0.0, 0.0, 1.0, 0.9))
        axes.set_axis_off()
        stage = Stage(axes, robot, SpatialGround())
        corners = stage.body.placed(poses.origin, poses.rotation)
        places = np.concatenate((corners, poses.origin))
        low, high = places.min(axis=0), places.max(axis=0)
        camera = Camera(0.5 * (low + high), FAR_AWAY * stage.body.size)
        nothing = np.zeros((0, 3))
        stage.show(
            Instant(
                corners=corners, place=nothing, force=nothing,
                center=spatial.center_of_mass(robot, q), pressure=np.full(3, np.nan),
                support=nothing,
            ),
            camera,
        )  # fmt: skip
        seen, _ = camera.seen(points)
        axes.plot(*seen.T, "^", color=INK, ms=5.0 if robot.nc <= FEW else 1.5, zorder=6)
        shown, _ = camera.seen(places)
        aspect = WIDTH / (0.9 * HEIGHT)
        half = 0.5 * float(max(np.ptp(shown[:, 1]), np.ptp(shown[:, 0]) / aspect)) / SHARE
        x, y = (0.5 * (shown.min(axis=0) + shown.max(axis=0))).tolist()
        axes.set(xlim=(x - half * aspect, x + half * aspect), ylim=(y - half, y + half))
        handles = legend_of(robot, forces=False)
        if robot.nc:
            handles.append(Line2D([], [], marker="^", color=INK, ls="", label="contact point"))
        page.suptitle(
            f"{robot.name}: {robot.total_mass:.4g} kg, {robot.nv} velocities, {robot.nu} actuators"
        )
        page.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.955), ncols=2)
        return save_figure(page, path)
