"""Torques that move the joints as asked for while the ground holds a foot, and loops hold.

What ground and loops hold ties accelerations to each other (:mod:`heelstrike.dynamics.held`): with
those of the joints given, v̇ is complete, and Nᵀ (A v̇ + H − passive) is what the motors must supply
(paper eq. 31-37). Motors of the independent joints do what is asked of them; where there are more
motors than ways to move, those on dependent joints help, and the torques are those of least norm.

A flat foot is held in its three coordinates. On a point foot the ground exerts no moment: one
coordinate without a motor stays independent, the trunk's turning about the foot. Its row of
Nᵀ (A v̇ + H) = Nᵀ Γ has no motor, which tells its acceleration (partial feedback linearisation:
M. W. Spong, *Partial feedback linearization of underactuated mechanical systems*, 1994).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.straight_line import is_code, play
from heelstrike.dynamics.dense import solve_positive
from heelstrike.dynamics.held import (
    FREE,
    HeldRows,
    add_loops,
    add_place,
    begin_solving,
    complete,
    keep_loops,
    keep_place,
    left_to_motors,
    solve_row,
    solve_rows,
)
from heelstrike.dynamics.kernels import inverse_dynamics, passive_force
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.controller.following import follow_held

if TYPE_CHECKING:
    from heelstrike.sim.controller.interface import Contacts
    from heelstrike.sim.controller.robot import ControlledRobot, ControlState


@kernel
def hold_place(
    robot: ControlledRobot, state: ControlState, link: int, position: Floats, center: Floats,
    components: int,
) -> None:  # fmt: skip
    """Write into `robot.held`, not yet solved, the accelerations that a place and the loops allow.

    Of a rolling disc the place is its lowest point, and its centre moves on evenly.
    """
    held, work = robot.held, state.kinematics
    held.count = 0
    add_place(robot.model, work, link, position, components, held)
    add_loops(robot.model, state.q, state.v, work, held)
    keep_place(work, link, center, components, 0, held)
    keep_loops(components, held)


@kernel
def hold_sole(robot: ControlledRobot, state: ControlState, link: int, sole: Floats) -> None:
    """Hold a flat foot at a point of its sole; solve `robot.held` for accelerations."""
    hold_place(robot, state, link, sole, sole, 3)
    solve_rows(robot.unactuated, robot.held)


@kernel
def hold_point(robot: ControlledRobot, state: ControlState, contacts: Contacts, foot: int) -> None:
    """Hold a point foot where it stands, or let its disc roll; `robot.held` is not yet solved."""
    model, center = robot.model, robot.other
    contact = robot.foot_contact[foot]
    radius, normal = model.contact_radius[contact], contacts.normal[contact]
    position = contacts.position[contact]
    for k in range(2):
        center[k] = position[k] + radius * normal[k]
    hold_place(robot, state, model.contact_link[contact], position, center, 2)


@kernel
def hold_still(robot: ControlledRobot, state: ControlState, foot: int) -> None:
    """Write velocities `v` that go with those of the joints while a flat foot rests (eq. 29)."""
    link, work, held = robot.foot_link[foot], state.kinematics, robot.held
    held.count = 0
    add_place(robot.model, work, link, work.origin[link], 3, held)
    add_loops(robot.model, state.q, state.v, work, held)
    solve_rows(robot.unactuated, held)
    for i in range(robot.nu):
        state.v[robot.model.actuator_joint[i]] = state.joint_velocity[i]
    follow_held(robot, state)


@kernel
def force_wanted(robot: ControlledRobot, state: ControlState, force: Floats) -> None:
    """Complete `robot.acceleration`; write A v̇ + H − passive, what motors, ground, loops supply."""
    complete(robot.held, robot.acceleration)
    inverse_dynamics(robot.model, robot.acceleration, state.kinematics, force)
    passive_force(robot.model, state.q, state.v, robot.passive)
    for j in range(robot.nv):
        force[j] -= robot.passive[j]


@kernel
def motors_help(robot: ControlledRobot) -> bool:
    """Whether a coordinate that follows from others has a motor, too."""
    helped = False
    for i in range(robot.nu):
        helped = helped or robot.held.row[robot.model.actuator_joint[i]] != FREE
    return helped


@kernel
def joint_torques(robot: ControlledRobot, torque: Floats) -> None:
    """Write the torques of least norm that leave ground and loops their part of `robot.force`."""
    if motors_help(robot):
        share_torques(robot, torque)
        return
    for i in range(robot.nu):
        torque[i] = left_to_motors(robot.model.actuator_joint[i], robot.force, robot.held)


@kernel
def share_torques(robot: ControlledRobot, torque: Floats) -> None:
    """Write the torques of least norm where there are more motors than ways to move."""
    held, motor, system, wanted = robot.held, robot.motor, robot.shares, robot.other
    rows, row_of = held.solved, held.row
    count = 0
    for j in range(robot.nv):
        if row_of[j] != FREE or motor[j] < 0:
            continue
        wanted[count] = left_to_motors(j, robot.force, held)
        place = 0
        for k in range(j + 1):
            if row_of[k] != FREE or motor[k] < 0:
                continue
            entry = 1.0 if k == j else 0.0
            for i in range(robot.nv):
                if row_of[i] != FREE and motor[i] >= 0:
                    entry += rows[row_of[i], j] * rows[row_of[i], k]
            system[count, place] = entry
            place += 1
        count += 1
    solve_positive(count, system, wanted)
    for i in range(robot.nu):
        torque[i] = 0.0
    count = 0
    for j in range(robot.nv):
        if row_of[j] != FREE or motor[j] < 0:
            continue
        torque[motor[j]] = wanted[count]
        for i in range(robot.nv):
            if row_of[i] != FREE and motor[i] >= 0:
                torque[motor[i]] -= rows[row_of[i], j] * wanted[count]
        count += 1


@kernel
def torques_for(
    robot: ControlledRobot, state: ControlState, acceleration: Floats, torque: Floats
) -> None:
    """Torques (nu,) that give independent joints an acceleration while `robot.held` holds.

    One coordinate that no motor reaches may be left, and follows; of more torques are NaN.
    """
    held, motor, whole, force = robot.held, robot.motor, robot.acceleration, robot.force
    turning = FREE
    reached = True
    for j in range(robot.nv):
        if held.row[j] == FREE:
            whole[j] = 0.0 if motor[j] < 0 else acceleration[motor[j]]
            if motor[j] < 0:
                reached = reached and turning == FREE
                turning = j
    if not reached or (turning != FREE and motors_help(robot)):
        for i in range(robot.nu):
            torque[i] = np.nan
        return
    force_wanted(robot, state, force)
    if turning != FREE:  # the force is linear in its acceleration
        missing = left_to_motors(turning, force, held)
        whole[turning] = 1.0
        force_wanted(robot, state, robot.other)
        inertia = left_to_motors(turning, robot.other, held) - missing
        for j in range(robot.nv):
            force[j] -= missing / inertia * (robot.other[j] - force[j])
    joint_torques(robot, torque)


@kernel
def hold_by_structure(
    model: Model, hold: Integers, position: Floats, kinematics: Workspace, held: HeldRows
) -> None:
    """Hold a flat foot at a point, of which the structure tells what each row is solved for.

    For accelerations, as :func:`hold_sole`, and without a branch on a value. `hold` (4,) has the
    link of the foot, and the coordinate of each row.
    """
    held.count = 0
    add_place(model, kinematics, hold[0], position, 3, held)
    keep_place(kinematics, hold[0], position, 3, 0, held)
    begin_solving(held)
    for row in range(3):
        solve_row(row, hold[1 + row], held)


@kernel
def supply_flat_foot(
    model: Model, hold: Integers, kinematics: Workspace, q: Floats, v: Floats,
    acceleration: Floats, held: HeldRows, whole: Floats, force: Floats, passive: Floats,
    torque: Floats,
) -> None:  # fmt: skip
    """Torques (nu,) that give the joints an acceleration (nu,) while a foot is held flat.

    The same as by search, for straight-line code.
    """
    hold_by_structure(model, hold, kinematics.origin[hold[0]], kinematics, held)
    for i in range(model.nu):
        whole[model.actuator_joint[i]] = acceleration[i]
    complete(held, whole)
    inverse_dynamics(model, whole, kinematics, force)
    passive_force(model, q, v, passive)
    for j in range(model.nv):
        force[j] -= passive[j]
    for i in range(model.nu):
        torque[i] = left_to_motors(model.actuator_joint[i], force, held)


@kernel
def flat_foot_torque(
    self: ControlledRobot, state: ControlState, foot: int, acceleration: Floats, torque: Floats
) -> None:
    """Torques (nu,) that give the joints an acceleration (nu,) while a foot is held flat.

    For robots whose coordinates without a motor follow from the others by the foot, closed loops
    and couplings; NaN for others. `torque` may be the array `acceleration`.
    """
    if is_code(self.flat_foot[foot]):
        play(
            self.flat_foot[foot],
            (
                self.model, self.flat_hold[foot], state.kinematics, state.q, state.v, acceleration,
                self.held, self.acceleration, self.force, self.passive, torque,
            ),
        )  # fmt: skip
        return
    link = self.foot_link[foot]
    hold_sole(self, state, link, state.kinematics.origin[link])
    torques_for(self, state, acceleration, torque)


@kernel
def point_foot_torque(
    self: ControlledRobot, state: ControlState, contacts: Contacts, foot: int,
    acceleration: Floats, torque: Floats,
) -> None:  # fmt: skip
    """Torques (nu,) that give the joints an acceleration (nu,) while a point foot stays in place.

    The foot's contact point is held, or its disc rolls. For robots of which one coordinate without
    a motor does not follow from the others: the trunk's turning about the foot; NaN for others.
    `torque` may be the array `acceleration`.
    """
    hold_point(self, state, contacts, foot)
    solve_rows(self.unactuated, self.held)
    torques_for(self, state, acceleration, torque)
