"""Where the links of a robot in space and its centre of mass are, in some rows of a run."""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.spatial.motion import centroidal_motion
from heelstrike.dynamics import spatial
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.spatial.run import SpatialRun


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """Motion of a robot in space, in world axes, in some rows of a run."""

    origin: Floats
    """(n, nl, 3) Position of every link frame, in m."""
    rotation: Floats
    """(n, nl, 3, 3) Rotation of every link: its axes, in the world's, are the columns."""
    center_of_mass: Floats
    """(n, 3) Position of the robot's centre of mass, in m."""
    center_of_mass_velocity: Floats
    """(n, 3) Its velocity, in m/s."""


def link_motion(run: SpatialRun, rows: Integers | None = None) -> LinkMotion:
    """Follow the robot of a run through some of its rows.

    Parameters
    ----------
    run : SpatialRun
        The run.
    rows : (n,) int, optional
        Which rows; all by default.

    Returns
    -------
    LinkMotion
        Where links and centre of mass are in each.
    """
    robot = run.robot
    chosen = np.arange(len(run.time)) if rows is None else rows
    origin = np.zeros((len(chosen), robot.nl, 3))
    rotation = np.zeros((len(chosen), robot.nl, 3, 3))
    for i, row in enumerate(chosen.tolist()):
        poses = spatial.link_poses(robot, run.position[row])
        origin[i], rotation[i] = poses.origin, poses.rotation
    whole = centroidal_motion(run)
    velocity = whole.momentum[chosen, :3] / max(robot.total_mass, 1e-300)
    return LinkMotion(origin, rotation, whole.center_of_mass[chosen], velocity)
