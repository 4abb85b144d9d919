"""Mechanical energy of a robot."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics import kernels
from heelstrike.dynamics.evaluation import evaluated, joint_vector
from heelstrike.robot.robot import Robot


def kinetic_energy(robot: Robot, q: ArrayLike, v: ArrayLike) -> float:
    """Kinetic energy of links and rotors, in J."""
    result = np.zeros(1)
    velocity = joint_vector(robot, "v", v)
    kernels.kinetic_energy(robot.model, velocity, evaluated(robot, q, v), result)
    return float(result[0])


def potential_energy(robot: Robot, q: ArrayLike) -> float:
    """Energy in the gravity field, zero at the world's origin, and of the joint springs, in J."""
    result = np.zeros(1)
    position = joint_vector(robot, "q", q)
    kernels.potential_energy(robot.model, position, evaluated(robot, q), result)
    return float(result[0])


def energy(robot: Robot, q: ArrayLike, v: ArrayLike) -> tuple[float, float]:
    """Kinetic and potential energy in J; the potential includes joint springs."""
    return kinetic_energy(robot, q, v), potential_energy(robot, q)
