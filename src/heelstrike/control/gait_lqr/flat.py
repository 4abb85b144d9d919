"""How a robot moves about a gait on one flat foot after the other, as its joints see it.

The stance foot lies flat and at rest, so that the trunk follows from the joints and every joint has
its motor: of joints' errors e = (δq, δq̇) at a time s since the last touchdown

    ė = A(s) e + B(s) δτ,    e⁺ = J e⁻.

Heel and toe meet the ground together on the gait. A disturbed foot's come down one after the other,
and the clock starts again at the first, which is a section therefore: the robot goes on to there,
suffers a plastic impact of one point, turns about it until the other is down, and suffers another,
with a saltation matrix of its own. Their product is J, one for either order; the regulator is for
their mean.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from heelstrike import dynamics
from heelstrike.contact import (
    ActiveContacts,
    PhaseLinearization,
    linearize_contact,
)
from heelstrike.contact.linearized.slopes import both, contact_slopes, exchanged, following
from heelstrike.contact.linearized.strikes import strikes
from heelstrike.control.computed_torque import pitch_of
from heelstrike.control.gait_lqr.riccati import over_all_steps, swept_back
from heelstrike.control.gait_lqr.table import in_the_middles
from heelstrike.control.zero_order_hold import over_an_interval, under_gains
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.held import HeldRobot
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
        self.rows = both(robot, self.driven)
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

    def state(self, joints: Floats, rates: Floats) -> tuple[Floats, Floats]:
        """Coordinates (nq,) and velocities (nv,), the foot at rest."""
        q, v = self.position(joints), np.zeros(self.robot.nv)
        v[self.driven] = rates
        return q, HeldRobot.on(Evaluation(self.robot, q), self.foot.contacts).velocity(v)

    def errors(self, joints: Floats, rates: Floats) -> Floats:
        """Errors of all coordinates by those of the joints, (nq + nv, 2 nu)."""
        contacts = self.foot.contacts
        return following(self.robot, *self.state(joints, rates), contacts, self.driven)

    def held(self, torque: Floats, joints: Floats, rates: Floats) -> PhaseLinearization:
        """The equations of motion about a state, under torques."""
        sole = ActiveContacts(resting=tuple(self.foot.contacts))
        return linearize_contact(self.robot, *self.state(joints, rates), torque, sole)

    def after(self, joints: Floats, rates: Floats) -> Floats:
        """Joints (2 nu,) just after a plastic impact of the swing sole, legs exchanged."""
        mirror = self.robot.mirror
        assert mirror is not None  # see pitch_of
        q, v = self.state(joints, rates)
        stopped, _ = HeldRobot.on(Evaluation(self.robot, q), self.swing.contacts).stopped(v)
        return np.concatenate([mirror.position(q), mirror.velocity(stopped)])[self.rows]


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
        q, v, wanted = self.joints(s)
        still = self.stance.held(np.zeros(self.stance.robot.nu), q, v)
        speeds = self.stance.robot.nq + self.stance.driven
        return np.asarray(np.linalg.solve(still.B[speeds], wanted - still.rate[speeds]))

    def regulator(self, cost: Floats, effort: Floats, count: int | None = None) -> Floats:
        """Gains (intervals, nu, 2 nu) of the least cost forever.

        Those of torques that follow at once, in the middles of `FINE` even intervals; or, of
        `count` intervals over each of which torques are held, at their beginnings.
        """
        from scipy.linalg import block_diag

        number = FINE if count is None else count
        both, width = block_diag(cost, effort), self.gait.step_duration / number
        moves, prices = [], []
        for A, B in self.between(number):
            if count is None:
                moves.append(over_an_interval(A, B, width))
                prices.append(width * both)
            else:
                *move, price = _sampled(A, B, both, width)
                moves.append((move[0], move[1]))
                prices.append(price)
        return over_all_steps(self.jump, lambda value: swept_back(moves, prices, value))

    def over_a_step(self, gains: Floats, *, held: bool = False) -> Floats:
        """What a step makes of errors under gains (intervals, nu, 2 nu), to before its impact.

        The torques follow at once, or are held over each interval.
        """
        width = self.gait.step_duration / len(gains)
        moved = np.eye(len(self.jump))
        for (A, B), gain in zip(self.between(len(gains)), gains, strict=True):
            if held:
                grown, pushed = over_an_interval(A, B, width)
                moved = (grown - pushed @ gain) @ moved
            else:
                moved = under_gains(A, B, gain, width) @ moved
        return moved

    def between(self, count: int) -> list[tuple[Floats, Floats]]:
        """A and B in the middles of even intervals."""
        A, B = (
            in_the_middles(self.time, np.array(each), count)
            for each in zip(*self.linear, strict=True)
        )
        return list(zip(A, B, strict=True))

    @cached_property
    def linear(self) -> list[tuple[Floats, Floats]]:
        """A and B at the instants."""
        return [self._about(s, torque) for s, torque in zip(self.time, self.torque, strict=True)]

    def _about(self, s: float, torque: Floats) -> tuple[Floats, Floats]:
        stance, (joints, rates, _) = self.stance, self.joints(s)
        linear = stance.held(torque, joints, rates)
        return linear.A[stance.rows] @ stance.errors(joints, rates), linear.B[stance.rows]

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
        stance, robot = self.stance, self.stance.robot
        points = stance.swing.contacts
        (second,) = {points[0], points[-1]} - {first}
        joints, rates, _ = self.joints(self.gait.step_duration)
        q, v = stance.state(joints, rates)
        assert robot.mirror is not None  # see pitch_of
        driven = robot.mirror.among(stance.driven)
        gap = contact_slopes(robot, q, v).gap
        one, other = strikes(
            robot, q, v, stance.held(self.torque[-1], joints, rates).rate,
            driven.sign * self.torque[0][driven.joint],
            [
                (gap[first], ActiveContacts(resting=(first,))),
                (gap[second], ActiveContacts(resting=tuple(points))),
            ],
        )  # fmt: skip
        landed = other.saltation() @ one.section @ stance.errors(joints, rates)
        return exchanged(robot, landed)[stance.rows]

    @property
    def misses(self) -> float:
        """How far the impact leads from the beginning of the gait (rad, rad/s)."""
        q, v, _ = self.joints(self.gait.step_duration)
        begin = np.concatenate(self.joints(0.0)[:2])
        return float(np.abs(self.stance.after(q, v) - begin).max())


def _sampled(A: Floats, B: Floats, price: Floats, width: float) -> tuple[Floats, Floats, Floats]:
    """The same, and what errors at its beginning and torques cost until its end.

    All three are blocks of one exponential (C. F. Van Loan 1978, *Computing integrals involving the
    matrix exponential*, IEEE Transactions on Automatic Control 23(3)).
    """
    from scipy.linalg import expm

    (nx, nu), size = B.shape, len(price)
    still = np.vstack([np.hstack([A, B]), np.zeros((nu, size))])
    found = expm(width * np.block([[-still.T, price], [np.zeros((size, size)), still]]))
    grown = found[size:, size:]
    return grown[:nx, :nx], grown[:nx, nx:], grown.T @ found[:size, size:]
