"""Soles of a robot in space: the rectangles on which its feet stand."""

from __future__ import annotations

import numpy as np

from heelstrike.dynamics import spatial
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.robot import SpatialRobot

LOWEST = 5e-3
"""How far above the lowest contact point of a foot (m) others still belong to its sole."""

LEAST = 1e-3
"""Half a length (m) below which a sole is a line or a point, on which nobody stands."""


@dataclass(frozen=True)
class Soles:
    """The soles of a robot's feet, each a rectangle along the x and y axes of its posture."""

    link: tuple[int, ...]
    """Link of each foot."""
    middle: Floats
    """(feet, 3) Middle of each, in the axes of its link (m)."""
    axes: Floats
    """(feet, 3, 3) Their directions forwards, to the left and up, one a row, in those axes."""
    half: Floats
    """(feet, 2) Half their lengths and widths (m)."""
    height: float
    """Of the robot's centre of mass over them, in the posture (m)."""


def soles_in_space(robot: SpatialRobot, posture: Floats) -> Soles:
    """Find the soles of a robot that stands in a posture on level ground.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    posture : (nq,) float
        Position in which its soles lie flat.

    Returns
    -------
    Soles
        The rectangles about the lowest contact points of each foot.

    Raises
    ------
    ControllerError
        If it has no feet, or one is no surface.
    """
    if not robot.feet:
        raise ControllerError(f"robot {robot.name!r} has no feet to stand on")
    poses = spatial.link_poses(robot, posture)
    points = spatial.lowest_positions(robot, posture)
    middle, axes, half, height = [], [], [], []
    for foot in robot.feet:
        own = points[list(foot.contacts)]
        own = own[own[:, 2] <= own[:, 2].min() + LOWEST]
        low, high = own.min(axis=0), own.max(axis=0)
        if np.any(0.5 * (high - low)[:2] < LEAST):
            raise ControllerError(
                f"balance is held on soles, and the foot {foot.name!r} of robot {robot.name!r} "
                "touches the ground along a line or in a point only"
            )
        rotation = poses.rotation[foot.link]
        between = np.array([*(0.5 * (low + high))[:2], low[2]])
        middle.append(rotation.T @ (between - poses.origin[foot.link]))
        axes.append(rotation)  # whose rows are the axes of the world in those of the link
        half.append(0.5 * (high - low)[:2])
        height.append(low[2])
    center = spatial.center_of_mass(robot, posture)
    return Soles(
        tuple(foot.link for foot in robot.feet), np.array(middle), np.array(axes), np.array(half),
        float(center[2] - np.mean(height)),
    )  # fmt: skip
