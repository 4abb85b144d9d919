"""What the velocities of a robot are, from encoders, pitch and contact.

An observer with the equations of motion inside. From call to call it predicts: with the torques
that were asked for, and with the contact points that carry force at rest, in one step of the
impulse-momentum equations,

    A (v⁺ − v) = h (Sᵀτ + passive − H) + Jᵀp,    J v⁺ = 0,

so that a touchdown, which gives a point its impulse within the step, makes the velocities jump in
the estimate as it does in the robot. Then it corrects joints and pitch by what was measured, as a
filter with critical damping does (g-h filter; Kalman's filter in its steady state is one of these),
and turns the velocities back to those that leave the standing points at rest. Where the robot is
along the ground follows from where its feet came down. That feet at rest tell about velocities is
the idea of contact-aided filters (M. Bloesch et al., *State estimation for legged robots*, 2012).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from heelstrike.arguments import positive, takes
from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.control.around import Around, Shown, Wrapper, copy, copy_contacts, own_period
from heelstrike.dynamics.held import (
    HeldRows,
    Reaction,
    add_loops,
    add_place,
    change_least,
    find_response,
    solve_rows,
)
from heelstrike.dynamics.kernels import (
    bias_force,
    integrate,
    passive_force,
    point_position,
    solve_factorized,
)
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.following import follow_positions, follow_speeds
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

UP = np.array([0.0, 1.0])
# Coordinate of a floating trunk's pitch.
PITCH = 2


class Parameters(Bundle):
    """Numbers of the estimator."""

    period: float = number(float)
    """Seconds between two calls."""
    position_gain: float = number(float)
    velocity_gain: float = number(float)
    """position_gain, velocity_gain: Parts of an error of a joint by which its position, and its
    speed times the period, are corrected."""
    threshold: float = number(float)
    """Normal force from which a contact point counts as standing, as a part of the weight."""
    up: Floats = array(2)
    """Direction along which feet stand on discs."""


class Memory(Shown):
    """What the estimator remembers: the estimate is what it shows."""

    calls: int = cell(int)
    floating: int = cell(int)
    """Whether the first coordinates are x, z and pitch of a trunk."""
    torque: Floats = array("nu")
    """Asked for at the last call."""
    standing: Integers = array("nc", of=int)
    """Whether each contact point stands."""
    anchor: Floats = array("nc", "axes")
    """Where it came to stand."""
    reaction: Reaction = part(Reaction)
    force: Floats = array("nv")
    passive: Floats = array("nv")
    point: Floats = array("nc", "axes")
    """reaction, force, passive, point: Scratch."""


class Log(Bundle):
    """What was estimated, as the controller saw it, in the run."""

    estimated_position: Floats = array(
        "nq", unit="m or rad", label="generalised positions as they were estimated"
    )
    estimated_velocity: Floats = array(
        "nv", unit="m/s or rad/s", label="generalised velocities as they were estimated"
    )


@kernel
def find_points(robot: ControlledRobot, parameters: Parameters, memory: Memory) -> None:
    """Find the lowest points of the contact discs of the estimate."""
    model, work = robot.model, memory.state.kinematics
    for i in range(robot.nc):
        at = memory.point[i]
        point_position(work, model.contact_link[i], model.contact_position[i], at)
        for k in range(2):
            at[k] -= model.contact_radius[i] * parameters.up[k]


@kernel
def hold_standing(robot: ControlledRobot, memory: Memory) -> None:
    """Hold the standing points and then the loops, at which nothing may tear either."""
    model, seen, held = robot.model, memory.state, robot.held
    held.count = 0
    for i in range(robot.nc):
        if memory.standing[i] == 1:
            link = model.contact_link[i]
            add_place(model, seen.kinematics, link, memory.point[i], 2, held)
    add_loops(model, seen.q, seen.v, seen.kinematics, held)


@kernel
def carry_trunk(standing: int, held: HeldRows, change: Floats) -> None:
    """Move the trunk along with corrected joints, so that the standing points stay in the mean.

    Their rows come first in `held`. The trunk is heavy: the least change of the velocities would
    rather undo the corrections.
    """
    x, z = 0.0, 0.0
    for point in range(standing):
        for j in range(change.shape[0]):
            x += held.rows[2 * point, j] * change[j]
            z += held.rows[2 * point + 1, j] * change[j]
    change[0] -= x / standing
    change[1] -= z / standing


@kernel
def note_standing(
    contacts: Contacts, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Look which points stand, and keep where they came to do so."""
    least = parameters.threshold * robot.mass * abs(robot.model.gravity[1])
    for i in range(memory.standing.shape[0]):
        stands = 1 if contacts.force[i, 0] > least else 0
        if stands == 1 and memory.standing[i] == 0:
            memory.anchor[i, 0], memory.anchor[i, 1] = memory.point[i, 0], memory.point[i, 1]
        memory.standing[i] = stands


