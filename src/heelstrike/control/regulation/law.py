"""Regulation of the zero moment point by the clock of a gait.

The joints follow q_d(s), a gait whose clock s is a state of the law. With ṡ known and s̈ free,

    v̇ᵈ = q_d′ s̈ + q_d″ ṡ² + kp (q_d − q) + kd (q_d′ ṡ − q̇) + e w,

e the stance ankle: what it accelerates besides. While the ground holds the stance foot, what it
exerts is affine in s̈ and w: inverse dynamics is linear in accelerations. So each of

    moment about the toe less a margin ≥ 0 ≥ moment about the heel less a margin,
    f_n ≥ least,   |f_t| ≤ μ f_n

is a half-line of s̈, and together they are an interval. s̈ is the number in it that is nearest to
the gait's own time law, s̈ = (1 − ṡ)/T_r. If no s̈ that the clock may have brings the zero moment
point within its bounds, w does.
"""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.control.regulation.disturbance import observe, remember
from heelstrike.control.regulation.interval import narrowed
from heelstrike.control.regulation.numbers import (
    CONDITIONS,
    MOMENTS,
    PERIOD,
    Choice,
    Log,
    Memory,
    Parameters,
)
from heelstrike.dynamics.held import complete, force_of_row
from heelstrike.gait.polynomials import motion_in_piece, place_in_step
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import hold_sole, joint_torques
from heelstrike.sim.controller.stance_clock import exchange_at_touchdown, has_landed

JUST_MET = 1e-9
"""Part of its terms by which a bound that the clock has just met may be missed: rounding."""


@kernel
def advance(t: float, memory: Memory) -> float:
    """Let the clock go on since the last call; return the time that has gone by."""
    elapsed = t - memory.time
    memory.clock += elapsed * (memory.rate + 0.5 * elapsed * memory.hurry)
    memory.rate += elapsed * memory.hurry
    memory.time = t
    return elapsed


@kernel
def look_up(parameters: Parameters, foot: int, clock: float, choice: Choice) -> None:
    """Find the gait and its derivatives by the clock; beyond its end it is still."""
    piece, inside, moves = place_in_step(clock, parameters.latest, parameters.breakpoints)
    terms = parameters.coefficients[foot, piece]
    for i in range(terms.shape[1]):
        position, slope, curvature = motion_in_piece(terms, i, inside, moves)
        choice.position[i] = position
        choice.slope[i] = slope
        choice.curvature[i] = curvature


@kernel
def find_forces(
    state: ControlState, robot: ControlledRobot, foot: int, disturbance: Floats, choice: Choice
) -> None:
    """Find what motors and ground must supply, as nothing is chosen, and for s̈ = 1 and w = 1."""
    link, held = robot.foot_link[foot], robot.held
    hold_sole(robot, state, link, state.kinematics.origin[link])
    for case in range(3):
        for i in range(robot.nu):
            robot.acceleration[robot.model.actuator_joint[i]] = choice.joints[case, i]
        complete(held, robot.acceleration)
        robot.inverse_dynamics(state, robot.acceleration, choice.force[case])
        for row in range(held.count):
            held.target[row] = 0.0
    robot.passive_force(state, robot.passive)
    robot.bias_force(state, robot.force)
    for j in range(robot.nv):
        choice.force[0, j] -= robot.passive[j] + disturbance[j]
        choice.force[1, j] -= robot.force[j]
        choice.force[2, j] -= robot.force[j]


@kernel
def find_conditions(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, foot: int, choice: Choice
) -> None:
    """Find what must not be negative of the ground's wrench, the foot being in `robot.held`."""
    link, held = robot.foot_link[foot], robot.held
    ends, angle = robot.foot_sole[foot], state.kinematics.angle[link]
    cosine, sine = np.cos(angle), np.sin(angle)
    along_x, along_z = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    length = np.hypot(along_x, along_z)
    # World axes; positive rotations take z to x.
    ahead = (
        (cosine * along_x + sine * along_z) / length,
        (cosine * along_z - sine * along_x) / length,
    )
    for case in range(3):
        force, rows = choice.force[case], choice.conditions
        fx, fz = force_of_row(0, force, held), force_of_row(1, force, held)
        moment = force_of_row(2, force, held)
        for end in range(2):
            inwards = parameters.margin if end == 0 else -parameters.margin
            x = cosine * ends[end, 0] + sine * ends[end, 1] + inwards * ahead[0]
            z = cosine * ends[end, 1] - sine * ends[end, 0] + inwards * ahead[1]
            about = moment - z * fx + x * fz
            rows[end, case] = -about if end == 0 else about
        normal = ahead[0] * fz - ahead[1] * fx
        tangent = ahead[0] * fx + ahead[1] * fz
        rows[2, case] = normal
        rows[3, case] = parameters.friction * normal - tangent
        rows[4, case] = parameters.friction * normal + tangent
    choice.conditions[2, 0] -= parameters.least_force


