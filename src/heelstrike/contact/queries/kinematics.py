"""A robot's contact points above a ground: gaps, Jacobians and velocities in one state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.contact.ground import Ground, ground_contact
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics import kernels
from heelstrike.dynamics.evaluation import evaluated, joint_vector
from heelstrike.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class ContactKinematics:
    """The contact points of a robot in one state, each with the nearest feature of the ground.

    Components are (normal, tangent); the tangent is (n_z, −n_x), forward on level ground.

    Attributes
    ----------
    position : (nc, 2) float
        World position of the point of each disc that is nearest to the ground, in m.
    normal : (nc, 2) float
        Outward normal of the ground there.
    gap : (nc,) float
        Distance to the ground, negative when penetrating, in m.
    friction : (nc,) float
        Coefficient of friction there.
    jacobian : (nc, 2, nv) float
        Rows (normal, tangent) of the points.
    velocity : (nc, 2) float
        Their velocity, in m/s.
    bias_acceleration : (nc, 2) float
        J̇v: rate of the gap's rate and of the sliding velocity at v̇ = 0, in m/s².
    """

    position: Floats
    normal: Floats
    gap: Floats
    friction: Floats
    jacobian: Floats
    velocity: Floats
    bias_acceleration: Floats


def contact_kinematics(
    robot: Robot, q: ArrayLike, v: ArrayLike, ground: Ground | None = None
) -> ContactKinematics:
    """Evaluate all contact points of a robot; level ground with its default friction if not given.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) array
        State.
    ground : Ground, optional
        Level ground with its default friction if not given.

    Returns
    -------
    ContactKinematics
        Gaps, velocities, normals and Jacobians of the points.

    Raises
    ------
    RobotError
        If `q` or `v` has the wrong length.
    """
    model, terrain = robot.model, (Ground() if ground is None else ground)._model
    work = evaluated(robot, q, v)
    velocity = joint_vector(robot, "v", v)
    position, normal = np.zeros((robot.nc, 2)), np.zeros((robot.nc, 2))
    gap, friction = np.zeros(robot.nc), np.zeros(robot.nc)
    jacobian, bias = np.zeros((robot.nc, 2, robot.nv)), np.zeros((robot.nc, 2))
    rows, acceleration = np.zeros((3, robot.nv)), np.zeros(3)
    for i in range(robot.nc):
        link, radius = int(model.contact_link[i]), float(model.contact_radius[i])
        center = position[i]
        kernels.point_position(work, link, model.contact_position[i], center)
        gap[i], friction[i], _ = ground_contact(terrain, center[0], center[1], radius, normal[i])
        kernels.point_bias_acceleration(work, link, center, acceleration)
        center -= radius * normal[i]
        kernels.point_jacobian(model, work, link, center, rows)
        axes = np.array([[normal[i, 0], normal[i, 1]], [normal[i, 1], -normal[i, 0]]])
        jacobian[i] = axes @ rows[:2]
        bias[i] = axes @ acceleration[:2] - [0.0, radius * acceleration[2]]
    return ContactKinematics(position, normal, gap, friction, jacobian, jacobian @ velocity, bias)
