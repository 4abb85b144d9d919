"""Gaits on point feet by direct collocation: the program, its solution and what comes of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import InfeasibleGaitError
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import actuated_joints, fingerprint
from heelstrike.gait.gauss import gauss_scheme
from heelstrike.gait.ipopt import Ipopt
from heelstrike.gait.margins import Margins
from heelstrike.gait.piecewise import PiecewiseGait
from heelstrike.gait.point_starts import point_starts
from heelstrike.gait.point_transcription import PointTranscription
from heelstrike.gait.program import CONVERGED, Solution
from heelstrike.gait.request import Request
from heelstrike.gait.transcription import Group
from heelstrike.robot.state import State

Floats = NDArray[np.float64]

POINTS = 4
"""Gauss points in every interval: joint positions are polynomials of degree 5 there."""
MOST_ITERATIONS = 250
"""Iterations of IPOPT after which a start is given up; those that succeed take 30 to 150."""
RESERVE = 1e-7
"""Scaled distance kept from every bound at the Gauss points, for the time between them."""
ROUNDS = 6
"""Times that the reserve is enlarged where a constraint fails between the Gauss points."""
FINER = 8
"""Parts of every interval at whose ends, and at peaks between, constraints are checked."""
FEASIBLE = 1e-9
"""Scaled violations below this are rounding."""

SETTINGS = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {
        "sb": "yes",
        "print_level": 0,
        "tol": CONVERGED,
        "constr_viol_tol": CONVERGED,
        "acceptable_iter": 0,
        "max_iter": MOST_ITERATIONS,
    },
}


def collocated_gait(request: Request, report: Callable[[float], None]) -> PiecewiseGait:
    """Find the gait of least effort on point feet.

    Raises
    ------
    InfeasibleGaitError
        If none was found.
    """
    transcription = PointTranscription(request)
    for profile in request.profiles:
        program = CollocationProgram(transcription, profile)
        report(0.05)
        found = []
        for place, guess in enumerate(islice(point_starts(request), request.starts)):
            found.append(program.solve(program.sampled(guess)))
            report(0.05 + 0.75 * (place + 1) / request.starts)
        converged = [solution for solution in found if solution.converged]
        if not converged:
            continue
        best = min(converged, key=lambda solution: solution.objective)
        held = _held_between_nodes(program, best)
        if held is not None:
            report(1.0)
            return _designed(program, held)
    raise InfeasibleGaitError(
        f"robot {request.robot.name!r}: no gait on point feet with {request} was found from "
        f"{request.starts} starting points ({found[-1].status}). Ask for a shorter or slower step "
        "or a lower clearance of the swing foot, or try more starts."
    )


class CollocationProgram:
    """The nonlinear program on a mesh of equal intervals.

    Unknowns are positions and velocities of pitch and joints at the ends of the intervals, their
    accelerations at the Gauss points, and the step's duration and length.

    Parameters
    ----------
    transcription : PointTranscription
        The functions.
    profile : ClearanceProfile
        Shape of the swing foot's clearance.
    """

    def __init__(self, transcription: PointTranscription, profile: ClearanceProfile) -> None:
        self.transcription = transcription
        self.request = transcription.request
        self.profile = profile
        self.scheme = gauss_scheme(POINTS)
        self.intervals = self.request.intervals
        n, count = transcription.size, self.intervals
        self._split = np.cumsum([n * (count + 1), n * (count + 1), n * count * POINTS, 1])
        share = np.arange(count)[None, :] + self.scheme.nodes[:, None]  # (points, intervals)
        self.phases = share / count
        self._build()

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._split[-1]) + 1

    def parts(self, unknowns: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Positions, velocities (n, N + 1), accelerations (n, N s), duration and length."""
        n, count = self.transcription.size, self.intervals
        a, b, c, d = (int(k) for k in self._split)
        shape = casadi.reshape
        return (
            shape(unknowns[:a], n, count + 1),
            shape(unknowns[a:b], n, count + 1),
            shape(unknowns[b:c], n, count * POINTS),
            unknowns[c],
            unknowns[d],
        )

    def _build(self) -> None:
        transcription, scheme, count = self.transcription, self.scheme, self.intervals
        unknowns = casadi.MX.sym("unknowns", self.size)
        q, v, acceleration, duration, length = self.parts(unknowns)
        h = duration / count
        at_node = [acceleration[:, place::POINTS] for place in range(POINTS)]
        begin, speed = q[:, :-1], v[:, :-1]

        def moved(row: int, share: float) -> tuple[Any, Any]:
            turn = sum(scheme.velocity[row, k] * a for k, a in enumerate(at_node))
            way = sum(scheme.position[row, k] * a for k, a in enumerate(at_node))
            return begin + share * h * speed + h**2 * way, speed + h * turn

        cost, along = 0.0, []
        path = transcription.path.map(count)
        for place, share in enumerate(scheme.nodes):
            position, velocity = moved(place, float(share))
            effort, values = path(position, velocity, at_node[place])
            cost = cost + scheme.weights[place] * h * casadi.sum2(effort)
            along.append(casadi.vec(values))
        if self.request.free_step:
            cost = cost / length
        end, end_speed = moved(POINTS, 1.0)
        mirrored = transcription.mirrored
        touchdown = transcription.touchdown(
            transcription.roll(q[:, 0]),
            q[:, -1],
            v[:, -1],
            mirrored(v[:, 0], positions=False),
            length,
        )
        equations = [
            casadi.vec(q[:, 1:] - end),
            casadi.vec(v[:, 1:] - end_speed),
            q[:, 0] - mirrored(q[:, -1], positions=True),
        ]
        if self.request.speed is not None:
            equations.append(length / (duration * self.request.speed) - 1.0)
        exact = casadi.vertcat(*equations)
        self._equations = int(exact.numel())
        constraints = casadi.vertcat(exact, touchdown, *along)
        problem = {"x": unknowns, "f": cost, "g": constraints}
        self._solver = Ipopt(problem, SETTINGS)

    def path_bounds(self, phases: Floats) -> tuple[Floats, Floats]:
        """Scaled bounds of the constraints along the path at phases, (rows, N) each."""
        rows = self.transcription.path_rows
        lower = np.array([[row.lower] for row in rows]).repeat(phases.size, axis=1)
        upper = np.array([[row.upper] for row in rows]).repeat(phases.size, axis=1)
        for k, row in enumerate(rows):
            if row.group is Group.CLEARANCE:
                lower[k] = self.clearance(phases)
        return lower, upper

    def clearance(self, phases: Floats) -> Floats:
        """Least height of the swing foot at phases (m); none at the ends, where it stands."""
        height = self.request.clearance * self.profile.height(phases)
        return np.where((phases > 0.0) & (phases < 1.0), height, -np.inf)

    def solve(self, guess: Floats, reserve: Floats | float = RESERVE) -> Solution:
        """Solve from a guess, keeping a reserve (scaled, (rows,)) from the bounds of the path."""
        rows = self.transcription.path_rows
        exact = np.array([row.lower == row.upper for row in rows])
        kept = np.where(exact, 0.0, reserve)[:, None]
        lower, upper = [np.zeros(self._equations)], [np.zeros(self._equations)]
        lower.append(np.array([row.lower for row in self.transcription.touchdown_rows]))
        upper.append(np.array([row.upper for row in self.transcription.touchdown_rows]))
        for phases in self.phases:
            low, high = self.path_bounds(phases)
            lower.append((low + kept).ravel(order="F"))
            upper.append((high - kept).ravel(order="F"))
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        low[-2], high[-2] = self.request.duration_bounds
        low[-1], high[-1] = self.request.length_bounds
        found, statistics = self._solver.solve(
            x0=np.clip(guess, low, high),
            lbx=low,
            ubx=high,
            lbg=np.concatenate(lower),
            ubg=np.concatenate(upper),
        )
        return Solution(
            unknowns=np.array(found["x"]).ravel(),
            objective=float(found["f"]),
            converged=statistics["return_status"] == "Solve_Succeeded",
            status=str(statistics["return_status"]).replace("_", " ").lower(),
            iterations=int(statistics["iter_count"]),
            multipliers=np.array(found["lam_g"]).ravel(),
        )

    def sampled(self, guess: tuple[Callable[[Any], tuple[Any, Any, Any]], float, float]) -> Floats:
        """Unknowns of a motion given by a function of time to (n, ...) q, v and a."""
        motion, duration, length = guess
        ends = duration * np.arange(self.intervals + 1) / self.intervals
        inner = duration * self.phases.T.ravel()
        q, v, _ = motion(ends)
        _, _, a = motion(inner)
        parts = [part.ravel(order="F") for part in (q, v, a)]
        return np.concatenate([*parts, [duration, length]])

    def pieces(self, unknowns: Floats) -> Floats:
        """Coefficients of pitch and joints in the time of each interval, (N, s + 2, n)."""
        q, v, a = (np.array(part) for part in self.parts(casadi.DM(unknowns))[:3])
        h = float(unknowns[-2]) / self.intervals
        n = self.transcription.size
        nodes = a.T.reshape(self.intervals, POINTS, n)
        order = np.arange(POINTS)
        power = (self.scheme.powers / h**order).T @ nodes  # (N, s, n) by broadcasting
        weights = (1.0 / ((order + 1.0) * (order + 2.0)))[:, None]
        return np.concatenate([q.T[:-1, None], v.T[:-1, None], weights * power], axis=1)


