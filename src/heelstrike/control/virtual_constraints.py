"""Virtual constraints: the joints follow a phase of the robot instead of time, on point feet.

Outputs y = C (q_a − h_d(θ)) say how far the joints are from the gait at the phase θ that the robot
has. The torques make them obey ÿ = u(y, ẏ) exactly while the stance foot stays in place
(input-output linearisation). With the accelerations of foot and joints prescribed, v̇ = a₀ + θ̈ n
is known but for θ̈, the one motion that no motor reaches. The phase is a row like those of the foot
that the ground holds (:mod:`heelstrike.dynamics.held`), but nothing pushes along it: of its force,
which is linear in θ̈, nothing may be left (Grizzle, Abba and Plestan 2001, *Asymptotically stable
walking for biped robots*, IEEE Transactions on Automatic Control 46(1)).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle, array, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.arguments import (
    gains_of,
    must_be,
    number_of,
    numbers_of,
    positive,
)
from heelstrike.dynamics.held import add_row, force_of_row, solve_rows
from heelstrike.dynamics.planar import Spatial
from heelstrike.errors import ControllerError
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import force_wanted, hold_point, joint_torques
from heelstrike.sim.controller.stance_clock import StanceClock, exchange_at_touchdown

# A swing foot that meets the ground before the middle of the step, at phase 0, scuffs.
LANDS_AFTER = 0.0
# In parts of half a step: so far beyond either end the series goes on, and so far beyond that the
# postures become straight.
BEYOND = 0.01
FADING = 0.1


class Parameters(Bundle):
    """Numbers of the law; the first extent of 2 is that of the stance foot."""

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Gains of ÿ = −kp y − kd ẏ (1/s², 1/s)."""
    epsilon: float = number(float)
    exponent: float = number(float)
    """epsilon, exponent: Time scale (s) and exponent of the finite-time law; a time scale of zero
    is none."""
    phase: Floats = array(2, "nv")
    """Factors of the coordinates in θ."""
    middle: Floats = array(2)
    half: float = number(float)
    """middle, half: Middle of the range of θ less what is constant in θ, and half its width
    (rad)."""
    coefficients: Floats = array(2, "terms", "nu")
    """Chebyshev series of the joints (rad)."""
    outputs: Floats = array(2, "nu", "nu")
    joints: Floats = array(2, "nu", "nu")
    """outputs, joints: Outputs of errors of the joints, C, and its inverse."""


class Memory(StanceClock):
    """What the law remembers: the foot that stands. The rest is scratch."""

    error: Floats = array("nu")
    error_rate: Floats = array("nu")
    """error, error_rate: How far the joints are from the gait."""
    slope: Floats = array("nu")
    wanted: Floats = array("nu")
    """slope, wanted: Derivatives of the gait by θ; accelerations of the joints but for those times
    θ̈."""


@kernel
def series(coefficients: Floats, joint: int, x: float) -> Spatial:
    """Value, slope and curvature of a Chebyshev series on [−1, 1] (Clenshaw) and beyond."""
    inside = min(max(x, -1.0 - BEYOND), 1.0 + BEYOND)
    b1, b2, d1, d2, e1, e2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(coefficients.shape[0] - 1, 0, -1):
        b1, b2 = coefficients[k, joint] + 2.0 * inside * b1 - b2, b1
        d1, d2 = 2.0 * b2 + 2.0 * inside * d1 - d2, d1
        e1, e2 = 4.0 * d2 + 2.0 * inside * e1 - e2, e1
    value = coefficients[0, joint] + inside * b1 - b2
    slope = b1 + inside * d1 - d2
    curvature = 2.0 * d1 + inside * e1 - e2
    if inside == x:
        return value, slope, curvature
    # Near the ends the series itself goes on, so that the return map has derivatives: what a later
    # or an earlier touchdown leads to has no kink. Then its curvature fades.
    bent = min(abs(x - inside), FADING)
    bend = math.copysign(bent - 0.5 * bent**2 / FADING, x) * curvature
    sag = curvature * bent**2 * (0.5 - bent / (6.0 * FADING))
    straight = x - inside - math.copysign(bent, x)
    value += (x - inside) * slope + sag + bend * straight
    return value, slope + bend, curvature * (1.0 - bent / FADING)


