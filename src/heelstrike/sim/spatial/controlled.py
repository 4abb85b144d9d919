"""The robot in space as a compiled controller sees it, and how the loop asks for its torques."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.words import copy_words
from heelstrike.dynamics.spatial.algebra import momentum_of, power, spatial
from heelstrike.dynamics.spatial.equations import (
    bias_force,
    composite_inertias,
    inverse_dynamics,
    passive_force,
)
from heelstrike.dynamics.spatial.kinematics import forward_kinematics, link_velocities
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace
from heelstrike.once_each import once_each
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import HINGE, SLIDE, SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.asking import call_law, show_contacts
from heelstrike.sim.controller.control import TRUSTED, Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import ControllerFunction, machine_code_of
from heelstrike.sim.controller.motors import limit_torques
from heelstrike.sim.controller.robot import NO_ENDING
from heelstrike.sim.memory import CommonTally


class SpatialControlState(Bundle):
    """Where a robot in space is and how it moves, as its controller sees it."""

    q: Floats = array("nq")
    v: Floats = array("nv")
    """q, v: Position and velocity."""
    joint_position: Floats = array("nu")
    joint_velocity: Floats = array("nu")
    """joint_position, joint_velocity: Those of what the actuators drive, in their order. An
    actuator of a ball or free joint has the position zero."""
    kinematics: SpatialWorkspace = part(SpatialWorkspace)
    """What follows from them, ready for the queries of :class:`SpatialControlledRobot`."""


@kernel
def show_driven(
    model: SpatialModel, position_of: Integers, q: Floats, v: Floats, state: SpatialControlState
) -> None:
    """Write positions and velocities of what the actuators drive."""
    for i in range(position_of.shape[0]):
        at = position_of[i]
        state.joint_position[i] = q[at] if at >= 0 else 0.0
        state.joint_velocity[i] = v[model.actuator_velocity[i]]


class SpatialControlledRobot(Bundle):
    """A robot in space and its dynamics, for use within a controller.

    Every query writes its answer into the array that it is given last.
    """

    model: SpatialModel = part(SpatialModel, address=True)
    """Its numbers; ``robot.model.actuator_velocity[i]`` is the velocity that actuator i drives."""
    nq: int = number(int)
    nv: int = number(int)
    nu: int = number(int)
    nc: int = number(int)
    nl: int = number(int)
    """nq, nv, nu, nc, nl: Positions, velocities, actuators, contact points and links."""
    mass: float = number(float)
    """Of the whole robot (kg)."""
    period: float = cell(float)
    """Seconds between two calls."""
    ending: int = cell(int)
    """Which ending of its own the law has come to, see :meth:`stop`; -1 for none."""
    position_of: Integers = array("nu", of=int)
    """Position of the joint of each actuator; -1 where it has several."""

    @kernel
    def update(self, state: SpatialControlState) -> None:
        """Let all that follows from the positions and velocities of a state follow from them."""
        show_driven(self.model, self.position_of, state.q, state.v, state)
        forward_kinematics(self.model, state.q, state.kinematics)
        link_velocities(self.model, state.v, state.kinematics)

    @kernel
    def driven_position(self, actuator: int) -> int:
        """Place in q of what an actuator drives; -1 where its joint has several."""
        return int(self.position_of[actuator])

    @kernel
    def driven_velocity(self, actuator: int) -> int:
        """Place in v of what an actuator drives."""
        return int(self.model.actuator_velocity[actuator])

    @kernel
    def stop(self, ending: int) -> None:
        """End the run with this instant, for the reason of that place among the law's `endings`."""
        self.ending = ending

    @kernel
    def bias_force(self, state: SpatialControlState, force: Floats) -> None:
        """Centrifugal, Coriolis and gravitational force H(q, v), (nv,)."""
        bias_force(self.model, state.kinematics, force)

    @kernel
    def passive_force(self, state: SpatialControlState, force: Floats) -> None:
        """Generalised force of joint springs and dampers on the robot, (nv,)."""
        passive_force(self.model, state.q, state.v, force)

    @kernel
    def inverse_dynamics(
        self, state: SpatialControlState, acceleration: Floats, force: Floats
    ) -> None:
        """Generalised force M v̇ + H, (nv,), of an acceleration (nv,)."""
        inverse_dynamics(self.model, acceleration, state.kinematics, force)

    @kernel
    def gravity_force(self, state: SpatialControlState, torque: Floats) -> None:
        """Torques (nu,) of the actuators that bear the weight beyond each joint: H(q, 0)."""
        work, gravity = state.kinematics, self.model.gravity
        composite_inertias(self.model, work)
        fall = (0.0, 0.0, 0.0, gravity[0], gravity[1], gravity[2])
        for i in range(self.nu):
            k = self.model.actuator_velocity[i]
            weight = momentum_of(work.composite, self.model.velocity_joint[k], fall)
            torque[i] = -power(spatial(work.motion, k), weight)


