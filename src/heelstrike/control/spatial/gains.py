"""Stiffness and damping that the step of a simulation bears, joint by joint.

Torques are held over a step h. With an inertia I that a joint moves when nothing else is held, the
motion of a spring and damper on it is stable while h² kp + 2 h kd < 4 I (the eigenvalues of
v⁺ = v − h (kp q + kd v) / I, q⁺ = q + h v⁺ have modulus one on that line). Where torques are held
over several steps, a time h in all, h kp must stay below 2 kd besides.
"""

from __future__ import annotations

import numpy as np

from heelstrike.dynamics import spatial
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.robot import SpatialRobot

OF_STIFFNESS, OF_DAMPING = 0.25, 0.5
"""Most that kp h² and kd h may be of the inertia: together 1.25 of the 4 that are the limit."""


def bearable_gains(
    robot: SpatialRobot, step: float, *, kp: float, kd: float
) -> tuple[Floats, Floats]:
    """Return gains of every actuator: those asked for, or less where the step bears no more.

    Parameters
    ----------
    robot : SpatialRobot
        The robot, whose inertias in its reference configuration count.
    step : float
        Time over which torques are held, in s.
    kp, kd : float
        Stiffness (N m/rad) and damping (N m s/rad) that are asked for.

    Returns
    -------
    kp, kd : (nu,) float
        What to use.

    Raises
    ------
    ControllerError
        If the step or a gain is negative or not finite.
    """
    for name, value in (("step", step), ("kp", kp), ("kd", kd)):
        if not (np.isfinite(value) and value >= 0.0):
            raise ControllerError(f"{name} must be a number from zero on, got {value}")
    mass = spatial.mass_matrix(robot, robot.model.reference)
    alone = 1.0 / np.diag(np.linalg.inv(mass))[robot.model.actuator_velocity]
    most = max(step, 1e-12)
    return np.minimum(kp, OF_STIFFNESS * alone / most**2), np.minimum(kd, OF_DAMPING * alone / most)
