"""The whole body along a motion of any phases: torques by a quadratic programme.

What :mod:`heelstrike.control.motion_tracking` looks for, the accelerations and contact forces
nearest to those of the motion, here within what ground and motors can do:

    minimise  |v̇_J − v̇ᵈ_J|² + w (pitch)² + ε |λ − λᵈ|²

with the equations of motion of coordinates without a motor, J v̇ + J̇v = 0 of the points that stand
in the phase, forces that push and stay in the friction cone of every foot, and torques within the
limits of the motors. If not all can be kept, the friction cones are given up first, then that
forces push, then that points rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.control.balance import shifted_feet
from heelstrike.control.balance.shifted_feet import moved_footholds, shift_feet
from heelstrike.control.balance.tasks import MOTOR_LEVEL, is_solved, torque_range
from heelstrike.control.followed_motion import place_in_phase
from heelstrike.control.motion_tracking import (
    PRICE_OF_FORCES,
    look_at_phase,
    torque_needed,
    tracked,
)
from heelstrike.control.quadratic.program import Program
from heelstrike.control.quadratic.tasks import add_row, clear
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.polynomials import motion_in_piece
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

REST_LEVEL, PUSH_LEVEL, SLIDE_LEVEL = 1, 2, 3
"""In which order rows are given up, the greatest first."""
LEAST_WEIGHT = 1e-6
"""Weight of the trunk's translation, and least of its rotation: what stands says where the trunk
is, and this only makes the least one point."""


class Parameters(shifted_feet.Parameters):
    """Numbers of the law."""

    link: Integers = array("nc", of=int)
    """Foot, or other link, of every contact point, counted from 0."""
    friction: float = number(float)
    """That the ground is believed to have."""
    pitch: float = number(float)
    """How much the trunk's rotation counts against the joints."""
    pitch_kp: float = number(float)
    pitch_kd: float = number(float)
    """pitch_kp, pitch_kd: Gains of the trunk's rotation (1/s², 1/s)."""


class Memory(shifted_feet.Memory):
    """What the law remembers."""

    program: Program = part(Program)
    """The last quadratic programme."""
    relaxed: int = cell(int)
    unsolved: int = cell(int)
    """relaxed, unsolved: Programmes that gave up rows, and those that were not solved."""


class Log(Bundle):
    """What the law tells of itself."""

    relaxed: int = cell(int, label="Levels of rows given up")
    unsolved: int = cell(int, label="Programmes that were not solved so far")
    """relaxed, unsolved: By the quadratic programme; where it is not solved, the last torques
    stay."""


@kernel
def add_wishes(count: int, robot: ControlledRobot, parameters: Parameters, memory: Memory) -> None:
    """Add what the motion wants of accelerations and forces."""
    program, n = memory.program, robot.nv
    for j in range(n):
        weight = LEAST_WEIGHT
        if robot.motor[j] >= 0:
            weight = 1.0
        elif robot.model.axis[j, 0] != 0.0:
            weight = max(parameters.pitch, LEAST_WEIGHT)
        program.hessian[j, j] = weight
        program.gradient[j] = -weight * memory.wanted[j]
    for k in range(program.x.shape[0] - n):
        program.hessian[n + k, n + k] = PRICE_OF_FORCES if k < count else 1.0
        if k < count:
            wanted = memory.reference[memory.held[k]] / parameters.weight
            program.gradient[n + k] = -PRICE_OF_FORCES * wanted