class SpatialControl(Control):
    """The numbers of a controller in space, and how it is asked."""

    state: SpatialControlState = part(SpatialControlState, address=True)  # type: ignore[assignment]
    robot: SpatialControlledRobot = part(  # type: ignore[assignment]
        SpatialControlledRobot, address=True
    )
    """state, robot: What it is shown, beside the contacts."""


@dissolved_kernel
def ask_in_space(
    controller: Any, time: float, q: Floats, v: Floats, model: SpatialModel,
    tree: SpatialWorkspace, contacts: Contacts, control: SpatialControl, torque: Floats,
) -> None:  # fmt: skip
    """Ask a controller for its torques; they are no number if it wrote where it may not."""
    state = control.state
    for i in range(q.shape[0]):
        state.q[i] = q[i]
    for k in range(v.shape[0]):
        state.v[k] = v[k]
    show_driven(model, control.robot.position_of, q, v, state)
    if control.conduct != TRUSTED:
        show_kinematics(tree, state.kinematics)
        show_contacts(contacts, control.contacts)
    if control.believes == 1:
        control.robot.update(state)
    at = control.kept_at, control.log_at
    call_law(controller, time, control.kept, at, control, torque)


@kernel
def show_kinematics(tree: SpatialWorkspace, own: SpatialWorkspace) -> None:
    """Copy kinematics: what a controller does to them harms nobody."""
    copy_words(tree.rotation, own.rotation)
    copy_words(tree.origin, own.origin)
    copy_words(tree.pivot, own.pivot)
    copy_words(tree.motion, own.motion)
    copy_words(tree.velocity, own.velocity)
    copy_words(tree.bias_acceleration, own.bias_acceleration)
    copy_words(tree.inertia, own.inertia)


@dissolved_kernel
def limit_torque_in_space(
    model: SpatialModel, voltage: int, v: Floats, tally: CommonTally, commands: Floats,
    torques: Floats,
) -> bool:  # fmt: skip
    """Find the torques of an instant from its commands; return whether all of these are finite."""
    return limit_torques(model, model.actuator_velocity, voltage, v, tally, commands, torques)


SEEN: dict[str, Any] = {
    "state": SpatialControlState, "contacts": Contacts, "robot": SpatialControlledRobot
}  # fmt: skip
"""What laws are shown in space."""


@once_each
def words_in_space(function: ControllerFunction) -> Integers:
    """Words by which the loop finds the machine code of a law, made for robots in space.

    Raises
    ------
    ControllerError
        If it cannot be compiled.
    """
    return machine_code_of(function, SEEN)


def view_of(robot: SpatialRobot) -> SpatialControlledRobot:
    """Make the view of a robot that a law has."""
    view = SpatialControlledRobot.allocate(
        robot.model.extents, model=robot.model, mass=robot.total_mass,
        position_of=driven_positions(robot),
    )  # fmt: skip
    view.ending = NO_ENDING
    return view


def driven_positions(robot: SpatialRobot) -> Integers:
    """Position of the joint of each actuator, (nu,); -1 of a joint with several."""
    model = robot.model
    joints = model.velocity_joint[model.actuator_velocity]
    single = np.isin(model.joint_kind[joints], (HINGE, SLIDE))
    return np.where(single, model.first_position[joints], -1).astype(np.int64)
