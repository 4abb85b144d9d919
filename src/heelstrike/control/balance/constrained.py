"""The robot on its stance foot, as functions of the accelerations of its joints alone.

While the ground holds the stance foot, J v̇ + J̇v = 0 gives the accelerations of the trunk; its
equations of motion then give the wrench of the ground, and those of the joints the torques (paper
eq. 32-37). All three are affine in the accelerations of the joints, which are therefore the only
unknowns of a whole-body controller: what they contribute are the columns found here.
"""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.kernels import (
    bias_force,
    mass_matrix,
    passive_force,
    point_bias_acceleration,
)
from heelstrike.dynamics.places import point_columns
from heelstrike.dynamics.spatial import power, scaled, solve_three, spatial
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import solve_three_transposed


class Constrained(Bundle):
    """The robot on its stance foot: what depends on joint accelerations a, and how.

    Attributes
    ----------
    motion, drift : (nv, nu) and (nv,) float
        v̇ = motion a + drift.
    wrench, load : (3, nu) and (3,) float
        Force (x, z) and moment about +y of the ground on the foot, at the middle of the sole:
        wrench a + load.
    torque, hold : (nu, nu) and (nu,) float
        Torques of the actuators: torque a + hold.
    rows, shift : (3, nu) and (3,) float
        Acceleration of a point (x, z, rotation): rows a + shift; see :func:`point_task`.
    mass, inertia, force, columns, bias : float
        Scratch.
    """

    motion: Floats = array("nv", "nu")
    drift: Floats = array("nv")
    wrench: Floats = array(3, "nu")
    load: Floats = array(3)
    torque: Floats = array("nu", "nu")
    hold: Floats = array("nu")
    rows: Floats = array(3, "nu")
    shift: Floats = array(3)
    mass: Floats = array("nv", "nv")
    inertia: Floats = array("nv", "nu")
    force: Floats = array("nv")
    columns: Floats = array("nv", 3)
    bias: Floats = array(3)


@kernel
def constrain(
    robot: ControlledRobot, state: ControlState, link: int, sole: Floats, on: Constrained
) -> None:
    """Find what depends on the accelerations of the joints while a foot is held at its sole."""
    find_motion(robot, state, link, sole, on)
    find_forces(robot, state, on)


@kernel
def find_motion(
    robot: ControlledRobot, state: ControlState, link: int, sole: Floats, on: Constrained
) -> None:
    """Find `motion` and `drift`; `columns` is then the Jacobian of the stance foot."""
    columns, rest, driven = on.columns, robot.unactuated, robot.model.actuator_joint
    point_columns(robot.model, state.kinematics, link, sole, columns)
    point_bias_acceleration(state.kinematics, link, sole, on.bias)
    a, b, c = rest[0], rest[1], rest[2]
    first, second, third = spatial(columns, a), spatial(columns, b), spatial(columns, c)
    for j in range(robot.nv):
        on.drift[j] = 0.0
        for i in range(robot.nu):
            on.motion[j, i] = 0.0
    on.drift[a], on.drift[b], on.drift[c] = solve_three(
        first, second, third, (-on.bias[0], -on.bias[1], -on.bias[2])
    )
    for i in range(robot.nu):
        joint = driven[i]
        on.motion[joint, i] = 1.0
        on.motion[a, i], on.motion[b, i], on.motion[c, i] = solve_three(
            first, second, third, scaled(spatial(columns, joint), -1.0)
        )


@kernel
def find_forces(robot: ControlledRobot, state: ControlState, on: Constrained) -> None:
    """Find wrench and torques by the motion, from the equations A v̇ + H = forces."""
    rest, driven, columns = robot.unactuated, robot.model.actuator_joint, on.columns
    a, b, c = rest[0], rest[1], rest[2]
    first, second, third = spatial(columns, a), spatial(columns, b), spatial(columns, c)
    mass_matrix(robot.model, state.kinematics, on.mass)
    bias_force(robot.model, state.kinematics, on.force)
    passive_force(robot.model, state.q, state.v, robot.passive)
    for j in range(robot.nv):
        total = on.force[j] - robot.passive[j]
        for k in range(3):
            total += on.mass[j, rest[k]] * on.drift[rest[k]]
        on.force[j] = total
        for i in range(robot.nu):
            total = on.mass[j, driven[i]]
            for k in range(3):
                total += on.mass[j, rest[k]] * on.motion[rest[k], i]
            on.inertia[j, i] = total
    force, inertia = on.force, on.inertia
    load = solve_three_transposed(first, second, third, (force[a], force[b], force[c]))
    on.load[0], on.load[1], on.load[2] = load
    for j in range(robot.nu):
        on.hold[j] = force[driven[j]] - power(spatial(columns, driven[j]), load)
    for i in range(robot.nu):
        share = solve_three_transposed(
            first, second, third, (inertia[a, i], inertia[b, i], inertia[c, i])
        )
        on.wrench[0, i], on.wrench[1, i], on.wrench[2, i] = share
        for j in range(robot.nu):
            on.torque[j, i] = inertia[driven[j], i] - power(spatial(columns, driven[j]), share)


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
