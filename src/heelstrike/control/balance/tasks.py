"""The quadratic programme of a whole body: tasks as costs, contact and motors as rows."""

from __future__ import annotations

from math import cos, inf, sin
from typing import Any

from heelstrike.compiler.compilation import kernel
from heelstrike.control.balance.constrained import Constrained
from heelstrike.control.balance.numbers import Memory, Parameters
from heelstrike.control.quadratic.dual_active_set import solve_or_relax
from heelstrike.control.quadratic.program import SOLVED, Program
from heelstrike.control.quadratic.tasks import add_task, keep_row
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.motors import motor_torque
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

CONTACT_ROWS = 5

# In which order rows are given up if not all can be kept: the margins of the centre of pressure
# first, then the least normal force, then the friction cone. Motors cannot be overruled.
KNEE_LEVEL = 4
PRESSURE_LEVEL = 2
FORCE_LEVEL = 3
CONE_LEVEL = 1
MOTOR_LEVEL = 0


@kernel
def add_wrench_row(
    on: Constrained, x: float, z: float, moment: float, level: int, program: Program
) -> int:
    """Add a row: force and moment of the ground along this direction are not negative."""
    row = program.count
    for i in range(program.x.shape[0]):
        program.rows[row, i] = x * on.wrench[0, i] + z * on.wrench[1, i] + moment * on.wrench[2, i]
    return keep_row(-(x * on.load[0] + z * on.load[1] + moment * on.load[2]), level, program)


@kernel
def add_contact(
    parameters: Parameters, tilt: float, under: float, on: Constrained, program: Program
) -> None:
    """Add what the ground can do: push, within the cone, and from within the sole.

    The ground under the foot is inclined by `under`, the sole by `tilt`: on its toe a foot may be
    turned farther than any cone is wide.
    """
    planning, friction = parameters.planning, parameters.friction
    nx, nz = sin(under), cos(under)  # along the ground goes (nz, −nx)
    pushes = add_wrench_row(on, nx, nz, 0.0, FORCE_LEVEL, program)
    program.bound[pushes] += parameters.least_force
    add_wrench_row(on, friction * nx + nz, friction * nz - nx, 0.0, CONE_LEVEL, program)
    add_wrench_row(on, friction * nx - nz, friction * nz + nx, 0.0, CONE_LEVEL, program)
    nx, nz = sin(tilt), cos(tilt)
    add_wrench_row(on, -planning.heel * nx, -planning.heel * nz, -1.0, PRESSURE_LEVEL, program)
    add_wrench_row(on, planning.toe * nx, planning.toe * nz, 1.0, PRESSURE_LEVEL, program)


@kernel
def torque_range(robot: ControlledRobot, state: ControlState, actuator: int) -> tuple[float, float]:
    """Least and greatest torque of a motor at its present speed."""
    model = robot.model
    least, most = model.torque_lower[actuator], model.torque_upper[actuator]
    return (
        motor_torque(model, actuator, 0, least, state.v),
        motor_torque(model, actuator, 0, most, state.v),
    )


@kernel
def add_motors(
    robot: ControlledRobot, state: ControlState, on: Constrained, program: Program
) -> None:
    """Add what the motors can do."""
    for actuator in range(robot.nu):
        least, most = torque_range(robot, state, actuator)
        for side in range(2):
            sign = 1.0 - 2.0 * side
            limit = -most if side else least
            if limit == -inf:
                continue
            row = program.count
            for i in range(robot.nu):
                program.rows[row, i] = sign * on.torque[actuator, i]
            keep_row(limit - sign * on.hold[actuator], MOTOR_LEVEL, program)


@kernel
def add_pressure(
    weight: float, tilt: float, pressure: float, total: float, on: Constrained, program: Program
) -> None:
    """Add the wish for a centre of pressure: no moment about there."""
    row = add_wrench_row(
        on, pressure * sin(tilt) / total, pressure * cos(tilt) / total, 1.0 / total, 0, program
    )
    program.count = row
    add_task(program.rows, row, program.bound[row], weight, program)


@kernel
def is_solved(program: Program, memory: Any) -> bool:
    """Solve a programme and count, in the memory of a law, whether it is relaxed or unsolved."""
    solve_or_relax(program)
    if program.relaxed > 0:
        memory.relaxed += 1
    if program.status != SOLVED:
        memory.unsolved += 1
    return bool(program.status == SOLVED)


@kernel
def solve_torques(
    robot: ControlledRobot, state: ControlState, memory: Memory, torque: Floats
) -> None:
    """Solve the programme; write the torques of its answer, or the last ones if it has none."""
    on, program = memory.on, memory.program
    if not is_solved(program, memory):
        return
    for j in range(robot.nu):
        total = on.hold[j]
        for i in range(robot.nu):
            total += on.torque[j, i] * program.x[i]
        least, most = torque_range(robot, state, j)
        torque[j] = min(max(total, least), most)
