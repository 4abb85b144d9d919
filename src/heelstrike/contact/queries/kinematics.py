"""A robot's contact points above a ground: gaps, Jacobians and velocities in one state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground, ground_contact, path_curvature
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.places import place_of, velocity_at, write_point_rows
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.errors import ContactProblemError
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class ContactKinematics:
    """The contact points of a robot in one state, each with the nearest feature of the ground.

    Components are (normal, tangent); the tangent is (n_z, −n_x), forward on level ground.
    """

    position: Floats
    """(nc, 2) World position of the point of each disc that is nearest to the ground, in m."""
    normal: Floats
    """(nc, 2) Outward normal of the ground there."""
    gap: Floats
    """(nc,) Distance to the ground, negative when penetrating, in m."""
    friction: Floats
    """(nc,) Coefficient of friction there."""
    jacobian: Floats
    """(nc, 2, nv) Rows (normal, tangent) of the points."""
    velocity: Floats
    """(nc, 2) Their velocity, in m/s."""
    bias_acceleration: Floats
    """(nc, 2) J̇v: rate of the gap's rate and of the sliding velocity at v̇ = 0, in m/s²."""


@takes(ContactProblemError)
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
    at = Evaluation(robot, q, v)
    points, axes = (robot.nc, model.axes), model.axes
    position, normal, bias = np.zeros(points), np.zeros(points), np.zeros(points)
    gap, friction = np.zeros(robot.nc), np.zeros(robot.nc)
    jacobian = np.zeros((*points, robot.nv))
    for i, link, center in at.contact_centers(None):
        radius = float(model.contact_radius[i])
        gap[i], coefficient, _ = ground_contact(terrain, center[0], center[1], radius, normal[i])
        friction[i] = model.friction_scale[i] * coefficient
        acceleration = at.bias_acceleration(link, center)
        bias[i] = into_frame(normal[i], tuple(acceleration[:axes]))
        bias[i, 1] -= radius * acceleration[axes]
        if terrain.curved:
            at_center = velocity_at(at.work.velocity, link, place_of(at.work, center))
            _, along = into_frame(normal[i], at_center)
            bend = path_curvature(terrain, center[0], gap[i] + radius, normal[i])
            bias[i, 0] += bend * along**2
        position[i] = center - radius * normal[i]
        write_point_rows(model, at.work, link, position[i], normal[i], 0, jacobian[i])
    velocity = jacobian @ at.v
    return ContactKinematics(position, normal, gap, friction, jacobian, velocity, bias)
