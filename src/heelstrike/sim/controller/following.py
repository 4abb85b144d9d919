"""What has no motor, where motors, closed loops and couplings want it: for laws that estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.held import FREE, add_loops, complete, given, solve_rows

if TYPE_CHECKING:
    from heelstrike.sim.controller.robot import ControlledRobot, ControlState

ATTEMPTS = 4
"""Newton's method squares errors: noise of encoders of 0.01 rad is gone by then."""


@kernel
def follow_positions(robot: ControlledRobot, state: ControlState) -> None:
    """Put what follows by loops and couplings where motors and trunk, as they are, want it.

    Newton's method, from where `state` has it. Of trees nothing follows.
    """
    held = robot.held
    count = held.loops.bias.shape[0]
    for _ in range(ATTEMPTS if count > 0 else 0):
        robot.update(state)
        held.count = 0
        add_loops(robot.model, state.q, state.v, state.kinematics, held)
        for row in range(count):
            held.target[row] = -held.loops.displacement[row]
        solve_rows(robot.unactuated, held)
        for i in range(count):
            coordinate = held.coordinate[i]
            if coordinate != FREE and robot.motor[coordinate] < 0:
                state.q[coordinate] += given(i, held)


@kernel
def follow_held(robot: ControlledRobot, state: ControlState) -> None:
    """Give what has no motor the speed that the solved rows of `robot.held` make of the motors'."""
    whole, held = robot.acceleration, robot.held
    for j in range(robot.nv):
        whole[j] = state.v[j]
    complete(held, whole)
    for j in range(robot.nv):
        if robot.motor[j] < 0:
            state.v[j] = whole[j]


@kernel
def follow_speeds(robot: ControlledRobot, state: ControlState) -> None:
    """Give what follows by loops and couplings the speed that these make of the motors'."""
    held = robot.held
    if held.loops.bias.shape[0] > 0:
        held.count = 0
        add_loops(robot.model, state.q, state.v, state.kinematics, held)
        solve_rows(robot.unactuated, held)
        follow_held(robot, state)


@kernel
def follow_motors(robot: ControlledRobot, state: ControlState) -> None:
    """Let what follows by loops and couplings do as trunk and motors do; update the state."""
    follow_positions(robot, state)
    robot.update(state)
    follow_speeds(robot, state)
    robot.update(state)
