"""The equations of motion of a robot in one state: A(q) v̇ + H(q, v) = SᵀΓ + passive + Jᵀλ.

Numpy in, numpy out. Generalised forces and accelerations are ordered as ``robot.velocity_names``:
the entry of a hinge is a torque (N m) or angular acceleration (rad/s²), that of a slide a force (N)
or acceleration (m/s²). Every function accepts anything array-like of the right length and raises a
`RobotError` otherwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics import kernels
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.evaluation import AnyEvaluation, Evaluation, evaluation_of
from heelstrike.dynamics.queries.held import HeldRobot
from heelstrike.dynamics.queries.query import of_position, of_state
from heelstrike.robot.model import Floats


@of_position("(nv, nv) float: In kg, kg m and kg m².")
def mass_matrix(at: AnyEvaluation) -> Floats:
    """Mass matrix A(q) (paper eq. 1), armature included."""
    return at.mass_matrix()


@of_state("(nv,) float: In N and N m.")
def bias_force(at: AnyEvaluation) -> Floats:
    """Centrifugal, Coriolis and gravitational forces H(q, v).

    It stands on the left-hand side of the equations of motion: the force that must be applied so
    that no velocity changes. Dampers and springs are not part of it (:func:`passive_force`).
    """
    return at.filled(at.v.shape, at.kernels.bias_force, at.model, at.work)


@of_position("(nv,) float: In N and N m.")
def gravity_force(at: AnyEvaluation) -> Floats:
    """Gravitational part of the bias force: what holds the robot at rest."""
    return bias_force.at(evaluation_of(at.robot)(at.robot, at.q))


@of_state("(nv,) float: In N and N m.")
def coriolis_force(at: AnyEvaluation) -> Floats:
    """Centrifugal and Coriolis part C(q, v) v of the bias force.

    It is computed without gravity, not as a difference, and loses no digits when it is small.
    """
    weightless = at.model.replaced(gravity=np.zeros(at.model.axes))
    return at.filled(at.v.shape, at.kernels.bias_force, weightless, at.work)


@of_state("(nv,) float: In N and N m, on the robot.")
def passive_force(at: AnyEvaluation) -> Floats:
    """Force of joint dampers and springs."""
    return at.filled(at.v.shape, at.kernels.passive_force, at.model, at.q, at.v)


@of_state("(nv,) float: In N and N m, on the robot.")
def applied_force(at: AnyEvaluation, torque: ArrayLike) -> Floats:
    """Generalised force SᵀΓ + passive of motors, dampers and springs."""
    force = passive_force.at(at)
    force[at.robot.driven] += at.vector("torque", torque)
    return force


@of_state("(nv,) float: In N and N m.")
def inverse_dynamics(at: AnyEvaluation, acceleration: ArrayLike) -> Floats:
    """Generalised force A(q) a + H(q, v) that yields an acceleration.

    It is the sum of all forces, whoever supplies them: motors, ground, closed loops; see
    :func:`heelstrike.contact_inverse_dynamics` for motors and ground apart.
    """
    rate = at.vector("acceleration", acceleration)
    return at.filled(at.v.shape, at.kernels.inverse_dynamics, at.model, rate, at.work)


@of_state("(nv,) float: In m/s² and rad/s².")
def forward_dynamics(at: Evaluation, force: ArrayLike) -> Floats:
    """Acceleration A⁻¹(force − H) under a generalised force that includes passive ones.

    Closed loops and couplings hold: A⁻¹(force + Jᵀ λ − H). There is no contact. The force of given
    joint torques is :func:`applied_force`; for the ground see
    :func:`heelstrike.contact_forward_dynamics`.
    """
    total, size = at.vector("force", force), at.model.nv
    if count_rows(at.model):
        return HeldRobot(at, []).accelerated(total - bias_force.at(at))[0]
    matrix, factor = at.zeros(size, size), at.zeros(size, size)
    return at.filled((size,), kernels.forward_dynamics, at.model, total, at.work, matrix, factor)
