"""What moves: the frames of a run for ``drawing.js``, as columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.analysis.friction import friction_coefficient
from heelstrike.analysis.motion import Motion, in_world
from heelstrike.analysis.support import carrying, on_ground
from heelstrike.analysis.zero_moment_point import ZeroMomentPoint
from heelstrike.contact.ground import Ground
from heelstrike.dynamics import center_of_mass_velocity
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.push import Push
from heelstrike.sim.run import Run
from heelstrike.view.page.rows import Rows, means


def frames(run: Run, rows: Rows, motion: Motion, zmp: ZeroMomentPoint) -> dict[str, Floats]:
    """Return what ``drawing.js`` draws in each row shown, by the names that it has there."""
    origin, angle = motion.link_origin[rows], motion.link_angle[rows]
    center = motion.center_of_mass[rows]
    velocity = np.array(
        [center_of_mass_velocity(run.robot, run.position[r], run.velocity[r]) for r in rows]
    ).reshape(-1, 2)
    return {
        "pose": np.concatenate((origin, angle[..., None]), axis=-1),
        "point": run.contact_point[rows],
        "normal": run.contact_normal[rows],
        "force": means(run, run.world_force, rows),
        "friction": friction_coefficient(run)[rows],
        "center": center,
        "capture": capture_point(run.robot, run.ground, center, velocity),
        "pressure": zmp.total[rows],
        "support": support_ends(run)[rows],
        "push": pushed(run.robot, run.pushes, run.time[rows], origin, angle),
    }


def capture_point(robot: Robot, ground: Ground, center: Floats, velocity: Floats) -> Floats:
    """Where a foot would have to stand to bring the robot to rest above it, (..., 2), in m.

    Of the linear inverted pendulum: x + ẋ √(h/g), h being the height of the centre of mass above
    the ground below it (Pratt, Carff, Drakunov, Goswami 2006). NaN where that is negative.

    Parameters
    ----------
    robot : Robot
        The robot, for gravity.
    ground : Ground
        The ground.
    center, velocity : (..., 2) float
        Of the centre of mass (m, m/s).
    """
    gravity = max(float(np.hypot(*robot.model.gravity)), 1e-12)
    height = center[..., 1] - ground.height(center[..., 0])
    with np.errstate(invalid="ignore"):
        x = center[..., 0] + velocity[..., 0] * np.sqrt(height / gravity)
    return np.stack((x, np.where(np.isfinite(x), ground.height(np.nan_to_num(x)), np.nan)), axis=-1)


def support_ends(run: Run) -> Floats:
    """First and last of the points on the ground in every row, (nt, 4): x, z, x, z in m."""
    if not run.robot.nc:
        return np.full((len(run.time), 4), np.nan)
    touching, place = carrying(run), on_ground(run)
    row = np.arange(len(run.time))
    x = place[..., 0]
    first = np.where(touching, x, np.inf).argmin(axis=1)
    last = np.where(touching, x, -np.inf).argmax(axis=1)
    ends = np.concatenate((place[row, first], place[row, last]), axis=-1)
    return np.where(touching.any(axis=1, keepdims=True), ends, np.nan)


def pushed(
    robot: Robot, pushes: Sequence[Push], time: Floats, origin: Floats, angle: Floats
) -> Floats:
    """Where pushes act and their forces, (n, 4 a push): x, z in m, then N; zero when they rest."""
    found = np.zeros((len(time), len(pushes), 4))
    for i, push in enumerate(pushes):
        link, place = push.place(robot)
        found[:, i, :2] = in_world(origin[:, link], angle[:, link], np.array(place))
        acts = (time >= push.start) & (time < push.end)
        found[:, i, 2:] = np.where(acts[:, None], push.force, 0.0)
    return found.reshape(len(time), -1)
