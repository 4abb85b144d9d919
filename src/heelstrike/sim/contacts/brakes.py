"""Brakes: joints that are held wherever they are, while a command says so.

A brake that does not slip is one more row of the loops (:mod:`heelstrike.sim.contacts.loops`)
while it is on: its force, a torque of the joint, may be anything, and what it keeps at zero is the
joint's motion. It takes hold at the instant at which it is put on, of a joint that moves by an
impact of all that touches.

One that slips is dry friction of its joint (:mod:`heelstrike.sim.contacts.dry_friction`): while it
is on it adds what it holds at most to that of the joint itself. What there is of both is shared in
the ratio of what there may be.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.latches import joints_with, several
from heelstrike.sim.contacts.loops import (
    BEGINS_TO_RUB,
    HOLDS,
    OFF,
    PUT_ON,
    RUBS,
    TAKES_HOLD,
    find_loops,
)
from heelstrike.sim.contacts.rows import DRY_JOINT
from heelstrike.sim.memory import Loops, Memory
from heelstrike.sim.record.record import Told
from heelstrike.sim.record.recording import log_event

JOINT_BRAKE = int(EventKind.JOINT_BRAKE)


@kernel
def awaits_hold(braked: Integers) -> bool:
    """Whether a brake has been put on and does not hold yet."""
    found = False
    for brake in range(braked.shape[0]):
        found = found or braked[brake] == PUT_ON
    return found


@kernel
def take_hold(model: Model, braked: Integers) -> bool:
    """Let the brakes hold that have been put on; return whether any takes hold without slipping."""
    found = False
    for brake in range(braked.shape[0]):
        if braked[brake] == PUT_ON:
            slips = model.brake_limit[brake] < np.inf
            braked[brake] = BEGINS_TO_RUB if slips else TAKES_HOLD
        found = found or braked[brake] == TAKES_HOLD
    return found


@kernel
def find_loops_of_step(model: Model, q: Floats, v: Floats, tree: Workspace, loops: Loops) -> None:
    """Find the rows of loops and brakes.

    Where brakes take hold the velocity that J̇ v is of ends: brakes that stop a loop twice over
    could not meet it.
    """
    stops = take_hold(model, loops.braked)
    find_loops(model, q, v, tree, loops)
    for row in range(loops.rows.bias.shape[0] if stops else 0):
        loops.rows.bias[row] = 0.0


@kernel
def stops_any(model: Model, v: Floats, rest: float, braked: Integers) -> bool:
    """Whether any of the brakes that take hold stops a joint that is faster than `rest`."""
    found = False
    for brake in range(braked.shape[0]):
        moves = abs(v[model.brake_joint[brake]]) > rest
        found = found or (braked[brake] == TAKES_HOLD and moves)
    return found


@kernel
def note_brakes(
    model: Model, time: float, span: float, force: Floats, told: Told, braked: Integers
) -> None:
    """Tell of the brakes that take hold, with the impulses of their forces over a span of time.

    One that slips gives none in an instant.
    """
    for brake in range(braked.shape[0]):
        if braked[brake] == TAKES_HOLD:
            braked[brake] = HOLDS
            impulse = span * force[brake]
            log_event(time, JOINT_BRAKE, model.brake_joint[brake], impulse, 0.0, told)
        elif braked[brake] == BEGINS_TO_RUB:
            braked[brake] = RUBS
            log_event(time, JOINT_BRAKE, model.brake_joint[brake], 0.0, 0.0, told)


@dissolved_kernel
def share_friction(
    model: Model, breakaway: Floats, friction_torque: Floats, brake_torque: Floats
) -> None:
    """Tell the torques of brakes that slip from the dry friction that their joints have anyway."""
    for brake in range(brake_torque.shape[0]):
        joint = model.brake_joint[brake]
        if model.brake_limit[brake] < np.inf:
            brake_torque[brake] = 0.0
            if breakaway[joint] > 0.0:
                part = 1.0 - model.dry_friction[joint] / breakaway[joint]
                brake_torque[brake] = part * friction_torque[joint]
                friction_torque[joint] -= brake_torque[brake]


def brakes_of(robot: Robot, joints: Iterable[str | int] | str | int) -> tuple[bool, ...]:
    """Tell which brakes of a robot are those of some joints.

    Raises
    ------
    SimulationError
        If a joint has no brake.
    """
    chosen = joints_with(robot, "brake", robot.brake_names, several("braked", joints))
    return tuple(joint in chosen for joint in robot.model.brake_joint.tolist())


def put_on(robot: Robot, wanted: Sequence[bool], state: State, how: int, memory: Memory) -> None:
    """Put some brakes on where their joints are, and let the others go; what is on stays.

    As a simulation begins, velocities are made to fit loops and brakes (`how` is ``HOLDS``); later
    that is an impact (``PUT_ON``).
    """
    model, loops = robot.model, memory.loops
    if not len(model.brake_joint):
        return
    for brake, joint in enumerate(model.brake_joint):
        slips = model.brake_limit[brake] < np.inf
        if not wanted[brake]:
            loops.braked[brake] = OFF
            loops.brake_force[brake] = 0.0
        elif loops.braked[brake] == OFF:
            loops.braked[brake] = RUBS if slips and how == HOLDS else how
            loops.brake_position[brake] = state.q[joint]
        if slips:
            added = model.brake_limit[brake] if wanted[brake] else 0.0
            memory.breakaway[joint] = model.dry_friction[joint] + added
            if memory.breakaway[joint] == 0.0:
                memory.reaction.friction_torque[joint] = 0.0
    dry = slice(memory.rows.first[DRY_JOINT], memory.rows.end[DRY_JOINT])
    rubbing = memory.breakaway[memory.rows.owner[dry]] > 0.0
    memory.reported.resting[dry][~rubbing] = -1  # as one that begins at rest, or in motion


def brakes_on(loops: Loops) -> tuple[bool, ...]:
    """Tell which brakes are on."""
    return tuple((loops.braked != OFF).tolist())


def braked_joints(robot: Robot, braked: Integers) -> tuple[str, ...]:
    """Return the names of the joints whose brakes are on."""
    return tuple(name for name, one in zip(robot.brake_names, braked, strict=True) if one != OFF)
