"""A motion of any phases, followed by computed torque (paper section 4.1, for any contacts).

At each instant the law looks for the accelerations v̇ and contact forces λ nearest to those of the
motion that are possible with the contacts of its phase:

    minimise  |v̇_J − v̇ᵈ_J|² + ε |λ − λᵈ|²   with   A v̇ + H = Jᵀλ (coordinates without a motor),
                                                     J v̇ + J̇v = 0,

where v̇ᵈ_J = q̈ᵈ + kp (qᵈ − q) + kd (q̇ᵈ − q̇) are those wanted of the joints (eq. 38). The torques
follow from the equations of the coordinates with motors. On a flat foot this is the paper's law; on
a point or in flight the trunk follows from the joints; on two feet the forces of the motion say how
these share the load.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import array, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.arguments import gains_of, must_be
from heelstrike.control.followed_motion import (
    FollowedMotion,
    PhaseClock,
    advance_phase,
    cycle_of,
    followed_motion,
    place_in_phase,
)
from heelstrike.dynamics.dense import solve_to_rank
from heelstrike.errors import ControllerError
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.polynomials import motion_in_piece
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

PRICE_OF_FORCES = 1e-6
"""ε, in (m/s²)² for forces of the robot's weight: so small that forces give way before motion."""


class Parameters(FollowedMotion):
    """Numbers of the law."""

    force: Floats = array("pieces", "stages", "rows")
    """Coefficients of the contact forces (N), (normal, tangent) point by point."""
    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Gains (1/s², 1/s)."""
    weight: float = number(float)
    """Of the robot (N)."""


class Memory(PhaseClock):
    """What the law remembers, and its scratch."""

    mass: Floats = array("nv", "nv")
    bias: Floats = array("nv")
    passive: Floats = array("nv")
    wanted: Floats = array("nv")
    """mass, bias, passive, wanted: A, H, forces of springs and dampers, v̇ᵈ."""
    jacobian: Floats = array("rows", "nv")
    moved: Floats = array("rows")
    reference: Floats = array("rows")
    """jacobian, moved, reference: Jacobian of the contact points, J̇v, λᵈ."""
    system: Floats = array("unknowns", "unknowns + 1")
    unknown: Floats = array("unknowns")
    order: Integers = array("unknowns", of=int)
    """system, unknown, order: The linear equations of the minimum."""
    held: Integers = array("rows", of=int)
    """Rows that hold the robot, one after the other."""


@kernel
def solve_for_nearest(
    count: int, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Find v̇ and λ nearest to what is wanted, the first unknowns.

    Unknowns are v̇ (nv,), the `count` forces along the rows that hold in units of the weight, and
    multipliers of the equations of motion and of the rows.
    """
    n, free = robot.nv, robot.unactuated.shape[0]
    size = n + count + free + count
    system, weight = memory.system, parameters.weight
    for i in range(size):
        for j in range(size + 1):
            system[i, j] = 0.0
    for i in range(robot.nu):
        joint = robot.model.actuator_joint[i]
        system[joint, joint] = 1.0
        system[joint, size] = memory.wanted[joint]
    for k in range(count):
        system[n + k, n + k] = PRICE_OF_FORCES
        system[n + k, size] = PRICE_OF_FORCES * memory.reference[memory.held[k]] / weight
    for f in range(free):
        j, row = robot.unactuated[f], n + count + f
        for i in range(n):
            system[row, i] = system[i, row] = memory.mass[j, i] / weight
        for k in range(count):
            system[row, n + k] = system[n + k, row] = -memory.jacobian[memory.held[k], j]
        system[row, size] = (memory.passive[j] - memory.bias[j]) / weight
    for k in range(count):
        row = n + count + free + k
        for i in range(n):
            system[row, i] = system[i, row] = memory.jacobian[memory.held[k], i]
        system[row, size] = -memory.moved[memory.held[k]]
    solve_to_rank(size, system, memory.order, memory.unknown)


