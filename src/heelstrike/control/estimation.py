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

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle, array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.around import Around, Shell, Shown, own_period
from heelstrike.dynamics.dense import solve_positive
from heelstrike.dynamics.kernels import (
    bias_force,
    factorize,
    integrate,
    mass_matrix,
    passive_force,
    point_position,
    solve_factorized,
)
from heelstrike.dynamics.loops import find_rows as find_loop_rows
from heelstrike.dynamics.places import write_point_rows
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.tied import follow_positions, follow_speeds

# Two points of a flat foot hold three coordinates by four equations: their matrix is singular, and
# gets this part of its trace added. Velocities hardly depend on it.
SOFTNESS = 1e-9
UP = np.array([0.0, 1.0])
# Coordinate of a floating trunk's pitch.
PITCH = 2


class Parameters(Bundle):
    """Numbers of the estimator.

    Attributes
    ----------
    period : float
        Seconds between two calls.
    position_gain, velocity_gain : float
        Parts of an error of a joint by which its position, and its speed times the period, are
        corrected.
    threshold : float
        Normal force from which a contact point counts as standing, as a part of the weight.
    up : (2,) float
        Direction along which feet stand on discs.
    """

    period: float = number(float)
    position_gain: float = number(float)
    velocity_gain: float = number(float)
    threshold: float = number(float)
    up: Floats = array(2)


class Memory(Shown):
    """What the estimator remembers: the estimate is what it shows.

    Attributes
    ----------
    calls : int
    floating : int
        Whether the first coordinates are x, z and pitch of a trunk.
    torque : (nu,) float
        Asked for at the last call.
    standing : (nc,) int
        Whether each contact point stands.
    anchor : (nc, 2) float
        Where it came to stand.
    matrix, factor, force, passive, point, rows, columns, small, right
        Scratch.
    """

    calls: int = cell(int)
    floating: int = cell(int)
    torque: Floats = array("nu")
    standing: Integers = array("nc", of=int)
    anchor: Floats = array("nc", "axes")
    matrix: Floats = array("nv", "nv")
    factor: Floats = array("nv", "nv")
    force: Floats = array("nv")
    passive: Floats = array("nv")
    point: Floats = array("nc", "axes")
    rows: Floats = array("held", "nv")
    columns: Floats = array("held", "nv")
    small: Floats = array("held", "held")
    right: Floats = array("held")


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
def find_rows(robot: ControlledRobot, parameters: Parameters, memory: Memory) -> int:
    """Write what a change of velocity takes that stops the standing points; return its rows.

    After these come the rows of closed loops and couplings, at which nothing may tear either.
    """
    model, work, count = robot.model, memory.state.kinematics, 0
    mass_matrix(model, work, memory.matrix)
    factorize(model, memory.matrix, memory.factor)
    for i in range(robot.nc):
        if memory.standing[i] == 1:
            link, at = model.contact_link[i], memory.point[i]
            write_point_rows(model, work, link, at, parameters.up, count, memory.rows)
            count += 2
    if robot.loops.bias.shape[0] > 0:
        find_loop_rows(model, memory.state.q, memory.state.v, work, robot.loops)
    for row in range(robot.loops.bias.shape[0]):
        for j in range(robot.nv):
            memory.rows[count, j] = robot.loops.jacobian[row, j]
        count += 1
    for row in range(count):
        for j in range(robot.nv):
            memory.columns[row, j] = memory.rows[row, j]
        solve_factorized(model, memory.factor, memory.columns[row])
    return count


@kernel
def stop_standing(robot: ControlledRobot, count: int, memory: Memory, v: Floats) -> None:
    """Give the velocities the least change that leaves the standing points at rest."""
    trace = 0.0
    for row in range(count):
        memory.right[row] = 0.0
        for j in range(robot.nv):
            memory.right[row] += memory.rows[row, j] * v[j]
        for other in range(count):
            entry = 0.0
            for j in range(robot.nv):
                entry += memory.rows[row, j] * memory.columns[other, j]
            memory.small[row, other] = entry
        trace += memory.small[row, row]
    for row in range(count):
        memory.small[row, row] += SOFTNESS * trace
    solve_positive(count, memory.small, memory.right)
    for row in range(count):
        for j in range(robot.nv):
            v[j] -= memory.right[row] * memory.columns[row, j]


