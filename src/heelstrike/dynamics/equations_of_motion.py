"""The equations of motion of a robot in one state: A(q) v̇ + H(q, v) = SᵀΓ + passive + Jᵀλ.

Numpy in, numpy out. Generalised forces and accelerations are ordered as ``robot.joint_names``; the
entry of a hinge is a torque (N m) or angular acceleration (rad/s²), that of a slide a force (N) or
acceleration (m/s²). Every function accepts anything array-like of the right length and raises a
`RobotError` otherwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics import kernels
from heelstrike.dynamics.evaluation import Floats, evaluated, joint_vector, torque_vector
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot


def mass_matrix(robot: Robot, q: ArrayLike) -> Floats:
    """Mass matrix A(q), (nv, nv), in kg, kg m and kg m² (paper eq. 1)."""
    matrix = np.zeros((robot.nv, robot.nv))
    kernels.mass_matrix(robot.model, evaluated(robot, q), matrix)
    return matrix


def bias_force(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Centrifugal, Coriolis and gravitational forces H(q, v), (nv,), in N and N m.

    It stands on the left-hand side of the equations of motion: the force that must be applied so
    that no coordinate accelerates. Dampers and springs are not part of it (:func:`passive_force`).
    """
    force = np.zeros(robot.nv)
    kernels.bias_force(robot.model, evaluated(robot, q, v), force)
    return force


def gravity_force(robot: Robot, q: ArrayLike) -> Floats:
    """Gravitational part of the bias force, (nv,), in N and N m: what holds the robot at rest."""
    return bias_force(robot, q, np.zeros(robot.nv))


def coriolis_force(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Centrifugal and Coriolis part C(q, v) v of the bias force, (nv,), in N and N m.

    It is computed without gravity, not as a difference, and loses no digits when it is small.
    """
    force = np.zeros(robot.nv)
    kernels.bias_force(weightless(robot.model), evaluated(robot, q, v), force)
    return force


def weightless(model: Model) -> Model:
    """Return a model without gravity."""
    return Model(**(model.members() | {"gravity": np.zeros(2)}))


def passive_force(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Force of joint dampers and springs on the robot, (nv,), in N and N m."""
    force = np.zeros(robot.nv)
    kernels.passive_force(
        robot.model, joint_vector(robot, "q", q), joint_vector(robot, "v", v), force
    )
    return force


def applied_force(robot: Robot, q: ArrayLike, v: ArrayLike, torque: ArrayLike) -> Floats:
    """Generalised force SᵀΓ + passive of motors, dampers and springs, (nv,), in N and N m.

    `torque` (nu,) is ordered as ``robot.actuator_names``.
    """
    force = passive_force(robot, q, v)
    force[robot.model.actuator_joint] += torque_vector(robot, torque)
    return force


def inverse_dynamics(robot: Robot, q: ArrayLike, v: ArrayLike, acceleration: ArrayLike) -> Floats:
    """Generalised force A(q) a + H(q, v) that yields an acceleration, (nv,), in N and N m.

    It is the sum of all forces, whoever supplies them; see
    :func:`heelstrike.contact_inverse_dynamics` for motors and ground apart.
    """
    force = np.zeros(robot.nv)
    kernels.inverse_dynamics(
        robot.model,
        joint_vector(robot, "acceleration", acceleration),
        evaluated(robot, q, v),
        force,
    )
    return force


def forward_dynamics(robot: Robot, q: ArrayLike, v: ArrayLike, force: ArrayLike) -> Floats:
    """Acceleration A⁻¹(force − H), (nv,), under a generalised force that includes passive ones.

    Without contact. The force of given joint torques is :func:`applied_force`; for the ground see
    :func:`heelstrike.contact_forward_dynamics`.
    """
    matrix = np.zeros((robot.nv, robot.nv))
    acceleration = np.zeros(robot.nv)
    kernels.forward_dynamics(
        robot.model,
        matrix,
        np.zeros_like(matrix),
        joint_vector(robot, "force", force),
        evaluated(robot, q, v),
        acceleration,
    )
    return acceleration
