"""Springs and dampers about a posture, with the weight beyond each joint fed forward.

Γ = g(q) + kp (q_ref − q) − kd q̇
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle, array, number
from heelstrike.control.arguments import gains_of, must_be
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.spatial.controlled import (
    SpatialControlledRobot,
    SpatialControlState,
    driven_positions,
)


class PostureGains(Bundle):
    """Numbers of the law."""

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Stiffness (N m/rad) and damping (N m s/rad)."""
    posture: Floats = array("nu")
    """Positions of the driven joints that it holds (rad, m)."""
    weight: int = number(int)
    """Whether the weight beyond each joint is fed forward."""


@controller
def hold_posture(
    state: SpatialControlState, robot: SpatialControlledRobot, parameters: PostureGains,
    torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    if parameters.weight == 1:
        robot.gravity_force(state, torque)
    else:
        for i in range(robot.nu):
            torque[i] = 0.0
    for i in range(robot.nu):
        torque[i] += parameters.kp[i] * (parameters.posture[i] - state.joint_position[i])
        torque[i] -= parameters.kd[i] * state.joint_velocity[i]


def posture_of(robot: SpatialRobot, posture: ArrayLike | None) -> tuple[Floats, Integers]:
    """Return a position (nq,) that a law holds, that of the file by default, and its driven places.

    Raises
    ------
    ControllerError
        If it is no position, or motors drive other joints than hinges and slides.
    """
    must_be(SpatialRobot, "robot", robot)
    whole = robot.model.reference if posture is None else np.asarray(posture, dtype=float)
    if whole.shape != (robot.nq,) or not np.all(np.isfinite(whole)):
        raise ControllerError(f"posture must be {robot.nq} finite numbers, got {posture!r}")
    places = driven_positions(robot)
    if np.any(places < 0):
        names = [robot.actuator_names[i] for i in np.flatnonzero(places < 0)]
        raise ControllerError(
            f"a posture is held by hinges and slides; {', '.join(names)} of robot "
            f"{robot.name!r} drive something else"
        )
    return whole, places


class HoldPosture(Law):
    """Hold a posture of a robot in space with springs and dampers on its joints.

    Parameters
    ----------
    robot : SpatialRobot
        The robot. Its actuators drive hinges and slides.
    kp, kd : float or (nu,) array
        Stiffness (N m/rad) and damping (N m s/rad).
    posture : (nq,) array, optional
        Position whose driven joints are held; that of the file by default.
    gravity : bool
        Whether the weight of what is beyond each joint is fed forward.

    Raises
    ------
    ControllerError
        If gains or posture do not fit the robot.

    Notes
    -----
    Torques are held over n steps, a time T in all: with the inertia I that a joint moves,
    T² kp / n + 2 T kd must stay below 4 I, and T kp (1 − 1/n) below 2 kd. A simulation warns of
    gains beyond that.
    """

    @takes(ControllerError)
    def __init__(
        self,
        robot: SpatialRobot,
        *,
        kp: ArrayLike,
        kd: ArrayLike,
        posture: ArrayLike | None = None,
        gravity: bool = True,
    ) -> None:
        must_be(SpatialRobot, "robot", robot)
        stiff, damped = gains_of("kp", kp, robot), gains_of("kd", kd, robot)
        whole, places = posture_of(robot, posture)
        parameters = PostureGains(
            kp=stiff, kd=damped, posture=whole[places].copy(), weight=int(gravity)
        )
        super().__init__(hold_posture, parameters, stiffness=stiff, damping=damped)