@kernel
def carry_trunk(robot: ControlledRobot, count: int, memory: Memory, change: Floats) -> None:
    """Move the trunk along with corrected joints, so that the standing points stay in the mean.

    The trunk is heavy: the least change of the velocities would rather undo the corrections.
    """
    z, x = 0.0, 0.0
    for row in range(0, count, 2):
        for j in range(robot.nv):
            z += memory.rows[row, j] * change[j]
            x += memory.rows[row + 1, j] * change[j]
    change[0] -= 2.0 * x / count
    change[1] -= 2.0 * z / count


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
    model, seen, step = robot.model, memory.state, parameters.period
    count = find_rows(robot, parameters, memory)
    bias_force(model, seen.kinematics, memory.force)
    passive_force(model, seen.q, seen.v, memory.passive)
    for j in range(robot.nv):
        memory.force[j] = memory.passive[j] - memory.force[j]
    for i in range(robot.nu):
        memory.force[model.actuator_joint[i]] += memory.torque[i]
    solve_factorized(model, memory.factor, memory.force)
    for j in range(robot.nv):
        seen.v[j] += step * memory.force[j]
    if count > 0:
        stop_standing(robot, count, memory, seen.v)
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
    rows = find_rows(robot, parameters, memory)
    if count > 0 and pitch >= 0:
        carry_trunk(robot, 2 * count, memory, change)
    for j in range(robot.nv):
        seen.v[j] += change[j]
    if robot.loops.bias.shape[0] > 0:
        follow_speeds(robot, seen, 0)
    if rows > 0:
        stop_standing(robot, rows, memory, seen.v)
    robot.update(seen)


@kernel
def estimate(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,  # noqa: ARG001
    parameters: Parameters, memory: Memory, log: Log,
) -> None:  # fmt: skip
    """Show the controller inside the estimate, which begins with what is shown first."""
    seen, told = memory.state, memory.contacts
    if memory.calls == 0:
        for j in range(robot.nq):
            seen.q[j] = state.q[j]
        for j in range(robot.nv):
            seen.v[j] = state.v[j]
        robot.update(seen)
        find_points(robot, parameters, memory)
        note_standing(contacts, robot, parameters, memory)
    else:
        note_standing(contacts, robot, parameters, memory)
        predict(robot, parameters, memory)
        correct(state, robot, parameters, memory)
    memory.calls += 1
    for j in range(robot.nq):
        log.estimated_position[j] = seen.q[j]
    for j in range(robot.nv):
        log.estimated_velocity[j] = seen.v[j]
    for i in range(robot.nc):
        told.gap[i] = contacts.gap[i]
        for k in range(2):
            told.position[i, k] = memory.point[i, k]
            told.normal[i, k] = contacts.normal[i, k]
            told.force[i, k] = contacts.force[i, k]


@kernel
def keep(
    t: float, state: ControlState, robot: ControlledRobot, parameters: Parameters,  # noqa: ARG001
    memory: Memory, log: Log, torque: Floats,  # noqa: ARG001
) -> None:  # fmt: skip
    """Keep in mind which torques were asked for, as far as the robot's limits let them through."""
    lower, upper = robot.model.torque_lower, robot.model.torque_upper
    for i in range(torque.shape[0]):
        memory.torque[i] = min(max(torque[i], lower[i]), upper[i])


ESTIMATED = Shell("estimated", estimate, keep, Parameters, Memory, Log)


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
            if not (math.isfinite(value) and value > 0.0):
                raise ControllerError(f"the {name} of an estimator must be positive, got {value!r}")
        period = own_period(ESTIMATED.name, controller, period)
        kept = math.exp(-2.0 * math.pi * bandwidth * period)
        own = Parameters(
            period=period, position_gain=1.0 - kept**2, velocity_gain=(1.0 - kept) ** 2,
            threshold=threshold, up=UP,
        )  # fmt: skip
        super().__init__(ESTIMATED, controller, own, period=period, extents={})
        if self.commands_voltage:
            raise ControllerError(
                f"controller {self.function.name!r} commands voltages: the estimator predicts by "
                "the torques that are asked for, and cannot tell those"
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
