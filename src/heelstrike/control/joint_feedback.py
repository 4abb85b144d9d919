"""Springs and dampers on the joints about a reference in time: the law that every engine knows.

    Γ = c(t) − kp q − kd q̇,   c = Γ_ref + kp q_ref + kd q̇_ref

with c a piecewise polynomial of time. Other engines have it as an actuator with an affine bias,
whose command is c at the time of each step.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.control.arguments import must_be, numbers_of
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.law import Law, controller, per_actuator
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

# A piece begins this much (s) early, so that round-off of time does not hold it up.
EARLY = 1e-12


class Parameters(Bundle):
    """Numbers of the law."""

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Stiffness (N m/rad) and damping (N m s/rad)."""
    begins: Floats = array("pieces")
    """When each piece begins, in s."""
    coefficients: Floats = array("pieces", "nu", "terms")
    """Those of c(t) in the time since then, lowest power first."""


@controller
def joint_feedback(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Parameters, torque: Floats
) -> None:
    """Joint torques of the law above."""
    begins, coefficients = parameters.begins, parameters.coefficients
    piece = 0
    while piece + 1 < begins.shape[0] and begins[piece + 1] <= t + EARLY:
        piece += 1
    time = t - begins[piece]
    for i in range(robot.nu):
        command = 0.0
        for power in range(coefficients.shape[2] - 1, -1, -1):
            command = command * time + coefficients[piece, i, power]
        torque[i] = (
            command
            - parameters.kp[i] * state.joint_position[i]
            - parameters.kd[i] * state.joint_velocity[i]
        )


class JointFeedback(Law):
    """Follow a reference in time with springs and dampers on the joints.

    Parameters
    ----------
    robot : Robot
        The robot.
    position : (nu,) or (pieces, nu, m) float
        Reference of the actuated joints: constant, or the coefficients of polynomials of the time
        since each piece began, lowest power first (rad, m).
    torque : (nu,) or (pieces, nu, m) float, optional
        Torques added to those of springs and dampers, in the same form (N m, N).
    kp, kd : float or (nu,) float
        Stiffness (N m/rad) and damping (N m s/rad).
    begins : (pieces,) float, optional
        When each piece begins, in s; the first at 0.

    Raises
    ------
    ControllerError
        If shapes do not fit.
    """

    def __init__(
        self,
        robot: Robot,
        position: ArrayLike,
        *,
        torque: ArrayLike = 0.0,
        kp: ArrayLike,
        kd: ArrayLike,
        begins: ArrayLike = (0.0,),
    ) -> None:
        must_be(Robot, "robot", robot)
        begins = np.atleast_1d(numbers_of("begins", begins))
        kp, kd = per_actuator("kp", kp, robot), per_actuator("kd", kd, robot)
        pieces = (len(begins), robot.nu)
        reference = _polynomials("position", position, *pieces)
        feedforward = _polynomials("torque", torque, *pieces)
        terms = max(reference.shape[2], feedforward.shape[2])
        command = np.zeros((*pieces, terms))
        command[:, :, : feedforward.shape[2]] += feedforward
        command[:, :, : reference.shape[2]] += kp[:, None] * reference
        powers = np.arange(1, reference.shape[2])
        command[:, :, : len(powers)] += kd[:, None] * powers * reference[:, :, 1:]
        parameters = Parameters(kp=kp, kd=kd, begins=begins, coefficients=command)
        super().__init__(joint_feedback, parameters, robot=robot, stiffness=kp, damping=kd)

    def command(self, times: ArrayLike) -> Floats:
        """Return c(t) at some times, (nt, nu): what an actuator with an affine bias is told."""
        times = np.asarray(times, dtype=np.float64)
        begins, coefficients = self.parameters.begins, self.parameters.coefficients
        piece = np.maximum(np.searchsorted(begins, times + EARLY, side="right") - 1, 0)
        terms = np.moveaxis(coefficients[piece], -1, 0)
        command: Floats = polyval((times - begins[piece])[:, None], terms, tensor=False)
        return command


def _polynomials(name: str, value: ArrayLike, pieces: int, nu: int) -> Floats:
    polynomials = numbers_of(name, value)
    if polynomials.ndim < 3 and polynomials.shape in ((), (1,), (nu,), (1, nu), (pieces, nu)):
        polynomials = np.broadcast_to(polynomials[..., None], (pieces, nu, 1))
    if polynomials.ndim != 3 or polynomials.shape[:2] != (pieces, nu):
        raise ControllerError(
            f"{name} must have a number for each of the {nu} motors, shape ({nu},), or "
            f"polynomials of shape ({pieces}, {nu}, m); it has shape {np.shape(value)}"
        )
    return polynomials
