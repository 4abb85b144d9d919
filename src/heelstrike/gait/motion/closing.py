"""How nearly a motion, integrated, comes to the state in which it goes on.

Computed torque follows the motion from its first state; contact points that stand and loops are
held by whatever forces it takes, and landings are plastic impacts. Of the motion only its joint
accelerations are used, and forces where they are not determined: all else follows from the
equations of motion, integrated far more finely than the motion was designed.

It is a statement of closing alone. Joints are pulled back to the motion on the way, and neither
torques nor states within a phase are compared: a design that breaks the equations of motion between
the ends of its pieces may close all the same.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any

import casadi
import numpy as np

from heelstrike.dynamics.dense import solve_to_rank
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols
from heelstrike.gait.motion.instant import point_rows
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.phases import standing
from heelstrike.gait.motion.request import Repeat
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

PROPORTIONAL, DERIVATIVE = 400.0, 40.0
"""Gains of computed torque (1/s², 1/s). Without feedback a chain of links that nothing holds falls
over: the flat walk of bravo7 multiplies an error by more than 1e6 in a step."""
FORCES = 1e-6
"""Price of forces, in (m/s²)² for the robot's weight: they give way before the motion does."""
MOST_CALLS = 5000
"""Evaluations of the equations of motion after which a piece is given up: a linkage that passes
through a position in which it may go on in two ways stops every integrator."""
FINE = {"method": "DOP853", "rtol": 3e-11, "atol": 1e-12}
"""How phases are integrated."""


