"""Brakes: joints that are held wherever they are, while a command says so.

An engaged brake is one more row of the loops (:mod:`heelstrike.sim.contacts.loops`): its force, a
torque of the joint, may be anything, and what it keeps at zero is the joint's motion. It takes hold
at the instant at which it is put on, of a joint that moves by an impact of all that touches.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.latches import several
from heelstrike.sim.contacts.loops import HOLDS, OFF, PUT_ON, TAKES_HOLD
from heelstrike.sim.memory import Loops
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import log_event

JOINT_BRAKE = int(EventKind.JOINT_BRAKE)


@kernel
def awaits_hold(loops: Loops) -> bool:
    """Whether a brake has been put on and does not hold yet."""
    found = False
    for brake in range(loops.braked.shape[0]):
        found = found or loops.braked[brake] == PUT_ON
    return found


@kernel
def take_hold(loops: Loops) -> bool:
    """Let the brakes hold that have been put on; return whether any takes hold."""
    found = False
    for brake in range(loops.braked.shape[0]):
        if loops.braked[brake] == PUT_ON:
            loops.braked[brake] = TAKES_HOLD
        found = found or loops.braked[brake] == TAKES_HOLD
    return found


@kernel
def note_brakes(model: Model, time: float, span: float, record: Record, loops: Loops) -> None:
    """Tell of the brakes that take hold, with their impulses over a span of time."""
    for brake in range(loops.braked.shape[0]):
        if loops.braked[brake] == TAKES_HOLD:
            loops.braked[brake] = HOLDS
            impulse = span * loops.brake_force[brake]
            log_event(time, JOINT_BRAKE, model.brake_joint[brake], impulse, 0.0, record)


def brakes_of(robot: Robot, joints: Iterable[str | int] | str | int) -> tuple[bool, ...]:
    """Tell which brakes of a robot are those of some joints.

    Raises
    ------
    SimulationError
        If a joint has no brake.
    """
    chosen = [robot.joint_index(joint) for joint in several(joints)]
    for joint in chosen:
        if joint not in robot.model.brake_joint:
            raise SimulationError(
                f"joint {robot.joint_names[joint]!r} of robot {robot.name!r} has no brake; "
                f"{', '.join(robot.brake_names) or 'no joint'} has"
            )
    return tuple(np.isin(robot.model.brake_joint, chosen).tolist())


def put_on(robot: Robot, wanted: Sequence[bool], state: State, how: int, loops: Loops) -> None:
    """Put some brakes on where their joints are, and let the others go; what is on stays.

    As a simulation begins, velocities are made to fit loops and brakes (`how` is ``HOLDS``); later
    that is an impact (``PUT_ON``).
    """
    for brake, joint in enumerate(robot.model.brake_joint):
        if not wanted[brake]:
            loops.braked[brake] = OFF
            loops.brake_force[brake] = 0.0
        elif loops.braked[brake] == OFF:
            loops.braked[brake] = how
            loops.brake_position[brake] = state.q[joint]


def braked_joints(robot: Robot, braked: Integers) -> tuple[str, ...]:
    """Return the names of the joints whose brakes are on."""
    return tuple(name for name, one in zip(robot.brake_names, braked, strict=True) if one != OFF)
