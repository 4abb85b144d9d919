"""What the motors make of commands: torques within their limits and on their speed-torque line.

A motor of direct current under the voltage U, with torque constant K and winding resistance R, has
at the speed Ω the current I = (U - K Ω) / R and the torque K I. Behind a reduction N the joint
moves at ω = Ω / N and feels τ = N K I. Let V be the full voltage of the supply. At the joint,
``stall_torque`` is τ₀ = N K V / R, ``no_load_speed`` is ω₀ = V / (N K), and under the voltage u V

    τ = τ₀ u - D ω,    D = τ₀ / ω₀ = (N K)² / R.

So the motor is a damper D by itself; the time that its current takes to build up is left out. The
supply gives |u| ≤ 1, and whatever the motor is asked for,

    -τ₀ - D ω ≤ τ ≤ τ₀ - D ω.

A command is either the voltage u, or a torque that the drive follows as far as this line lets it.
Between the two stand the robot's own limits of the torque. The line has the last word: beyond the
no-load speed no drive keeps a motor from braking. R is in D; by itself it only tells the volts,
V² = R τ₀ ω₀, and the amperes, I² = τ² ω₀ / (τ₀ R). Under a constant u a joint with the viscous
damping d, and nothing else, comes to the speed ω = τ₀ u / (D + d).

While a command is held, ω changes. So commands and torques are two arrays, and torques are found
again of the velocity at which they act: at the beginning of a time step, at every stage of an
integration, before an impact.
"""

from __future__ import annotations

from typing import Any

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.memory import Tally

INFINITY = float("inf")


@dissolved_kernel
def within(lower: float, upper: float, value: float) -> float:
    """Return the nearest number in an interval."""
    if value > upper:
        return upper
    return lower if value < lower else value


@dissolved_kernel
def possible_command(model: Any, actuator: int, voltage: int, command: float) -> float:
    """Return the nearest command, torque or voltage, that is one at any speed."""
    if voltage == 1:
        return within(-1.0, 1.0, command)
    return within(model.torque_lower[actuator], model.torque_upper[actuator], command)


@dissolved_kernel
def free_torque(model: Any, joint: int, voltage: int, command: float, v: Floats) -> float:
    """Return what a possible command comes to at the velocities `v` if nothing limits it."""
    stall = model.stall_torque[joint]
    if voltage == 0:
        return command
    return float(stall * command - stall / model.no_load_speed[joint] * v[joint])


@dissolved_kernel
def torque_at(
    model: Any, actuator: int, joint: int, voltage: int, command: float, v: Floats
) -> float:
    """Return what acts at a joint of a possible command at the velocities `v`."""
    stall = model.stall_torque[joint]
    if stall == INFINITY:
        return command
    torque = free_torque(model, joint, voltage, command, v)
    if voltage == 1:
        torque = within(model.torque_lower[actuator], model.torque_upper[actuator], torque)
    drag = stall / model.no_load_speed[joint] * v[joint]
    return within(-stall - drag, stall - drag, torque)


@dissolved_kernel
def motor_torque(model: Model, actuator: int, voltage: int, command: float, v: Floats) -> float:
    """Return what acts of a possible command at the velocities `v`."""
    return torque_at(model, actuator, model.actuator_joint[actuator], voltage, command, v)


@kernel
def motor_damping(model: Model, actuator: int, voltage: int, command: float, v: Floats) -> float:
    """Return how fast the torque of a held command falls with the speed of its joint."""
    joint = model.actuator_joint[actuator]
    stall = model.stall_torque[joint]
    torque = motor_torque(model, actuator, voltage, command, v)
    follows = voltage == 0 and torque == command
    limited = torque in (model.torque_lower[actuator], model.torque_upper[actuator])
    return 0.0 if stall == INFINITY or follows or limited else stall / model.no_load_speed[joint]


@dissolved_kernel
def is_obeyed(model: Any, actuator: int, joint: int, voltage: int, command: float) -> bool:
    """Whether a command is a torque within its limits, and that of a motor without a line."""
    return bool(
        voltage == 0
        and abs(command) < INFINITY
        and model.torque_lower[actuator] <= command <= model.torque_upper[actuator]
        and model.stall_torque[joint] == INFINITY
    )


@dissolved_kernel
def are_obeyed(model: Any, voltage: int, commands: Floats) -> bool:
    """Whether all commands are torques within their limits, and no joint has a motor with a line.

    Asked without a branch, since it is so as a rule.
    """
    beyond, nothing, stall = -INFINITY, 0.0, INFINITY
    for i in range(commands.shape[0]):
        command = commands[i]
        beyond = max(beyond, model.torque_lower[i] - command, command - model.torque_upper[i])
        nothing += 0.0 * command  # or no number, if it is not finite
    for joint in range(model.stall_torque.shape[0]):
        stall = min(stall, model.stall_torque[joint])
    return voltage == 0 and beyond <= 0.0 and nothing == 0.0 and stall == INFINITY


@dissolved_kernel
def limit_torques(
    model: Any, driven: Integers, voltage: int, v: Floats, tally: Any, commands: Floats,
    torques: Floats,
) -> bool:  # fmt: skip
    """Find the torques of an instant from its commands; return whether all of these were finite.

    `driven` has the place in `v` of what each actuator drives, in the plane or in space.
    """
    if are_obeyed(model, voltage, commands):
        for i in range(torques.shape[0]):
            torques[i] = commands[i]
        return True
    for i in range(driven.shape[0]):
        wanted = commands[i]
        if is_obeyed(model, i, driven[i], voltage, wanted):
            torques[i] = wanted
            continue
        if not abs(wanted) < INFINITY:
            tally.bad_torque = i
            return False
        command = possible_command(model, i, voltage, wanted)
        torque = torque_at(model, i, driven[i], voltage, command, v)
        if command != wanted or torque != free_torque(model, driven[i], voltage, command, v):
            tally.saturations += 1
        commands[i] = command
        torques[i] = torque
    return True


@dissolved_kernel
def limit_torque(
    model: Model, voltage: int, v: Floats, tally: Tally, commands: Floats, torques: Floats
) -> bool:
    """Find the torques of an instant from its commands; return whether all of these were finite."""
    return limit_torques(model, model.actuator_joint, voltage, v, tally, commands, torques)


@kernel
def try_torque(
    model: Model, voltage: int, q: Floats, v: Floats, tally: Tally, command: Floats, torque: Floats
) -> None:
    """Find the torques of commands within a step, at a state that may be no good.

    Keeps in mind which command was not finite when there was one last at a state that was.
    """
    bad = 0
    for i in range(torque.shape[0]):
        if is_obeyed(model, i, model.actuator_joint[i], voltage, command[i]):
            torque[i] = command[i]
        elif not abs(command[i]) < INFINITY:
            bad = i + 1
            torque[i] = command[i]
        else:
            command[i] = possible_command(model, i, voltage, command[i])
            torque[i] = motor_torque(model, i, voltage, command[i], v)
    for i in range(v.shape[0]):
        if not (abs(q[i]) < INFINITY and abs(v[i]) < INFINITY):
            return
    tally.bad_trial = bad
