"""The linear-quadratic regulator about a motion of any phases.

    τ = τ_d(s) + K(s) (x_d(s) − x),   x = (q, v),   s the time since the phase began

A phase begins at its touchdown, whenever that is. How far the robot has come along the ground does
not matter, and heights count from where it came down last.
"""

from __future__ import annotations

from itertools import repeat

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.bundle import array, cell
from heelstrike.compiler.compilation import kernel
from heelstrike.control.arguments import must_be, weights_of
from heelstrike.control.followed_motion import (
    FollowedMotion,
    PhaseClock,
    advance_phase,
    followed_motion,
    place_in_phase,
)
from heelstrike.control.gait_lqr.phases import PhasedOrbit
from heelstrike.control.gait_lqr.table import feed_back, interpolated
from heelstrike.control.gait_lqr.transverse import multipliers_of
from heelstrike.errors import ControllerError
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.motion.request import Repeat
from heelstrike.gait.polynomials import motion_in_piece
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance_clock import LANDED_SPEED

PLACES = 96
"""Intervals of a phase at whose ends torques and gains are kept."""

LONGEST_LANDING = 0.01
"""Time (s) after which what has touched without coming to rest counts as landed."""


class Parameters(FollowedMotion):
    """Numbers of the law."""

    up: Floats = array(2)
    """Direction away from the ground."""
    torque: Floats = array("phases", "places", "nu")
    gains: Floats = array("phases", "places", "nu", "2 nv")
    """Torques of the motion, and K, evenly over each phase; between them they are linear."""


class Memory(PhaseClock):
    """What the law remembers; the rest is scratch."""

    level: float = cell(float)
    """How high the ground is where the robot came down last (m)."""
    levelled: int = cell(int)
    """Whether that is known yet."""
    landed: int = cell(int)
    """Whether it is past that impact."""
    error: Floats = array("2 nv")
    """What the state lacks of the motion."""


@kernel
def all_landed(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory,
) -> bool:  # fmt: skip
    """Whether all points that stand in this phase have come down."""
    landed = memory.landed == 1 or t - memory.start > LONGEST_LANDING
    if not landed:
        landed = True
        for i in range(robot.nc):
            if parameters.stands[memory.phase, 2 * i] == 1:
                robot.contact_velocity(state, contacts, i, robot.three)
                landed = landed and -robot.three[0] < LANDED_SPEED
    memory.landed = 1 if landed else 0
    return landed


@kernel
def find_errors(
    t: float, landed: bool, state: ControlState, parameters: Parameters, memory: Memory
) -> None:
    """Write what the state lacks of the motion; no velocities while the robot is landing."""
    piece, inside, moves = place_in_phase(t, parameters, memory)
    error, terms, n = memory.error, parameters.pieces[piece], state.q.shape[0]
    for j in range(n):
        position, velocity, _ = motion_in_piece(terms, j, inside, moves)
        error[j] = position - state.q[j]
        error[n + j] = velocity - state.v[j] if landed else 0.0
    x, z = parameters.up[0], parameters.up[1]
    lower = x * error[0] + z * error[1] + memory.level
    error[0], error[1] = lower * x, lower * z


@kernel
def first_level(contacts: Contacts, parameters: Parameters, phase: int) -> float:
    """How high the ground is under the nearest point that stands; its lowest if none does."""
    level, nearest, stands = np.inf, np.inf, False
    for i in range(contacts.gap.shape[0]):
        gap = contacts.gap[i]
        x = contacts.position[i, 0] - gap * contacts.normal[i, 0]
        z = contacts.position[i, 1] - gap * contacts.normal[i, 1]
        height = parameters.up[0] * x + parameters.up[1] * z
        if parameters.stands[phase, 2 * i] == 1:
            if gap < nearest:
                level, nearest, stands = height, gap, True
        elif not stands:
            level = min(level, height)
    return level