@kernel
def signed_power(x: float, exponent: float) -> float:
    """sign(x) |x|^exponent."""
    return math.copysign(abs(x) ** exponent, x)


@kernel
def finite_time(y: float, rate: float, epsilon: float, exponent: float) -> float:
    """Acceleration that brings a double integrator to rest in finite time.

    S. P. Bhat and D. S. Bernstein (1998), *Continuous finite-time stabilization of the
    translational and rotational double integrators*, IEEE Transactions on Automatic Control 43(5).
    """
    scaled = epsilon * rate
    surface = y + signed_power(scaled, 2.0 - exponent) / (2.0 - exponent)
    share = exponent / (2.0 - exponent)
    return -(signed_power(scaled, exponent) + signed_power(surface, share)) / epsilon**2


@kernel
def phase_of_foot(state: ControlState, parameters: Parameters, foot: int) -> float:
    """Where in the step of a foot the robot is: from −1 to 1."""
    theta = -parameters.middle[foot]
    for j in range(parameters.phase.shape[1]):
        theta += parameters.phase[foot, j] * state.q[j]
    return theta / parameters.half


@kernel
def want(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Find what the joints are to do: `memory.wanted` + θ̈ `memory.slope`."""
    foot, half = memory.stance, parameters.half
    x = phase_of_foot(state, parameters, foot)
    rate = 0.0
    for j in range(robot.nv):
        rate += parameters.phase[foot, j] * state.v[j]
    for i in range(robot.nu):
        value, slope, curvature = series(parameters.coefficients[foot], i, x)
        memory.slope[i] = slope / half
        memory.wanted[i] = curvature * (rate / half) ** 2
        memory.error[i] = state.joint_position[i] - value
        memory.error_rate[i] = state.joint_velocity[i] - memory.slope[i] * rate
    outputs, joints = parameters.outputs[foot], parameters.joints[foot]
    for i in range(robot.nu):
        y, y_rate = 0.0, 0.0
        for k in range(robot.nu):
            y += outputs[i, k] * memory.error[k]
            y_rate += outputs[i, k] * memory.error_rate[k]
        if parameters.epsilon > 0.0:
            law = finite_time(y, y_rate, parameters.epsilon, parameters.exponent)
        else:
            law = -parameters.kp[i] * y - parameters.kd[i] * y_rate
        for k in range(robot.nu):
            memory.wanted[k] += joints[k, i] * law


@kernel
def hold_foot(
    state: ControlState, contacts: Contacts, robot: ControlledRobot, phase: Floats, foot: int
) -> None:
    """Hold a point foot; the phase is the last row of `robot.held`."""
    hold_point(robot, state, contacts, foot)
    add_row(phase[foot], robot.held)
    solve_rows(robot.unactuated, robot.held)


@kernel
def demand(
    state: ControlState, robot: ControlledRobot, accelerations: Floats, slope: Floats
) -> float:
    """Write `robot.force` that gives joints the accelerations + θ̈ slope, the foot held; tell θ̈."""
    whole, force, other, held = robot.acceleration, robot.force, robot.other, robot.held
    phase, driven = held.count - 1, robot.model.actuator_joint
    for i in range(robot.nu):
        whole[driven[i]] = accelerations[i]
    held.target[phase] = 0.0
    force_wanted(robot, state, force)
    for i in range(robot.nu):
        whole[driven[i]] += slope[i]
    held.target[phase] = 1.0
    force_wanted(robot, state, other)
    missing = force_of_row(phase, force, held)
    share = -missing / (force_of_row(phase, other, held) - missing)
    for j in range(robot.nv):
        force[j] += share * (other[j] - force[j])
    return share


@controller
def virtual_constraints(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques that make the outputs obey ÿ = u(y, ẏ) on a point foot."""
    gone = phase_of_foot(state, parameters, memory.stance)
    exchange_at_touchdown(t, gone, LANDS_AFTER, contacts, robot.contact_foot, memory)
    want(state, robot, parameters, memory)
    hold_foot(state, contacts, robot, parameters.phase, memory.stance)
    demand(state, robot, memory.wanted, memory.slope)
    joint_torques(robot, torque)


class VirtualConstraints(Law):
    """Walk on point feet by virtual constraints: the joints follow a phase of the robot.

    There is no clock: a push moves the robot on along the same postures, faster or slower, and what
    its steps do to that speed is in :func:`~heelstrike.zero_dynamics`.

    Left and right change places when the swing foot has met the ground in the second half of a
    step. Beyond either end of the range of the phase the postures soon go on along a straight line.

    Parameters
    ----------
    gait : PhasedGait
        The gait, with the robot it is for.
    kp, kd : float or (nu,) float
        Gains of ÿ = −kp y − kd ẏ, in 1/s² and 1/s.
    finite_time : float, optional
        Time scale ε (s) of the law of Bhat and Bernstein, which is used instead of gains:
        ÿ = ψ(y, εẏ)/ε².
    exponent : float
        Its exponent, above 0 and below 1.
    outputs : (nu, nu) array, optional
        C of y = C (q_a − h_d(θ)), a row an output; the joints themselves by default. Laws that are
        the same linear one for all outputs do not depend on it.

    Raises
    ------
    ControllerError
        If gains or outputs do not fit the robot.
    """

    def __init__(
        self,
        gait: PhasedGait,
        *,
        kp: ArrayLike = 400.0,
        kd: ArrayLike = 40.0,
        finite_time: float | None = None,
        exponent: float = 0.9,
        outputs: ArrayLike | None = None,
    ) -> None:
        must_be(PhasedGait, "gait", gait)
        robot = gait.robot
        if finite_time is not None:
            positive("finite_time", finite_time)
        number_of("exponent", exponent)
        if not 0.0 < exponent < 1.0:
            raise ControllerError(
                f"the exponent of a finite-time law lies between 0 and 1, got {exponent!r}"
            )
        first, last = gait.phase_range
        phase, constant = gait.on_both_feet()
        matrix = _outputs(robot, outputs)
        mirrored = matrix @ gait.joint_mirror()
        both = [matrix, mirrored] if gait.stance_foot == 0 else [mirrored, matrix]
        parameters = Parameters(
            kp=gains_of("kp", kp, robot),
            kd=gains_of("kd", kd, robot),
            epsilon=0.0 if finite_time is None else float(finite_time),
            exponent=float(exponent),
            phase=phase,
            middle=0.5 * (first + last) - constant,
            half=0.5 * (last - first),
            coefficients=gait.coefficients_on_both_feet(),
            outputs=np.array(both),
            joints=np.linalg.inv(both),
        )
        super().__init__(
            virtual_constraints, parameters, memory={"stance": gait.stance_foot}, robot=robot
        )
        self.gait = gait


def _outputs(robot: Robot, outputs: ArrayLike | None) -> Floats:
    matrix = np.eye(robot.nu) if outputs is None else numbers_of("outputs", outputs)
    if matrix.shape != (robot.nu, robot.nu) or not np.all(np.isfinite(matrix)):
        raise ControllerError(
            f"outputs must be a matrix of finite numbers of shape ({robot.nu}, {robot.nu}), a row "
            f"an output and a column an actuator; got {outputs!r}"
        )
    if np.linalg.cond(matrix) > 1e8:
        raise ControllerError("outputs must be independent of each other: their matrix is singular")
    return matrix
