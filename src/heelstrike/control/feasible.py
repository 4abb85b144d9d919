"""Joint accelerations that ground, motors and joints allow: the nearest feasible to those wanted.

While the ground holds a point foot, its force, the torques of the motors and the rate of the phase
are affine functions of what is wanted of the joints. Where that would need more friction than there
is, a pull of the ground, more than a motor has, or would carry a joint out of its range, it is
changed as little as may be: a quadratic programme with an unknown for each joint.
"""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.control.quadratic.dual_active_set import solve_or_relax
from heelstrike.control.quadratic.program import SOLVED, Program
from heelstrike.control.virtual_constraints import demand, hold_foot
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.held import force_of_row
from heelstrike.dynamics.planar import Spatial
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import joint_torques

# Rows: pressing, friction either way; then of each joint its motor's least and greatest torque, and
# the low and the high end of its range.
GROUND_ROWS = 3
JOINT_ROWS = 4
# In which order they are given up if not all can be kept: the greatest first.
RANGE_LEVEL, PRESS_LEVEL, CONE_LEVEL, MOTOR_LEVEL = 4, 3, 2, 1
# A joint may near the end of its range at this rate (1/s), and at no more than this part of what is
# left from call to call: torques that are held for longer than 1/NEARING would overshoot.
NEARING, NEARER = 100.0, 0.5
# What a motor without a limit has (N m).
ENDLESS = 1e9


class Bounds(Bundle):
    """What is to be kept to."""

    friction: float = number(float)
    press: float = number(float)
    """friction, press: Friction that is counted on; normal force that is kept on the foot (N)."""
    lower: Floats = array("nu")
    upper: Floats = array("nu")
    """lower, upper: Ranges of the joints (rad)."""


class Feasible(Bundle):
    """The accelerations that are wanted, and the programme of the nearest feasible ones."""

    wanted: Floats = array("nu")
    slope: Floats = array("nu")
    """wanted, slope: The joints are to be accelerated by wanted + θ̈ slope, θ the phase."""
    program: Program = part(Program)
    """Its unknowns are changes of `wanted`."""
    asked: Floats = array("nv")
    share: Floats = array("nv", "nu")
    """asked, share: Generalised force that gives what is wanted, and how it changes."""
    turned: Floats = array("nu")
    """How θ̈ changes."""
    torque: Floats = array("nu")
    """Scratch."""


@kernel
def ground_rows(robot: ControlledRobot, normal: Floats, friction: float, torque: Floats) -> Spatial:
    """Find the rows of the ground, and the torques, for a force in `robot.force`."""
    force, held = robot.force, robot.held
    pushed = force_of_row(0, force, held), force_of_row(1, force, held)
    up, along = into_frame(normal, pushed)
    joint_torques(robot, torque)
    return up, friction * up - along, friction * up + along


@kernel
def nearing(period: float) -> float:
    """Rate (1/s) at which a joint may near the end of its range, by the time between two calls."""
    return NEARING if NEARING * period <= NEARER else NEARER / period


@kernel
def is_feasible(
    state: ControlState, robot: ControlledRobot, normal: Floats, turning: float, bounds: Bounds,
    feasible: Feasible,
) -> bool:  # fmt: skip
    """Whether what is wanted, whose force is in `robot.force`, is feasible; write the bounds."""
    bound, torque, model = feasible.program.bound, feasible.torque, robot.model
    rate = nearing(robot.period)
    up, ahead, behind = ground_rows(robot, normal, bounds.friction, torque)
    bound[0], bound[1], bound[2] = bounds.press - up, -ahead, -behind
    for i in range(robot.nu):
        row = GROUND_ROWS + JOINT_ROWS * i
        bound[row] = max(model.torque_lower[i], -ENDLESS) - torque[i]
        bound[row + 1] = torque[i] - min(model.torque_upper[i], ENDLESS)
        place, speed = state.joint_position[i], state.joint_velocity[i]
        free = feasible.wanted[i] + turning * feasible.slope[i] + 2.0 * rate * speed
        bound[row + 2] = rate**2 * (bounds.lower[i] - place) - free
        bound[row + 3] = rate**2 * (place - bounds.upper[i]) + free
    worst = 0.0
    for row in range(bound.shape[0]):
        worst = max(worst, bound[row])
    return worst <= 0.0


@kernel
def find_shares(state: ControlState, robot: ControlledRobot, feasible: Feasible) -> None:
    """Write how force and θ̈ change with what is wanted: they are affine in it."""
    wanted, slope = feasible.wanted, feasible.slope
    rate = demand(state, robot, wanted, slope)
    for j in range(robot.nv):
        feasible.asked[j] = robot.force[j]
    for i in range(robot.nu):
        wanted[i] += 1.0
        feasible.turned[i] = demand(state, robot, wanted, slope) - rate
        wanted[i] -= 1.0
        for j in range(robot.nv):
            feasible.share[j, i] = robot.force[j] - feasible.asked[j]


@kernel
def write_rows(robot: ControlledRobot, normal: Floats, friction: float, feasible: Feasible) -> None:
    """Write the rows of the programme."""
    rows, torque = feasible.program.rows, feasible.torque
    for k in range(robot.nu):
        for j in range(robot.nv):
            robot.force[j] = feasible.share[j, k]
        rows[0, k], rows[1, k], rows[2, k] = ground_rows(robot, normal, friction, torque)
        for i in range(robot.nu):
            row = GROUND_ROWS + JOINT_ROWS * i
            rows[row, k], rows[row + 1, k] = torque[i], -torque[i]
            own = 1.0 if i == k else 0.0
            rows[row + 2, k] = own + feasible.turned[k] * feasible.slope[i]
            rows[row + 3, k] = -rows[row + 2, k]


@kernel
def prepare(program: Program) -> None:
    """Write what stays: the change is to be the least, and in which order rows are given up."""
    for i in range(program.x.shape[0]):
        program.gradient[i] = 0.0
        for k in range(program.x.shape[0]):
            program.hessian[i, k] = 1.0 if i == k else 0.0
    program.equalities, program.count = 0, program.bound.shape[0]
    for row in range(GROUND_ROWS, program.count):
        ends = (row - GROUND_ROWS) % JOINT_ROWS >= 2
        program.level[row] = RANGE_LEVEL if ends else MOTOR_LEVEL
    program.level[0], program.level[1], program.level[2] = PRESS_LEVEL, CONE_LEVEL, CONE_LEVEL


@kernel
def find_nearest(program: Program) -> None:
    """Solve for the least change that keeps the rows, or as many of them as can be."""
    solve_or_relax(program)
    if program.status != SOLVED:
        for i in range(program.x.shape[0]):
            program.x[i] = 0.0


@kernel
def find_feasible_force(
    state: ControlState, contacts: Contacts, robot: ControlledRobot, phase: Floats, foot: int,
    bounds: Bounds, feasible: Feasible,
) -> None:  # fmt: skip
    """Write `robot.force` that gives what is wanted, or the nearest feasible."""
    normal = contacts.normal[robot.foot_contact[foot]]
    hold_foot(state, contacts, robot, phase, foot)
    rate = demand(state, robot, feasible.wanted, feasible.slope)
    if is_feasible(state, robot, normal, rate, bounds, feasible):
        return
    find_shares(state, robot, feasible)
    write_rows(robot, normal, bounds.friction, feasible)
    find_nearest(feasible.program)
    for j in range(robot.nv):
        total = feasible.asked[j]
        for i in range(robot.nu):
            total += feasible.share[j, i] * feasible.program.x[i]
        robot.force[j] = total
