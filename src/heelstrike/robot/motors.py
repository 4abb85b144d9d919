"""What the motors of a robot can give at a speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.robot.model import Floats, Model


def torque_range(model: Model, v: ArrayLike) -> tuple[Floats, Floats]:
    """Return the least and the greatest torque of each actuator at velocities v.

    Limits of the torque where the speed-torque line of the motor leaves room for them; where it
    does not, beyond the no-load speed, what the line leaves. See
    :mod:`heelstrike.sim.controller.motors` for the line.

    Parameters
    ----------
    model : Model
        The robot's numbers.
    v : (nv,) or (n, nv) array
        Velocities.

    Returns
    -------
    (nu,) or (n, nu) float, twice
        Torques (N m) or forces (N); infinite where nothing limits them.
    """
    joint = model.actuator_joint
    stall = model.stall_torque[joint]
    known = np.isfinite(stall)
    drag = np.zeros(np.shape(v)[:-1] + stall.shape)
    speed = np.asarray(v, dtype=np.float64)[..., joint[known]]
    drag[..., known] = stall[known] / model.no_load_speed[joint[known]] * speed
    low, high = -stall - drag, stall - drag
    return np.clip(model.torque_lower, low, high), np.clip(model.torque_upper, low, high)
