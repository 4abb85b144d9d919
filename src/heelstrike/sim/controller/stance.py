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
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model

if TYPE_CHECKING:
    from heelstrike.sim.controller.interface import Contacts
    from heelstrike.sim.controller.robot import ControlledRobot, ControlState


@kernel
def solve_three(
    columns: Floats, a: int, b: int, c: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Solve [columns a, b, c] s = (x, y, z) for a 3 by 3 system whose columns are rows here."""
    a0, a1, a2 = columns[a, 0], columns[a, 1], columns[a, 2]
    b0, b1, b2 = columns[b, 0], columns[b, 1], columns[b, 2]
    c0, c1, c2 = columns[c, 0], columns[c, 1], columns[c, 2]
    bc0, bc1, bc2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
    determinant = a0 * bc0 + a1 * bc1 + a2 * bc2
    first = (x * bc0 + y * bc1 + z * bc2) / determinant
    ca0, ca1, ca2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
    second = (x * ca0 + y * ca1 + z * ca2) / determinant
    ab0, ab1, ab2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    third = (x * ab0 + y * ab1 + z * ab2) / determinant
    return first, second, third


@kernel
def solve_three_transposed(
    columns: Floats, a: int, b: int, c: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Solve [columns a, b, c]ᵀ s = (x, y, z)."""
    a0, a1, a2 = columns[a, 0], columns[a, 1], columns[a, 2]
    b0, b1, b2 = columns[b, 0], columns[b, 1], columns[b, 2]
    c0, c1, c2 = columns[c, 0], columns[c, 1], columns[c, 2]
    bc0, bc1, bc2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
    ca0, ca1, ca2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
    ab0, ab1, ab2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    determinant = a0 * bc0 + a1 * bc1 + a2 * bc2
    first = (x * bc0 + y * ca0 + z * ab0) / determinant
    second = (x * bc1 + y * ca1 + z * ab1) / determinant
    third = (x * bc2 + y * ca2 + z * ab2) / determinant
    return first, second, third


@kernel
def point_columns(
    model: Model, work: Workspace, link: int, position: Floats, columns: Floats
) -> None:
    """Jacobian (x, z, rotation) of a point of a link, one row a coordinate."""
    x = position[0] - work.pivot[0]
    z = position[1] - work.pivot[1]
    for j in range(model.parent.shape[0]):
        for k in range(3):
            columns[j, k] = 0.0
    j = link
    while j >= 0:
        columns[j, 0] = work.motion[j, 1] + work.motion[j, 0] * z
        columns[j, 1] = work.motion[j, 2] - work.motion[j, 0] * x
        columns[j, 2] = work.motion[j, 0]
        j = model.parent[j]


@kernel
def hold_still(robot: ControlledRobot, state: ControlState, foot: int) -> None:
    """Set velocities of the unactuated coordinates so that a flat foot is at rest (eq. 29)."""
    columns, v = robot.columns, state.v
    link = robot.foot_link[foot]
    point_columns(robot.model, state.kinematics, link, state.kinematics.origin[link], columns)
    x = 0.0
    z = 0.0
    rotation = 0.0
    for i in range(robot.nu):
        joint = robot.model.actuator_joint[i]
        x -= columns[joint, 0] * v[joint]
        z -= columns[joint, 1] * v[joint]
        rotation -= columns[joint, 2] * v[joint]
    a, b, c = robot.unactuated[0], robot.unactuated[1], robot.unactuated[2]
    v[a], v[b], v[c] = solve_three(columns, a, b, c, x, z, rotation)


@kernel
def _force_wanted(
    robot: ControlledRobot, state: ControlState, acceleration: Floats, force: Floats
) -> None:
    """Force A v̇ + H − passive that motors and ground must supply; `passive` is ready."""
    inverse_dynamics(robot.model, acceleration, state.kinematics, force)
    for j in range(robot.nv):
        force[j] -= robot.passive[j]


@kernel
def flat_foot_torque(
    self: ControlledRobot, state: ControlState, foot: int, acceleration: Floats, torque: Floats
) -> None:
    """Torques (nu,) that give the joints an acceleration (nu,) while a foot is held flat.

    For robots with three coordinates without a motor; NaN for others. `torque` may be the array
    `acceleration`.
    """
    if self.unactuated.shape[0] != 3:
        for i in range(self.nu):
            torque[i] = np.nan
        return
    model, work, columns, wanted = self.model, state.kinematics, self.columns, self.acceleration
    a, b, c = self.unactuated[0], self.unactuated[1], self.unactuated[2]
    link = self.foot_link[foot]
    point_columns(model, work, link, work.origin[link], columns)
    drift = self.other
    point_bias_acceleration(work, link, work.origin[link], drift)
    x = -drift[0]
    z = -drift[1]
    rotation = -drift[2]
    for i in range(self.nu):
        joint = model.actuator_joint[i]
        wanted[joint] = acceleration[i]
        x -= columns[joint, 0] * acceleration[i]
        z -= columns[joint, 1] * acceleration[i]
        rotation -= columns[joint, 2] * acceleration[i]
    wanted[a], wanted[b], wanted[c] = solve_three(columns, a, b, c, x, z, rotation)
    passive_force(model, state.q, state.v, self.passive)
    force = self.force
    _force_wanted(self, state, wanted, force)
    # The foot's wrench from the unactuated rows, torques from the actuated ones (eq. 36, 37).
    x, z, rotation = solve_three_transposed(columns, a, b, c, force[a], force[b], force[c])
    for i in range(self.nu):
        joint = model.actuator_joint[i]
        torque[i] = force[joint] - (
            columns[joint, 0] * x + columns[joint, 1] * z + columns[joint, 2] * rotation
        )


@kernel
def point_foot_torque(
    self: ControlledRobot, state: ControlState, contacts: Contacts, foot: int,
    acceleration: Floats, torque: Floats,
) -> None:  # fmt: skip
    """Torques (nu,) that give the joints an acceleration (nu,) while a point foot stays in place.

    The foot's contact point is held, or its disc rolls. For robots with three coordinates without
    a motor; NaN for others. `torque` may be the array `acceleration`.
    """
    if self.unactuated.shape[0] != 3:
        for i in range(self.nu):
            torque[i] = np.nan
        return
    model, work, columns, wanted = self.model, state.kinematics, self.columns, self.acceleration
    a, b, c = self.unactuated[0], self.unactuated[1], self.unactuated[2]
    contact = self.foot_contact[foot]
    link = model.contact_link[contact]
    position, normal = contacts.position[contact], contacts.normal[contact]
    radius = model.contact_radius[contact]
    point_columns(model, work, link, position, columns)
    for j in range(self.nv):
        columns[j, 2] = 0.0
    columns[a, 2] = columns[b, 0] * columns[c, 1] - columns[c, 0] * columns[b, 1]
    columns[b, 2] = columns[c, 0] * columns[a, 1] - columns[a, 0] * columns[c, 1]
    columns[c, 2] = columns[a, 0] * columns[b, 1] - columns[b, 0] * columns[a, 1]
    center, drift = self.force, self.other  # both are written anew below
    center[0] = position[0] + radius * normal[0]
    center[1] = position[1] + radius * normal[1]
    point_bias_acceleration(work, link, center, drift)
    x = -drift[0]
    z = -drift[1]
    for i in range(self.nu):
        joint = model.actuator_joint[i]
        wanted[joint] = acceleration[i]
        x -= columns[joint, 0] * acceleration[i]
        z -= columns[joint, 1] * acceleration[i]
    wanted[a], wanted[b], wanted[c] = solve_three(columns, a, b, c, x, z, 0.0)

    # Turning about the foot, without a motor; the force is linear in it.
    passive_force(model, state.q, state.v, self.passive)
    force, other = self.force, self.other
    _force_wanted(self, state, wanted, force)
    for j in range(self.nv):
        wanted[j] += columns[j, 2]
    _force_wanted(self, state, wanted, other)
    missing = 0.0
    inertia = 0.0
    for j in range(self.nv):
        missing += columns[j, 2] * force[j]
        inertia += columns[j, 2] * (other[j] - force[j])
    share = -missing / inertia
    for j in range(self.nv):
        force[j] += share * (other[j] - force[j])
    x, z, _ = solve_three_transposed(columns, a, b, c, force[a], force[b], force[c])
    for i in range(self.nu):
        joint = model.actuator_joint[i]
        torque[i] = force[joint] - (columns[joint, 0] * x + columns[joint, 1] * z)
