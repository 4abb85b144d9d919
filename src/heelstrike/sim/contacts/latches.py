"""Latches: joint stops that hold what has reached them, until they let go.

A latch engages when its joint is stopped at its end of the range. From then on the force of that
stop may pull as well as press: the set of its impulses is the line and no longer the half-line.
It lets go when a certain link touches down, or when somebody says so, and is a stop like others
then. What a latch does follows from the events of the run, under every method.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.sets import LINE
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.record.record import Told
from heelstrike.sim.record.recording import JOINT_STOP, TOUCHDOWN, log_event

JOINT_RELEASE = int(EventKind.JOINT_RELEASE)

AT_THE_END = 1e-6
"""A joint is at an end of its range within this (rad, m), and at rest below this (rad/s, m/s)."""


@dissolved_kernel
def react(model: Model, first: int, q: Floats, told: Told, held: Integers) -> None:
    """Let latches engage and let go by the events of a run, from the `first` on.

    A leg whose foot comes down while its knee is stopped may be told both at once: letting go is
    what comes last.
    """
    if held.shape[0] > 0 and told.events > first:
        engage(model, first, q, told, held)
        let_go(model, first, told, held)


@kernel
def engage(model: Model, first: int, q: Floats, told: Told, held: Integers) -> None:
    """Engage the latches of joints that have been stopped at their end."""
    for event in range(first, told.events):
        if told.event_kind[event] != JOINT_STOP:
            continue
        for latch in range(held.shape[0]):
            joint = model.latch_joint[latch]
            above = abs(model.upper[joint] - q[joint]) < abs(q[joint] - model.lower[joint])
            if told.event_contact[event] == joint and above == (model.latch_side[latch] > 0):
                held[latch] = 1


@kernel
def let_go(model: Model, first: int, told: Told, held: Integers) -> None:
    """Let go the latches whose link has touched down."""
    for event in range(first, told.events):
        if told.event_kind[event] != TOUCHDOWN:
            continue
        link = model.contact_link[told.event_contact[event]]
        for latch in range(held.shape[0]):
            if held[latch] == 1 and model.latch_release[latch] == link:
                held[latch] = 0
                time = told.event_time[event]
                log_event(time, JOINT_RELEASE, model.latch_joint[latch], 0.0, 0.0, told)


@dissolved_kernel
def hold(count: int, stop: Integers, held: Integers, candidate: Integers, sets: Integers) -> int:
    """Let the stops of engaged latches hold, where they are among the first `count` candidates.

    `stop` tells the candidate that each latch is, `held` whether it is engaged, `candidate` and
    `sets` who they are and where their impulses lie. Returns an engaged latch whose stop is not
    among them, or -1.
    """
    missing = -1
    for latch in range(held.shape[0]):
        if held[latch] == 1:
            found = False
            for place in range(count):
                if candidate[place] == stop[latch]:
                    sets[place] = LINE
                    found = True
            if not found:
                missing = latch
    return missing


def latches_of(robot: Robot, latched: Iterable[str | int]) -> list[int]:
    """Return which joints are named, all of which have a latch.

    Raises
    ------
    SimulationError
        If a joint has none.
    """
    return joints_with(robot, "latch", robot.latch_names, several("latched", latched))


def joints_with(
    robot: Robot, part: str, having: tuple[str, ...], joints: Iterable[str | int]
) -> list[int]:
    """Return the indices of joints, or refuse one that is not among those having a part."""
    chosen = [robot.joint_index(joint) for joint in joints]
    for joint in chosen:
        if robot.joint_names[joint] not in having:
            raise SimulationError(
                f"joint {robot.joint_names[joint]!r} of robot {robot.name!r} has no {part}; "
                f"{', '.join(having) or 'no joint'} has"
            )
    return chosen


def latches_at(
    robot: Robot, state: State, ground: Ground, latched: Iterable[str | int] | None
) -> tuple[bool, ...]:
    """Tell which latches are engaged in a state.

    Parameters
    ----------
    robot : Robot
    state : State
    ground : Ground
    latched : iterable of str or int, or None
        Joints that are held. If nobody says, those at rest at their end, unless the link whose
        touchdown lets go stands on the ground.

    Raises
    ------
    SimulationError
        If a joint has no latch, or is not at the end where its latch would hold it.
    """
    model = robot.model
    if latched is None and not model.latches:
        return ()
    end = np.where(model.latch_side > 0, model.upper[model.latch_joint], 0.0)
    end = np.where(model.latch_side < 0, model.lower[model.latch_joint], end)
    there = np.abs(state.q[model.latch_joint] - end) <= AT_THE_END
    if latched is None:
        rests = there & (np.abs(state.v[model.latch_joint]) <= AT_THE_END)
        if not rests.any():
            return (False,) * len(rests)
        at = contact_kinematics(robot, state.q, state.v, ground)
        stands = (np.abs(at.gap) <= AT_THE_END) & (np.abs(at.velocity[:, 0]) <= AT_THE_END)
        standing = model.contact_link[stands]
        return tuple((rests & ~np.isin(model.latch_release, standing)).tolist())
    chosen = latches_of(robot, latched)
    for joint in chosen:
        of_joint = model.latch_joint == joint
        if not np.any(of_joint & there):
            raise SimulationError(
                f"the latch of joint {robot.joint_names[joint]!r} holds it at "
                f"{end[of_joint][0]:.6g}, where it is not: it is at {state.q[joint]:.6g}"
            )
    return tuple((np.isin(model.latch_joint, chosen) & there).tolist())


def is_one(joints: Any) -> bool:
    """Whether it is a joint by itself, rather than several: arrays have an ``__index__``, too."""
    return isinstance(joints, str) or (hasattr(joints, "__index__") and np.ndim(joints) == 0)


def several(name: str, joints: Any) -> Iterable[Any]:
    """Return joints of which one may be given by itself.

    Raises
    ------
    SimulationError
        If they are none; `name` is what is asked for.
    """
    if is_one(joints):
        return (joints,)
    if not isinstance(joints, Iterable):
        raise SimulationError(f"{name} must be names of joints, got {joints!r}")
    return joints