def _held_between_nodes(program: CollocationProgram, solution: Solution) -> Floats | None:
    """Enlarge the reserve where constraints fail between the Gauss points, until none does."""
    rows = program.transcription.path_rows
    reserve = np.full(len(rows), RESERVE)
    for _ in range(ROUNDS):
        excess = _excess(program, solution.unknowns)
        if excess.max() <= FEASIBLE:
            return solution.unknowns
        reserve += 1.2 * np.where(excess > FEASIBLE, excess, 0.0)
        solution = program.solve(solution.unknowns, reserve)
        if not solution.converged:
            return None
    return None


def fine_motion(
    program: CollocationProgram, unknowns: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Phases of a fine grid, and positions, velocities and accelerations there, (n, N) each.

    Every interval has both its ends in the grid: accelerations jump from one to the next.
    """
    local = np.linspace(0.0, 1.0, FINER + 1)
    h = float(unknowns[-2]) / program.intervals
    pieces = program.pieces(unknowns)
    degree = np.arange(pieces.shape[1])
    time = (h * local)[:, None] ** degree  # (FINER, degree + 1)
    rate = np.zeros_like(time)
    rate[:, 1:] = degree[1:] * time[:, :-1]
    second = np.zeros_like(time)
    second[:, 2:] = degree[2:] * degree[1:-1] * time[:, :-2]
    phases = (np.arange(program.intervals)[:, None] + local) / program.intervals
    size = pieces.shape[2]
    q, v, a = (
        np.einsum("fd,kdn->kfn", basis, pieces).reshape(-1, size).T
        for basis in (time, rate, second)
    )
    return phases.ravel(), q, v, a


def _excess(program: CollocationProgram, unknowns: Floats) -> Floats:
    """Largest scaled violation of every inequality along the path, (rows,)."""
    phases, q, v, a = fine_motion(program, unknowns)
    _, values = program.transcription.path.map(phases.size)(q, v, a)
    lower, upper = program.path_bounds(phases)
    excess = np.maximum(lower - np.array(values), np.array(values) - upper)
    highest = _highest(excess.reshape(-1, program.intervals, FINER + 1))
    exact = np.array([row.lower == row.upper for row in program.transcription.path_rows])
    result: Floats = np.where(exact, 0.0, highest)
    return result


def _highest(values: Floats) -> Floats:
    """Greatest of values on the grid and of the parabolas through three neighbours, by rows."""
    before, here, after = values[..., :-2], values[..., 1:-1], values[..., 2:]
    inside = np.isfinite(before) & np.isfinite(after) & (here > before) & (here > after)
    rise, bend = np.zeros_like(here), np.ones_like(here)
    np.subtract(after, before, out=rise, where=inside)
    np.subtract(2.0 * here, before + after, out=bend, where=inside)
    peaks = here + rise**2 / (8.0 * bend)
    highest: Floats = np.maximum(values.max(axis=(1, 2)), peaks.max(axis=(1, 2)))
    return highest


def _designed(program: CollocationProgram, unknowns: Floats) -> PiecewiseGait:
    """Gait with the given unknowns, its joints in the order of the actuators."""
    transcription, request = program.transcription, program.request
    robot = request.robot
    mirror = robot.mirror
    assert mirror is not None
    joint = robot.model.actuator_joint
    actuator_of = {int(j): k for k, j in enumerate(joint)}
    q, v, _, _, _ = (np.array(part) for part in program.parts(casadi.DM(unknowns)))
    duration, length = (float(value) for value in unknowns[-2:])
    pieces = program.pieces(unknowns)
    state = [np.array(part).ravel() for part in transcription.state(q[:, 0], v[:, 0])]
    after = transcription.mirrored(v[:, 0], positions=False)
    impulse = np.array(transcription.landing(q[:, -1], v[:, -1], after)[0]).ravel()
    offset = robot.model.reference - mirror.sign * robot.model.reference[mirror.joint]
    solution_cost = _effort(program, unknowns)
    return PiecewiseGait(
        robot=robot.name,
        fingerprint=fingerprint(robot),
        joint_names=actuated_joints(robot),
        step_length=length,
        step_duration=duration,
        start_position=q[joint - 2, 0],
        end_position=q[joint - 2, -1],
        start_velocity=v[joint - 2, 0],
        end_velocity=v[joint - 2, -1],
        mirror_joint=np.array([actuator_of[int(mirror.joint[j])] for j in joint]),
        mirror_sign=mirror.sign[joint],
        mirror_offset=offset[joint],
        stance_foot=request.stance.foot,
        initial_state=State(*state),
        cost=solution_cost,
        friction=request.friction,
        clearance=request.clearance,
        clearance_profile=program.profile,
        touchdown_impulse=np.array([impulse[1], impulse[0], 0.0] if request.impact else [0.0] * 3),
        margins=_margins(program, unknowns),
        breakpoints=duration * np.arange(program.intervals + 1) / program.intervals,
        pieces=np.ascontiguousarray(pieces[:, :, joint - 2]),
        pitch_pieces=np.ascontiguousarray(pieces[:, :, 0]),
    )


def _effort(program: CollocationProgram, unknowns: Floats) -> float:
    """∫ΓᵀΓ dt by the quadrature of the program."""
    total = 0.0
    pieces = program.pieces(unknowns)
    h = float(unknowns[-2]) / program.intervals
    degree = np.arange(pieces.shape[1])
    for node, weight in zip(program.scheme.nodes, program.scheme.weights, strict=True):
        t = h * node
        basis = t**degree
        rate = np.append(0.0, degree[1:] * basis[:-1])
        second = np.append([0.0, 0.0], degree[2:] * degree[1:-1] * basis[:-2])
        motion = [(row @ pieces).T for row in (basis, rate, second)]
        cost, _ = program.transcription.path.map(program.intervals)(*motion)
        total += weight * h * float(np.sum(np.array(cost)))
    return float(total)


def _margins(program: CollocationProgram, unknowns: Floats) -> Margins:
    """Worst values on the fine grid, from the motion itself."""
    transcription, request = program.transcription, program.request
    model = request.robot.model
    phases, q, v, a = fine_motion(program, unknowns)
    force, torque, height, _ = (
        np.array(part) for part in transcription.motion.map(phases.size)(q, v, a)
    )
    actuator = np.argsort(model.actuator_joint)
    limits = np.minimum(
        model.torque_upper[actuator, None] - torque, torque - model.torque_lower[actuator, None]
    )
    ranges = np.minimum(request.upper[3:, None] - q[1:], q[1:] - request.lower[3:, None])
    position, velocity, _, _, length = program.parts(casadi.DM(unknowns))
    start, start_speed = np.array(position[:, 0]).ravel(), np.array(velocity[:, 0]).ravel()
    end, end_speed = position[:, -1], velocity[:, -1]
    after = transcription.mirrored(start_speed, positions=False)
    impulse, vertical = (
        np.array(part).ravel() for part in transcription.landing(end, end_speed, after)
    )
    touchdown = np.array(
        transcription.touchdown(transcription.roll(start), end, end_speed, after, length)
    ).ravel()
    periodic = [row.group in (Group.IMPACT, Group.PERIODIC) for row in transcription.touchdown_rows]
    cone = request.friction * force[1]
    return Margins(
        normal_force=float(force[1].min()),
        friction_use=float((np.abs(force[0]) / cone).max()) if request.friction else math.inf,
        zero_moment_point=0.0,
        clearance=float((height.ravel() - program.clearance(phases)).min()),
        joint_range=float(ranges.min()),
        torque=float(limits.min()),
        peak_torque=float(np.abs(torque).max()),
        impulse=float(impulse[1]) if request.impact else 0.0,
        impulse_friction_use=(
            float(abs(impulse[0]) / (request.friction * impulse[1]))
            if request.impact and request.friction
            else 0.0
        ),
        impulse_center=0.0,
        landing_velocity=float(vertical[0]),
        lift_velocity=float(vertical[1]),
        touchdown_error=float(np.abs(touchdown[:2]).max()),
        impact_error=float(np.abs(touchdown[periodic]).max()),
    )