class Follower:
    """A robot that follows a motion by computed torque, without a controller.

    Parameters
    ----------
    robot : Robot
        The robot.
    motion : Motion
        Its motion.
    """

    def __init__(self, robot: Robot, motion: Motion) -> None:
        self.robot, self.motion = robot, motion
        self._mechanics = _mechanics_of(robot, motion.slope)

    def missed(self) -> float:
        """Largest difference (m, rad, m/s, rad/s) at the end of the whole motion.

        It is infinite if the motion cannot be integrated.
        """
        motion = self.motion
        q, v = motion.initial_state.q, motion.initial_state.v
        for p in range(len(motion.phases)):
            q, v = self._through(p, q, v)
            if not np.all(np.isfinite(v)):
                return np.inf
        return _away(motion, len(motion.phases) - 1, q, v)

    def missed_by_phases(self) -> Floats:
        """Likewise at the end of every phase that begins where it was designed to, (phases,)."""
        motion = self.motion
        starts = [(each.coordinates(0.0), each.coordinates(0.0, order=1)) for each in motion.phases]
        return np.array(
            [_away(motion, p, *self._through(p, *start)) for p, start in enumerate(starts)]
        )

    def _through(self, p: int, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """State after a phase, and after what comes down at its end."""
        from scipy.integrate import solve_ivp  # takes long to import

        phase = self.motion.phases[p]
        held = self._held(phase.contacts)
        given = np.ascontiguousarray(_forces(phase)[:, :, held])
        rate = _Rate(self.robot, self.motion.slope, held, phase.pieces[0], given[0])
        for k, (begin, end) in enumerate(pairwise(phase.breakpoints)):
            # One polynomial at a time: the next one has other accelerations where both meet.
            rate.follow(phase.pieces[k], given[k])
            found = solve_ivp(rate, (0.0, end - begin), np.concatenate([q, v]), **FINE)
            q, v = np.split(found.y[:, -1], 2)
            if found.status < 0:
                return q, np.full(v.size, np.inf)
        return q, self._landed(p, q, v)

    def _landed(self, p: int, q: Floats, v: Floats) -> Floats:
        """Velocity after a plastic impact of all that stands after a phase, if a point is new."""
        motion, names = self.motion, self.robot.contact_names
        before, last = set(motion.phases[p].contacts), p + 1 == len(motion.phases)
        if last and motion.repeat is Repeat.NEVER:
            return v
        after = motion.phases[0 if last else p + 1].contacts
        if last and motion.repeat is Repeat.MIRRORED:
            after = tuple(names[motion.mirror_contact[names.index(each)]] for each in after)
        if not set(after) - before:
            return v
        mass, _, rows, _ = (np.array(each) for each in self._mechanics(q, v))
        rows = rows[self._held(after)]
        inverse = np.linalg.solve(mass, rows.T)
        return np.asarray(v - inverse @ _solved(rows @ inverse, rows @ v))

    def _held(self, contacts: tuple[str, ...]) -> list[int]:
        """Rows that hold the robot."""
        points = [self.robot.contact_names.index(each) for each in contacts]
        loops = range(2 * self.robot.nc, 2 * self.robot.nc + count_rows(self.robot.model))
        return [*standing(self.robot, points).forces, *loops]


class _Rate:
    """How the state changes on a piece: by the possible accelerations nearest to those wanted.

    Parameters
    ----------
    robot : Robot
        The robot.
    slope : float
        Angle of the ground (rad).
    held : list of int
        Rows that hold it.
    terms, forces : (d + 1, nv) and (s, held) array
        Coefficients of a piece and of its forces, of which only the shapes matter.
    """

    def __init__(
        self, robot: Robot, slope: float, held: list[int], terms: Floats, forces: Floats
    ) -> None:
        sizes = len(terms), len(forces)
        equations = _equations_of(robot, slope, tuple(held), sizes)
        count = equations.size_out(0)[1]
        self._time, self._state = np.zeros(1), np.zeros(2 * robot.nv)
        self._terms, self._forces = np.zeros(terms.shape), np.zeros(forces.shape)
        self._equations = np.zeros((count, count + 1))
        self._found, self._column = np.zeros(count), np.zeros(count, np.int64)
        self._buffer, self._evaluate = equations.buffer()
        for k, given in enumerate((self._time, self._state, self._terms, self._forces)):
            self._buffer.set_arg(k, given.data)
        self._buffer.set_res(0, self._equations.data)
        self._calls = 0

    def follow(self, terms: Floats, forces: Floats) -> None:
        """Follow another piece."""
        self._terms[:], self._forces[:], self._calls = terms, forces, 0

    def __call__(self, time: float, state: Floats) -> Floats:
        """Derivative of the state (q, v)."""
        self._calls += 1
        self._time[0], self._state[:] = time, state
        self._evaluate()
        if self._calls > MOST_CALLS or not np.all(np.isfinite(self._equations)):
            return np.full(state.size, np.nan)
        solve_to_rank(self._found.size, self._equations, self._column, self._found)
        half = state.size // 2
        return np.concatenate([state[half:], self._found[:half]])


@lru_cache(maxsize=16)
def _equations_of(robot: Robot, slope: float, held: tuple[int, ...], sizes: tuple[int, int]) -> Any:
    """Equations of accelerations and forces, the right-hand side last, row by row.

    They are those of a least squares problem: accelerations of the motors are to be those of
    computed torque, and forces, by far less, those of the motion, while the equations that no motor
    enters and those of what holds the robot are satisfied. Given are time and state, (2 nv,), and
    the coefficients, lowest first, of a piece and of its forces, one coefficient a column.
    """
    n, count, weight = robot.nv, len(held), robot.weight
    driven = robot.model.actuator_joint.tolist()
    free = [j for j in range(n) if j not in driven]
    time, state = casadi.SX.sym("time"), casadi.SX.sym("state", 2 * n)
    terms, forces = casadi.SX.sym("terms", n, sizes[0]), casadi.SX.sym("forces", count, sizes[1])
    q, v = casadi.vertsplit(state, n)
    mass, force, rows, moved = _mechanics_of(robot, slope)(q, v)
    rows, moved = rows[list(held), :], moved[list(held)]
    at, fast, bend = (_value(terms, time, order) for order in range(3))
    price = np.zeros(n + count)
    price[driven], price[n:] = 1.0, FORCES
    nearest = casadi.vertcat(
        bend + DERIVATIVE * (fast - v) + PROPORTIONAL * (at - q), _value(forces, time, 0) / weight
    )
    must = casadi.blockcat(
        [[mass[free, :] / weight, -rows[:, free].T], [rows, casadi.SX(count, count)]]
    )
    right = casadi.vertcat(price * nearest, -force[free] / weight, -moved)
    none = casadi.SX(must.shape[0], must.shape[0])
    system = casadi.blockcat([[casadi.diag(casadi.SX(price)), must.T], [must, none]])
    equations = casadi.densify(casadi.horzcat(system, right).T)  # its columns follow each other
    return casadi.Function("equations", [time, state, terms, forces], [casadi.cse(equations)])


def _value(terms: Any, time: Any, order: int) -> Any:
    """Value or a derivative of polynomials, the coefficients of which are columns."""
    total = casadi.SX(terms.shape[0], 1)
    for k in range(terms.shape[1] - 1, order - 1, -1):
        total = total * time + math.perm(k, order) * terms[:, k]
    return total


@lru_cache(maxsize=4)
def _mechanics_of(robot: Robot, slope: float) -> Any:
    """Mass matrix, force, rows that may hold the robot and their J̇v, of positions and velocities.

    It is built once, for all motions that are tried.
    """
    q, v = casadi.SX.sym("q", robot.nv), casadi.SX.sym("v", robot.nv)
    along = np.array([np.cos(slope), np.sin(slope)])
    dynamics = TracedDynamics(robot, symbols(q), symbols(v))
    _, rows, moved = point_rows(dynamics, np.array([-along[1], along[0]]), along)
    rows = np.vstack([rows, dynamics.loop_jacobian()])
    moved = np.concatenate([moved, dynamics.loop_bias_acceleration()])
    force = dynamics.bias_force() - dynamics.passive_force()
    found = [dynamics.mass_matrix(), force, rows, moved]
    expressions = casadi.cse([casadi.densify(expression(each)) for each in found])
    return casadi.Function("mechanics", [q, v], expressions)


def _away(motion: Motion, p: int, q: Floats, v: Floats) -> float:
    """Distance from the state in which a motion goes on after a phase."""
    if not np.all(np.isfinite(v)):
        return np.inf
    # Not by the time, which may be rounded to either side of a landing.
    last = p + 1 == len(motion.phases)
    if last and motion.repeat is Repeat.NEVER:
        ends = motion.phases[p]
        there = [ends.coordinates(ends.duration, order=order) for order in range(2)]
    else:
        begins = motion.phases[0 if last else p + 1]
        there = [begins.coordinates(0.0, order=order) for order in range(2)]
        if last:
            there = [motion.repeated(x, np.ones(()), order=k) for k, x in enumerate(there)]
    return float(max(np.abs(q - there[0]).max(), np.abs(v - there[1]).max()))


def _solved(system: Floats, right: Floats) -> Floats:
    """Solve equations of which some may follow from others, as those of two feet that stand do."""
    size = right.size
    equations, found = np.column_stack([system, right]), np.zeros(size)
    if not np.all(np.isfinite(equations)):
        return np.full(size, np.nan)
    solve_to_rank(size, equations, np.zeros(size, np.int64), found)
    return found


def _forces(phase: MotionPhase) -> Any:
    """Coefficients of the forces of points and loops, lowest first, (K, s, forces)."""
    return np.concatenate([phase.force_pieces, phase.loop_force_pieces], axis=2)
