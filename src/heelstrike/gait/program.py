"""The nonlinear program of a step, and its solution by IPOPT with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
from numpy.polynomial.legendre import legvander

from heelstrike.blas_threads import one_blas_thread
from heelstrike.field_texts import dataclass
from heelstrike.gait.blocks import BlockProgram, Copies
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.gait import Gait
from heelstrike.gait.polynomials import Instants, coefficients, gauss, lobatto
from heelstrike.gait.request import Request
from heelstrike.gait.rows import Row
from heelstrike.gait.sequential import Derivatives, optimum_near
from heelstrike.gait.starts import Start, typical_step
from heelstrike.gait.transcription import Group, Transcription
from heelstrike.interruption import deferred_interrupts
from heelstrike.robot.model import Floats

CONVERGED = 1e-8
"""Tolerance of IPOPT on scaled constraints and optimality."""
RELAXED = 1e-8
"""Relative distance by which bounds of inequalities are moved outwards, as IPOPT does by itself:
the rear foot's freedom to lift has prices of 1e5, so that costs show it in the fifth digit."""
FEASIBLE = 1e-7
"""Scaled violations up to which a point satisfies all constraints."""
MOST_ITERATIONS = 100
"""Iterations after which a start is given up; those that succeed take about 25. Giving up sooner is
no gain: of 24 requests for gaits, one was met at a cost 27 % higher with 40 to 50."""
POINTS = 4
"""Gauss points in every piece of a motion that must satisfy an equation along the path."""
PRICE_OF_EQUATIONS = 1000.0
"""Price of violating an equation in an elastic program; that of an inequality is 1. Equations say
what a periodic step is, so that they give way last."""
SHIFT = 1e-15
"""Added to the squares of the singular values of equations (scaled) that may be dependent."""
MOST_STEPS = 10
"""Steps of Newton's method that satisfy equations."""
WORSE = 2.0
"""How many times as much a limit may be violated after equations were satisfied as all was before:
limits that are held at other instants are violated a little, before and after."""
ROUNDING = 1e-12
"""Scaled violation of equations that counts as rounding."""
RESERVE = 1e-6
"""Scaled distance kept from every bound along the path, for the time between the instants."""

CLOSE = 1e-4
"""Barrier parameter and distance from bounds with which IPOPT begins near an optimum. From 1e-3 to
1e-6, solving again takes 6 to 12 iterations; 16 to 20 from IPOPT's own 0.1."""

SETTINGS = {
    "sb": "yes",
    "print_level": 0,
    "tol": CONVERGED,
    "constr_viol_tol": CONVERGED,
    "acceptable_iter": 0,
    "max_iter": MOST_ITERATIONS,
}
NEAR = SETTINGS | {
    "warm_start_init_point": "yes",
    "mu_init": CLOSE,
    **{
        f"warm_start_{each}": CLOSE
        for each in ("bound_push", "slack_bound_push", "mult_bound_push", "bound_frac",
                     "slack_bound_frac")
    },
}  # fmt: skip
"""Settings of IPOPT, and those for a start that is nearly an optimum."""
INSIDE = SETTINGS | {"mu_strategy": "adaptive", "max_iter": 2 * MOST_ITERATIONS}
"""Those for a start that satisfies all constraints where others led nowhere. The barrier follows
the problem: an optimum that 100 iterations with a falling one missed takes 20."""


