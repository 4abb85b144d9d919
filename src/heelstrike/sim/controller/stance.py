"""Torques that move the joints as asked for while the ground holds a foot.

With the stance foot held, J_u v̇_u + J_a v̇_a + J̇ v = 0 ties the accelerations of the unactuated
coordinates to those of the actuated ones (paper eq. 32-34). The generalised force f = A v̇ + H, less
what springs and dampers give, then fixes what the ground exerts, J_uᵀ F = f_u, and the torques
Γ = f_a − J_aᵀ F. This is eq. 37 with the products MᵀA M and MᵀH carried out by recursion instead of
as matrices.

A flat foot is held in its three coordinates. On a point foot the ground exerts no moment: two of
the three unactuated accelerations follow from the contact. The third goes along the direction n
with J_u n = 0, the trunk's turning about the foot; the motors do not reach it, nᵀ(A v̇ + H)_u = 0,
so it follows from the accelerations of the joints (partial feedback linearisation: M. W. Spong,
*Partial feedback linearization of underactuated mechanical systems*, 1994).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.kernels import inverse_dynamics, passive_force, point_bias_acceleration
from heelstrike.dynamics.places import point_columns
from heelstrike.dynamics.spatial import (
    Spatial,
    cross,
    plus,
    power,
    scaled,
    solve_three,
    spatial,
)
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.tied import follow_speeds, tied_torque

if TYPE_CHECKING:
    from heelstrike.sim.controller.interface import Contacts
    from heelstrike.sim.controller.robot import ControlledRobot, ControlState


@kernel
def solve_three_transposed(a: Spatial, b: Spatial, c: Spatial, right: Spatial) -> Spatial:
    """Solve [a b c]ᵀ s = right."""
    bc = cross(b, c)
    determinant = power(a, bc)
    x, y, z = plus(
        plus(scaled(bc, right[0]), scaled(cross(c, a), right[1])), scaled(cross(a, b), right[2])
    )
    return x / determinant, y / determinant, z / determinant


@kernel
def complete(robot: ControlledRobot, target: Spatial, joints: Floats, whole: Floats) -> None:
    """Write rates of all coordinates that move a foot as the target says, given the joints'.

    The Jacobian of the foot is in `robot.columns`; `joints` is (nu,), `whole` (nv,).
    """
    columns, driven, rest = robot.columns, robot.model.actuator_joint, robot.unactuated
    for i in range(robot.nu):
        whole[driven[i]] = joints[i]
        target = plus(target, scaled(spatial(columns, driven[i]), -joints[i]))
    a, b, c = rest[0], rest[1], rest[2]
    whole[a], whole[b], whole[c] = solve_three(
        spatial(columns, a), spatial(columns, b), spatial(columns, c), target
    )


@kernel
def hold_still(robot: ControlledRobot, state: ControlState, foot: int) -> None:
    """Write velocities `v` that go with those of the joints while a flat foot rests (eq. 29)."""
    link = robot.foot_link[foot]
    point_columns(robot.model, state.kinematics, link, state.kinematics.origin[link], robot.columns)
    if robot.loops.bias.shape[0] > 0:
        for i in range(robot.nu):
            state.v[robot.model.actuator_joint[i]] = state.joint_velocity[i]
        follow_speeds(robot, state, 3)
        return
    complete(robot, (0.0, 0.0, 0.0), state.joint_velocity, state.v)


@kernel
def force_wanted(robot: ControlledRobot, state: ControlState, force: Floats) -> None:
    """Write A v̇ + H − passive, which motors and ground must supply for `robot.acceleration`."""
    inverse_dynamics(robot.model, robot.acceleration, state.kinematics, force)
    passive_force(robot.model, state.q, state.v, robot.passive)
    for j in range(robot.nv):
        force[j] -= robot.passive[j]


@kernel
def refused(robot: ControlledRobot, torque: Floats) -> bool:
    """Whether other than three coordinates are without a motor; then torques are NaN."""
    if robot.unactuated.shape[0] == 3:
        return False
    for i in range(robot.nu):
        torque[i] = np.nan
    return True


@kernel
def joint_torques(robot: ControlledRobot, torque: Floats) -> None:
    """Split `robot.force`: the foot's wrench, and the torques besides it (eq. 36, 37)."""
    columns, force, rest = robot.columns, robot.force, robot.unactuated
    a, b, c = rest[0], rest[1], rest[2]
    wrench = solve_three_transposed(
        spatial(columns, a),
        spatial(columns, b),
        spatial(columns, c),
        (force[a], force[b], force[c]),
    )
    for i in range(robot.nu):
        joint = robot.model.actuator_joint[i]
        torque[i] = force[joint] - power(spatial(columns, joint), wrench)


