"""Where the links of a robot are and how they move, in world axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.evaluation import Floats, evaluated
from heelstrike.robot.robot import Robot


@dataclass(frozen=True)
class LinkPoses:
    """Poses of all links in the world.

    Attributes
    ----------
    origin : (nv, 2) float
        Position (x, z) of each link frame, in metres.
    angle : (nv,) float
        Rotation of each link about +y from the reference configuration, in rad.
    center_of_mass : (nv, 2) float
        Position (x, z) of each link's centre of mass, in metres.
    """

    origin: Floats
    angle: Floats
    center_of_mass: Floats


def link_poses(robot: Robot, q: ArrayLike) -> LinkPoses:
    """Poses of all links in the world."""
    work = evaluated(robot, q)
    c, s = work.cosine, work.sine
    x, z = robot.model.center_of_mass.T
    center = work.origin + np.column_stack((c * x + s * z, c * z - s * x))
    return LinkPoses(work.origin, work.angle, center)


@dataclass(frozen=True)
class LinkVelocities:
    """Velocities of all links in the world.

    Attributes
    ----------
    origin : (nv, 2) float
        Velocity (x, z) of each link frame's origin, in m/s.
    angular : (nv,) float
        Angular velocity of each link about +y, in rad/s.
    center_of_mass : (nv, 2) float
        Velocity (x, z) of each link's centre of mass, in m/s.
    """

    origin: Floats
    angular: Floats
    center_of_mass: Floats


def link_velocities(robot: Robot, q: ArrayLike, v: ArrayLike) -> LinkVelocities:
    """Velocities of all links in the world."""
    work = evaluated(robot, q, v)
    poses = link_poses(robot, q)
    angular = work.velocity[:, 0].copy()

    def at(points: Floats) -> Floats:
        x, z = (points - work.pivot).T
        velocity: Floats = work.velocity[:, 1:] + np.column_stack((angular * z, -angular * x))
        return velocity

    return LinkVelocities(at(poses.origin), angular, at(poses.center_of_mass))
