"""Where points of a robot are and how they move.

A point is given by its link (index, or name of the body) and its place `local` (x, z) in the axes
of that link, in metres. Results are in world axes: x forward, z up, rotations about +y.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics import kernels
from heelstrike.dynamics.evaluation import (
    Floats,
    evaluated,
    joint_vector,
    link_index,
    plane_vector,
)
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.robot import Robot


def point_position(robot: Robot, q: ArrayLike, link: int | str, local: ArrayLike) -> Floats:
    """World position (x, z) of a point of a link, (2,), in metres."""
    return _position(evaluated(robot, q), link_index(robot, link), plane_vector("local", local))


def point_velocity(
    robot: Robot, q: ArrayLike, v: ArrayLike, link: int | str, local: ArrayLike
) -> Floats:
    """Velocity (x, z) of a point and angular velocity of its link, (3,), in m/s and rad/s."""
    velocity: Floats = point_jacobian(robot, q, link, local) @ joint_vector(robot, "v", v)
    return velocity


def point_jacobian(robot: Robot, q: ArrayLike, link: int | str, local: ArrayLike) -> Floats:
    """Rows (x, z, rotation) of the Jacobian of a point of a link, (3, nv).

    Times v they give the velocity of the point and of its link's rotation; its transpose takes a
    force at the point and a moment about +y, (f_x, f_z, m), to the generalised force.
    """
    work = evaluated(robot, q)
    place = link_index(robot, link)
    jacobian = np.zeros((3, robot.nv))
    position = _position(work, place, plane_vector("local", local))
    kernels.point_jacobian(robot.model, work, place, position, jacobian)
    return jacobian


def point_bias_acceleration(
    robot: Robot, q: ArrayLike, v: ArrayLike, link: int | str, local: ArrayLike
) -> Floats:
    """J̇v of :func:`point_jacobian`, (3,), in m/s² and rad/s²: the acceleration at v̇ = 0."""
    work = evaluated(robot, q, v)
    place = link_index(robot, link)
    acceleration = np.zeros(3)
    position = _position(work, place, plane_vector("local", local))
    kernels.point_bias_acceleration(work, place, position, acceleration)
    return acceleration


def contact_positions(robot: Robot, q: ArrayLike) -> Floats:
    """World positions (x, z) of the centres of the contact discs, (nc, 2), in metres."""
    work = evaluated(robot, q)
    positions = np.zeros((robot.nc, 2))
    for i in range(robot.nc):
        link, local = int(robot.model.contact_link[i]), robot.model.contact_position[i]
        kernels.point_position(work, link, local, positions[i])
    return positions


def contact_jacobian(robot: Robot, q: ArrayLike) -> Floats:
    """Rows (normal, tangent) of the contact points on level ground, (nc, 2, nv).

    They are those of the lowest point of each contact disc: normal is up, tangent forward.
    """
    work = evaluated(robot, q)
    result = np.zeros((robot.nc, 2, robot.nv))
    jacobian = np.zeros((3, robot.nv))
    lowest = contact_positions(robot, q) - np.outer(robot.model.contact_radius, (0.0, 1.0))
    for i in range(robot.nc):
        link = int(robot.model.contact_link[i])
        kernels.point_jacobian(robot.model, work, link, lowest[i], jacobian)
        result[i] = jacobian[[1, 0]]
    return result


def contact_bias_acceleration(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """J̇v of :func:`contact_jacobian`, (normal, tangent), (nc, 2), in m/s².

    It belongs to the gap and to the sliding velocity of each disc: a disc that rolls on the ground
    has neither, although the material point that touches is drawn towards the disc's centre.
    """
    work = evaluated(robot, q, v)
    result = np.zeros((robot.nc, 2))
    acceleration = np.zeros(3)
    for i, center in enumerate(contact_positions(robot, q)):
        kernels.point_bias_acceleration(
            work, int(robot.model.contact_link[i]), center, acceleration
        )
        result[i] = acceleration[[1, 0]]
        result[i, 1] -= robot.model.contact_radius[i] * acceleration[2]
    return result


def _position(work: Workspace, link: int, local: Floats) -> Floats:
    position = np.zeros(2)
    kernels.point_position(work, link, local, position)
    return position
