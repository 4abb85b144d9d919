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
    """The soles of a robot's feet, each the least rectangle about its lowest points."""

    link: tuple[int, ...]
    """Link of each foot."""
    middle: Floats
    """(feet, 3) Middle of each, in the axes of its link (m)."""
    axes: Floats
    """(feet, 3, 3) Their directions along, across and up, one a row, in those axes."""
    half: Floats
    """(feet, 2) Half their lengths and widths, which are the shorter (m)."""
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
        The least rectangles about the lowest contact points of each foot.

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
        between, along, lengths = least_rectangle(own[:, :2])
        if min(lengths) < LEAST:
            raise ControllerError(
                f"balance is held on soles, and the foot {foot.name!r} of robot {robot.name!r} "
                "touches the ground along a line or in a point only"
            )
        rotation, lowest = poses.rotation[foot.link], own[:, 2].min()
        middle.append(rotation.T @ (np.array([*between, lowest]) - poses.origin[foot.link]))
        ahead, aside = (*along, 0.0), (-along[1], along[0], 0.0)
        axes.append(np.array([ahead, aside, (0.0, 0.0, 1.0)]) @ rotation)
        half.append(lengths)
        height.append(lowest)
    center = spatial.center_of_mass(robot, posture)
    return Soles(
        tuple(foot.link for foot in robot.feet), np.array(middle), np.array(axes), np.array(half),
        float(center[2] - np.mean(height)),
    )  # fmt: skip


def least_rectangle(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Return middle, long direction and half the lengths of the least rectangle about points.

    It has a side through two of them. They are (n, 2), the answers (2,) each.
    """
    apart = (points[:, None] - points[None]).reshape(-1, 2)
    size = np.linalg.norm(apart, axis=1)
    along = apart[size > 0.0] / size[size > 0.0, None]
    if not len(along):
        return points[0], np.array([1.0, 0.0]), np.zeros(2)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    sides = np.stack([along, across], axis=1)  # of each rectangle
    places = sides @ points.T
    low, high = places.min(axis=2), places.max(axis=2)
    best = int(np.argmin(np.prod(high - low, axis=1)))
    half, middle = 0.5 * (high - low)[best], 0.5 * (high + low)[best] @ sides[best]
    longer = int(np.argmax(half))
    return middle, sides[best, longer], half[[longer, 1 - longer]]
