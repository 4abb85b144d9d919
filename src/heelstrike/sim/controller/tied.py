"""Torques of motors that move joints through closed loops and couplings.

What a foot on the ground and the loops hold is C v̇ + c = 0. Gauss–Jordan elimination of C, on
coordinates without a motor before others, tells dependent accelerations from independent ones,
v̇ = N z + v̇₀, and Nᵀ Cᵀ = 0 takes the forces of ground and loops out of A v̇ + H = Γ + Cᵀ λ. The
motors of the independent joints follow what is asked of them; where there are more motors than
ways to move, those on dependent joints help, and the torques are those of least norm.

A point foot leaves one coordinate without a motor independent, the trunk's turning about the foot:
its row of Nᵀ (A v̇ + H) = Nᵀ Γ has no motor, which tells its acceleration.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.dense import solve_positive
from heelstrike.dynamics.kernels import inverse_dynamics, passive_force
from heelstrike.dynamics.loops import find_rows
from heelstrike.robot.model import Floats, Integers
from heelstrike.tolerances import NO_PIVOT

if TYPE_CHECKING:
    from heelstrike.sim.controller.robot import ControlledRobot, ControlState

FREE = -1
"""What stands for the row of a coordinate that is independent."""

ATTEMPTS = 4
"""Newton's method squares errors: noise of encoders of 0.01 rad is gone by then."""


@kernel
def reduce_rows(rows: int, motor: Integers, tied: Floats, row_of: Integers) -> None:
    """Eliminate dependent coordinates from C x = d, those without a motor before others.

    Parameters
    ----------
    rows : int
        Number of equations.
    motor : (nv,) int
        Motor of each coordinate, -1 for none.
    tied : (rows, nv + 1) float
        C and d. Out: in the row of a dependent coordinate, what it takes of the independent ones.
    row_of : (nv,) int
        Out: row of each dependent coordinate, ``FREE`` for the others.
    """
    size = row_of.shape[0]
    largest = 0.0
    for j in range(size):
        row_of[j] = FREE
        for i in range(rows):
            largest = max(largest, abs(tied[i, j]))
    done = 0
    for driven in range(2):
        while done < rows:
            best = NO_PIVOT * largest
            row = -1
            column = -1
            for j in range(size):
                if (motor[j] >= 0) == (driven == 1) and row_of[j] == FREE:
                    for i in range(done, rows):
                        if abs(tied[i, j]) > best:
                            best = abs(tied[i, j])
                            row = i
                            column = j
            if row < 0:
                break
            inverse = 1.0 / tied[row, column]
            for j in range(size + 1):
                tied[row, j], tied[done, j] = tied[done, j], inverse * tied[row, j]
            for i in range(rows):
                ratio = tied[i, column]
                if i != done and ratio != 0.0:
                    for j in range(size + 1):
                        tied[i, j] -= ratio * tied[done, j]
            row_of[column] = done
            done += 1


@kernel
def along_independent(j: int, tied: Floats, row_of: Integers, force: Floats) -> float:
    """Row j of Nᵀ times a generalised force."""
    total = force[j]
    for i in range(force.shape[0]):
        if row_of[i] != FREE:
            total -= tied[row_of[i], j] * force[i]
    return total


@kernel
def force_along(robot: ControlledRobot, state: ControlState, force: Floats) -> None:
    """Complete `robot.acceleration` and write A v̇ + H − passive, what it takes.

    Independent coordinates are given.
    """
    tied, row_of, whole = robot.tied, robot.tied_row, robot.acceleration
    for i in range(robot.nv):
        if row_of[i] != FREE:
            total = tied[row_of[i], robot.nv]
            for j in range(robot.nv):
                if row_of[j] == FREE:
                    total -= tied[row_of[i], j] * whole[j]
            whole[i] = total
    inverse_dynamics(robot.model, whole, state.kinematics, force)
    passive_force(robot.model, state.q, state.v, robot.passive)
    for j in range(robot.nv):
        force[j] -= robot.passive[j]


@kernel
def write_ties(robot: ControlledRobot, state: ControlState, held: int) -> None:
    """Write what the loops and a foot hold; Jacobian and J̇ v of the foot are there."""
    tied, rows, nv = robot.tied, robot.loops, robot.nv
    find_rows(robot.model, state.q, state.v, state.kinematics, rows)
    for i in range(held):
        for j in range(nv):
            tied[i, j] = robot.columns[j, i]
        tied[i, nv] = -robot.other[i]
    for row in range(rows.bias.shape[0]):
        for j in range(nv):
            tied[held + row, j] = rows.jacobian[row, j]
        tied[held + row, nv] = -rows.bias[row]


