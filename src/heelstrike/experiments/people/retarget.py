"""Directions of a person's segments as joints of a robot, in times and lengths of its size."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.dynamics import contact_positions, link_poses
from heelstrike.dynamics.inverse_kinematics import leg_joints
from heelstrike.errors import GaitError
from heelstrike.experiments.people.stride import Stride
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A stride of a person on a robot."""

    robot: Robot
    """The robot."""
    stride: Stride
    """The stride of the person."""
    duration: float
    """Duration of a stride of the robot (s): as the square root of the lengths of legs."""
    length: float
    """Length of a stride of the robot (m): as the lengths of legs."""
    legs: tuple[tuple[int, ...], ...]
    """Joints of the right and the left leg, from the hip down."""
    upright: Floats
    """(nq,) Positions of the robot with upright trunk, straight legs and flat feet."""

    def position(self, time: Any, lib: Any = np) -> list[Any]:
        """Return the person's pitch and joints as coordinates of the robot, (nq - 2,).

        Parameters
        ----------
        time : number or expression
            Time since the right foot came down (s).
        lib : module
            What has cos and sin: numpy, or casadi for an expression.
        """
        turned = self._turned(time, lib, 0)
        return [float(begin) + each for begin, each in zip(self.upright[2:], turned, strict=True)]

    def acceleration(self, time: Any, lib: Any = np) -> list[Any]:
        """Return the second derivatives of :meth:`position` (rad/s²), (nq - 2,).

        Parameters
        ----------
        time : number or expression
            Time since the right foot came down (s).
        lib : module
            What has cos and sin: numpy, or casadi for an expression.
        """
        return [each / self.duration**2 for each in self._turned(time, lib, 2)]

    def _turned(self, time: Any, lib: Any, order: int) -> list[Any]:
        """Pitch and joints from upright on, or a derivative by the phase."""
        phase, sense = time / self.duration, self.robot.model.axis[:, 0]
        turned: list[Any] = [0.0] * len(self.upright)
        for leg, shift in zip(self.legs, (0.0, 0.5), strict=True):
            before, *segments = self.stride.directions(phase + shift, lib, order=order)
            turned[2] = float(sense[2]) * before
            for joint, segment in zip(leg, segments, strict=False):
                turned[joint] = float(sense[joint]) * (segment - before)
                before = segment
        return turned[2:]

    def whole(self, time: float) -> Floats:
        """Return all coordinates at a time (nq,), the lowest contact point on level ground."""
        q = self.upright.copy()
        q[2:] = self.position(time)
        q[1] = 0.0
        q[1] = -float((contact_positions(self.robot, q)[:, 1]).min())
        q[0] = self.length / self.duration * time
        return q


def retargeted(stride: Stride, robot: Robot) -> Retargeted:
    """Put a stride of a person on a robot: the same directions of segments, in its time.

    Parameters
    ----------
    stride : Stride
        The stride.
    robot : Robot
        A floating robot on two legs of hip, knee and ankle, all driven, nothing else.

    Raises
    ------
    GaitError
        If it is no such robot.
    """
    model = robot.model
    legs = leg_joints(robot) if robot.floating and len(robot.feet) == 2 else ()
    whole = sorted(joint for leg in legs for joint in leg)
    if [len(leg) for leg in legs] != [3, 3] or whole != list(range(3, robot.nq)):
        raise GaitError(
            f"robot {robot.name!r} cannot follow a person: it needs two legs of hip, knee "
            "and ankle, all driven, on a trunk that floats"
        )
    if not np.all(np.abs(model.axis[whole, 0]) == 1.0):
        raise GaitError(f"robot {robot.name!r} cannot follow a person: it has a sliding joint")
    left = ["left" in foot.name for foot in robot.feet]
    if left == [True, False]:
        legs = legs[::-1]
    upright = _upright(robot, legs)
    heights = contact_positions(robot, upright)[:, 1] - model.contact_radius
    hip = link_poses(robot, upright).origin[legs[0][0], 1]
    ratio = float(hip - heights.min()) / stride.leg
    return Retargeted(
        robot, stride, stride.duration * float(np.sqrt(ratio)), stride.length * ratio,
        tuple(legs), upright,
    )  # fmt: skip


def _upright(robot: Robot, legs: tuple[tuple[int, ...], ...]) -> Floats:
    """Positions with straight legs: hip, knee and ankle above each other, and flat feet."""
    q = robot.reference_state().q.copy()
    for leg in legs:
        foot = next(each for each in robot.feet if each.link == leg[-1])
        for joint, end in ((leg[0], leg[1]), (leg[1], leg[2])):
            origin = link_poses(robot, q).origin
            along = origin[end] - origin[joint]
            q[joint] -= robot.model.axis[joint, 0] * np.arctan2(-along[0], -along[1])
        places = contact_positions(robot, q)
        heel, toe = places[foot.contacts[0]], places[foot.contacts[-1]]
        if len(foot.contacts) > 1:
            tilt = -np.arctan2(toe[1] - heel[1], toe[0] - heel[0])
            q[leg[-1]] -= robot.model.axis[leg[-1], 0] * tilt
    return q