@kernel
def predict(robot: ControlledRobot, parameters: Parameters, memory: Memory) -> None:
    """Move the estimate on by a period."""
    model, seen, step, reaction = robot.model, memory.state, parameters.period, memory.reaction
    hold_standing(robot, memory)
    solve_rows(robot.unactuated, robot.held)
    find_response(model, robot.held, seen.kinematics, reaction)
    bias_force(model, seen.kinematics, memory.force)
    passive_force(model, seen.q, seen.v, memory.passive)
    for j in range(robot.nv):
        memory.force[j] = memory.passive[j] - memory.force[j]
    for i in range(robot.nu):
        memory.force[model.actuator_joint[i]] += memory.torque[i]
    solve_factorized(model, reaction.factor, memory.force)
    for j in range(robot.nv):
        seen.v[j] += step * memory.force[j]
    change_least(robot.held, reaction, seen.v)
    integrate(model, seen.q, seen.v, step, seen.q)


@kernel
def correct(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Bring joints and pitch nearer to what was measured, standing points to their place."""
    seen, change = memory.state, memory.force
    for j in range(robot.nv):
        change[j] = 0.0
    position, speed = parameters.position_gain, parameters.velocity_gain / parameters.period
    for i in range(robot.nu):
        joint = robot.model.actuator_joint[i]
        error = state.q[joint] - seen.q[joint]
        seen.q[joint] += position * error
        change[joint] = speed * error
    pitch = PITCH if memory.floating == 1 else -1
    if pitch >= 0:
        error = state.q[pitch] - seen.q[pitch]
        seen.q[pitch] += position * error
        change[pitch] = speed * error
    follow_positions(robot, seen)
    robot.update(seen)
    find_points(robot, parameters, memory)
    x, z, count = 0.0, 0.0, 0
    for i in range(robot.nc):
        if memory.standing[i] == 1:
            x += memory.anchor[i, 0] - memory.point[i, 0]
            z += memory.anchor[i, 1] - memory.point[i, 1]
            count += 1
    if count > 0 and pitch >= 0:
        seen.q[0] += x / count
        seen.q[1] += z / count
        robot.update(seen)
        find_points(robot, parameters, memory)
    if count > 0 and pitch >= 0:
        hold_standing(robot, memory)
        carry_trunk(count, robot.held, change)
    for j in range(robot.nv):
        seen.v[j] += change[j]
    follow_speeds(robot, seen)
    hold_standing(robot, memory)
    if robot.held.count > 0:
        solve_rows(robot.unactuated, robot.held)
        find_response(robot.model, robot.held, seen.kinematics, memory.reaction)
        change_least(robot.held, memory.reaction, seen.v)
    robot.update(seen)


@kernel
def estimate(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,  # noqa: ARG001
    parameters: Parameters, memory: Memory, log: Log,
) -> None:  # fmt: skip
    """Show the controller inside the estimate, which begins with what is shown first."""
    seen, told = memory.state, memory.contacts
    if memory.calls == 0:
        copy(state.q, seen.q)
        copy(state.v, seen.v)
        robot.update(seen)
        find_points(robot, parameters, memory)
        note_standing(contacts, robot, parameters, memory)
    else:
        note_standing(contacts, robot, parameters, memory)
        predict(robot, parameters, memory)
        correct(state, robot, parameters, memory)
    memory.calls += 1
    copy(seen.q, log.estimated_position)
    copy(seen.v, log.estimated_velocity)
    copy_contacts(contacts, told)
    for i in range(robot.nc):
        copy(memory.point[i], told.position[i])


@kernel
def keep(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Parameters,  # noqa: ARG001
    memory: Memory, log: Log, torque: Floats,  # noqa: ARG001
) -> None:  # fmt: skip
    """Keep in mind which torques were asked for, as far as the robot's limits let them through."""
    lower, upper = robot.model.torque_lower, robot.model.torque_upper
    for i in range(torque.shape[0]):
        memory.torque[i] = min(max(torque[i], lower[i]), upper[i])


ESTIMATED = Wrapper("estimated", estimate, keep, Parameters, Memory, Log)


class Estimated(Around):
    """A controller that sees an estimate: any controller, compiled or in Python.

    The estimate is made of the positions of the actuated joints and of the trunk's pitch, and of
    which contact points carry force, as these are shown to it; of the robot's equations of motion;
    and of the torques asked for. Velocities that it is shown are not looked at. It stands between
    sensors and controller: ``Sensed(Estimated(law), encoders=...)``. The equations of motion are
    those of the robot that the controller knows, or of the one that is simulated; its first
    coordinates are x, z and pitch of the trunk, or it is fixed to the world.

    Parameters
    ----------
    controller : Controller
        What decides the torques.
    bandwidth : float
        Frequency (Hz) up to which measurements are followed: more follows errors of the model
        faster, and noise.
    threshold : float
        Normal force from which a contact point counts as standing, as a part of the weight; it
        does not slip then.
    period : float, optional
        Seconds between two calls; by default that of the controller, 1 ms at most.

    Raises
    ------
    ControllerError
        If a number cannot be; when it is simulated, if the robot's trunk has other coordinates.

    Notes
    -----
    The run's log holds ``estimated_position`` and ``estimated_velocity``. Behind switches, whose
    forces read 1 or 0, choose a threshold below ``1 / robot.weight``.
    """

    @takes(ControllerError)
    def __init__(
        self, controller: Controller, *, bandwidth: float = 8.0,
        threshold: float = 0.05, period: float | None = None,
    ) -> None:  # fmt: skip
        for name, value in (("bandwidth", bandwidth), ("threshold", threshold)):
            positive(f"the {name} of an estimator", value, ControllerError)
        period = own_period(ESTIMATED.name, controller, period)
        kept = math.exp(-2.0 * math.pi * bandwidth * period)
        own = Parameters(
            period=period, position_gain=1.0 - kept**2, velocity_gain=(1.0 - kept) ** 2,
            threshold=threshold, up=UP,
        )  # fmt: skip
        super().__init__(ESTIMATED, controller, own, period=period, extents={})
        if self.commands_voltage:
            raise ControllerError(
                f"controller {self.function.name!r} commands voltages, but the estimator "
                "needs torques to predict with: use a law that commands torques"
            )
        self.bandwidth = bandwidth

    def numbers(self, robot: Robot) -> tuple[Bundle, Bundle]:
        """Return parameters and memory, if the robot's trunk is one that is known."""
        upright = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
        if robot.floating and abs(robot.model.axis[:3]).tolist() != upright:
            raise ControllerError(
                f"robot {robot.name!r}: the estimator needs a trunk whose first coordinates are x, "
                f"z and pitch; they are {', '.join(robot.joint_names[:3])}"
            )
        parameters, memory = super().numbers(robot)
        begun: Any = memory
        begun.own.floating = int(robot.floating)
        return parameters, memory
