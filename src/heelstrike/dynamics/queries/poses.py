"""How velocities move a robot, and where its links are, in world axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.queries.evaluation import AnyEvaluation, Evaluation
from heelstrike.dynamics.queries.query import of_position, of_state
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats


@dataclass(frozen=True)
class LinkPoses:
    """Poses of all links in the world."""

    origin: Floats
    """(nl, 2) Position (x, z) of each link frame, in metres."""
    angle: Floats
    """(nl,) Rotation of each link about +y from the reference configuration, in rad."""
    center_of_mass: Floats
    """(nl, 2) Position (x, z) of each link's centre of mass, in metres."""


@of_position("LinkPoses: In m and rad; SpatialPoses in space.")
def link_poses(at: Evaluation) -> LinkPoses:
    """Poses of all links in the world."""
    work = at.work
    c, s = work.cosine, work.sine
    x, z = at.model.center_of_mass.T
    center = work.origin + np.column_stack((c * x + s * z, c * z - s * x))
    return LinkPoses(work.origin, work.angle, center)


@dataclass(frozen=True)
class LinkVelocities:
    """Velocities of all links in the world."""

    origin: Floats
    """(nl, 2) Velocity (x, z) of each link frame's origin, in m/s."""
    angular: Floats
    """(nl,) Angular velocity of each link about +y, in rad/s."""
    center_of_mass: Floats
    """(nl, 2) Velocity (x, z) of each link's centre of mass, in m/s."""


@of_state("LinkVelocities: In m/s and rad/s; SpatialVelocities in space.")
def link_velocities(at: Evaluation) -> LinkVelocities:
    """Velocities of all links in the world."""
    poses = link_poses.at(at)
    angular = at.work.velocity[:, 0].copy()

    def of(points: Floats) -> Floats:
        x, z = (points - at.work.pivot).T
        velocity: Floats = at.work.velocity[:, 1:] + np.column_stack((angular * z, -angular * x))
        return velocity

    return LinkVelocities(of(poses.origin), angular, of(poses.center_of_mass))


@of_state("(nq,) float: In m and rad.")
def integrate(at: AnyEvaluation, time: float) -> Floats:
    """Position after a time at a constant velocity."""
    return at.filled(at.q.shape, at.kernels.integrate, at.model, at.q, at.v, float(time))


@of_position("(nv,) float: In m and rad, in a unit of time.")
def difference(at: AnyEvaluation, end: ArrayLike) -> Floats:
    """Velocity that takes a position to another, `end`, in a unit of time, the shortest way."""
    to = at.position("end", end)
    return at.filled((at.model.nv,), at.kernels.difference, at.model, at.q, to)
