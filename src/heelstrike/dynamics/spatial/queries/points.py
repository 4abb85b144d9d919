"""Where points of a robot in space are and how they move, in world axes.

A point is given by its link (index, or name of the body) and its place `local` (x, y, z) in the
axes of that link, in metres.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.queries import points
from heelstrike.dynamics.queries.evaluation import contact_indices
from heelstrike.dynamics.queries.query import of_position, of_space
from heelstrike.dynamics.spatial import kinematics, rows
from heelstrike.dynamics.spatial.algebra import Vector
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.dynamics.spatial.rotations import Matrix
from heelstrike.robot.model import Floats

UP: Vector = (0.0, 0.0, 1.0)
"""Normal of level ground."""

WORLD_AXES: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
ON_LEVEL_GROUND: Matrix = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
"""Normal up, then tangents along x and y."""


@points.point_position.in_space("(3,) float: World position (x, y, z), in m.")
def point_position(at: SpatialEvaluation, link: int | str, local: ArrayLike) -> Floats:
    """Where a point of a link is."""
    return np.array(at.point(link, local)[1])


@points.point_velocity.in_space("(6,) float: Along x, y, z in m/s, and about them in rad/s.")
def point_velocity(at: SpatialEvaluation, link: int | str, local: ArrayLike) -> Floats:
    """Velocity of a point and angular velocity of its link."""
    place, position = at.point(link, local)
    moves = at.run(kinematics.point_velocity, at.work, place, position)
    return np.array([*moves, *at.run(kinematics.angular_velocity, at.work, place)])


@points.point_jacobian.in_space("(6, nv) float: Rows x, y, z and rotations about them, in m and 1.")
def point_jacobian(at: SpatialEvaluation, link: int | str, local: ArrayLike) -> Floats:
    """Jacobian of a point of a link and of the link's rotation.

    Times v its rows give the velocity of the point and of its link's rotation; its transpose takes
    a force at the point and a moment, six numbers, to the generalised force.
    """
    place, position = at.point(link, local)
    result = at.zeros(6, at.model.nv)
    result[:3] = _rows(at, place, position, WORLD_AXES)
    for k in at.model.chain[at.model.last_velocity[place]]:
        if k >= 0:
            result[3:, k] = at.work.motion[k, :3]
    return result


@points.point_bias_acceleration.in_space(
    "(6,) float: Along x, y, z in m/s², and about them in rad/s²."
)
def point_bias_acceleration(at: SpatialEvaluation, link: int | str, local: ArrayLike) -> Floats:
    """J̇v of :func:`point_jacobian`: the acceleration at v̇ = 0."""
    place, position = at.point(link, local)
    moves = at.run(kinematics.point_bias, at.work, place, position)
    return np.array([*moves, *at.work.bias_acceleration[place, :3]])


@points.contact_positions.in_space("(k, 3) float: World positions (x, y, z), in m.")
def contact_positions(at: SpatialEvaluation, contacts: Iterable[int | str] | None = None) -> Floats:
    """Where the centres of the contact spheres and rims are."""
    found = contact_indices(at.robot, contacts)
    centers = [at.run(rows.contact_center, at.model, at.work, each) for each in found]
    return np.array(centers).reshape(-1, 3)


@of_space
@of_position("(k, 3) float: World positions (x, y, z), in m.")
def lowest_positions(at: SpatialEvaluation, contacts: Iterable[int | str] | None = None) -> Floats:
    """Where the lowest points of the contact spheres and rims are."""
    found = contact_indices(at.robot, contacts)
    lowest = [at.run(rows.contact_point, at.model, at.work, each, UP) for each in found]
    return np.array(lowest).reshape(-1, 3)


@points.contact_jacobian.in_space(
    "(k, 3, nv) float: Rows normal (up) and tangents along x and y, in m and 1."
)
def contact_jacobian(at: SpatialEvaluation, contacts: Iterable[int | str] | None = None) -> Floats:
    """Jacobian of the contact points on level ground: of the lowest point of each sphere or rim."""
    found = contact_indices(at.robot, contacts)
    result = at.zeros(len(found), 3, at.model.nv)
    for block, contact in zip(result, found, strict=True):
        lowest = at.run(rows.contact_point, at.model, at.work, contact, UP)
        link = int(at.model.contact_link[contact])
        block[:] = _rows(at, link, lowest, ON_LEVEL_GROUND)
    return result


@points.contact_bias_acceleration.in_space("(k, 3) float: Normal (up) and along x and y, in m/s².")
def contact_bias_acceleration(
    at: SpatialEvaluation, contacts: Iterable[int | str] | None = None
) -> Floats:
    """J̇v of :func:`contact_jacobian`.

    It belongs to the gap and to the sliding velocity of each sphere or rim: a sphere that rolls on
    the ground has neither.
    """
    found = contact_indices(at.robot, contacts)
    result = at.zeros(len(found), 3)
    for row, contact in zip(result, found, strict=True):
        x, y, z = at.run(rows.contact_bias, at.model, at.work, contact, UP)
        row[:] = z, x, y
    return result


def _rows(at: SpatialEvaluation, link: int, position: Vector, frame: Matrix) -> Any:
    """Rows (3, nv) of the Jacobian of a point, in the axes of a frame."""
    along = at.zeros(3, at.model.longest)
    at.run(rows.write_point_rows, at.model, at.work, link, position, frame, 0, along)
    last = int(at.model.last_velocity[link])
    count = int(at.model.depth[last]) + 1
    result = at.zeros(3, at.model.nv)
    result[:, at.model.chain[last, :count]] = along[:, :count]
    return result