@controller
def motion_tracking(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Torques that make the joints follow the motion."""
    count = look_at_phase(t, state, contacts, robot, parameters, memory)
    solve_for_nearest(count, robot, parameters, memory)
    for i in range(robot.nu):
        torque[i] = torque_needed(i, count, robot, parameters, memory)


@kernel
def look_at_phase(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory,
) -> int:  # fmt: skip
    """Find what the motion wants now, and the equations of motion; return how many rows hold.

    Of coordinates without a motor the accelerations of the motion are wanted.
    """
    advance_phase(t, contacts, parameters, memory)
    phase = memory.phase
    piece, inside, moves = place_in_phase(t, parameters, memory)
    for f in range(robot.unactuated.shape[0]):
        joint = robot.unactuated[f]
        _, _, acceleration = motion_in_piece(parameters.pieces[piece], joint, inside, moves)
        memory.wanted[joint] = acceleration
    for i in range(robot.nu):
        joint = robot.model.actuator_joint[i]
        position, velocity, acceleration = motion_in_piece(
            parameters.pieces[piece], joint, inside, moves
        )
        memory.wanted[joint] = (
            acceleration
            + parameters.kp[i] * (position - state.joint_position[i])
            + parameters.kd[i] * (velocity - state.joint_velocity[i])
        )
    robot.mass_matrix(state, memory.mass)
    robot.bias_force(state, memory.bias)
    robot.passive_force(state, memory.passive)
    count = 0
    for i in range(robot.nc):
        if parameters.stands[phase, 2 * i] == 1 or parameters.stands[phase, 2 * i + 1] == 1:
            robot.contact_jacobian(state, contacts, i, memory.jacobian[2 * i : 2 * i + 2])
            robot.contact_bias_acceleration(state, contacts, i, memory.moved[2 * i : 2 * i + 2])
        for row in range(2 * i, 2 * i + 2):
            if parameters.stands[phase, row] == 1:
                memory.held[count] = row
                count += 1
    terms, reference = parameters.force[piece], memory.reference
    for row in range(terms.shape[1]):
        reference[row] = 0.0
        for k in range(terms.shape[0] - 1, -1, -1):
            reference[row] = reference[row] * inside + terms[k, row]
    return count


@kernel
def torque_needed(
    actuator: int, count: int, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> float:
    """Torque of a motor with the accelerations and forces that were found."""
    j = robot.model.actuator_joint[actuator]
    total = memory.bias[j] - memory.passive[j]
    for k in range(robot.nv):
        total += memory.mass[j, k] * memory.unknown[k]
    for k in range(count):
        force = parameters.weight * memory.unknown[robot.nv + k]
        total -= memory.jacobian[memory.held[k], j] * force
    return total


class MotionTracking(Law):
    """Follow a motion of any phases by computed torque.

    A phase ends when the points come down that stand in the next one, in its second half; one in
    which nothing comes down ends by time, and so at the latest does one in which a foot that stands
    rolls onto other points of its own at less than 0.02 m/s. Where a faster touchdown fails to
    come, the motion stands still soon after the end of its phase. Nothing brings back what the
    joints do not reach, as the pitch of a trunk on a point: motions may be unstable under this law,
    and :class:`~heelstrike.MotionLQR` makes them stable.

    Parameters
    ----------
    robot : Robot
        The robot that the motion was designed for.
    motion : Motion
        The motion.
    kp, kd : float or (nu,) array
        Gains of eq. 38, in 1/s² and 1/s.

    Raises
    ------
    ControllerError
        If the gains do not fit the robot.
    GaitError
        If the motion was designed for another robot.
    """

    def __init__(
        self, robot: Robot, motion: Motion, *, kp: ArrayLike = 400.0, kd: ArrayLike = 40.0
    ) -> None:
        must_be(Robot, "robot", robot)
        must_be(Motion, "motion", motion)
        numbers, sizes = tracked(robot, motion, kp, kd)
        super().__init__(motion_tracking, Parameters(**numbers), memory=sizes, robot=robot)
        self.motion = motion


def tracked(
    robot: Robot, motion: Motion, kp: ArrayLike, kd: ArrayLike
) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the numbers of the law about a motion, and how much it remembers."""
    motion.check_robot(robot)
    refuse_loops(robot, "a law that follows a motion", ControllerError)
    numbers = {
        **followed_motion(robot, motion),
        "force": np.concatenate([phase.force_pieces for phase in cycle_of(robot, motion)]),
        "kp": gains_of("kp", kp, robot),
        "kd": gains_of("kd", kd, robot),
        "weight": robot.weight,
    }
    free = robot.nv - robot.nu
    return numbers, {"unknowns": robot.nv + free + 4 * robot.nc, "rows": 2 * robot.nc}
