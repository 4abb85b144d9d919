"""How a robot moves about a motion of any phases, as all its coordinates see it.

While the contacts of a phase hold, errors e = (δq, δv) at a time s since its beginning obey

    ė = A(s) e + B(s) δτ.

A touchdown that ends a phase starts the clock of the next, and is a section therefore: errors
are those at the touchdown, whenever that is. Several points that come down together on the motion
come down one after the other if it is disturbed, each with a saltation matrix of its own; for the
regulator the mean of all orders is taken. Where time ends a phase errors stay what they are.

Errors keep to what the contacts allow: they obey J̇ e's equations with the robot, and each impact
takes away what does not rest on the ground after it. So no coordinates need to be left out, but for
one: how far the robot has come along the ground means nothing, and costs nothing.
"""

from __future__ import annotations

from functools import cached_property
from itertools import permutations

import numpy as np

from heelstrike.contact import ActiveContacts, Ground, linearize_contact
from heelstrike.contact.linearized.slopes import contact_slopes, exchanged
from heelstrike.contact.linearized.strikes import strikes
from heelstrike.control.followed_motion import (
    SLOWLY,
    arrival_speeds,
    mirrored_phase,
    points_of_phase,
)
from heelstrike.control.gait_lqr.riccati import over_all_steps, swept_back
from heelstrike.control.gait_lqr.table import in_the_middles
from heelstrike.control.zero_order_hold import over_an_interval, under_gains
from heelstrike.dynamics import contact_jacobian, inverse_dynamics, passive_force
from heelstrike.errors import ControllerError
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.request import Repeat
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

INSTANTS = 24
"""Intervals of a phase at whose ends the equations are found; between they are interpolated."""
WIDTH, FEWEST = 1e-3, 16
"""Longest interval (s) in which gains stay, for the Riccati equation, and how many a phase has at
the least."""
TOGETHER = 3
"""Contact points that may come down in one instant, in any order."""


