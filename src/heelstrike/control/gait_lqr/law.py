"""The linear-quadratic regulator about a walk: torques by the phase of the robot.

    τ = τ_d(θ) − K(θ) (x − x_d(θ)),   x = (q, v) but for where the trunk is

Walk and gains are Chebyshev series of the phase. On the other foot the robot is looked at in the
mirror, and its torques are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle, array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.arguments import weights_of
from heelstrike.control.gait_lqr.orbit import NODES, Course, nodes, orbit_of
from heelstrike.control.gait_lqr.transverse import FINE, Transverse, multipliers_of
from heelstrike.errors import ControllerError
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance_clock import StanceClock, exchange_at_touchdown

LANDS_AFTER = 0.5
"""A swing foot that meets the ground before this part of the phase scuffs; after it, it lands."""

BEYOND = 0.01
"""Series go on for this part of half the phase beyond either end; then they stay as they are."""


class Parameters(Bundle):
    """Numbers of the law."""

    stance: int = number(int)
    """The foot that stands as the walk is given."""
    joint: Integers = array("nv", of=int)
    sign: Floats = array("nv")
    offset: Floats = array("nq")
    """joint, sign, offset: The mirror: q[j] of the image is sign[j] q[joint[j]] + offset[j]."""
    actuator: Integers = array("nu", of=int)
    actuator_sign: Floats = array("nu")
    """actuator, actuator_sign: That of the torques."""
    phase: Floats = array("nv")
    """Factors of the coordinates in θ."""
    first: float = number(float)
    width: float = number(float)
    """first, width: Where θ begins, and how far it goes (rad)."""
    walk: Floats = array("2 nv", "terms")
    """Coordinates and velocities of the walk, as Chebyshev series over the range of θ."""
    torque: Floats = array("nu", "terms")
    gains: Floats = array("nu", "2 nv", "terms")
    """Torques of the walk, and K, likewise."""


class Memory(StanceClock):
    """What the law remembers: the foot that stands. The rest is scratch."""

    x: Floats = array("2 nv")
    away: Floats = array("2 nv")
    """x, away: State as in the walk, and how far from it."""
    asked: Floats = array("nu")
    """Torques as in the walk."""
    polynomial: Floats = array("terms")
    """Chebyshev polynomials at the phase."""


class Log(Bundle):
    """What the law tells of itself."""

    phase: float = cell(float, label="Phase of the step")
    """θ as a part of its range, from 0 to 1."""


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
def find_polynomials(x: float, polynomial: Floats) -> None:
    """Write the Chebyshev polynomials at x."""
    before, now = 1.0, x
    polynomial[0] = before
    for k in range(1, polynomial.shape[0]):
        polynomial[k] = now
        before, now = now, 2.0 * x * now - before


@kernel
def value(series: Floats, polynomial: Floats) -> float:
    """Value of a series."""
    total = 0.0
    for k in range(polynomial.shape[0]):
        total += series[k] * polynomial[k]
    return total


@controller
def gait_lqr(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    part = seen_as_in_the_walk(state, parameters, memory)
    if exchange_at_touchdown(t, part, LANDS_AFTER, contacts, robot.contact_foot, memory):
        part = seen_as_in_the_walk(state, parameters, memory)
    log.phase = part
    x = min(max(2.0 * part - 1.0, -1.0 - BEYOND), 1.0 + BEYOND)
    polynomial = memory.polynomial
    find_polynomials(x, polynomial)
    count = memory.x.shape[0]
    for j in range(count):
        memory.away[j] = memory.x[j] - value(parameters.walk[j], polynomial)
    for i in range(robot.nu):
        total = value(parameters.torque[i], polynomial)
        for j in range(count):
            total -= value(parameters.gains[i, j], polynomial) * memory.away[j]
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
        position_weight: ArrayLike = 1e6,
        velocity_weight: ArrayLike = 1e3,
        torque_weight: ArrayLike = 1.0,
    ) -> None:
        if not isinstance(gait, PhasedGait):
            raise ControllerError(
                "a regulator about a walk needs a gait over a phase: "
                "hs.PhasedGait.from_gait(robot, gait)"
            )
        robot = gait.robot
        cost = np.concatenate(
            [
                weights_of("position_weight", position_weight, robot.nv)[2:],
                weights_of("velocity_weight", velocity_weight, robot.nv)[2:],
            ]
        )
        effort = weights_of("torque_weight", torque_weight, robot.nu, positive=True)
        orbit = orbit_of(gait)
        transverse = Transverse.of(orbit)
        found = transverse.regulator(np.diag(cost), np.diag(effort))
        first, last = orbit.q.first, orbit.q.last
        gains = Course.through(first, last, found(nodes(first, last)))
        # What the series make of the gains is what is predicted.
        fine = Transverse.of(orbit, FINE)
        step = fine.over_a_step(gains(fine.theta) @ fine.basis)
        self.multipliers = multipliers_of(step)
        if not np.all(np.abs(self.multipliers) < 1.0):
            raise ControllerError(
                "no stabilising regulator was found for this walk; try other weights"
            )
        self.gait = gait
        size = robot.nv - 2
        whole = np.zeros((NODES, robot.nu, 2 * robot.nv))
        whole[:, :, 2 : robot.nv] = gains.coefficients[:, :, :size]
        whole[:, :, robot.nv + 2 :] = gains.coefficients[:, :, size:]
        walk = np.hstack([orbit.q.coefficients, orbit.v.coefficients])
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
            first=first,
            width=last - first,
            walk=_terms_last(walk),
            torque=_terms_last(orbit.torque.coefficients),
            gains=_terms_last(whole),
        )
        begin = {"stance": gait.stance_foot, "terms": NODES}
        super().__init__(gait_lqr, parameters, memory=begin, robot=robot)


def _terms_last(coefficients: Floats) -> Floats:
    return np.ascontiguousarray(np.moveaxis(coefficients, 0, -1))
