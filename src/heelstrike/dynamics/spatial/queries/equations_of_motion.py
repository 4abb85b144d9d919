"""The equations of motion of a robot in space: M(q) v̇ + H(q, v) = SᵀΓ + passive + Jᵀλ.

Generalised forces and accelerations are ordered as ``robot.velocity_names``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.spatial import equations
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.dynamics.spatial.queries.query import of_position, of_state
from heelstrike.robot.model import Floats


@of_position("(nv, nv) float: In kg, kg m and kg m².")
def mass_matrix(at: SpatialEvaluation) -> Floats:
    """Mass matrix M(q), armature included."""
    return at.mass_matrix()


@of_state("(nv,) float: In N and N m.")
def bias_force(at: SpatialEvaluation) -> Floats:
    """Centrifugal, Coriolis and gravitational forces H(q, v).

    It stands on the left-hand side of the equations of motion: the force that must be applied so
    that no velocity changes. Dampers and springs are not part of it (:func:`passive_force`).
    """
    return at.filled(at.v.shape, equations.bias_force, at.model, at.work)


@of_position("(nv,) float: In N and N m.")
def gravity_force(at: SpatialEvaluation) -> Floats:
    """Gravitational part of the bias force: what holds the robot at rest."""
    return bias_force.at(SpatialEvaluation(at.robot, at.q))


@of_state("(nv,) float: In N and N m.")
def coriolis_force(at: SpatialEvaluation) -> Floats:
    """Centrifugal and Coriolis part of the bias force.

    It is computed without gravity, not as a difference, and loses no digits when it is small.
    """
    weightless = at.model.replaced(gravity=np.zeros(at.model.axes))
    return at.filled(at.v.shape, equations.bias_force, weightless, at.work)


@of_state("(nv,) float: In N and N m, on the robot.")
def passive_force(at: SpatialEvaluation) -> Floats:
    """Force of joint dampers and springs."""
    return at.filled(at.v.shape, equations.passive_force, at.model, at.q, at.v)


@of_state("(nv,) float: In N and N m, on the robot.")
def applied_force(at: SpatialEvaluation, torque: ArrayLike) -> Floats:
    """Generalised force SᵀΓ + passive of motors, dampers and springs."""
    force = passive_force.at(at)
    force[at.model.actuator_velocity] += at.vector("torque", torque)
    return force


@of_state("(nv,) float: In N and N m.")
def inverse_dynamics(at: SpatialEvaluation, acceleration: ArrayLike) -> Floats:
    """Generalised force M(q) a + H(q, v) that yields an acceleration.

    It is the sum of all forces, whoever supplies them.
    """
    given = at.vector("acceleration", acceleration)
    return at.filled(at.v.shape, equations.inverse_dynamics, at.model, given, at.work)


@of_state("(nv,) float: In m/s² and rad/s².")
def forward_dynamics(at: SpatialEvaluation, force: ArrayLike) -> Floats:
    """Acceleration M⁻¹(force − H) under a generalised force that includes passive ones.

    There is no contact. The force of given joint torques is :func:`applied_force`.
    """
    total, size = at.vector("force", force), at.model.nv
    return at.filled((size,), equations.forward_dynamics, at.model, total, at.work, at.tree())