@kernel
def add_equations(
    count: int, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Add the equations of motion of coordinates without a motor, and of points that stand."""
    program, n, weight = memory.program, robot.nv, parameters.weight
    for f in range(robot.unactuated.shape[0]):
        j = robot.unactuated[f]
        row = add_row((memory.passive[j] - memory.bias[j]) / weight, MOTOR_LEVEL, program)
        for i in range(n):
            program.rows[row, i] = memory.mass[j, i] / weight
        for k in range(count):
            program.rows[row, n + k] = -memory.jacobian[memory.held[k], j]
    for k in range(count):
        held = memory.held[k]
        row = add_row(-memory.moved[held], REST_LEVEL, program)
        for i in range(n):
            program.rows[row, i] = memory.jacobian[held, i]
    program.equalities = program.count


@kernel
def add_ground(count: int, robot: ControlledRobot, parameters: Parameters, memory: Memory) -> None:
    """Add that points push, and that those of a link stay in its friction cone."""
    program, n = memory.program, robot.nv
    for k in range(count):
        point, tangent = memory.held[k] // 2, memory.held[k] % 2
        if tangent == 0:
            program.rows[add_row(0.0, PUSH_LEVEL, program), n + k] = 1.0
            continue
        for side in range(2):  # a link has one tangential force
            row = add_row(0.0, SLIDE_LEVEL, program)
            program.rows[row, n + k] = 1.0 - 2.0 * side
            for other in range(count):
                if (
                    memory.held[other] % 2 == 0
                    and parameters.link[memory.held[other] // 2] == parameters.link[point]
                ):
                    program.rows[row, n + other] = parameters.friction


@kernel
def add_motors(
    count: int, robot: ControlledRobot, state: ControlState, parameters: Parameters, memory: Memory
) -> None:
    """Add what the motors can do."""
    program, n = memory.program, robot.nv
    for actuator in range(robot.nu):
        least, most = torque_range(robot, state, actuator)
        j = robot.model.actuator_joint[actuator]
        rest = memory.bias[j] - memory.passive[j]
        for side in range(2):
            sign = 1.0 - 2.0 * side
            limit = -most if side else least
            if limit == -inf:
                continue
            row = add_row((limit - sign * rest) / parameters.weight, MOTOR_LEVEL, program)
            for i in range(n):
                program.rows[row, i] = sign * memory.mass[j, i] / parameters.weight
            for k in range(count):
                program.rows[row, n + k] = -sign * memory.jacobian[memory.held[k], j]


@kernel
def want_trunk(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Bring back the trunk's rotation, which no motor reaches."""
    piece, inside, moves = place_in_phase(t, parameters, memory)
    for f in range(robot.unactuated.shape[0]):
        j = robot.unactuated[f]
        if robot.model.axis[j, 0] != 0.0:
            position, velocity, _ = motion_in_piece(parameters.pieces[piece], j, inside, moves)
            memory.wanted[j] += parameters.pitch_kp * (position - state.q[j])
            memory.wanted[j] += parameters.pitch_kd * (velocity - state.v[j])


@controller
def keep_to_motion(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Torques that keep to the motion within what ground and motors can do."""
    count = look_at_phase(t, state, contacts, robot, parameters, memory)
    program = memory.program
    if parameters.adapts != 0.0:
        shift_feet(t, state, contacts, robot, parameters, memory)
    want_trunk(t, state, robot, parameters, memory)
    clear(program)
    add_wishes(count, robot, parameters, memory)
    add_equations(count, robot, parameters, memory)
    add_ground(count, robot, parameters, memory)
    add_motors(count, robot, state, parameters, memory)
    solved = is_solved(program, memory)
    log.relaxed, log.unsolved = program.relaxed, memory.unsolved
    if not solved:
        return
    for i in range(robot.nv + count):
        memory.unknown[i] = program.x[i]
    for i in range(robot.nu):
        least, most = torque_range(robot, state, i)
        torque[i] = min(max(torque_needed(i, count, robot, parameters, memory), least), most)


GAINS = {"kp": 400.0, "kd": 40.0, "pitch": 1.0, "pitch_kp": 400.0, "pitch_kd": 40.0}
"""Numbers of the law that may be chosen."""


def along_motion(
    robot: Robot, motion: Motion, chosen: Mapping[str, float], *, adapts: bool
) -> tuple[Parameters, dict[str, int]]:
    """Return the numbers of the law about a motion, and how much it remembers."""
    rest: dict[str, Any] = dict(chosen)
    numbers, sizes = tracked(robot, motion, rest.pop("kp"), rest.pop("kd"))
    moved = moved_footholds(robot, motion, adapts=float(adapts))
    link = robot.model.contact_link
    feet = np.unique(link, return_inverse=True)[1]
    parameters = Parameters(**numbers, **moved, link=feet, **rest)
    free, rows = robot.nv - robot.nu, 2 * robot.nc
    sizes |= {"feet": len(robot.feet), "longest": robot.nv}
    sizes |= {"n": robot.nv + rows, "m": free + 3 * rows + 2 * robot.nu}
    return parameters, sizes