@controller
def motion_lqr(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    if memory.levelled == 0:
        memory.level = first_level(contacts, parameters, memory.phase)
        memory.levelled = 1
    touched = advance_phase(t, contacts, parameters, memory)
    if touched >= 0:
        x, z = contacts.position[touched, 0], contacts.position[touched, 1]
        memory.level = parameters.up[0] * x + parameters.up[1] * z
        memory.landed = 0
    landed = all_landed(t, state, contacts, robot, parameters, memory)
    find_errors(t, landed, state, parameters, memory)
    phase = memory.phase
    share = (t - memory.start) / parameters.duration[phase]
    feed_back(share, parameters.torque[phase], parameters.gains[phase], memory.error, torque)


class MotionLQR(Law):
    """Walk or run by the linear-quadratic regulator about a motion of any phases.

    The torques are those of the motion at the time since its phase began, and gains times what the
    whole state differs from it; the gains solve the Riccati equation of all cycles to come, impacts
    included. So what no motor moves directly, as a trunk on a point foot or in flight, is steered
    by what the next touchdowns make of it. See ``docs/lqr.md`` for the theory and what it cannot
    do.

    Parameters
    ----------
    robot : Robot
        The robot that the motion was designed for.
    motion : Motion
        The motion. What comes down must do so at 0.02 m/s at the least: design it with
        `landing_speed`.
    position_weight, velocity_weight : float or (nv,) array
        What errors of all coordinates and their velocities cost (1/rad², 1/m²; s²/rad², s²/m²).
        How far the trunk has come along the ground counts for nothing.
    torque_weight : float or (nu,) array
        What torques cost besides those of the motion, 1/(N m)².

    Attributes
    ----------
    multipliers : (2 nv - 1,) complex
        Floquet multipliers of a cycle that the linear equations predict, the largest first; empty
        for a motion that never repeats.

    Raises
    ------
    ControllerError
        If a weight does not fit, a touchdown has no derivative, or the motors cannot stabilise the
        motion.
    GaitError
        If the motion was designed for another robot.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("rabbit")
    >>> run = [hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=4),
    ...        hs.ContactPhase(duration=(0.05, 0.3), pieces=3)]
    >>> motion = hs.optimize_motion(robot, run, speed=2.0, starts=1)
    >>> law = hs.MotionLQR(robot, motion)
    >>> bool(abs(law.multipliers[0]) < 1.0)
    True
    """

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        *,
        position_weight: ArrayLike = 1e4,
        velocity_weight: ArrayLike = 1e2,
        torque_weight: ArrayLike = 1.0,
    ) -> None:
        must_be(Robot, "robot", robot)
        must_be(Motion, "motion", motion)
        motion.check_robot(robot)
        refuse_loops(robot, "a regulator about a motion", ControllerError)
        by_position = weights_of("position_weight", position_weight, robot.nv)
        by_velocity = weights_of("velocity_weight", velocity_weight, robot.nv)
        effort = weights_of("torque_weight", torque_weight, robot.nu, positive=True)
        orbit = PhasedOrbit(robot, motion)
        found = orbit.regulator(by_position, by_velocity, effort)
        even = np.linspace(0.0, 1.0, PLACES + 1)
        middles = [(np.arange(len(each)) + 0.5) / len(each) for each in found]
        gains = [interpolated(*each, even) for each in zip(found, middles, strict=True)]
        self.multipliers: NDArray[np.complex128] = np.zeros(0, np.complex128)
        if motion.repeat is not Repeat.NEVER:
            # What the tables make of the gains is what is predicted.
            kept = [interpolated(*each) for each in zip(gains, repeat(even), middles, strict=False)]
            self.multipliers = multipliers_of(orbit.across(orbit.over_a_cycle(kept)))
            if not np.all(np.abs(self.multipliers) < 1.0):
                raise ControllerError(
                    "no regulator makes this motion repeat: its largest multiplier is "
                    f"{abs(self.multipliers[0]):.3g}. Try other weights"
                )
        torques = [orbit.torques(p, phase.duration * even) for p, phase in enumerate(motion.phases)]
        if motion.repeat is Repeat.MIRRORED:
            for each in range(len(motion.phases)):
                image = _in_the_mirror(robot, torques[each], gains[each])
                torques.append(image[0])
                gains.append(image[1])
        parameters = Parameters(
            **followed_motion(robot, motion),
            up=np.array([-orbit.along[1], orbit.along[0]]),
            torque=np.array(torques),
            gains=np.array(gains),
        )
        super().__init__(motion_lqr, parameters, memory={"landed": 1}, robot=robot)
        self.motion = motion


def _in_the_mirror(robot: Robot, torques: Floats, gains: Floats) -> tuple[Floats, Floats]:
    """Torques (places, nu) and gains (places, nu, 2 nv) of the mirror image of a phase."""
    mirror = robot.mirror
    assert mirror is not None  # see Motion
    driven = mirror.among(robot.model.actuator_joint)
    sign = np.tile(mirror.sign, 2)
    both = np.concatenate([mirror.joint, robot.nv + mirror.joint])
    return (
        driven.sign * torques[:, driven.joint],
        driven.sign[:, None] * gains[:, driven.joint][:, :, both] * sign,
    )