@kernel
def flat_foot_torque(
    self: ControlledRobot, state: ControlState, foot: int, acceleration: Floats, torque: Floats
) -> None:
    """Torques (nu,) that give the joints an acceleration (nu,) while a foot is held flat.

    For robots with three coordinates without a motor, and those whose other joints follow by closed
    loops and couplings (:mod:`heelstrike.sim.controller.tied`); NaN for others. `torque` may be the
    array `acceleration`.
    """
    work, link, drift = state.kinematics, self.foot_link[foot], self.other
    point_columns(self.model, work, link, work.origin[link], self.columns)
    point_bias_acceleration(work, link, work.origin[link], drift)
    if self.tied.shape[0] > 0:
        tied_torque(self, state, 3, acceleration, torque)
        return
    if refused(self, torque):
        return
    complete(self, (-drift[0], -drift[1], -drift[2]), acceleration, self.acceleration)
    force_wanted(self, state, self.force)
    joint_torques(self, torque)


@kernel
def point_foot_torque(
    self: ControlledRobot, state: ControlState, contacts: Contacts, foot: int,
    acceleration: Floats, torque: Floats,
) -> None:  # fmt: skip
    """Torques (nu,) that give the joints an acceleration (nu,) while a point foot stays in place.

    The foot's contact point is held, or its disc rolls. For robots with three coordinates without
    a motor, and those whose other joints follow by closed loops and couplings; NaN for others.
    `torque` may be the array `acceleration`.
    """
    model, columns, wanted = self.model, self.columns, self.acceleration
    contact = self.foot_contact[foot]
    link, radius = model.contact_link[contact], model.contact_radius[contact]
    position, normal = contacts.position[contact], contacts.normal[contact]
    point_columns(model, state.kinematics, link, position, columns)
    center, drift = self.force, self.other  # both are written anew below
    center[0] = position[0] + radius * normal[0]
    center[1] = position[1] + radius * normal[1]
    point_bias_acceleration(state.kinematics, link, center, drift)
    if self.tied.shape[0] > 0:
        tied_torque(self, state, 2, acceleration, torque)
        return
    if refused(self, torque):
        return
    # In the place of the rotation, which nothing holds: the trunk's turning about the foot.
    for j in range(self.nv):
        columns[j, 2] = 0.0
    a, b, c = self.unactuated[0], self.unactuated[1], self.unactuated[2]
    columns[a, 2], columns[b, 2], columns[c, 2] = cross(
        (columns[a, 0], columns[b, 0], columns[c, 0]), (columns[a, 1], columns[b, 1], columns[c, 1])
    )
    complete(self, (-drift[0], -drift[1], 0.0), acceleration, wanted)

    # Turning about the foot, without a motor; the force is linear in it.
    force, other = self.force, self.other
    force_wanted(self, state, force)
    for j in range(self.nv):
        wanted[j] += columns[j, 2]
    force_wanted(self, state, other)
    missing = 0.0
    inertia = 0.0
    for j in range(self.nv):
        missing += columns[j, 2] * force[j]
        inertia += columns[j, 2] * (other[j] - force[j])
    share = -missing / inertia
    for j in range(self.nv):
        force[j] += share * (other[j] - force[j])
    joint_torques(self, torque)
