"""The linear-quadratic regulator about a walk: torques by the phase of the robot.

    τ = τ_d(θ) − K(θ) (x − x_d(θ)),   x = (q, v) but for where the trunk is

Walk and gains are cubic splines of the phase. On the other foot the robot is looked at in the
mirror, and its torques are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from heelstrike.compiler.bundle import Bundle, array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.gait_lqr.orbit import orbit_of
from heelstrike.control.gait_lqr.transverse import STEPS, Transverse, sorted_by_size
from heelstrike.errors import ControllerError
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

LANDS_AFTER = 0.5
"""A swing foot that meets the ground before this part of the phase scuffs; after it, it lands."""

BEYOND = 0.1
"""Splines go on for this part of the phase beyond either end; then they stay as they are."""


class Parameters(Bundle):
    """Numbers of the law.

    Attributes
    ----------
    stance : int
        The foot that stands as the walk is given.
    joint, sign, offset : (nv,) int, (nv,) and (nq,) float
        The mirror: q[j] of the image is sign[j] q[joint[j]] + offset[j].
    actuator, actuator_sign : (nu,) int and float
        That of the torques.
    phase : (nv,) float
        Factors of the coordinates in θ.
    first, width : float
        Where θ begins, and how far it goes (rad).
    walk : (pieces, 2 nv, 4) float
        Coordinates and velocities of the walk; cubics of the part of a piece gone by, lowest power
        first.
    torque : (pieces, nu, 4) float
        Torques of the walk, likewise.
    gains : (pieces, nu, 2 nv, 4) float
        K, likewise.
    """

    stance: int = number(int)
    joint: Integers = array("nv", of=int)
    sign: Floats = array("nv")
    offset: Floats = array("nq")
    actuator: Integers = array("nu", of=int)
    actuator_sign: Floats = array("nu")
    phase: Floats = array("nv")
    first: float = number(float)
    width: float = number(float)
    walk: Floats = array("pieces", "2 nv", 4)
    torque: Floats = array("pieces", "nu", 4)
    gains: Floats = array("pieces", "nu", "2 nv", 4)


class Memory(Bundle):
    """What the law remembers: the foot that stands. The rest is scratch.

    Attributes
    ----------
    stance : int
    x, away : (2 nv,) float
        State as in the walk, and how far from it.
    asked : (nu,) float
        Torques as in the walk.
    """

    stance: int = cell(int)
    x: Floats = array("2 nv")
    away: Floats = array("2 nv")
    asked: Floats = array("nu")


class Log(Bundle):
    """What the law tells of itself.

    Attributes
    ----------
    phase : float
        θ as a part of its range, from 0 to 1.
    """

    phase: float = cell(float, label="Phase of the step")


@kernel
def seen_as_in_the_walk(state: ControlState, parameters: Parameters, memory: Memory) -> float:
    """Write the state into `x`, in the mirror on the other foot; return the part of θ gone by."""
    theta, n = 0.0, state.v.shape[0]
    for j in range(n):
        if memory.stance == parameters.stance:
            memory.x[j], memory.x[n + j] = state.q[j], state.v[j]
        else:
            k, sign = parameters.joint[j], parameters.sign[j]
            memory.x[j] = sign * state.q[k] + parameters.offset[j]
            memory.x[n + j] = sign * state.v[k]
        theta += parameters.phase[j] * memory.x[j]
    return (theta - parameters.first) / parameters.width


@kernel
def cubic(numbers: Floats, s: float) -> float:
    """Value of a cubic."""
    return numbers[0] + s * (numbers[1] + s * (numbers[2] + s * numbers[3]))


@controller
def gait_lqr(
    state: ControlState, contacts: Contacts, robot: ControlledRobot, parameters: Parameters,
    memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    part = seen_as_in_the_walk(state, parameters, memory)
    swing = 1 - memory.stance
    if part > LANDS_AFTER and contacts.force[robot.foot_contact[swing], 0] > 0.0:
        memory.stance = swing
        part = seen_as_in_the_walk(state, parameters, memory)
    log.phase = part
    pieces = parameters.walk.shape[0]
    place = min(max(part, -BEYOND), 1.0 + BEYOND) * pieces
    piece = min(max(int(place), 0), pieces - 1)
    s = place - piece
    walk, given = parameters.walk[piece], parameters.torque[piece]
    gains = parameters.gains[piece]
    count = memory.x.shape[0]
    for j in range(count):
        memory.away[j] = memory.x[j] - cubic(walk[j], s)
    for i in range(robot.nu):
        total = cubic(given[i], s)
        for j in range(count):
            total -= cubic(gains[i, j], s) * memory.away[j]
        memory.asked[i] = total
    for i in range(robot.nu):
        if memory.stance == parameters.stance:
            torque[i] = memory.asked[i]
        else:
            torque[i] = parameters.actuator_sign[i] * memory.asked[parameters.actuator[i]]


class GaitLQR(Law):
    """Walk on point feet by the linear-quadratic regulator about a walk that repeats.

    The torques are those of the walk at the phase that the robot has, and gains times what the
    state differs from it there; the gains solve the Riccati equation of all steps to come, impacts
    included. See ``docs/lqr.md`` for the theory and what it cannot do.

    Parameters
    ----------
    gait : PhasedGait
        The gait, with the robot it is for; one that an impact leads back to, see
        :func:`~heelstrike.make_invariant`.
    position_weight, velocity_weight : float or (nv,) array
        What differences from the walk cost, of each coordinate and its velocity (1/rad², s²/rad²).
        Those of where the trunk is count for nothing.
    torque_weight : float or (nu,) array
        What torques cost besides those of the walk, 1/(N m)².
    pieces : int
        Cubic pieces of the splines.

    Attributes
    ----------
    multipliers : (2 nv - 5,) complex
        Floquet multipliers that the linear equations predict, the largest first.

    Raises
    ------
    ControllerError
        If a weight does not fit, no walk over the gait repeats, or the motors cannot stabilise it.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("rabbit")
    >>> gait = hs.optimize_gait(
    ...     robot, step_length=0.21, step_duration=0.58, clearance=0.02, friction=0.6
    ... )
    >>> phased = hs.PhasedGait.from_gait(robot, gait)
    >>> law = hs.GaitLQR(phased)
    >>> start = hs.zero_dynamics(phased).initial_state
    >>> hs.simulate(robot, law, state=start, duration=2.0).completed
    True
    """

    def __init__(
        self,
        gait: PhasedGait,
        *,
        position_weight: ArrayLike = 1e4,
        velocity_weight: ArrayLike = 1e2,
        torque_weight: ArrayLike = 1.0,
        pieces: int = 64,
    ) -> None:
        robot = gait.robot
        if pieces < 8 or STEPS % pieces:
            raise ControllerError(
                f"pieces must be a divisor of {STEPS}, from 8 on, got {pieces!r}"
            )
        cost = np.concatenate(
            [
                _weights("position_weight", position_weight, robot.nv)[2:],
                _weights("velocity_weight", velocity_weight, robot.nv)[2:],
            ]
        )
        effort = _weights("torque_weight", torque_weight, robot.nu)
        if np.any(effort == 0.0):
            raise ControllerError(f"torque_weight must be positive, got {torque_weight!r}")
        orbit = orbit_of(gait)
        transverse = Transverse.of(orbit)
        found = transverse.regulator(np.diag(cost), np.diag(effort)) @ transverse.basis.T
        theta = transverse.theta[:: 2 * STEPS // pieces]
        gains = CubicSpline(theta, found[:: STEPS // pieces])
        # What the splines make of the gains is what is predicted.
        step = transverse.over_a_step(gains(transverse.theta) @ transverse.basis)
        self.multipliers = sorted_by_size(np.linalg.eigvals(step))
        if not np.all(np.abs(self.multipliers) < 1.0):
            raise ControllerError("no regulator makes this walk repeat; try other weights")
        self.gait = gait
        size = robot.nv - 2
        whole = np.zeros((len(theta), robot.nu, 2 * robot.nv))
        spline = np.asarray(gains(theta))
        whole[:, :, 2 : robot.nv] = spline[:, :, :size]
        whole[:, :, robot.nv + 2 :] = spline[:, :, size:]
        mirror = robot.mirror
        assert mirror is not None  # see PhasedGait
        driven = mirror.among(robot.model.actuator_joint)
        parameters = Parameters(
            stance=gait.stance_foot,
            joint=mirror.joint,
            sign=mirror.sign,
            offset=mirror.offset,
            actuator=driven.joint,
            actuator_sign=driven.sign,
            phase=gait.phase,
            first=float(theta[0]),
            width=float(theta[-1] - theta[0]),
            walk=_cubics(theta, np.hstack([orbit.q(theta), orbit.v(theta)])),
            torque=_cubics(theta, orbit.torque(theta)),
            gains=_cubics(theta, whole),
        )
        super().__init__(gait_lqr, parameters, memory={"stance": gait.stance_foot}, robot=robot)


def _cubics(theta: Floats, values: Floats) -> Floats:
    """Coefficients of a spline, (pieces, ..., 4), in the part of each piece that has gone by."""
    spline = CubicSpline(theta, values)
    width = (theta[1] - theta[0]) ** np.arange(4)
    return np.ascontiguousarray(np.moveaxis(spline.c[::-1], 0, -1) * width)


def _weights(name: str, value: ArrayLike, size: int) -> NDArray[np.float64]:
    weights = np.asarray(value, dtype=np.float64)
    fits = weights.ndim <= 1 and weights.size in (1, size)
    if not fits or not np.all(np.isfinite(weights)) or np.any(weights < 0.0):
        raise ControllerError(
            f"{name} must be one number that is not negative, or {size} of them, got {value!r}"
        )
    return np.broadcast_to(weights, (size,)).copy()
