"""The linear-quadratic regulator about a gait on flat feet: torques by the time since touchdown.

    τ = τ_d(s) + K(s) (x_d(s) − x),   x = (q, q̇) of the joints

On the other foot errors are looked at in the mirror, and torques are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.bundle import array, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.arguments import check_gait, positive, weights_of
from heelstrike.control.computed_torque import pitch_of
from heelstrike.control.followed_gait import FollowedGait, followed
from heelstrike.control.gait_lqr.flat import FINE, KEPT, FlatOrbit
from heelstrike.control.gait_lqr.table import feed_back, interpolated
from heelstrike.control.gait_lqr.transverse import multipliers_of
from heelstrike.errors import ControllerError
from heelstrike.gait.gait import Footing, Gait
from heelstrike.gait.polynomials import motion_in_piece, place_in_step
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance_clock import StanceClock, exchange_at_touchdown, has_landed

REPEATS = 1e-6
"""Impacts may lead this far from the beginning of the gait (rad, rad/s)."""

FEWEST = 20
"""Calls a step with which the regulator is still one of the step."""


class Parameters(FollowedGait):
    """Numbers of the law."""

    first: int = number(int)
    """The foot that stands as torques and gains are given."""
    actuator: Integers = array("nu", of=int)
    actuator_sign: Floats = array("nu")
    """actuator, actuator_sign: The mirror of the joints."""
    duration: float = number(float)
    """Of a step (s)."""
    torque: Floats = array("places", "nu")
    gains: Floats = array("places", "nu", "2 nu")
    """Torques of the gait, and K, evenly over the step; between them they are linear."""


class Memory(StanceClock):
    """What the law remembers; the rest is scratch."""

    away: Floats = array("2 nu")
    """Errors as on the first foot."""
    asked: Floats = array("nu")
    """Torques as on the first foot."""
    error: Floats = array("2 nu")
    """Errors."""


@kernel
def find_errors(state: ControlState, parameters: Parameters, memory: Memory, phase: float) -> None:
    """Write what joints lack of the gait at a time in the step, and their velocities."""
    piece, inside, moves = place_in_step(phase, parameters.latest, parameters.breakpoints)
    terms = parameters.coefficients[memory.stance, piece]
    count = terms.shape[1]
    for i in range(count):
        position, velocity, _ = motion_in_piece(terms, i, inside, moves)
        memory.error[i] = position - state.joint_position[i]
        memory.error[count + i] = velocity - state.joint_velocity[i]


@controller
def flat_gait_lqr(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    exchange_at_touchdown(
        t, t - memory.start, parameters.earliest, contacts, robot.contact_foot, memory
    )
    landed = has_landed(t, parameters.landing, state, contacts, robot, memory)
    phase = t - memory.start
    find_errors(state, parameters, memory, phase)
    n, first = robot.nu, memory.stance == parameters.first
    for i in range(n):
        j, sign = (i, 1.0) if first else (parameters.actuator[i], parameters.actuator_sign[i])
        memory.away[i] = sign * memory.error[j]
        memory.away[n + i] = sign * memory.error[n + j] if landed else 0.0
    share = phase / parameters.duration
    feed_back(share, parameters.torque, parameters.gains, memory.away, memory.asked)
    for i in range(n):
        if first:
            torque[i] = memory.asked[i]
        else:
            torque[i] = parameters.actuator_sign[i] * memory.asked[parameters.actuator[i]]


class FlatGaitLQR(Law):
    """Walk on flat feet by the linear-quadratic regulator about a gait.

    The torques are those of the gait at the time since the last touchdown, and gains times what the
    joints differ from it; the gains solve the Riccati equation of all steps to come, impacts
    included. See ``docs/lqr.md`` for the theory and what it cannot do.

    Parameters
    ----------
    robot : Robot
        A floating robot with two mirrored flat feet, all joints but the trunk's actuated.
    gait : Gait
        The gait, which stands on one flat foot at a time and which its impact leads back to.
    position_weight, velocity_weight : float or (nu,) array
        What errors of the joints and their velocities cost (1/rad², s²/rad²).
    torque_weight : float or (nu,) array
        What torques cost besides those of the gait, 1/(N m)².
    period : float or None
        Seconds between two calls, for which the regulator is found: torques are held meanwhile.
        None for a law that acts continuously, or every millisecond.

    Attributes
    ----------
    multipliers : (2 nu,) complex
        Floquet multipliers of a step that the linear equations predict, the largest first: of the
        mean of those in which heel or toe come down first.
    either : tuple of two float
        Size of the largest if one end of the sole always comes down first, and if the other does.

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, the gait, a weight or the period does not fit
        it, or the motors cannot stabilise it.

    Notes
    -----
    Without a period the gains are those of torques that follow at once. With the usual weights
    errors of a light foot die within a millisecond: a law that is called less often has to know.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, starts=1)
    >>> law = hs.FlatGaitLQR(robot, gait)
    >>> hs.simulate(robot, law, state=gait.initial_state, duration=1.4).completed
    True
    """

    def __init__(
        self,
        robot: Robot,
        gait: Gait,
        *,
        position_weight: ArrayLike = 1e5,
        velocity_weight: ArrayLike = 1e3,
        torque_weight: ArrayLike = 1.0,
        period: float | None = None,
    ) -> None:
        check_gait(robot, gait)
        refuse_loops(robot, "a regulator about a gait", ControllerError)
        pitch_of(robot)
        _check(robot, gait)
        by_position = weights_of("position_weight", position_weight, robot.nu)
        by_velocity = weights_of("velocity_weight", velocity_weight, robot.nu)
        effort = weights_of("torque_weight", torque_weight, robot.nu, positive=True)
        orbit = FlatOrbit(robot, gait)
        if not orbit.misses < REPEATS:
            raise ControllerError(
                f"the impact of robot {robot.name!r} at the end of this gait does not lead "
                f"to its start: it is {orbit.misses:.2g} rad or rad/s off. Design a gait "
                "with optimize_gait"
            )
        duration = gait.step_duration
        count = None if period is None else _calls(period, duration)
        cost = np.diag(np.concatenate([by_position, by_velocity]))
        found = orbit.regulator(cost, np.diag(effort), count)
        # What the table makes of the gains is what is predicted.
        places = (np.arange(len(found)) + (0.5 if count is None else 0.0)) / len(found)
        even = np.linspace(0.0, 1.0, KEPT + 1)
        gains = interpolated(found, places, even)
        kept = interpolated(gains, even, places)
        step = orbit.over_a_step(kept, held=count is not None)
        self.multipliers: NDArray[np.complex128] = multipliers_of(orbit.jump @ step)
        self.either = tuple(float(abs(multipliers_of(each @ step)[0])) for each in orbit.jumps)
        if not np.all(np.abs(self.multipliers) < 1.0):
            raise ControllerError(
                "no stabilising regulator was found for this walk; try other weights"
            )
        mirror = robot.mirror
        assert mirror is not None  # see pitch_of
        driven = mirror.among(robot.model.actuator_joint)
        # Torques that are held until the next call are those of half way there.
        times = np.linspace(0.0, duration, KEPT + 1) + 0.5 * (period or 0.0)
        parameters = Parameters(
            first=gait.stance_foot,
            actuator=driven.joint,
            actuator_sign=driven.sign,
            **followed(gait),
            duration=duration,
            torque=orbit.torques(times),
            gains=gains,
        )
        begin = {"stance": gait.stance_foot, "landed": 1}
        super().__init__(flat_gait_lqr, parameters, memory=begin, robot=robot, period=period)
        self.gait = gait


def _check(robot: Robot, gait: Gait) -> None:
    """Refuse gaits that do not stand on one flat foot at a time."""
    flat = [phase.contacts == {gait.stance_foot: Footing.FLAT} for phase in gait.phases]
    if not all(flat) or any(len(foot.contacts) < 2 for foot in robot.feet):
        raise ControllerError(
            "this regulator needs a gait that stands on one flat foot at a time; for one on point "
            "feet, hs.GaitLQR(hs.PhasedGait.from_gait(robot, gait))"
        )


def _calls(period: float, duration: float) -> int:
    """How often a law is called in a step, as far as it makes a difference."""
    positive("period", period)
    calls = round(duration / period)
    if calls < FEWEST:
        raise ControllerError(
            f"a period of {period:g} s is too long for steps of {duration:g} s: the law must be "
            f"called {FEWEST} times a step at the least"
        )
    return min(calls, FINE)
