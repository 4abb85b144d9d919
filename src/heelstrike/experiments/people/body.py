"""A person as a planar human, and how all coordinates moved."""

from __future__ import annotations

from collections.abc import Mapping

from heelstrike.errors import GaitError
from heelstrike.experiments.people.splines import Splines
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.motion import RecordedMotion
from heelstrike.gait.recordings.table import Table
from heelstrike.gait.recordings.units import ANGLES, UNITS
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

JOINTS = ("hip", "knee", "ankle")
"""Joints of a leg of a person, from above."""


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """How a planar human moved, smooth in time."""

    robot: Robot
    """The human, scaled to the person."""
    time: Floats
    """(n,) In s, from 0 on."""
    q: Floats
    """(n, nq)"""
    v: Floats
    """(n, nv)"""
    acceleration: Floats
    """(n, nv) Positions, velocities and accelerations (m, rad, s)."""
    sides: tuple[str, ...]
    """Legs that were recorded: right, left or both; the other rests at zero."""
    residual: Mapping[str, float]
    """Root mean square distance of every marker from its place on the human, in m; empty where
    joints were recorded."""
    begin: float = 0.0
    """When the recording begins, as its file counts time, in s."""

    def joint(self, name: str) -> Floats:
        """Return the positions of a joint, (n,), in rad.

        Parameters
        ----------
        name : str
            The joint.
        """
        return self.q[:, self.robot.joint_names.index(name)]


def body_of_joints(robot: Robot, motion: RecordedMotion, pitch: Floats | None) -> BodyMotion:
    """Return the motion of a human whose joints were recorded, smooth in time.

    Parameters
    ----------
    robot : Robot
        The human.
    motion : RecordedMotion
        Its joints.
    pitch : (n,) array, optional
        Pitch of the trunk (rad); upright if it was not recorded.
    """
    splines = Splines(motion.time)
    coefficients = splines.fitted(motion.position)
    found = []
    for order in range(3):
        whole = robot.reference_state().q * (order == 0) + 0.0 * motion.time[:, None]
        whole[:, robot.model.actuator_joint] = splines.values(coefficients, order)
        if pitch is not None:
            whole[:, 2] = splines.values(splines.fitted(pitch[:, None]), order)[:, 0]
        found.append(whole)
    q, v, acceleration = found
    return BodyMotion(robot, motion.time, q, v, acceleration, ("right", "left"), {})


def pitch_in(table: Table, unit: str = "") -> Floats | None:
    """Return the pitch of the trunk (rad) that a table holds, if it does.

    Parameters
    ----------
    table : Table
        The table.
    unit : str
        Of the pitch, where its column names none; rad by default.

    Raises
    ------
    GaitError
        If it is in no unit of angles, or a number is missing.
    """
    column = table.column("root_pitch")
    if column < 0:
        return None
    unit = table.units[column] or unit or "rad"
    if unit not in ANGLES:
        raise GaitError(f"{table.path}: root_pitch is in {unit}; an angle is wanted")
    pitch: Floats = table.whole(["root_pitch"])[:, 0] * UNITS[unit]
    return pitch
