"""How a robot moves about a gait on one flat foot after the other, as its joints see it.

The stance foot lies flat and at rest, so that the trunk follows from the joints and every joint has
its motor: of joints' errors e = (δq, δq̇) at a time s since the last touchdown

    ė = A(s) e + B(s) δτ,    e⁺ = J e⁻.

Heel and toe meet the ground together on the gait. A disturbed foot's come down one after the other,
and the clock begins anew at the first: the robot goes on to there, suffers a plastic impact of one
point, turns about it until the other is down, and suffers another. To first order that is J, one
for either order; the regulator is for their mean.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag, expm
from scipy.signal import cont2discrete

from heelstrike import dynamics
from heelstrike.control.computed_torque import pitch_of
from heelstrike.control.gait_lqr.orbit import SMALL
from heelstrike.control.gait_lqr.transverse import PERIODS, SETTLED
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.held import HeldRobot
from heelstrike.errors import ControllerError
from heelstrike.gait.gait import Gait
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

STEPS = 64
"""Instants of a step at which the equations are found; between them they are interpolated."""

FINE, KEPT = 1024, 128
"""Intervals of a step in each of which gains stay, of the Riccati equation; places of a table."""


class FlatStance:
    """A robot whose stance foot is flat and at rest, by its joints alone.

    Parameters
    ----------
    robot : Robot
    foot : int
        The foot that stands.
    """

    def __init__(self, robot: Robot, foot: int) -> None:
        self.robot, self.foot = robot, robot.feet[foot]
        self.swing = robot.feet[1 - foot]
        self.driven = robot.model.actuator_joint
        self._pitch = pitch_of(robot)

    def position(self, joints: Floats) -> Floats:
        """Coordinates (nq,), the foot flat on z = 0."""
        q = self.robot.reference_state().q
        q[self.driven] = joints
        heel, toe = self._ends(q)
        tilt = np.arctan2(toe[1] - heel[1], toe[0] - heel[0])  # which a positive pitch makes less
        q[self._pitch] += self.robot.model.axis[self._pitch, 0] * tilt
        q[1] -= self._ends(q)[0][1]
        return q

    def _ends(self, q: Floats) -> tuple[Floats, Floats]:
        places = dynamics.contact_positions(self.robot, q)[list(self.foot.contacts)]
        at_rest = dynamics.contact_positions(self.robot, self.robot.reference_state().q)
        order = np.argsort(at_rest[list(self.foot.contacts), 0])
        return places[order[0]], places[order[-1]]

    def velocity(self, q: Floats, rates: Floats) -> Floats:
        """Velocities (nv,), the foot at rest."""
        v = np.zeros(self.robot.nv)
        v[self.driven] = rates
        return HeldRobot.on(Evaluation(self.robot, q), self.foot.contacts).velocity(v)

    def acceleration(self, joints: Floats, rates: Floats, torque: Floats) -> Floats:
        """Accelerations of the joints (nu,), under torques."""
        q = self.position(joints)
        v = self.velocity(q, rates)
        return self.rate(q, v, torque, self.foot.contacts)[self.driven]

    def stopped(self, q: Floats, v: Floats, points: Sequence[int]) -> Floats:
        """Velocities (nv,) just after a plastic impact of contact points."""
        return HeldRobot.on(Evaluation(self.robot, q), points).stopped(v)[0]

    def rate(self, q: Floats, v: Floats, torque: Floats, points: Sequence[int]) -> Floats:
        """Accelerations (nv,) while contact points stay in place."""
        robot = self.robot
        force = dynamics.applied_force(robot, q, v, torque) - dynamics.bias_force(robot, q, v)
        return HeldRobot.on(Evaluation(robot, q, v), points).accelerated(force)[0]

    def relabelled(self, q: Floats, v: Floats) -> Floats:
        """Joints (2 nu,) with legs exchanged."""
        mirror = self.robot.mirror
        assert mirror is not None  # see pitch_of
        return np.concatenate([mirror.position(q)[self.driven], mirror.velocity(v)[self.driven]])

    def after(self, state: Floats) -> Floats:
        """Joints (2 nu,) just after a plastic impact of the swing sole, legs exchanged."""
        nu = self.robot.nu
        q = self.position(state[:nu])
        v = self.velocity(q, state[nu:])
        return self.relabelled(q, self.stopped(q, v, self.swing.contacts))


class FlatOrbit:
    """A gait on flat feet, its torques and the linear equations of its errors.

    Parameters
    ----------
    robot : Robot
    gait : Gait

    Attributes
    ----------
    time : (STEPS + 1,) float
        Instants of a step (s).
    torque : (STEPS + 1, nu) float
        Of the gait (N m).
    """

    def __init__(self, robot: Robot, gait: Gait) -> None:
        self.stance, self.gait = FlatStance(robot, gait.stance_foot), gait
        self.time = np.linspace(0.0, gait.step_duration, STEPS + 1)
        self.torque = self.torques(self.time)

    def joints(self, s: float) -> tuple[Floats, Floats, Floats]:
        """Positions, velocities and accelerations of the joints."""
        position, velocity, acceleration = (self.gait.in_step(s, order=k) for k in range(3))
        return position, velocity, acceleration

    def torques(self, times: Floats) -> Floats:
        """Torques of the gait at times of a step, (times, nu)."""
        return np.array([self._torque(s) for s in times])

    def _torque(self, s: float) -> Floats:
        """Torques that make the accelerations, which they do in proportion."""
        stance, (q, v, wanted) = self.stance, self.joints(s)
        still = stance.acceleration(q, v, np.zeros(stance.robot.nu))
        return np.asarray(np.linalg.solve(self._response(q, v), wanted - still))

    def _response(self, q: Floats, v: Floats) -> Floats:
        """Accelerations of the joints by torques, (nu, nu)."""
        nu = self.stance.robot.nu
        still = self.stance.acceleration(q, v, np.zeros(nu))
        each = [self.stance.acceleration(q, v, one) - still for one in np.eye(nu)]
        return np.array(each).T

    def regulator(self, cost: Floats, effort: Floats, count: int | None = None) -> Floats:
        """Gains (intervals, nu, 2 nu) of the least cost for ever.

        Those of torques that follow at once, in the middles of `FINE` even intervals; or, of
        `count` intervals over each of which torques are held, at their beginnings.
        """
        number, nx = FINE if count is None else count, len(cost)
        both, width = block_diag(cost, effort), self.gait.step_duration / number
        moves = [
            (*_held(A, B, width), width * both) if count is None else _sampled(A, B, both, width)
            for A, B in self.between(number)
        ]
        value, before = np.zeros_like(cost), np.inf
        gains = np.zeros((number, len(effort), nx))
        for _ in range(PERIODS):
            value = self.jump.T @ value @ self.jump
            for k in range(number - 1, -1, -1):
                A, B, price = moves[k]
                answered = B.T @ value @ A + price[nx:, :nx]
                gains[k] = np.linalg.solve(price[nx:, nx:] + B.T @ value @ B, answered)
                left, chosen = A - B @ gains[k], np.vstack([np.eye(nx), -gains[k]])
                value = chosen.T @ price @ chosen + left.T @ value @ left
            size = np.abs(value).max()
            if not np.isfinite(size):
                break
            if abs(size - before) <= SETTLED * size:
                return gains
            before = size
        raise ControllerError("no regulator makes this walk repeat: its motors do not reach enough")

    def over_a_step(self, gains: Floats, *, held: bool = False) -> Floats:
        """What a step makes of errors under gains (intervals, nu, 2 nu), to before its impact.

        The torques follow at once, or are held over each interval.
        """
        width = self.gait.step_duration / len(gains)
        moved = np.eye(len(self.jump))
        for (A, B), gain in zip(self.between(len(gains)), gains, strict=True):
            if held:
                grown, pushed = _held(A, B, width)
                moved = (grown - pushed @ gain) @ moved
            else:
                moved = expm(width * (A - B @ gain)) @ moved
        return moved

    def between(self, count: int) -> list[tuple[Floats, Floats]]:
        """A and B in the middles of even intervals."""
        middles = (np.arange(count) + 0.5) * self.gait.step_duration / count
        A, B = (
            CubicSpline(self.time, np.array(each))(middles)
            for each in zip(*self.linear, strict=True)
        )
        return list(zip(A, B, strict=True))

    @cached_property
    def linear(self) -> list[tuple[Floats, Floats]]:
        """A and B at the instants."""
        nu = self.stance.robot.nu
        found = []
        for s, torque in zip(self.time, self.torque, strict=True):
            q, v, _ = self.joints(s)

            def rate(x: Floats, torque: Floats = torque) -> Floats:
                return self.stance.acceleration(x[:nu], x[nu:], torque)

            below = _slope(rate, np.concatenate([q, v]))
            above = np.hstack([np.zeros((nu, nu)), np.eye(nu)])
            pushes = np.vstack([np.zeros((nu, nu)), self._response(q, v)])
            found.append((np.vstack([above, below]), pushes))
        return found

    @cached_property
    def jump(self) -> Floats:
        """Errors after a touchdown of those before: the mean of those of either order."""
        return np.asarray(np.mean(self.jumps, axis=0))

    @cached_property
    def jumps(self) -> tuple[Floats, Floats]:
        """The same where one end of the sole comes down first, and where the other does."""
        points = self.stance.swing.contacts
        return self._jump(points[0]), self._jump(points[-1])

    def _jump(self, first: int) -> Floats:
        """Errors after a touchdown of which one point comes down first, and begins the step."""
        stance, nu = self.stance, self.stance.robot.nu
        points = stance.swing.contacts
        (second,) = {points[0], points[-1]} - {first}
        q, v, _ = self.joints(self.gait.step_duration)
        begin = self.joints(0.0)
        mirror = stance.robot.mirror
        assert mirror is not None  # see pitch_of
        driven = mirror.among(stance.driven)
        torque = driven.sign * self.torque[0][driven.joint]

        def falls(at: Floats, rate: Floats, point: int) -> float:
            """Time until a point is down, to first order."""
            height = dynamics.contact_positions(stance.robot, at)[point, 1]
            return float(-height / (dynamics.contact_jacobian(stance.robot, at)[point, 0] @ rate))

        def through(state: Floats) -> Floats:
            at = stance.position(state[:nu])
            rate = stance.velocity(at, state[nu:])
            until = falls(at, rate, first)
            hurry = stance.rate(at, rate, self.torque[-1], stance.foot.contacts)
            at, rate = at + until * rate, rate + until * hurry
            rate = stance.stopped(at, rate, (first,))
            until = falls(at, rate, second)
            hurry = stance.rate(at, rate, torque, (first,))
            at, rate = at + until * rate, rate + until * hurry
            rate = stance.stopped(at, rate, points)
            passed = np.concatenate([begin[1], begin[2]])
            return stance.relabelled(at, rate) - until * passed

        return _slope(through, np.concatenate([q, v]))

    @property
    def misses(self) -> float:
        """How far the impact leads from the beginning of the gait (rad, rad/s)."""
        q, v, _ = self.joints(self.gait.step_duration)
        begin = np.concatenate(self.joints(0.0)[:2])
        return float(np.abs(self.stance.after(np.concatenate([q, v])) - begin).max())


def _held(A: Floats, B: Floats, width: float) -> tuple[Floats, Floats]:
    """What an interval makes of errors, and of torques that are held over it."""
    return cont2discrete((A, B, A, 0.0 * B), width)[:2]


def _sampled(A: Floats, B: Floats, price: Floats, width: float) -> tuple[Floats, Floats, Floats]:
    """The same, and what errors at its beginning and torques cost until its end.

    All three are blocks of one exponential (C. F. Van Loan 1978, *Computing integrals involving the
    matrix exponential*, IEEE Transactions on Automatic Control 23(3)).
    """
    (nx, nu), size = B.shape, len(price)
    still = np.vstack([np.hstack([A, B]), np.zeros((nu, size))])
    found = expm(width * np.block([[-still.T, price], [np.zeros((size, size)), still]]))
    grown = found[size:, size:]
    return grown[:nx, :nx], grown[:nx, nx:], grown.T @ found[:size, size:]


def _slope(function: Callable[[Floats], Floats], x: Floats) -> Floats:
    """Derivative by central differences, (m, n)."""
    columns = [
        (function(x + SMALL * one) - function(x - SMALL * one)) / (2.0 * SMALL)
        for one in np.eye(len(x))
    ]
    return np.array(columns).T
