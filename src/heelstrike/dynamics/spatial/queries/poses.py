"""How velocities move a robot in space, and where its links are, in world axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.spatial import configurations, kinematics
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation, position_vector
from heelstrike.dynamics.spatial.queries.query import of_position, of_state
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


@of_position("SpatialPoses: In m.")
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


@of_state("SpatialVelocities: In m/s and rad/s, in world axes.")
def link_velocities(at: SpatialEvaluation) -> SpatialVelocities:
    """Velocities of all links in the world."""
    poses = link_poses.at(at)
    angular = at.work.velocity[:, :3].copy()

    def of(points: Floats) -> Floats:
        moves = [
            at.run(kinematics.point_velocity, at.work, link, tuple(point))
            for link, point in enumerate(points)
        ]
        return np.array(moves).reshape(-1, 3)

    return SpatialVelocities(of(poses.origin), angular, of(poses.center_of_mass))


@of_state("(nq,) float: In m and rad, quaternions of length one.")
def integrate(at: SpatialEvaluation, time: float) -> Floats:
    """Position after a time at a constant velocity."""
    return at.filled(at.q.shape, configurations.integrate, at.model, at.q, at.v, float(time))


@of_position("(nv,) float: In m and rad, in a unit of time.")
def difference(at: SpatialEvaluation, end: ArrayLike) -> Floats:
    """Velocity that takes a position to another, `end`, in a unit of time, the shortest way."""
    to = end if at.symbolic else position_vector(at.robot, "end", end)
    return at.filled((at.model.nv,), configurations.difference, at.model, at.q, to)
