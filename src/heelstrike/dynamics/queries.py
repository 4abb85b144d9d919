"""What a roboticist asks of a robot in one state: numpy in, numpy out.

Generalised coordinates are those of ``robot.joint_names``. World axes: x forward, z up; rotations
are about +y. Every function accepts anything array-like of the right length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.dynamics import kernels
from heelstrike.dynamics.workspace import Workspace, workspace
from heelstrike.errors import RobotError
from heelstrike.robot.robot import Robot

Floats = NDArray[np.float64]


def _vector(robot: Robot, name: str, value: ArrayLike) -> Floats:
    vector = np.ascontiguousarray(value, dtype=np.float64)
    if vector.shape != (robot.nv,):
        raise RobotError(
            f"{name} of robot {robot.name!r} must have {robot.nv} entries "
            f"({', '.join(robot.joint_names)}), got shape {vector.shape}"
        )
    return vector


def evaluated(robot: Robot, q: ArrayLike, v: ArrayLike | None = None) -> Workspace:
    """Workspace with kinematics (and velocities, if `v` is given) of a state."""
    work = workspace(robot.nv)
    kernels.forward_kinematics(robot.model, _vector(robot, "q", q), work)
    velocity = np.zeros(robot.nv) if v is None else _vector(robot, "v", v)
    kernels.link_velocities(robot.model, velocity, work)
    return work


def mass_matrix(robot: Robot, q: ArrayLike) -> Floats:
    """Mass matrix A(q), (nv, nv), in kg, kg m and kg m² (paper eq. 1)."""
    matrix = np.zeros((robot.nv, robot.nv))
    kernels.mass_matrix(robot.model, evaluated(robot, q), matrix)
    return matrix


def bias_force(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Centrifugal, Coriolis and gravitational forces H(q, v), (nv,), in N and N m."""
    force = np.zeros(robot.nv)
    kernels.bias_force(robot.model, evaluated(robot, q, v), force)
    return force


def gravity_force(robot: Robot, q: ArrayLike) -> Floats:
    """Gravitational part of the bias force, (nv,), in N and N m."""
    return bias_force(robot, q, np.zeros(robot.nv))


def passive_force(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Force of joint dampers and springs on the robot, (nv,), in N and N m."""
    force = np.zeros(robot.nv)
    kernels.passive_force(robot.model, _vector(robot, "q", q), _vector(robot, "v", v), force)
    return force


def inverse_dynamics(robot: Robot, q: ArrayLike, v: ArrayLike, acceleration: ArrayLike) -> Floats:
    """Generalised force A(q) a + H(q, v) that yields an acceleration, (nv,), in N and N m."""
    force = np.zeros(robot.nv)
    kernels.inverse_dynamics(
        robot.model,
        _vector(robot, "acceleration", acceleration),
        evaluated(robot, q, v),
        force,
    )
    return force


def forward_dynamics(robot: Robot, q: ArrayLike, v: ArrayLike, force: ArrayLike) -> Floats:
    """Acceleration A⁻¹(force − H), (nv,), under a generalised force that includes passive ones."""
    matrix = np.zeros((robot.nv, robot.nv))
    acceleration = np.zeros(robot.nv)
    kernels.forward_dynamics(
        robot.model,
        matrix,
        np.zeros_like(matrix),
        _vector(robot, "force", force),
        evaluated(robot, q, v),
        acceleration,
    )
    return acceleration


def point_jacobian(robot: Robot, q: ArrayLike, link: int, local: ArrayLike) -> Floats:
    """Rows (x, z, rotation) of the Jacobian of a point of a link, (3, nv).

    `local` is the point (x, z) in the link frame, in metres.
    """
    work = evaluated(robot, q)
    position = np.zeros(2)
    kernels.point_position(work, link, np.asarray(local, dtype=np.float64), position)
    jacobian = np.zeros((3, robot.nv))
    kernels.point_jacobian(robot.model, work, link, position, jacobian)
    return jacobian


def point_bias_acceleration(
    robot: Robot, q: ArrayLike, v: ArrayLike, link: int, local: ArrayLike
) -> Floats:
    """J̇v of :func:`point_jacobian`, (3,), in m/s² and rad/s²."""
    work = evaluated(robot, q, v)
    position = np.zeros(2)
    kernels.point_position(work, link, np.asarray(local, dtype=np.float64), position)
    acceleration = np.zeros(3)
    kernels.point_bias_acceleration(work, link, position, acceleration)
    return acceleration


def contact_positions(robot: Robot, q: ArrayLike) -> Floats:
    """World positions (x, z) of the centres of the contact discs, (nc, 2), in metres."""
    work = evaluated(robot, q)
    positions = np.zeros((robot.nc, 2))
    for i in range(robot.nc):
        kernels.point_position(
            work,
            int(robot.model.contact_link[i]),
            robot.model.contact_position[i],
            positions[i],
        )
    return positions


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


def center_of_mass(robot: Robot, q: ArrayLike) -> Floats:
    """World position (x, z) of the robot's centre of mass, (2,), in metres."""
    position = np.zeros(2)
    kernels.center_of_mass(robot.model, evaluated(robot, q), position)
    return position


def momentum(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Momentum along x and z (N s) and moment of momentum about the centre of mass (N m s)."""
    result = np.zeros(3)
    kernels.momentum(robot.model, evaluated(robot, q, v), result)
    return result


def energy(robot: Robot, q: ArrayLike, v: ArrayLike) -> tuple[float, float]:
    """Kinetic and potential energy in J; the potential includes joint springs."""
    work = evaluated(robot, q, v)
    kinetic = np.zeros(1)
    potential = np.zeros(1)
    kernels.kinetic_energy(robot.model, _vector(robot, "v", v), work, kinetic)
    kernels.potential_energy(robot.model, _vector(robot, "q", q), work, potential)
    return float(kinetic[0]), float(potential[0])