HASTY = SETTINGS | {"max_iter": MOST_ITERATIONS // 2}
"""Those for the first start, before it is known whether any point satisfies all constraints: most
that take longer find none."""
ROUGH = 14
"""Intervals of the grid on which the best of the starts is chosen: costs have ten digits there, and
its optimum is three steps of Newton's method from that on the whole grid."""


def first_instants(request: Request) -> tuple[int, Instants]:
    """Degree of the polynomials, and the instants on which a program begins.

    On flat feet every motion of the joints is possible and the paper's cubics are chosen among. On
    points an equation of motion is left: there, pieces have the degree at which the accelerations
    can satisfy it at the Gauss points of each (direct collocation; positions at the joints of the
    pieces are then accurate to order 2 `POINTS`: U. M. Ascher, R. M. M. Mattheij and R. D.
    Russell, *Numerical Solution of Boundary Value Problems for Ordinary Differential Equations*,
    1995, section 5.3).
    """
    if request.stance.flat:
        return 3, _one_piece(request.intervals)
    return POINTS + 1, Instants.in_every_piece(request.intervals, *gauss(POINTS))


def coarse(program: Program) -> Program:
    """Return a program of one piece with fewer instants; others as they are."""
    request = program.request
    if program.instants.pieces > 1 or request.intervals <= ROUGH:
        return program
    return replace(program, instants=_one_piece(ROUGH))


def _one_piece(intervals: int) -> Instants:
    """Nodes of Gauss and Lobatto on one piece."""
    return Instants.in_every_piece(1, *lobatto(intervals))


@dataclass(frozen=True)
class Solution:
    """Where IPOPT stopped."""

    unknowns: Floats
    """(n,) The unknowns of the program."""
    objective: float
    """Value of the objective."""
    converged: bool
    """Whether it is an optimum within the tolerance."""
    ended: str
    """IPOPT's own word for how it did."""
    multipliers: Floats
    """Multipliers of the constraints: of the gaps between the pieces, then of the scaled ones in
    the order of :meth:`Program.labelled_rows`."""


@dataclass(eq=False)
class Program:
    """The program on a mesh of equal pieces.

    Unknowns are, of all free coordinates, the positions at the end and the velocities at the
    beginning of every piece, and the parts of its acceleration, as they are if the step has its
    usual duration, or the one that was asked for; then the step's duration and length. Over the
    share of a piece that has gone by, the motion is affine in them whatever the duration, and the
    program made of blocks. The positions at its beginning are the mirror image of those at its end.
    Where a piece ends, the next one begins: those equations always hold, also in an elastic
    program.
    """

    request: Request
    """What is asked."""
    transcription: Transcription
    """The functions."""
    profile: ClearanceProfile
    """Shape of the swing foot's clearance."""
    degree: int
    """Degree of the polynomials."""
    instants: Instants
    """When the constraints along the path hold. Equations among them hold where the instants have a
    weight; the others only carry inequalities."""
    near: bool = False
    """Whether guesses are nearly optima."""
    inside: bool = False
    """Whether guesses satisfy all constraints."""
    hasty: bool = False
    """Whether to give up soon."""
    elastic: bool = False
    """Let every constraint be violated and minimise the sum of the scaled violations instead of the
    effort: shows which constraints are in conflict when there is no solution."""

    kept: dict[str, Any] = field(default_factory=dict, repr=False)
    """What programs on other instants, or for other starts, have in common with it."""

    def __post_init__(self) -> None:
        n, pieces = self.transcription.size, self.instants.pieces
        _, usual = typical_step(self.request)
        self._usual = usual / pieces
        """Duration of a piece (s) with which velocities and accelerations are told."""
        self._ends = Instants.in_every_piece(pieces, np.ones(1))
        sizes = [n * pieces, n * pieces, n * pieces * (self.degree - 1), 1, 1]
        self._places = [0, *np.cumsum(sizes).tolist()]
        self._gaps = n * (2 * pieces - 1)
        self._lower, self._upper = self._bounds()

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._places[-1])

    def path_bounds(self, instants: Instants) -> tuple[Floats, Floats]:
        """Scaled bounds of the constraints along the path at instants, (rows, N) each."""
        rows = self.transcription.path_rows
        lower = np.array([[row.lower] for row in rows]).repeat(instants.share.size, axis=1)
        upper = np.array([[row.upper] for row in rows]).repeat(instants.share.size, axis=1)
        for k, row in enumerate(rows):
            if row.kind is Group.CLEARANCE:
                lower[k] = self.clearance(instants)
            if row.lower == row.upper:
                lower[k, instants.weight == 0.0] = -np.inf
                upper[k, instants.weight == 0.0] = np.inf
        return lower, upper

    def clearance(self, instants: Instants) -> Floats:
        """Least height of the swing foot at instants (m); none at the ends, where it stands."""
        phases = instants.phases
        height = self.request.clearance * self.profile.height(phases)
        return np.where((phases > 0.0) & (phases < 1.0), height, -np.inf)

    def labelled_rows(self) -> list[tuple[Row, float | None]]:
        """Meaning of every constraint, at touchdown first, with its phase if along the path."""
        rows: list[tuple[Row, float | None]]
        rows = [(row, None) for row in self.transcription.touchdown_rows]
        for phase in self.instants.phases.tolist():
            rows += [(row, phase) for row in self.transcription.path_rows]
        return rows

    def _bounds(self) -> tuple[Floats, Floats]:
        """Bounds of the gaps between the pieces, and scaled ones of the constraints."""
        gaps, touchdown = np.zeros(self._gaps), self.transcription.touchdown_rows
        lower, upper = self.path_bounds(self.instants)
        reserve = np.minimum(RESERVE, 0.5 * (upper - lower))
        return (
            np.concatenate([gaps, [row.lower for row in touchdown], (lower + reserve).T.ravel()]),
            np.concatenate([gaps, [row.upper for row in touchdown], (upper - reserve).T.ravel()]),
        )

    def _parts(self, unknowns: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Positions, and derivatives by the share of a piece, (n, ...); duration and length."""
        if isinstance(unknowns, np.ndarray):
            unknowns = casadi.DM(unknowns)
        n = self.transcription.size
        q, v, a, duration, length = (unknowns[k:end] for k, end in pairwise(self._places))
        q, v, a = (casadi.reshape(part, n, -1) for part in (q, v, a))
        start = self.transcription.mirror.position(q[:, -1])
        rate = self._usual
        return casadi.horzcat(start, q), rate * v, rate**2 * a, duration, length

    def _along(self, unknowns: Any, instants: Instants) -> tuple[Any, Any, Any]:
        """Positions and their derivatives by the share of a piece at instants, (n, N) each."""
        q, v, a, _, _ = self._parts(unknowns)
        values = casadi.horzcat(q[:, :-1], v, a)
        position, velocity, acceleration = (
            values @ casadi.sparsify(casadi.DM(instants.matrix(self.degree, order)))
            for order in range(3)
        )
        return position, velocity, acceleration

    def motion(self, unknowns: Floats, instants: Instants) -> list[Floats]:
        """Positions, velocities and accelerations at instants, (n, N) each."""
        piece = self._piece(unknowns)
        parts = self._along(unknowns, instants)
        return [np.array(part) / piece**order for order, part in enumerate(parts)]

    def at_touchdown(self, unknowns: Floats) -> tuple[Any, Any, Any, Any, Any]:
        """Return q(T), v(T), v(0), duration and length, as the transcription takes them."""
        q, v, _, duration, length = self._parts(unknowns)
        _, ends, _ = self._along(unknowns, self._ends)
        piece = self._piece(unknowns)
        return q[:, -1], ends[:, -1] / piece, v[:, 0] / piece, duration, length

    def _piece(self, unknowns: Floats) -> float:
        """Duration of a piece (s)."""
        return float(unknowns[-2]) / self.instants.pieces

    def effort(self, unknowns: Floats) -> float:
        """∫ΓᵀΓ dt over the step, in N²m²s."""
        return self._spent(self.transcription.effort, unknowns)

    def cost(self, unknowns: Floats) -> float:
        """What was minimised, over the step, in its own unit."""
        return self._spent(self.transcription.path, unknowns)

    def _spent(self, rate: Any, unknowns: Floats) -> float:
        """Integral over the step of the first result of a function along the path."""
        motion = self.motion(unknowns, self.instants)
        values = rate.map(self.instants.share.size).call(
            [*motion, unknowns[-1], self.request.under_foot]
        )[0]
        return float(unknowns[-2] * (np.array(values) @ self.instants.weight)[0])

    def pieces(self, unknowns: Floats) -> Floats:
        """Coefficients of the free coordinates in the time of each piece, (K, degree + 1, n)."""
        n, count, piece = self.transcription.size, self.instants.pieces, self._piece(unknowns)
        q, v, a, _, _ = (np.array(part) for part in self._parts(unknowns))
        values = np.concatenate([q[:, :-1], v / piece, a / piece**2], axis=1)
        return coefficients(values.reshape(n, self.degree + 1, count).transpose(2, 1, 0), piece)

    @cached_property
    def _blocks(self) -> BlockProgram:
        """Gaps between the pieces, then the blocks of touchdown and of the instants."""
        x, gaps, touchdown = self._joins()
        return BlockProgram(x, gaps, [touchdown, self._path(x)])

    @cached_property
    def _equations(self) -> tuple[Any, Any]:
        """Constraints up to the last equation, and their Jacobian: of the path only if need be."""
        if any(row.lower == row.upper for row in self.transcription.path_rows):
            return self._with_slopes(self._blocks)
        if "equations" not in self.kept:
            x, gaps, touchdown = self._joins()
            self.kept["equations"] = self._with_slopes(BlockProgram(x, gaps, [touchdown]))
        value, slopes = self.kept["equations"]
        return value, slopes

    def _with_slopes(self, blocks: BlockProgram) -> tuple[Any, Any]:
        x = casadi.MX.sym("x", self.size)
        return blocks.value, casadi.Function("slopes", [x], [blocks.jacobian(x)])

    @cached_property
    def _solver(self) -> Ipopt:
        """IPOPT with the derivatives of the program: no need of it to satisfy equations only."""
        x = casadi.MX.sym("x", self.size)
        f, g = self._blocks.value(x)
        slope, slopes = self._blocks.gradient(x), self._blocks.jacobian(x)
        price, prices = casadi.MX.sym("price"), casadi.MX.sym("prices", g.numel())
        bend = self._blocks.hessian(x, price, prices)
        if self.elastic:
            # Each constraint may be exceeded upwards or downwards; the sum of that is minimised.
            gaps, total = self._gaps, self._lower.size - self._gaps
            excess = casadi.MX.sym("excess", 2 * total)
            cost = np.where(self._lower == self._upper, PRICE_OF_EQUATIONS, 1.0)[gaps:]
            cost, both = casadi.DM(np.tile(cost, 2)), casadi.DM.eye(total)
            taken = casadi.vertcat(casadi.DM(gaps, 2 * total), casadi.horzcat(both, -both))
            f, slope = casadi.dot(cost, excess), casadi.vertcat(casadi.DM(self.size, 1), cost)
            g, slopes = g + taken @ excess, casadi.horzcat(slopes, taken)
            bend = casadi.diagcat(
                self._blocks.hessian(x, 0.0, prices), casadi.DM(2 * total, 2 * total)
            )
            x = casadi.vertcat(x, excess)
        return Ipopt(
            x, f, g, gradient=slope, jacobian=slopes, hessian=(price, prices, bend),
            settings=self._settings,
        )  # fmt: skip

    @property
    def _settings(self) -> dict[str, Any]:
        """Settings of IPOPT."""
        if self.hasty:
            return HASTY
        return NEAR if self.near else INSIDE if self.inside else SETTINGS

    def _joins(self) -> tuple[Any, Any, Copies]:
        """Symbols of the unknowns, the gaps between the pieces, and the touchdown."""
        if "joins" not in self.kept:
            x = casadi.MX.sym("x", self.size)
            q, v, _, duration, length = self._parts(x)
            q_end, v_end, _ = self._along(x, self._ends)
            gaps = casadi.veccat(q[:, 1:] - q_end, v[:, 1:] - v_end[:, :-1])
            landing = casadi.vertcat(q[:, -1], v_end[:, -1], v[:, 0], duration, length)
            _, block = self.transcription.blocks(self.instants.pieces)
            touchdown = Copies.of(block, np.zeros(1), x, landing, self.request.under_foot)
            self.kept["joins"] = x, gaps, touchdown
        x, gaps, touchdown = self.kept["joins"]
        return x, gaps, touchdown

    def _path(self, x: Any) -> Copies:
        """Copies of the path, made of those of a program with fewer instants if there is one."""
        instants = self.instants
        known, copies = self.kept.get("path", (None, None))
        more = None if known is None else instants.after(known)
        if more is None or more.share.size:
            new = instants if more is None else more
            block, _ = self.transcription.blocks(instants.pieces)
            step = casadi.repmat(casadi.vertcat(*self._parts(x)[3:]), 1, new.share.size)
            along = casadi.vertcat(*self._along(x, new), step)
            made = Copies.of(block, new.weight, x, along, self.request.under_foot)
            copies = made if more is None else copies.joined(made)
            self.kept["path"] = instants, copies
        found: Copies = copies
        return found

    def solve(self, guess: Floats, multipliers: Floats | None = None) -> Solution:
        """Solve from a guess of the unknowns and, near an optimum, of the multipliers.

        Those of instants that are new are zero. An elastic program starts with the violations of
        the guess taken up by the excesses.
        """
        if self.near and self.instants.pieces == 1:  # few unknowns, for dense matrices
            found = self._optimum_near(guess, multipliers)
            if found is not None:
                return found
        size, more = self.size, 2 * (self._lower.size - self._gaps) if self.elastic else 0
        low, high = np.array([self.request.duration_bounds, self.request.length_bounds]).T
        lower = np.concatenate([np.full(size - 2, -np.inf), low, np.zeros(more)])
        upper = np.concatenate([np.full(size - 2, np.inf), high, np.full(more, np.inf)])
        start = self.in_bounds(guess)
        if self.elastic:
            missing = self.violations(start)
            start = np.concatenate([start, np.maximum(missing, 0.0), np.maximum(-missing, 0.0)])
        priced = np.zeros(self._lower.size)
        if multipliers is not None:
            priced[: multipliers.size] = multipliers
        found, statistics = self._solver.solve(
            x0=start, lam_g0=priced, lbx=lower, ubx=upper, lbg=self._lower, ubg=self._upper
        )
        return Solution(
            unknowns=np.array(found["x"]).ravel()[:size],
            objective=float(found["f"]),
            converged=statistics["return_status"] == "Solve_Succeeded",
            ended=str(statistics["return_status"]).replace("_", " ").lower(),
            multipliers=np.array(found["lam_g"]).ravel(),
        )

    def _optimum_near(self, guess: Floats, multipliers: Floats | None) -> Solution | None:
        """Solve by sequential quadratic programming; None if the guess is not near enough."""
        step = np.eye(self.size)[-2:]  # whose bounds are constraints like others here

        def slopes(x: Floats) -> Derivatives:
            gradient, values, jacobian = self._blocks.first(x)
            return gradient, np.append(values, x[-2:]), np.vstack([jacobian, step])

        low, high = np.array([self.request.duration_bounds, self.request.length_bounds]).T
        lower, upper = np.append(self._lower, low), np.append(self._upper, high)
        free = lower < upper
        relaxed = [RELAXED * np.maximum(np.abs(each), 1.0) * free for each in (lower, upper)]
        priced = np.zeros(lower.size)
        if multipliers is not None:
            priced[: multipliers.size] = multipliers
        found = optimum_near(
            self.in_bounds(guess), priced, self._blocks.cost, slopes,
            lambda x, prices: self._blocks.second(x, 1.0, prices[:-2]),
            (lower - relaxed[0], upper + relaxed[1]),
        )  # fmt: skip
        if found is None:
            return None
        unknowns, priced = found
        cost = self._blocks.cost(unknowns)
        return Solution(unknowns, cost, True, "solved by Newton's steps", priced[:-2])

    def in_bounds(self, unknowns: Floats) -> Floats:
        """Bring duration and length of the step within their bounds."""
        low, high = np.array([self.request.duration_bounds, self.request.length_bounds]).T
        return np.append(unknowns[:-2], np.clip(unknowns[-2:], low, high))

    def at(self, unknowns: Floats) -> Solution:
        """Return a point that is no optimum, as if IPOPT had stopped there."""
        cost = float(self._blocks.value(unknowns)[0])
        return Solution(unknowns, cost, False, "no optimum", np.zeros(self._lower.size))

    def satisfied_by(self, solution: Solution) -> bool:
        """Whether a point satisfies all constraints, optimum or not."""
        return bool(np.abs(self.violations(solution.unknowns)).max() <= FEASIBLE)

    def sampled(self, start: Start) -> Floats:
        """Unknowns of a motion to start from."""
        q, v, a = start.motion(np.linspace(0.0, 1.0, self.instants.pieces + 1))
        rate = start.duration / self.instants.pieces / self._usual
        rest = np.zeros(self._places[3] - self._places[2])
        rest[: v[:, 1:].size] = rate**2 * a[:, 1:].ravel(order="F")
        parts = [q[:, 1:].ravel(order="F"), rate * v[:, :-1].ravel(order="F"), rest]
        return np.concatenate([*parts, [start.duration, start.length]])

    def resampled(self, gait: Gait) -> Floats:
        """Unknowns of a motion that is nearly that of another gait, of the same joints."""
        n, pieces, duration = self.transcription.size, self.instants.pieces, gait.step_duration
        piece = duration / pieces
        nodes, _ = gauss(self.degree - 1)
        grid = np.linspace(0.0, duration, pieces + 1)
        beginnings, ends = grid[:-1], grid[1:]
        inner: Floats = (beginnings[:, None] + piece * nodes).ravel()
        rate = piece / self._usual
        q, v = self._of_gait(gait, ends, 0), rate * self._of_gait(gait, beginnings, 1)
        a = rate**2 * self._of_gait(gait, inner, 2).reshape(n, pieces, nodes.size)
        basis = legvander(2.0 * nodes - 1.0, nodes.size - 1)
        parts = np.linalg.solve(basis, np.moveaxis(a, 2, 0).reshape(nodes.size, -1))
        # All pieces of the first part come first.
        rest = parts.reshape(nodes.size, n, pieces).transpose(0, 2, 1).ravel()
        columns = [part.ravel(order="F") for part in (q, v)]
        return np.concatenate([*columns, rest, [duration, gait.step_length]])

    def _of_gait(self, gait: Gait, times: Floats, order: int) -> Floats:
        """Free coordinates of a gait at times of its first step, or a derivative, (n, N)."""
        joints = gait.in_step(times, order=order)
        actuators = self.request.robot.model.actuator_joint.tolist()
        pitched = 3 - self.transcription.held
        driven = [actuators.index(j) for j in self.transcription.free[pitched:]]
        pitch = [gait.pitch(times, order=order)] if pitched else []
        return np.array([*pitch, *joints[:, driven].T])

    def violations(self, unknowns: Floats) -> Floats:
        """Scaled distances of the constraints outside of their bounds; positive if too low."""
        values = np.array(self._blocks.value(unknowns)[1]).ravel()
        return outside(values, self._lower, self._upper)[self._gaps :]

    def polished(self, unknowns: Floats, *, within_limits: bool = True) -> Floats:
        """Satisfy the equations to rounding, by the least change of the unknowns.

        Within limits, what is given is returned if that would break one by more than it breaks
        anything.
        """
        step = np.ptp([self.request.duration_bounds, self.request.length_bounds], axis=1) > 0.0
        free = np.append(np.full(self.size - 2, True), step)
        value, slopes = self._equations
        count = value.numel_out(1)
        found = satisfied(
            unknowns, lambda x: np.array(value(x)[1]).ravel(), slopes,
            (self._lower[:count], self._upper[:count]), free,
        )  # fmt: skip
        if within_limits and not is_no_worse(self._missing(found), self._missing(unknowns)):
            return unknowns
        return found

    def _missing(self, unknowns: Floats) -> float:
        """Largest violation of a constraint, or of a bound of the step."""
        beyond = np.abs(unknowns - self.in_bounds(unknowns)).max()
        return float(max(beyond, np.abs(self.violations(unknowns)).max()))


def outside(values: Floats, lower: Floats, upper: Floats) -> Floats:
    """Distances of values from their bounds; positive if too low, zero within."""
    return np.asarray(np.maximum(lower - values, 0.0) - np.maximum(values - upper, 0.0))


def is_no_worse(after: float, before: float) -> bool:
    """Whether unknowns that satisfy equations more nearly break nothing else instead.

    Parameters
    ----------
    after, before : float
        Largest scaled violations.
    """
    return after <= max(FEASIBLE, WORSE * before)


def satisfied(
    unknowns: Floats, value: Callable[[Floats], Floats], slopes: Callable[[Floats], Any],
    bounds: tuple[Floats, Floats], free: Any,
) -> Floats:  # fmt: skip
    """Change unknowns least so that constraints are satisfied to rounding whose bounds are equal.

    Parameters
    ----------
    unknowns : (n,) array
        Where to begin: nearly there.
    value, slopes : callable
        Return the constraints (m,) at unknowns, and their derivatives (m, n), a CasADi matrix.
    bounds : two (m,) arrays
        Lower and upper bounds.
    free : (n,) array of bool
        Which unknowns may change.

    Returns
    -------
    (n,) float
        Those that came nearest, be it where it began: constraints need not be satisfied.
    """
    import scipy.sparse.linalg

    lower, upper = bounds
    exact = np.flatnonzero(lower == upper)
    found, best, least = unknowns.copy(), unknowns, np.inf
    for k in range(MOST_STEPS + 1):
        missing = value(found)[exact] - lower[exact]
        most = float(np.abs(missing).max(initial=0.0))
        if k >= 3 and most <= ROUNDING:
            return found
        if most < least:
            best, least = found.copy(), most
        if k == MOST_STEPS or not np.isfinite(most):
            break
        rows = slopes(found).sparse().tocsr()[exact][:, free]
        # Equations may depend on each other: then, and only then, does the shift matter. They may
        # nearly do so on a fine mesh, so that their normal equations would lose all digits.
        count = rows.shape[1]
        system = scipy.sparse.bmat(
            [
                [scipy.sparse.identity(count), rows.T],
                [rows, -SHIFT * scipy.sparse.identity(exact.size)],
            ],
            format="csc",
        )
        right = np.concatenate([np.zeros(count), missing])
        try:
            found[free] -= scipy.sparse.linalg.splu(system).solve(right)[:count]
        except RuntimeError:  # exactly singular, for all of the shift
            break
    return best


class Ipopt:
    """A nonlinear program for IPOPT, in a form that Ctrl-C can stop.

    CasADi looks for signals in the functions that IPOPT evaluates, takes what they raise for a
    failure of the function, and returns; nobody learns that there was a Ctrl-C. So the signal is
    held back, and IPOPT stopped after the iteration in which it came.

    Parameters
    ----------
    unknowns : casadi.MX
        (n,) The unknowns.
    objective, constraints : casadi.MX
        Expressions of them.
    gradient, jacobian : casadi.MX
        Their derivatives, (n,) and (m, n).
    hessian : tuple of casadi.MX
        Prices of the objective and of the constraints, (m,), and the Hessian of the priced sum.
    settings : mapping
        Options of IPOPT.
    """

    def __init__(
        self, unknowns: Any, objective: Any, constraints: Any, *, gradient: Any, jacobian: Any,
        hessian: tuple[Any, Any, Any], settings: Mapping[str, Any],
    ) -> None:  # fmt: skip
        self._watch = _Watch(unknowns.numel(), constraints.numel())
        given, (price, prices, bend) = [unknowns, casadi.MX.sym("none", 0, 0)], hessian
        derivatives = {
            "grad_f": casadi.Function("grad_f", given, [objective, casadi.densify(gradient)]),
            "jac_g": casadi.Function("jac_g", given, [constraints, jacobian]),
            "hess_lag": casadi.Function("hess_lag", [*given, price, prices], [casadi.triu(bend)]),
        }
        self._solver = casadi.nlpsol(
            "gait",
            "ipopt",
            {"x": unknowns, "f": objective, "g": constraints},
            {
                **derivatives,
                "ipopt": dict(settings),
                "iteration_callback": self._watch,
                "print_time": False,
                "error_on_fail": False,
            },
        )

    def solve(self, **arguments: Any) -> tuple[Any, Any]:
        """Solve it; return what ``casadi.nlpsol`` found, and its statistics.

        Raises
        ------
        KeyboardInterrupt
            At Ctrl-C, once the iteration under way has ended.
        """
        with deferred_interrupts() as interrupted, one_blas_thread():
            self._watch.stop = interrupted
            found = self._solver(**arguments)
        return found, self._solver.stats()


class _Watch(casadi.Callback):  # type: ignore[misc]
    """What IPOPT asks after every iteration: whether to stop."""

    def __init__(self, unknowns: int, constraints: int) -> None:
        casadi.Callback.__init__(self)
        self._sizes = {"f": 1, "x": unknowns, "lam_x": unknowns, "g": constraints}
        self._sizes |= {"lam_g": constraints, "lam_p": 0}
        self.stop: Callable[[], bool] = lambda: False
        self.construct("watch", {})

    def get_n_in(self) -> int:
        """Return how many results of a program it is shown."""
        return int(casadi.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return how many answers it gives."""
        return 1

    def get_sparsity_in(self, index: int) -> Any:
        """Return the shape of a result."""
        return casadi.Sparsity.dense(self._sizes[casadi.nlpsol_out(index)], 1)

    def eval(self, _: Any) -> list[int]:
        """Return whether to stop."""
        return [int(self.stop())]