@kernel
def follow_positions(robot: ControlledRobot, state: ControlState) -> None:
    """Put what follows by loops and couplings where motors and trunk, as they are, want it.

    Newton's method, from where `state` has it. Of trees nothing follows.
    """
    tied, row_of, rows, nv = robot.tied, robot.tied_row, robot.loops, robot.nv
    count = rows.bias.shape[0]
    for _ in range(ATTEMPTS if count > 0 else 0):
        robot.update(state)
        write_ties(robot, state, 0)
        for row in range(count):
            tied[row, nv] = -rows.displacement[row]
        reduce_rows(count, robot.motor, tied, row_of)
        for j in range(nv):
            if row_of[j] != FREE and robot.motor[j] < 0:
                state.q[j] += tied[row_of[j], nv]


@kernel
def follow_speeds(robot: ControlledRobot, state: ControlState, held: int) -> None:
    """Give what has no motor the speed that loops, and a foot that rests, make of the motors'.

    Kinematics of the state are there, and the Jacobian of the foot as :func:`tied_torque` wants it.
    """
    tied, row_of, v = robot.tied, robot.tied_row, state.v
    write_ties(robot, state, held)
    count = held + robot.loops.bias.shape[0]
    for row in range(count):
        tied[row, robot.nv] = 0.0
    reduce_rows(count, robot.motor, tied, row_of)
    for i in range(robot.nv):
        if row_of[i] != FREE and robot.motor[i] < 0:
            v[i] = 0.0
            for j in range(robot.nv):
                if row_of[j] == FREE:
                    v[i] -= tied[row_of[i], j] * v[j]


@kernel
def follow_motors(robot: ControlledRobot, state: ControlState) -> None:
    """Let what follows by loops and couplings do as trunk and motors do; update the state."""
    follow_positions(robot, state)
    robot.update(state)
    if robot.loops.bias.shape[0] > 0:
        follow_speeds(robot, state, 0)
        robot.update(state)


@kernel
def share_torques(robot: ControlledRobot, force: Floats, torque: Floats) -> None:
    """Write the torques of least norm that do on the independent joints what a force asks."""
    tied, row_of, motor, system = robot.tied, robot.tied_row, robot.motor, robot.shares
    wanted = robot.other
    count = 0
    for j in range(robot.nv):
        if row_of[j] != FREE or motor[j] < 0:
            continue
        wanted[count] = along_independent(j, tied, row_of, force)
        place = 0
        for k in range(j + 1):
            if row_of[k] != FREE or motor[k] < 0:
                continue
            entry = 1.0 if k == j else 0.0
            for i in range(robot.nv):
                if row_of[i] != FREE and motor[i] >= 0:
                    entry += tied[row_of[i], j] * tied[row_of[i], k]
            system[count, place] = entry
            place += 1
        count += 1
    solve_positive(count, system, wanted)
    for i in range(robot.nv):
        if motor[i] >= 0:
            torque[motor[i]] = 0.0
    count = 0
    for j in range(robot.nv):
        if row_of[j] != FREE or motor[j] < 0:
            continue
        torque[motor[j]] = wanted[count]
        for i in range(robot.nv):
            if row_of[i] != FREE and motor[i] >= 0:
                torque[motor[i]] -= tied[row_of[i], j] * wanted[count]
        count += 1


@kernel
def tied_torque(
    robot: ControlledRobot, state: ControlState, held: int, acceleration: Floats, torque: Floats
) -> None:
    """Torques (nu,) that give independent joints an acceleration while foot and loops hold.

    Jacobian and J̇ v of what the ground holds of the foot are in `robot.columns` and `robot.other`.
    Torques are NaN where the motors do not reach all that moves.
    """
    write_ties(robot, state, held)
    row_of, motor, whole, force = robot.tied_row, robot.motor, robot.acceleration, robot.force
    reduce_rows(held + robot.loops.bias.shape[0], motor, robot.tied, row_of)
    turning = FREE
    reached = True
    helped = False
    for j in range(robot.nv):
        helped = helped or (row_of[j] != FREE and motor[j] >= 0)
        if row_of[j] == FREE:
            whole[j] = 0.0 if motor[j] < 0 else acceleration[motor[j]]
            if motor[j] < 0:
                reached = reached and turning == FREE and held == 2
                turning = j
    if not reached or (turning != FREE and helped):
        for i in range(robot.nu):
            torque[i] = np.nan
        return
    force_along(robot, state, force)
    if turning != FREE:  # the force is linear in its acceleration
        missing = along_independent(turning, robot.tied, row_of, force)
        whole[turning] = 1.0
        force_along(robot, state, robot.other)
        inertia = along_independent(turning, robot.tied, row_of, robot.other) - missing
        for j in range(robot.nv):
            force[j] -= missing / inertia * (robot.other[j] - force[j])
    share_torques(robot, force, torque)
