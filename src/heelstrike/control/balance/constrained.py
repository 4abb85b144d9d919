"""The robot on its stance foot, as functions of the accelerations of its joints alone.

While the ground holds the stance foot (:mod:`heelstrike.dynamics.held`), the accelerations of the
trunk, the wrench of the ground and the torques follow from the accelerations of the joints. All
three are affine in these, which are therefore the only unknowns of a whole-body controller: what
they contribute are the columns found here.
"""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.held import FREE, force_of_row, given, left_to_motors
from heelstrike.dynamics.kernels import (
    bias_force,
    mass_matrix,
    passive_force,
    point_bias_acceleration,
)
from heelstrike.dynamics.places import point_columns
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import hold_sole


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
    robot: ControlledRobot, state: ControlState, link: int, sole: Floats, on: Constrained
) -> None:
    """Find what depends on the accelerations of the joints while a foot is held at its sole."""
    hold_sole(robot, state, link, sole)
    find_motion(robot, on)
    find_forces(robot, state, on)


@kernel
def find_motion(robot: ControlledRobot, on: Constrained) -> None:
    """Find `motion` and `drift`."""
    held, driven = robot.held, robot.model.actuator_joint
    for j in range(robot.nv):
        row = held.row[j]
        on.drift[j] = 0.0 if row == FREE else given(row, held)
        for i in range(robot.nu):
            on.motion[j, i] = 0.0 if row == FREE else -held.solved[row, driven[i]]
    for i in range(robot.nu):
        on.motion[driven[i], i] = 1.0


@kernel
def find_forces(robot: ControlledRobot, state: ControlState, on: Constrained) -> None:
    """Find wrench and torques by the motion, from the equations A v̇ + H = forces."""
    rest, driven, held, force = robot.unactuated, robot.model.actuator_joint, robot.held, on.force
    mass_matrix(robot.model, state.kinematics, on.mass)
    bias_force(robot.model, state.kinematics, force)
    passive_force(robot.model, state.q, state.v, robot.passive)
    for j in range(robot.nv):
        force[j] -= robot.passive[j]
        for k in range(rest.shape[0]):
            force[j] += on.mass[j, rest[k]] * on.drift[rest[k]]
    for j in range(robot.nu):
        on.hold[j] = left_to_motors(driven[j], force, held)
    for k in range(3):
        on.load[k] = force_of_row(k, force, held)
    for i in range(robot.nu):
        for j in range(robot.nv):
            force[j] = on.mass[j, driven[i]]
            for k in range(rest.shape[0]):
                force[j] += on.mass[j, rest[k]] * on.motion[rest[k], i]
        for j in range(robot.nu):
            on.torque[j, i] = left_to_motors(driven[j], force, held)
        for k in range(3):
            on.wrench[k, i] = force_of_row(k, force, held)


@kernel
def point_task(
    robot: ControlledRobot, state: ControlState, link: int, position: Floats, on: Constrained
) -> None:
    """Find `rows` and `shift` of a point of a link: its acceleration by those of the joints."""
    point_columns(robot.model, state.kinematics, link, position, on.columns)
    point_bias_acceleration(state.kinematics, link, position, on.shift)
    for k in range(3):
        for j in range(robot.nv):
            on.shift[k] += on.columns[j, k] * on.drift[j]
        for i in range(robot.nu):
            total = 0.0
            for j in range(robot.nv):
                total += on.columns[j, k] * on.motion[j, i]
            on.rows[k, i] = total
