"""Where the links of a robot in space are and how they move, in world axes."""

from __future__ import annotations

import numpy as np

from heelstrike.dynamics.queries import poses
from heelstrike.dynamics.spatial import kinematics
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats


@dataclass(frozen=True)
class SpatialPoses:
    """Poses of all links in the world."""

    origin: Floats
    """(nl, 3) Position of each link frame, in metres."""
    rotation: Floats
    """(nl, 3, 3) Rotation of each link: its axes, in the world's, are the columns."""
    center_of_mass: Floats
    """(nl, 3) Position of each link's centre of mass, in metres."""


@poses.link_poses.in_space("SpatialPoses: In m, rotations as matrices.")
def link_poses(at: SpatialEvaluation) -> SpatialPoses:
    """Poses of all links in the world."""
    origin = at.work.origin.copy()
    rotation = at.work.rotation.reshape(-1, 3, 3).copy()
    center = origin + (rotation * at.model.center_of_mass[:, None, :]).sum(axis=2)
    return SpatialPoses(origin, rotation, center)


@dataclass(frozen=True)
class SpatialVelocities:
    """Velocities of all links in the world."""

    origin: Floats
    """(nl, 3) Velocity of each link frame's origin, in m/s."""
    angular: Floats
    """(nl, 3) Angular velocity of each link, in world axes, in rad/s."""
    center_of_mass: Floats
    """(nl, 3) Velocity of each link's centre of mass, in m/s."""


@poses.link_velocities.in_space("SpatialVelocities: In m/s and rad/s.")
def link_velocities(at: SpatialEvaluation) -> SpatialVelocities:
    """Velocities of all links in the world."""
    here = link_poses.at(at)
    angular = at.work.velocity[:, :3].copy()

    def of(points: Floats) -> Floats:
        moves = [
            at.run(kinematics.point_velocity, at.work, link, tuple(point))
            for link, point in enumerate(points)
        ]
        return np.array(moves).reshape(-1, 3)

    return SpatialVelocities(of(here.origin), angular, of(here.center_of_mass))