class PhasedOrbit:
    """A motion, its torques and the linear equations of its errors.

    Parameters
    ----------
    robot : Robot
    motion : Motion
    """

    def __init__(self, robot: Robot, motion: Motion) -> None:
        self.robot, self.motion = robot, motion
        self.ground = Ground(friction=motion.friction, slope=motion.slope)
        self.along = np.array([np.cos(motion.slope), np.sin(motion.slope)])
        self.stands = [sorted(points_of_phase(robot, phase)) for phase in motion.phases]

    def torques(self, p: int, times: Floats) -> Floats:
        """Torques of the motion at times of a phase, (times, nu)."""
        phase, robot = self.motion.phases[p], self.robot
        moved = [phase.coordinates(times, order=order) for order in range(3)]
        ahead, up = self.along, np.array([-self.along[1], self.along[0]])
        found = []
        for q, v, a, force in zip(*moved, phase.forces(times), strict=True):
            needed = inverse_dynamics(robot, q, v, a) - passive_force(robot, q, v)
            pushed = force @ np.array([up, ahead])  # (x, z) of each point
            for rows, push in zip(contact_jacobian(robot, q), pushed, strict=True):
                needed -= rows.T @ push[::-1]
            found.append(needed[robot.model.actuator_joint])
        return np.array(found)

    @cached_property
    def times(self) -> list[Floats]:
        """Instants of each phase (s)."""
        return [np.linspace(0.0, each.duration, INSTANTS + 1) for each in self.motion.phases]

    @cached_property
    def linear(self) -> list[tuple[Floats, Floats]]:
        """A and B at the instants of each phase, (instants, …) each."""
        found = []
        for p, times in enumerate(self.times):
            held = ActiveContacts(resting=tuple(self.stands[p]))
            phase, torques = self.motion.phases[p], self.torques(p, times)
            places, speeds = (phase.coordinates(times, order=order) for order in range(2))
            each = [
                linearize_contact(self.robot, *state, held, ground=self.ground)
                for state in zip(places, speeds, torques, strict=True)
            ]
            found.append((np.array([one.A for one in each]), np.array([one.B for one in each])))
        return found

    def intervals(self, p: int) -> int:
        """How many intervals a phase has in which gains stay."""
        return max(FEWEST, int(np.ceil(self.motion.phases[p].duration / WIDTH)))

    def between(self, p: int) -> list[tuple[Floats, Floats]]:
        """A and B in the middles of even intervals of a phase."""
        A, B = (in_the_middles(self.times[p], each, self.intervals(p)) for each in self.linear[p])
        return list(zip(A, B, strict=True))

    @cached_property
    def jumps(self) -> list[Floats]:
        """What becomes of errors where each phase ends, the last one's seen in the mirror.

        After the last phase of a motion that never repeats there is none.
        """
        phases = self.motion.phases
        torques = [self.torques(p, np.zeros(1))[0] for p in range(len(phases))]
        found = [self._jump(p, phases[p + 1], torques[p + 1]) for p in range(len(phases) - 1)]
        if self.motion.repeat is Repeat.NEVER:
            return found
        first, start = phases[0], torques[0]
        if self.motion.repeat is Repeat.MIRRORED:
            assert self.robot.mirror is not None
            first = mirrored_phase(self.robot, self.motion, first)
            driven = self.robot.mirror.among(self.robot.model.actuator_joint)
            start = driven.sign * start[driven.joint]
        last = self._jump(len(phases) - 1, first, start)
        if self.motion.repeat is Repeat.MIRRORED:
            last = exchanged(self.robot, last)
        return [*found, last]

    def _jump(self, p: int, following: MotionPhase, torque: Floats) -> Floats:
        """Errors just after a phase by those just before: the mean of all orders of touchdowns."""
        robot, phase = self.robot, self.motion.phases[p]
        stood, stands = set(self.stands[p]), points_of_phase(robot, following)
        fresh = sorted(stands - stood)
        if not fresh:
            return np.eye(robot.nq + robot.nv)
        self._check_touchdown(p, fresh)
        q, v = (phase.coordinates(phase.duration, order=order) for order in range(2))
        held = ActiveContacts(resting=tuple(self.stands[p]))
        before = self.torques(p, np.array([phase.duration]))[0]
        rate = linearize_contact(robot, q, v, before, held, ground=self.ground).rate
        gap = contact_slopes(robot, q, v, self.ground).gap
        found = []
        for order in permutations(fresh):
            down = sorted(stands & stood)
            several = []
            for point in order:
                down = sorted([*down, point])
                several.append((gap[point], ActiveContacts(resting=tuple(down))))
            struck = strikes(robot, q, v, rate, torque, several, ground=self.ground)
            if struck:
                jump = struck[0].section
                for strike in struck[1:]:
                    jump = strike.saltation() @ jump
                found.append(jump)
        if not found:
            names = ", ".join(robot.contact_names[i] for i in fresh)
            raise ControllerError(
                f"{names} come down together at the end of phase {p + 1}, and whichever is down "
                "first throws the others up: errors have no derivative there. Let them come down "
                "in phases one after the other"
            )
        return np.asarray(np.mean(found, axis=0))

    def _check_touchdown(self, p: int, fresh: list[int]) -> None:
        """Refuse touchdowns at which errors have no derivative: they decide when it happens."""
        speeds = arrival_speeds(self.robot, self.motion.slope, self.motion.phases[p])
        slowest = min(fresh, key=lambda i: float(speeds[i]))
        if speeds[slowest] < SLOWLY:
            raise ControllerError(
                f"{self.robot.contact_names[slowest]!r} comes down at {speeds[slowest]:.2g} m/s at "
                f"the end of phase {p + 1}: of what comes down slowly small errors decide when. "
                "Design the motion by hs.optimize_motion(..., landing_speed=0.1), or follow it "
                "with hs.ComputedTorque"
            )
        if len(fresh) > TOGETHER:
            raise ControllerError(
                f"{len(fresh)} contact points come down at once at the end of phase {p + 1}; a "
                f"regulator knows what becomes of {TOGETHER} at the most"
            )

    def regulator(self, position: Floats, velocity: Floats, effort: Floats) -> list[Floats]:
        """Gains (intervals, nu, 2 nv) in the middles of even intervals of each phase.

        Parameters
        ----------
        position, velocity : (nv,) float
            What errors cost. Of where the trunk is only how far it is from the ground counts.
        effort : (nu,) float
            What torques cost.
        """
        robot = self.robot
        cost = np.diag(np.concatenate([position, velocity, effort]))
        up = np.array([-self.along[1], self.along[0]])
        cost[:2, :2] = position[1] * np.outer(up, up)
        moves, prices = [], []
        for p, phase in enumerate(self.motion.phases):
            width = phase.duration / self.intervals(p)
            moves.append([over_an_interval(A, B, width) for A, B in self.between(p)])
            prices.append([width * cost] * len(moves[-1]))

        def sweep(value: Floats) -> tuple[Floats, list[Floats]]:
            gains: list[Floats] = []
            for p in reversed(range(len(moves))):
                value, found = swept_back(moves[p], prices[p], value)
                gains.insert(0, found)
                if p:
                    value = self.jumps[p - 1].T @ value @ self.jumps[p - 1]
            return value, gains

        if self.motion.repeat is Repeat.NEVER:
            return sweep(cost[: 2 * robot.nv, : 2 * robot.nv])[1]
        return over_all_steps(self.jumps[-1], sweep)

    def over_a_cycle(self, gains: list[Floats]) -> Floats:
        """What the motion, its last touchdown included, makes of errors under gains."""
        moved = np.eye(2 * self.robot.nv)
        for p, phase in enumerate(self.motion.phases):
            width = phase.duration / self.intervals(p)
            for (A, B), gain in zip(self.between(p), gains[p], strict=True):
                moved = under_gains(A, B, gain, width) @ moved
            moved = self.jumps[p] @ moved
        return moved

    def across(self, cycle: Floats) -> Floats:
        """The same of errors that differ in more than how far along the ground the robot is."""
        unit = np.zeros(2 * self.robot.nv)
        unit[:2] = self.along
        basis = np.linalg.svd(unit[None, :])[2][1:].T
        return np.asarray(basis.T @ cycle @ basis)
