"""The robot in space as a compiled controller sees it, and how the loop asks for its torques."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.bundle_type import address_of
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import VALUE
from heelstrike.dynamics.spatial.algebra import momentum_of, power, spatial
from heelstrike.dynamics.spatial.equations import (
    bias_force,
    composite_inertias,
    inverse_dynamics,
    passive_force,
)
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import HINGE, SLIDE, SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import ControllerFunction, Law, machine_code_of
from heelstrike.sim.spatial.memory import SpatialMemory

GOES_ON = -1
"""What `SpatialControlledRobot.ending` is while the law lets the run go on."""


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


class SpatialControl(Bundle):
    """The numbers of a controller in space, and how it is asked."""

    function: Integers = array(VALUE, of=int, address=True)
    """The compiled function, as :func:`~heelstrike.compiler.words.kept_value` reads it."""
    parameters_at: int = number(int)
    memory_at: int = number(int)
    log_at: int = number(int)
    """parameters_at, memory_at, log_at: Where the tables of the bundles are."""
    state: SpatialControlState = part(SpatialControlState, address=True)
    contacts: Contacts = part(Contacts, address=True)
    robot: SpatialControlledRobot = part(SpatialControlledRobot, address=True)
    """state, contacts, robot: What it is shown."""
    in_python: int = cell(int)
    """Whether the loop has to come back for its torques."""


@kernel
def show_state(
    model: SpatialModel, robot: SpatialControlledRobot, q: Floats, v: Floats,
    state: SpatialControlState,
) -> None:  # fmt: skip
    """Copy the state for the controller."""
    for i in range(q.shape[0]):
        state.q[i] = q[i]
    for k in range(v.shape[0]):
        state.v[k] = v[k]
    for i in range(model.nu):
        at = robot.position_of[i]
        state.joint_position[i] = q[at] if at >= 0 else 0.0
        state.joint_velocity[i] = v[model.actuator_velocity[i]]


@kernel
def ask_law(
    controller: Any, time: float, model: SpatialModel, q: Floats, v: Floats,
    control: SpatialControl, command: Floats,
) -> None:  # fmt: skip
    """Ask a compiled controller for its commands."""
    show_state(model, control.robot, q, v, control.state)
    controller(
        time, address_of(control.state), address_of(control.contacts), address_of(control.robot),
        control.parameters_at, control.memory_at, control.log_at, command,
    )  # fmt: skip


SEEN: dict[str, Any] = {
    "state": SpatialControlState, "contacts": Contacts, "robot": SpatialControlledRobot
}  # fmt: skip
"""What laws are shown in space."""


@cache
def words_in_space(function: ControllerFunction) -> Integers:
    """Words by which the loop finds the machine code of a law, made for robots in space.

    Raises
    ------
    ControllerError
        If it cannot be compiled.
    """
    return machine_code_of(function, SEEN)


class ReadySpatialLaw:
    """A law made ready for a robot in space: its numbers, and a new memory and log.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    law : Law
        The law.
    function : (any,) int64
        Words of the machine code that the loop asks.
    memory : SpatialMemory
        Of the simulation; its kinematics are those that the law is shown.

    Attributes
    ----------
    control : SpatialControl
        What the loop hands along.
    parameters, memory, log : Bundle
        Its numbers, what it remembers, and what it tells of itself.
    """

    def __init__(
        self, robot: SpatialRobot, law: Law, function: Integers, memory: SpatialMemory
    ) -> None:
        known: Any = robot
        self.parameters, self.memory = law.numbers(known)
        self.log = law.new_log(known)
        extents = robot.model.extents
        view = SpatialControlledRobot.allocate(
            extents, model=robot.model, mass=robot.total_mass, position_of=driven_positions(robot)
        )
        view.ending = GOES_ON
        self.control = SpatialControl(
            function=function.copy(),
            parameters_at=self.parameters.address, memory_at=self.memory.address,
            log_at=self.log.address,
            state=SpatialControlState.allocate(extents, kinematics=memory.equations.tree),
            contacts=memory.contacts, robot=view,
        )  # fmt: skip


def driven_positions(robot: SpatialRobot) -> Integers:
    """Position of the joint of each actuator, (nu,); -1 of a joint with several."""
    model = robot.model
    joints = model.velocity_joint[model.actuator_velocity]
    single = np.isin(model.joint_kind[joints], (HINGE, SLIDE))
    return np.where(single, model.first_position[joints], -1).astype(np.int64)
