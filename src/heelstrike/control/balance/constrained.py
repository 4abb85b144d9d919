"""The robot on its stance foot, as functions of the accelerations of its joints alone.

While the ground holds the stance foot (:mod:`heelstrike.dynamics.held`), the accelerations of the
trunk, the wrench of the ground and the torques follow from the accelerations of the joints. All
three are affine in these, which are therefore the only unknowns of a whole-body controller: what
they contribute are the columns found here.
"""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.straight_line import is_code, play
from heelstrike.dynamics.held import HeldRows, force_of_row, given, left_to_motors
from heelstrike.dynamics.kernels import (
    bias_force,
    mass_matrix,
    passive_force,
    point_bias_acceleration,
)
from heelstrike.dynamics.places import point_columns
from heelstrike.dynamics.workspace import Workspace
from heelstrike.once_each import once_each
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import hold_by_structure, hold_sole
from heelstrike.sim.controller.straight_line import flat_foot_arguments, flat_foot_programs


class Constrained(Bundle):
    """The robot on its stance foot: what depends on joint accelerations a, and how."""

    motion: Floats = array("nv", "nu")
    drift: Floats = array("nv")
    """motion, drift: v̇ = motion a + drift."""
    wrench: Floats = array(3, "nu")
    load: Floats = array(3)
    """wrench, load: Force (x, z) and moment about +y of the ground on the foot, at the middle of
    the sole: wrench a + load."""
    torque: Floats = array("nu", "nu")
    hold: Floats = array("nu")
    """torque, hold: Torques of the actuators: torque a + hold."""
    rows: Floats = array(3, "nu")
    shift: Floats = array(3)
    """rows, shift: Acceleration of a point (x, z, rotation): rows a + shift; see
    :func:`point_task`."""
    mass: Floats = array("nv", "nv")
    force: Floats = array("nv")
    columns: Floats = array("nv", 3)
    """mass, force, columns: Scratch."""


@kernel
def constrain(
    robot: ControlledRobot, state: ControlState, foot: int, sole: Floats, programs: Integers,
    on: Constrained,
) -> None:  # fmt: skip
    """Find what depends on the accelerations of the joints while a foot is held at its sole."""
    model, kinematics, held, rest = robot.model, state.kinematics, robot.held, robot.unactuated
    hold, passive = robot.flat_hold[foot], robot.passive
    if is_code(programs[foot]):
        play(
            programs[foot],
            (model, hold, rest, sole, kinematics, state.q, state.v, held, passive, on),
        )
        return
    hold_sole(robot, state, robot.foot_link[foot], sole)
    find_motion(model, rest, held, on)
    find_forces(model, rest, kinematics, state.q, state.v, held, passive, on)


@kernel
def constrain_tree(
    model: Model, hold: Integers, rest: Integers, sole: Floats, kinematics: Workspace, q: Floats,
    v: Floats, held: HeldRows, passive: Floats, on: Constrained,
) -> None:  # fmt: skip
    """Find the same of a tree, without a branch on a value, for straight-line code."""
    hold_by_structure(model, hold, sole, kinematics, held)
    find_motion(model, rest, held, on)
    find_forces(model, rest, kinematics, q, v, held, passive, on)


@once_each
def constrained_programs(robot: Robot) -> Integers:
    """Return the addresses of :func:`constrain_tree` on each foot, zero where there is none."""
    arguments = flat_foot_arguments(robot) | {
        "rest": np.setdiff1d(np.arange(robot.nv), robot.model.actuator_joint),
        "sole": np.zeros(2),
        "on": Constrained.allocate(nv=robot.nv, nu=robot.nu),
    }
    unread = "on.mass", "on.force", "on.columns"
    return np.array(flat_foot_programs(robot, constrain_tree, arguments, unread), np.int64)


@kernel
def find_motion(model: Model, rest: Integers, held: HeldRows, on: Constrained) -> None:
    """Find `motion` and `drift`."""
    driven, motion, drift = model.actuator_joint, on.motion, on.drift
    for j in range(model.nv):
        drift[j] = 0.0
        for i in range(model.nu):
            motion[j, i] = 0.0
    for k in range(rest.shape[0]):
        row = held.row[rest[k]]
        drift[rest[k]] = given(row, held)
        for i in range(model.nu):
            motion[rest[k], i] = -held.solved[row, driven[i]]
    for i in range(model.nu):
        motion[driven[i], i] = 1.0


@kernel
def find_forces(
    model: Model, rest: Integers, kinematics: Workspace, q: Floats, v: Floats, held: HeldRows,
    passive: Floats, on: Constrained,
) -> None:  # fmt: skip
    """Find wrench and torques by the motion, from the equations A v̇ + H = forces."""
    driven, force, mass, drift, motion = (
        model.actuator_joint, on.force, on.mass, on.drift, on.motion,
    )  # fmt: skip
    torque, wrench = on.torque, on.wrench
    mass_matrix(model, kinematics, mass)
    bias_force(model, kinematics, force)
    passive_force(model, q, v, passive)
    for j in range(model.nv):
        force[j] -= passive[j]
        for k in range(rest.shape[0]):
            force[j] += mass[j, rest[k]] * drift[rest[k]]
    for j in range(model.nu):
        on.hold[j] = left_to_motors(driven[j], force, held)
    for k in range(3):
        on.load[k] = force_of_row(k, force, held)
    for i in range(model.nu):
        for j in range(model.nv):
            force[j] = mass[j, driven[i]]
            for k in range(rest.shape[0]):
                force[j] += mass[j, rest[k]] * motion[rest[k], i]
        for j in range(i + 1):  # Nᵀ A N is symmetric
            torque[j, i] = torque[i, j] = left_to_motors(driven[j], force, held)
        for k in range(3):
            wrench[k, i] = force_of_row(k, force, held)


@kernel
def point_task(
    robot: ControlledRobot, state: ControlState, link: int, position: Floats, on: Constrained
) -> None:
    """Find `rows` and `shift` of a point of a link: its acceleration by those of the joints."""
    columns, rest, driven = on.columns, robot.unactuated, robot.model.actuator_joint
    shift, rows, drift, motion = on.shift, on.rows, on.drift, on.motion
    point_columns(robot.model, state.kinematics, link, position, columns)
    point_bias_acceleration(state.kinematics, link, position, shift)
    for k in range(3):
        for i in range(driven.shape[0]):
            rows[k, i] = columns[driven[i], k]
        for j in range(rest.shape[0]):
            follows = columns[rest[j], k]
            shift[k] += follows * drift[rest[j]]
            for i in range(driven.shape[0]):
                rows[k, i] += follows * motion[rest[j], i]
