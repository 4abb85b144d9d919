"""A step whose feet and centre of mass are given, and all joints of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import Polynomial

from heelstrike.dynamics import (
    center_of_mass,
    center_of_mass_bias_acceleration,
    center_of_mass_jacobian,
    inverse_kinematics,
    link_poses,
    point_bias_acceleration,
    point_jacobian,
    point_position,
)
from heelstrike.errors import InfeasibleGaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.cart_table.center_of_mass import Motion
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import Sole, sole

PERIOD = 5e-3
"""Time between two samples of the plan (s), as in the paper; a step has a whole number of them."""
NEWTON, LEFT = 30, 1e-12
"""Steps of Newton's method to a posture at most, and what may be left of its error (m, rad)."""
LONGEST = 0.5
"""Largest change of a coordinate in one of them (m, rad)."""
ACROSS = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
"""From 0 to 1, at rest at both ends: how the swing foot moves along the ground."""
HUMP = 64.0 * Polynomial([0.0, 0.0, 0.0, 1.0, -3.0, 3.0, -1.0])
"""64 s³ (1 − s)³, at rest at both ends and 1 half-way: how high it is."""


@dataclass(frozen=True, eq=False)
class Step:
    """What a step is to be: where the feet are, and when."""

    robot: Robot
    """The robot."""
    length: float
    """Distance between the feet (m)."""
    duration: float
    """Duration of the step (s)."""
    both: float
    """Duration of double support, with which it begins (s)."""
    clearance: float
    """Height of the swing foot half-way (m)."""

    @property
    def samples(self) -> Floats:
        """Times of the plan (s), (n + 1,)."""
        return np.linspace(0.0, self.duration, round(self.duration / PERIOD) + 1)

    def wanted(self, times: Floats) -> Floats:
        """Zero moment point (m) from the middle of the front foot, at times of the step."""
        return np.interp(times, [0.0, self.both, self.duration], [-self.length, 0.0, 0.0])

    def swing(self, t: float) -> Floats:
        """Place (x, z) of the foot that swings, with two derivatives, (3, 2)."""
        single = self.duration - self.both
        s = np.clip((t - self.both) / single, 0.0, 1.0)
        place = np.array([[ACROSS.deriv(n)(s), HUMP.deriv(n)(s)] for n in range(3)])
        place = place * [2.0 * self.length, self.clearance] / single ** np.arange(3)[:, None]
        place[0, 0] -= self.length
        return place


@dataclass(frozen=True, eq=False)
class Planned:
    """A step with the motion of its centre of mass."""

    step: Step
    """The step."""
    height: float
    """Height of the centre of mass (m)."""
    center: Motion
    """Its motion along the ground."""

    def coordinates(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Positions, velocities and accelerations of all coordinates, (N, nv) each.

        Raises
        ------
        InfeasibleGaitError
            If the legs do not reach.
        """
        step, robot = self.step, self.step.robot
        soles = [sole(robot, foot) for foot in robot.feet]
        along = self.center(times)
        q = self._first(soles, float(along[0, 0]))
        found = []
        for k, t in enumerate(times.tolist()):
            swing = step.swing(t)
            target = np.zeros((3, 9))
            target[:, 3:5] = swing
            target[:, 7] = along[:, k]
            target[0, 8] = self.height
            q = self._posture(q, soles, target[0])
            jacobian = _jacobian(robot, q, soles)
            v = np.linalg.solve(jacobian, target[1])
            a = np.linalg.solve(jacobian, target[2] - _bias(robot, q, v, soles))
            found.append((q, v, a))
        positions, velocities, accelerations = map(np.array, zip(*found, strict=True))
        return positions, velocities, accelerations

    def _first(self, soles: Sequence[Sole], ahead: float) -> Floats:
        """Posture from which to begin: the trunk over the centre of mass, the feet in places."""
        robot = self.step.robot
        q = robot.reference_state().q.copy()
        center = center_of_mass(robot, q)
        q[:2] += [ahead - center[0], self.height - center[1] - lowest(robot, q, soles)]
        for foot, x in enumerate((0.0, -self.step.length)):
            q = inverse_kinematics(robot, q, foot, (x, 0.0, 0.0)).q
        return q

    def _posture(self, q: Floats, soles: Sequence[Sole], target: Floats) -> Floats:
        robot = self.step.robot
        for _ in range(NEWTON):
            missing = target - _places(robot, q, soles)
            if np.abs(missing).max() < LEFT:
                return q
            change = np.linalg.solve(_jacobian(robot, q, soles), missing)
            q = q + change / max(1.0, 2.0 * np.abs(change).max())
        raise InfeasibleGaitError(
            f"the legs of robot {robot.name!r} do not reach with the centre of mass at "
            f"{self.height:.3g} m: {np.abs(missing).max():.2g} m are missing."
        )


def lowest(robot: Robot, q: Floats, soles: Sequence[Sole]) -> float:
    """Height of the lowest heel (m)."""
    return min(float(point_position(robot, q, each.foot.link, each.ends[0])[1]) for each in soles)


def _places(robot: Robot, q: Floats, soles: Sequence[Sole]) -> Floats:
    """Middles of soles (x, z) and their angles, pitch of the trunk, centre of mass, (9,)."""
    angle, feet = link_poses(robot, q).angle, []
    for each in soles:
        link, (x, z) = each.foot.link, each.ends[1] - each.ends[0]
        feet += [*point_position(robot, q, link, each.ends.mean(axis=0)),
                 angle[link] - np.arctan2(z, x)]  # fmt: skip
    return np.array([*feet, angle[2], *center_of_mass(robot, q)])


def _jacobian(robot: Robot, q: Floats, soles: Sequence[Sole]) -> Floats:
    """How fast these move, by the velocities, (9, nv)."""
    feet = [point_jacobian(robot, q, each.foot.link, each.ends.mean(axis=0)) for each in soles]
    trunk = point_jacobian(robot, q, 2, (0.0, 0.0))[2]
    return np.vstack([*feet, trunk, center_of_mass_jacobian(robot, q)])


def _bias(robot: Robot, q: Floats, v: Floats, soles: Sequence[Sole]) -> Floats:
    """Their accelerations where the coordinates have none, (9,)."""
    feet = [
        point_bias_acceleration(robot, q, v, each.foot.link, each.ends.mean(axis=0))
        for each in soles
    ]
    return np.concatenate([*feet, [0.0], center_of_mass_bias_acceleration(robot, q, v)])
