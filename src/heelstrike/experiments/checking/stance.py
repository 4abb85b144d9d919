"""Where the trunk is and which foot stands, of a motion that has joints alone.

A foot that stands lies flat on level ground and stays where it is; of two, the one that the other
is above.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from heelstrike.dynamics import contact_positions
from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.motion import RecordedMotion
from heelstrike.gait.sole import sole
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot

SPACING = 0.01
"""Time between two instants that are looked at, in s."""
TOUCHING = 1e-9
"""How far outside a phase (s) a sample is of it: rounding."""
FEWEST = 6
"""Samples that a phase has, to be looked at by itself."""
SHORTEST = 0.1
"""Shortest phase, in s: what is shorter is an exchange that has not ended."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A motion with its trunk."""

    time: Floats
    """(n,) In s."""
    q: Floats
    """(n, nq)"""
    v: Floats
    """(n, nv)"""
    acceleration: Floats
    """(n, nv) Positions, velocities and accelerations."""
    stance: Integers
    """(n,) Foot that stands."""
    clearance: Floats
    """(n,) Height of the lowest point of the other foot, in m; negative in the ground."""
    phases: tuple[tuple[int, int, int], ...]
    """Foot, first and last row of each phase."""


def placed(robot: Robot, motion: RecordedMotion) -> Placed:
    """Find the trunk of a motion, and which foot stands.

    Parameters
    ----------
    robot : Robot
        A robot on two flat feet whose joints are all driven.
    motion : RecordedMotion
        Its joints.

    Raises
    ------
    GaitError
        If the robot is no such one.
    """
    if not (robot.floating and len(robot.feet) == 2 and robot.nu == robot.nv - 3):
        raise GaitError(f"robot {robot.name!r}: a check needs two feet, and all joints driven")
    soles = [sole(robot, foot) for foot in (0, 1)]
    if not all(each.flat for each in soles):
        raise GaitError(
            f"robot {robot.name!r}: a check needs flat feet; on point feet the trunk does not "
            "follow from the joints"
        )
    count = max(int(motion.time[-1] / SPACING), 2) + 1
    time = np.linspace(0.0, float(motion.time[-1]), count)
    stance = _stance(robot, CubicSpline(motion.time, motion.position)(time), time)
    ends = [0, *(np.flatnonzero(np.diff(stance)) + 1).tolist(), count]
    q = np.zeros((count, robot.nq))
    v, acceleration = np.zeros((count, robot.nv)), np.zeros((count, robot.nv))
    clearance, phases, stands_at = np.zeros(count), [], 0.0
    for first, end in pairwise(ends):
        foot, rows = int(stance[first]), slice(first, end)
        joints = _within(motion, float(time[first]), float(time[end - 1]))(time[rows])
        places = np.array([_flat(robot, each, foot) for each in joints])
        q[rows, robot.model.actuator_joint] = joints
        q[rows, :3], clearance[rows] = places[:, :3], places[:, 3]
        if first:  # the foot comes to stand where it was as the other one stood
            other = _flat(robot, joints[0], 1 - foot)
            stands_at = _middle(robot, _with(q[first], other, stands_at), foot)
        q[rows, 0] += stands_at
        if end - first > 3:
            piece = CubicSpline(time[rows], q[rows])
            v[rows], acceleration[rows] = piece(time[rows], 1), piece(time[rows], 2)
        phases.append((foot, first, end - 1))
    return Placed(time, q, v, acceleration, stance, clearance, tuple(phases))


def _stance(robot: Robot, joints: Floats, time: Floats) -> Integers:
    """Which foot stands at each instant: the one that the other is above."""
    above = np.array([[_flat(robot, each, foot)[3] for foot in (0, 1)] for each in joints])
    return _smoothed((above[:, 1] > above[:, 0]).astype(np.int64), time)


def _within(motion: RecordedMotion, begin: float, end: float) -> CubicSpline:
    """Return the joints within a phase by its own samples: accelerations jump at its ends."""
    own = (motion.time >= begin - TOUCHING) & (motion.time <= end + TOUCHING)
    own = own if np.count_nonzero(own) >= FEWEST else np.ones(len(own), dtype=bool)
    return CubicSpline(motion.time[own], motion.position[own])


def _with(q: Floats, place: Sequence[float], stands_at: float) -> Floats:
    """Return a posture as the other foot stands, with its middle at a place."""
    found = q.copy()
    found[:3] = place[:3]
    found[0] += stands_at
    return found


def _middle(robot: Robot, q: Floats, foot: int) -> float:
    return float(contact_positions(robot, q)[list(robot.feet[foot].contacts), 0].mean())


def _flat(robot: Robot, joints: Floats, foot: int) -> list[float]:
    """Place of the trunk (x, z, pitch) with a foot flat on the ground, its middle at x = 0.

    And how high the other foot is then.
    """
    q = np.zeros(robot.nq)
    q[robot.model.actuator_joint] = joints
    contacts, others = (list(robot.feet[each].contacts) for each in (foot, 1 - foot))
    heel, toe = contact_positions(robot, q)[[contacts[0], contacts[-1]]]
    dx, dz = toe - heel
    q[2] = np.arctan2(dz, dx) * np.sign(robot.model.axis[2, 0])  # a positive pitch lowers the toe
    points = contact_positions(robot, q)
    radius = robot.model.contact_radius
    q[0] = -points[contacts, 0].mean()
    q[1] = -float((points[contacts, 1] - radius[contacts]).min())
    lowest = float((points[others, 1] - radius[others]).min())
    return [q[0], q[1], q[2], lowest + q[1]]


def _smoothed(stance: Integers, time: Floats) -> Integers:
    """Let phases that are too short be part of the one before; the first of that after it."""
    found = stance.copy()
    begin = 0
    for row in range(1, len(found) + 1):
        if row == len(found) or found[row] != found[begin]:
            if time[row - 1] - time[begin] < SHORTEST:
                found[begin:row] = found[begin - 1] if begin else found[min(row, len(found) - 1)]
            begin = row
    return found