@kernel
def choose(parameters: Parameters, elapsed: float, memory: Memory, log: Log) -> tuple[float, float]:
    """Choose s̈, nearest to the gait's own time law, and w, nearest to nothing."""
    rows, rate = memory.choice.conditions, memory.rate
    soon = max(elapsed, PERIOD)
    lower = max(-parameters.hurry, min((parameters.slowest - rate) / soon, parameters.hurry))
    upper = min(parameters.hurry, max((parameters.fastest - rate) / soon, -parameters.hurry))
    log.given_up = 0
    for i in range(CONDITIONS):
        lower, upper, kept = narrowed(lower, upper, rows[i, 0], rows[i, 1])
        if not kept:
            log.given_up = 2 if i < MOMENTS else max(log.given_up, 1)
    log.slowest_hurry, log.fastest_hurry = lower, upper
    hurry = min(max((1.0 - rate) / parameters.returning, lower), upper)
    lowest, highest = -np.inf, np.inf
    for i in range(MOMENTS):
        left = rows[i, 0] + rows[i, 1] * hurry
        # Bounds that the clock has just met are met: rounding moves no ankle.
        left += JUST_MET * (abs(rows[i, 0]) + abs(rows[i, 1] * hurry))
        lowest, highest, kept = narrowed(lowest, highest, left, rows[i, 2])
        if not kept:
            log.given_up = 3
    return hurry, min(max(0.0, lowest), highest)


@controller
def regulate_zero_moment_point(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    choice, disturbance = memory.choice, memory.disturbance
    elapsed = advance(t, memory)
    # The next step begins at the pace of this one.
    if exchange_at_touchdown(
        t, memory.clock, parameters.earliest, contacts, robot.contact_foot, memory
    ):
        memory.clock = 0.0
        disturbance.known = 0
    landed = has_landed(t, parameters.landing, state, contacts, robot, memory)
    if parameters.bandwidth >= 0.0 and landed and disturbance.known == 1 and elapsed > 0.0:
        observe(elapsed, parameters.bandwidth, state, contacts, robot, disturbance)
    foot = memory.stance
    look_up(parameters, foot, memory.clock, choice)
    for i in range(robot.nu):
        error = choice.position[i] - state.joint_position[i]
        joint = choice.curvature[i] * memory.rate**2 + parameters.kp[i] * error
        if landed:
            error_rate = choice.slope[i] * memory.rate - state.joint_velocity[i]
            joint += parameters.kd[i] * error_rate
        choice.joints[0, i] = joint
        choice.joints[1, i] = choice.slope[i]
        choice.joints[2, i] = 1.0 if i == parameters.ankle[foot] else 0.0
    find_forces(state, robot, foot, disturbance.force, choice)
    find_conditions(state, robot, parameters, foot, choice)
    hurry, ankle = choose(parameters, elapsed, memory, log)
    memory.hurry = hurry
    for j in range(robot.nv):
        robot.force[j] = (
            choice.force[0, j] + hurry * choice.force[1, j] + ankle * choice.force[2, j]
        )
    joint_torques(robot, torque)
    if landed:
        remember(state, robot, torque, disturbance)
    tell(robot, parameters, memory, ankle, log)


@kernel
def tell(
    robot: ControlledRobot, parameters: Parameters, memory: Memory, ankle: float, log: Log
) -> None:
    """Write what was chosen into the log."""
    rows, hurry = memory.choice.conditions, memory.hurry
    log.clock, log.rate, log.hurry, log.ankle = memory.clock, memory.rate, hurry, ankle
    heel = rows[0, 0] + rows[0, 1] * hurry + rows[0, 2] * ankle
    toe = rows[1, 0] + rows[1, 1] * hurry + rows[1, 2] * ankle
    ends = robot.foot_sole[memory.stance]
    # Together the two moments are the force times the length between the margins.
    log.pressure = 0.0
    if heel + toe > 0.0:
        length = np.hypot(ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1])
        within = length - 2.0 * parameters.margin
        log.pressure = 0.5 * within * (heel - toe) / (heel + toe)
