"""How compiled loops ask a controller for torques."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.bundle_type import address_of
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.sets import row_of
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.controller.control import OVERRAN, TRUSTED, Control
from heelstrike.sim.controller.guard import intact, intact_between
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import ControlState


@dissolved_kernel
def ask(
    controller: Any, time: float, q: Floats, v: Floats, model: Model, tree: Workspace,
    contacts: Contacts, control: Control, torque: Floats,
) -> None:  # fmt: skip
    """Ask a controller for its torques; they are no number if it wrote where it may not."""
    robot = control.robot
    robot.trial = 0
    at = control.kept_at, control.log_at
    _ask(controller, time, q, v, model, tree, contacts, control.kept, at, control, torque)


@dissolved_kernel
def consult(
    controller: Any, time: float, q: Floats, v: Floats, model: Model, tree: Workspace,
    contacts: Contacts, control: Control, torque: Floats,
) -> None:  # fmt: skip
    """Ask a controller for the torques it would want, were this its next call; it forgets that."""
    for i in range(control.kept.shape[0]):
        control.spare[i] = control.kept[i]
    robot = control.robot
    robot.trial = 1
    at = control.spare_at, control.spare_log_at
    _ask(controller, time, q, v, model, tree, contacts, control.spare, at, control, torque)


@dissolved_kernel
def _show(q: Floats, v: Floats, model: Model, state: ControlState) -> None:
    copy_words(q, state.q)
    copy_words(v, state.v)
    for i in range(model.actuator_joint.shape[0]):
        joint = row_of(i, model.actuator_joint)
        state.joint_position[i] = q[joint]
        state.joint_velocity[i] = v[joint]


@dissolved_kernel
def _ask(
    controller: Any, time: float, q: Floats, v: Floats, model: Model, tree: Workspace,
    contacts: Contacts, kept: Integers, at: tuple[int, int], control: Control, torque: Floats,
) -> None:  # fmt: skip
    state = control.state
    _show(q, v, model, state)
    if control.conduct != TRUSTED:
        _show_kinematics(tree, state.kinematics)
        show_contacts(contacts, control.contacts)
    if control.believes == 1:
        control.robot.update(state)
    call_law(controller, time, kept, at, control, torque)


@dissolved_kernel
def call_law(
    controller: Any, time: float, kept: Integers, at: tuple[int, int], control: Control,
    torque: Floats,
) -> None:  # fmt: skip
    """Call a controller; its torques are no number if it wrote where it may not."""
    memory_at, log_at = at
    controller(
        time, address_of(control.state), address_of(control.contacts), address_of(control.robot),
        control.parameters_at, memory_at, log_at, torque,
    )  # fmt: skip
    spoilt = not (intact(torque) and intact(kept) and intact(control.parameters))
    if control.conduct != TRUSTED and not spoilt:
        spoilt = not (
            intact_between(kept, control.between_kept)
            and intact_between(control.parameters, control.between_parameters)
        )
    if spoilt:
        control.conduct = OVERRAN
        if torque.size > 0:
            torque[0] = np.nan


@kernel
def _show_kinematics(tree: Workspace, own: Workspace) -> None:
    """Copy kinematics: what a controller does to them harms nobody."""
    copy_words(tree.angle, own.angle)
    copy_words(tree.cosine, own.cosine)
    copy_words(tree.sine, own.sine)
    copy_words(tree.origin, own.origin)
    copy_words(tree.pivot, own.pivot)
    copy_words(tree.motion, own.motion)
    copy_words(tree.velocity, own.velocity)
    copy_words(tree.bias_acceleration, own.bias_acceleration)
    copy_words(tree.inertia, own.inertia)


@kernel
def show_contacts(contacts: Contacts, seen: Contacts) -> None:
    """Copy contact points."""
    copy_words(contacts.position, seen.position)
    copy_words(contacts.normal, seen.normal)
    copy_words(contacts.gap, seen.gap)
    copy_words(contacts.force, seen.force)
