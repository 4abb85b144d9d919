"""Springs and dampers on the joints about a reference in time: the law that every engine knows.

    Γ = c(t) − kp q − kd q̇,   c = Γ_ref + kp q_ref + kd q̇_ref

with c a piecewise polynomial of time. Other engines have it as an actuator with an affine bias,
whose command is c at the time of each step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import CompiledController, Contacts, controller_kernel

# Places in the parameters: pieces, coefficients of each polynomial, then beginnings of the pieces,
# gains, and coefficients by piece, actuator and power.
PIECES = 0
ORDER = 1
HEADER = 2

# A piece begins this much (s) early, so that round-off of time does not hold it up.
EARLY = 1e-12


@controller_kernel
def joint_feedback(
    t: float,
    q: Floats,
    v: Floats,
    contacts: Contacts,  # noqa: ARG001 - kernels of one signature use what they need
    model: Model,
    tree: Workspace,  # noqa: ARG001
    scratch: Workspace,  # noqa: ARG001
    parameters: Floats,
    memory: Floats,  # noqa: ARG001
    torque: Floats,
) -> None:
    """Joint torques of the law above."""
    nu = model.actuator_joint.shape[0]
    pieces = int(parameters[PIECES])
    order = int(parameters[ORDER])
    piece = 0
    while piece + 1 < pieces and parameters[HEADER + piece + 1] <= t + EARLY:
        piece += 1
    time = t - parameters[HEADER + piece]
    gains = HEADER + pieces
    for i in range(nu):
        joint = model.actuator_joint[i]
        place = gains + 2 * nu + (piece * nu + i) * order
        command = 0.0
        for power in range(order - 1, -1, -1):
            command = command * time + parameters[place + power]
        torque[i] = (
            command - parameters[gains + i] * q[joint] - parameters[gains + nu + i] * v[joint]
        )


class JointFeedback:
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
        self.robot = robot
        self.begins = np.atleast_1d(np.asarray(begins, dtype=np.float64))
        self.kp = _of_actuators("kp", kp, robot)
        self.kd = _of_actuators("kd", kd, robot)
        reference = self._polynomials("position", position)
        feedforward = self._polynomials("torque", torque)
        order = max(reference.shape[2], feedforward.shape[2])
        command = np.zeros((len(self.begins), robot.nu, order))
        command[:, :, : feedforward.shape[2]] += feedforward
        command[:, :, : reference.shape[2]] += self.kp[:, None] * reference
        powers = np.arange(1, reference.shape[2])
        command[:, :, : len(powers)] += self.kd[:, None] * powers * reference[:, :, 1:]
        self.coefficients: NDArray[np.float64] = command

    def compiled(self) -> CompiledController:
        """Return the controller in the form that runs inside the compiled loop."""
        pieces, _, order = self.coefficients.shape
        header = [float(pieces), float(order)]
        parameters = np.concatenate(
            [header, self.begins, self.kp, self.kd, self.coefficients.ravel()]
        )
        return CompiledController(
            joint_feedback, parameters, np.zeros(0), stiffness=self.kp, damping=self.kd
        )

    def command(self, times: ArrayLike) -> NDArray[np.float64]:
        """Return c(t) at some times, (nt, nu): what an actuator with an affine bias is told."""
        times = np.asarray(times, dtype=np.float64)
        piece = np.maximum(np.searchsorted(self.begins, times + EARLY, side="right") - 1, 0)
        since = times - self.begins[piece]
        command = np.zeros((len(times), self.robot.nu))
        for power in range(self.coefficients.shape[2] - 1, -1, -1):
            command = command * since[:, None] + self.coefficients[piece, :, power]
        return command

    def torque(self, t: float, state: State, contacts: Contacts) -> NDArray[np.float64]:  # noqa: ARG002
        """Return the joint torques (nu,), in N m."""
        driven = self.robot.model.actuator_joint
        torque: NDArray[np.float64] = (
            self.command([t])[0] - self.kp * state.q[driven] - self.kd * state.v[driven]
        )
        return torque

    def _polynomials(self, name: str, value: ArrayLike) -> NDArray[np.float64]:
        array = np.asarray(value, dtype=np.float64)
        if array.ndim < 3:
            array = np.broadcast_to(array[..., None], (len(self.begins), self.robot.nu, 1))
        if array.shape[:2] != (len(self.begins), self.robot.nu):
            raise ControllerError(
                f"{name} must be ({self.robot.nu},) or polynomials of shape "
                f"({len(self.begins)}, {self.robot.nu}, m), got {np.shape(value)}"
            )
        return array


def _of_actuators(name: str, value: ArrayLike, robot: Robot) -> NDArray[np.float64]:
    gains = np.asarray(value, dtype=np.float64)
    if gains.ndim > 1 or gains.size not in (1, robot.nu) or not np.all(np.isfinite(gains)):
        raise ControllerError(
            f"{name} must be one finite number or {robot.nu} (one an actuator), got {value!r}"
        )
    return np.broadcast_to(gains, (robot.nu,)).copy()
