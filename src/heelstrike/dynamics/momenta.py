"""Centre of mass and momentum of the whole robot, in world axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics import kernels
from heelstrike.dynamics.equations_of_motion import weightless
from heelstrike.dynamics.evaluation import Floats, evaluated
from heelstrike.robot.robot import Robot


def center_of_mass(robot: Robot, q: ArrayLike) -> Floats:
    """World position (x, z) of the robot's centre of mass, (2,), in metres."""
    position = np.zeros(2)
    kernels.center_of_mass(robot.model, evaluated(robot, q), position)
    return position


def center_of_mass_jacobian(robot: Robot, q: ArrayLike) -> Floats:
    """Jacobian (x, z) of the robot's centre of mass, (2, nv)."""
    return momentum_matrix(robot, q)[:2] / robot.total_mass


def center_of_mass_velocity(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Velocity (x, z) of the robot's centre of mass, (2,), in m/s."""
    return momentum(robot, q, v)[:2] / robot.total_mass


def center_of_mass_bias_acceleration(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """J̇v of :func:`center_of_mass_jacobian`, (2,), in m/s²."""
    model = weightless(robot.model)
    work = evaluated(robot, q, v)
    kernels.inverse_dynamics(model, np.zeros(robot.nv), work, np.zeros(robot.nv))
    # The recursion leaves in every link the resultant of its subtree: d'Alembert's forces.
    rate: Floats = work.force[model.parent < 0, 1:].sum(axis=0) / robot.total_mass
    return rate


def momentum(robot: Robot, q: ArrayLike, v: ArrayLike) -> Floats:
    """Momentum along x and z (N s) and moment of momentum about the centre of mass (N m s)."""
    result = np.zeros(3)
    kernels.momentum(robot.model, evaluated(robot, q, v), result)
    return result


def angular_momentum(robot: Robot, q: ArrayLike, v: ArrayLike) -> float:
    """Moment of momentum about the centre of mass and about +y, in N m s.

    Rotors (armature) turn with the motors, not with the links, and are not counted.
    """
    return float(momentum(robot, q, v)[2])


def momentum_matrix(robot: Robot, q: ArrayLike) -> Floats:
    """Centroidal momentum matrix, (3, nv): times v it gives :func:`momentum`."""
    matrix = np.zeros((3, robot.nv))
    kernels.momentum_matrix(robot.model, evaluated(robot, q), matrix)
    return matrix
