"""The nonlinear program of a motion of several phases (direct collocation)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi
import numpy as np

from heelstrike.dynamics import contact_positions, link_poses
from heelstrike.field_texts import dataclass
from heelstrike.gait.blocks import BlockProgram, Copies
from heelstrike.gait.motion.instant import MotionFunctions
from heelstrike.gait.motion.phases import Standing
from heelstrike.gait.motion.request import MotionRequest, Repeat
from heelstrike.gait.motion.rows import Kind
from heelstrike.gait.polynomials import Instants, coefficients, gauss
from heelstrike.gait.program import NEAR, SETTINGS, Ipopt, is_no_worse, outside, satisfied
from heelstrike.gait.rows import Row
from heelstrike.robot.model import Floats

STAGES = 4
"""Gauss points of a piece, at which the equations of motion hold: positions at the ends of pieces
are accurate to order 2 `STAGES`."""
DEGREE = STAGES + 1
"""Degree of the polynomials."""
EQUATIONS = {
    Kind.MOTION, Kind.NORMAL_REST, Kind.TANGENT_REST, Kind.NORMAL_STILL, Kind.TANGENT_STILL,
    Kind.PLACE, Kind.LOOP_REST, Kind.LOOP_STILL, Kind.LOOP_CLOSED,
}  # fmt: skip
"""Kinds of constraint along the path that are equations."""
MORE_ITERATIONS = {"max_iter": 300}
ADAPTIVE = {"mu_strategy": "adaptive"}
"""Settings of IPOPT: phases of free duration take more iterations than a step. With a barrier that
follows the problem, least energies are found, too; one that only falls misses them. Near an optimum
it takes two thirds of the iterations."""
FROM_STOPS = 1e-3
"""Distance (rad, m) that joints keep from their stops: a robot that follows a motion nearly is not
to hit them."""
PARTS = 7
"""Kinds of unknowns of a phase."""
COUNTED = 2 * STAGES
"""Gauss points of a piece at which costs with corners are summed up. Were they those of the
equations of motion, forces would swing between them, unseen by the cost."""
FROM_LIMITS = 1e-6
"""Scaled distance kept from the bounds of inequalities along the path, for the time between."""


def lagrange(share: Floats) -> Floats:
    """Values at shares of a piece of the polynomials that are 1 at one Gauss point, (STAGES, N)."""
    nodes, _ = gauss(STAGES)
    others = [np.delete(nodes, k) for k in range(STAGES)]
    return np.array(
        [
            np.prod((share[:, None] - rest) / (node - rest), axis=1)
            for node, rest in zip(nodes, others, strict=True)
        ]
    )


def lagrange_rates(share: Floats) -> Floats:
    """Derivatives of those of :func:`lagrange` by the share, (STAGES, N)."""
    nodes, _ = gauss(STAGES)
    found = []
    for k, node in enumerate(nodes):
        rest = np.delete(nodes, k)
        parts = [np.prod(share[:, None] - np.delete(rest, j), axis=1) for j in range(rest.size)]
        found.append(np.sum(parts, axis=0) / np.prod(node - rest))
    return np.array(found)


@dataclass(frozen=True, eq=False)
class PhaseUnknowns:
    """Expressions of the unknowns of a phase, affine in all unknowns."""

    q: Any
    """(nv, K + 1) Positions at the ends of its pieces, and where it begins."""
    v: Any
    """(nv, K) Velocities at the beginnings, by the share of a piece."""
    a: Any
    """(nv, (STAGES) K) Parts of the accelerations, all first parts first."""
    force: Any
    """(forces, STAGES K) Forces of contact points and loops at the Gauss points."""
    places: Any
    """(nc,) Where the points stand along the ground (m); of the others nothing is meant."""
    spent: Any
    """(powers, COUNTED K) Bounds of what the motors spend; none if no cost has corners."""
    duration: Any
    """Duration of the phase (s)."""
    stands: Floats
    """(nc,) 1 for points that stand, 0 for others."""
    rated: bool
    """Whether rates of torques matter."""

    @property
    def lengths(self) -> Floats:
        """Shares of the phase that its pieces last, (K,)."""
        return np.diff(breakpoints(self.v.shape[1]))

    def along(self, grid: Instants) -> tuple[Any, Any, Any]:
        """Positions and derivatives by the share of a piece at instants, (nv, N) each."""
        first, second, third = (self._derivative(grid, order) for order in range(3))
        return first, second, third

    def rates(self, grid: Instants) -> tuple[Any, Any]:
        """Derivatives of accelerations and forces by the share of a piece, (nv | forces, N)."""
        return self._derivative(grid, 3), self.forces(grid, lagrange_rates)

    def _derivative(self, grid: Instants, order: int) -> Any:
        values = casadi.horzcat(self.q[:, :-1], self.v, self.a)
        return values @ casadi.sparsify(casadi.DM(grid.matrix(DEGREE, order)))

    def forces(self, grid: Instants, basis: Callable[[Floats], Floats] = lagrange) -> Any:
        """Forces at instants, (forces, N)."""
        values = np.zeros((self.force.shape[1], grid.share.size))
        shares = basis(grid.share)
        for k in range(STAGES):
            values[STAGES * grid.piece + k, np.arange(grid.share.size)] = shares[k]
        return self.force @ casadi.sparsify(casadi.DM(values))


def path_variables(phases: list[PhaseUnknowns], p: int, grid: Instants, distance: Any) -> Any:
    """Variables of ``MotionFunctions.path`` at instants of a phase, (variables, N)."""
    own, count = phases[p], grid.share.size
    step = casadi.DM(own.lengths[grid.piece]).T * own.duration
    places, far = (casadi.repmat(each, 1, count) for each in (own.places, distance))
    begun, shares = sum(each.duration for each in phases[:p]), casadi.DM(phases_of(grid)).T
    time, stands = begun + shares * own.duration, casadi.repmat(casadi.DM(own.stands), 1, count)
    path = [*own.along(grid), own.forces(grid), places, stands, step, far, time, shares]
    return casadi.vertcat(*path, *(own.rates(grid) if own.rated else ()))


def breakpoints(pieces: int) -> Floats:
    """Shares of a phase between which one polynomial holds, (K + 1,): closer near both ends.

    Motions change fastest after a landing and before a foot leaves.
    """
    return np.asarray(0.5 * (1.0 - np.cos(np.pi * np.arange(pieces + 1) / pieces)))


def phases_of(grid: Instants) -> Floats:
    """Share of the phase that has gone by at instants, (N,)."""
    ends = breakpoints(grid.pieces)
    shares: Floats = ends[grid.piece] + np.diff(ends)[grid.piece] * grid.share
    return shares


def gauss_points(pieces: int, stages: int = STAGES) -> Instants:
    """Gauss points of all pieces of a phase."""
    return Instants.in_every_piece(pieces, *gauss(stages))


def looked_at(pieces: int, *, jumps: bool = False) -> Instants:
    """Gauss points of all pieces of a phase, where the pieces end, and where the first begins.

    And where all the others begin, if there a constraint jumps.
    """
    begin = beginnings(pieces if jumps else 1)
    return gauss_points(pieces).joined(endings(pieces)).joined(begin)


def beginnings(pieces: int) -> Instants:
    """The beginning of every piece."""
    return Instants.in_every_piece(pieces, np.zeros(1))


def endings(pieces: int) -> Instants:
    """The end of every piece."""
    return Instants.in_every_piece(pieces, np.ones(1))


@dataclass(eq=False)
class MotionProgram:
    """The program of a request.

    Unknowns are, phase by phase: positions at the ends of the pieces, velocities at their
    beginnings and parts of the accelerations (as they are in a phase of its usual duration), the
    forces that contact points and loops may exert at the Gauss points, in units of the weight, the
    places where points stand, bounds of what motors spend, if a cost has corners, and the duration;
    then the impulses of every landing; then the distance.
    """

    request: MotionRequest
    """What is asked."""
    functions: MotionFunctions
    """The robot at an instant, and at a landing."""
    grids: tuple[Instants, ...]
    """When the constraints of each phase hold; equations where there is a weight."""
    near: float = 0.0
    """Barrier parameter where guesses are nearly optima; zero elsewhere. IPOPT begins with it where
    the barrier only falls; one that follows the problem is chosen at each iteration."""
    falling: bool = False
    """Whether the barrier only falls there, which takes more iterations."""
    rounded: bool = False
    """Whether corners of costs are rounded off, instead of bounds of what the motors spend."""

    def __post_init__(self) -> None:
        request = self.request
        n = request.robot.nv
        sizes: list[int] = []
        for phase, stands in zip(request.phases, request.standing, strict=True):
            pieces = phase.pieces
            sizes += [n * pieces, n * pieces, STAGES * n * pieces]
            sizes += [len(self._exerted(stands)) * STAGES * pieces, len(stands.tangent)]
            sizes += [self.powers * COUNTED * pieces, 1]
        sizes += [len(self._struck(each)) for each in self.landings]
        self._ends = [0, *np.cumsum([*sizes, 1]).tolist()]
        self._build()

    @cached_property
    def landings(self) -> list[Standing]:
        """What holds the robot after each phase; nothing after the last of one that never repeats.

        Where no point comes down there is no impulse.
        """
        request = self.request
        after = [*request.standing[1:]]
        if request.repeat is not Repeat.NEVER:
            after.append(request.standing_after)
        nothing = Standing(frozenset(), (), ())
        return [
            following if following.points - before.points else nothing
            for before, following in zip(request.standing, after, strict=False)
        ]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._ends[-1])

    @property
    def falls(self) -> bool:
        """Whether the barrier only falls.

        Near a motion of least energy one that follows the problem led to a dearer one.
        """
        return self.falling or (self.near > 0.0 and self.powers > 0)

    @property
    def powers(self) -> int:
        """How many powers of motors have bounds."""
        return 0 if self.rounded else self.functions.powers

    def parts(self, x: Any) -> tuple[list[PhaseUnknowns], list[Any], Any]:
        """Return phases, impulses (forces,) and distance, of all unknowns."""
        request, robot = self.request, self.request.robot
        n = robot.nv
        pieces_of = [x[k:end] for k, end in pairwise(self._ends)]
        distance = pieces_of[-1]
        count = len(request.phases)
        own = [pieces_of[PARTS * p : PARTS * (p + 1)] for p in range(count)]
        last = casadi.reshape(own[-1][0], n, -1)[:, -1]
        start = request.start_position(last, distance)
        phases = []
        for phase, stands, usual, mine in zip(
            request.phases, request.standing, request.usual, own, strict=True
        ):
            pieces, piece = phase.pieces, usual * np.diff(breakpoints(phase.pieces))
            rate, bend = (np.diag(x) for x in (piece, np.tile(piece**2, STAGES)))
            q = casadi.horzcat(start, casadi.reshape(mine[0], n, pieces))
            exerted = self._exerted(stands)
            force = casadi.reshape(mine[3], len(exerted), STAGES * pieces)
            phases.append(
                PhaseUnknowns(
                    q=q,
                    v=casadi.reshape(mine[1], n, pieces) @ casadi.sparsify(casadi.DM(rate)),
                    a=casadi.reshape(mine[2], n, STAGES * pieces)
                    @ casadi.sparsify(casadi.DM(bend)),
                    force=self._spread(exerted) @ force,
                    places=self._placed(stands) @ mine[4],
                    spent=casadi.reshape(mine[5], self.powers, COUNTED * pieces),
                    duration=mine[6],
                    stands=np.isin(np.arange(robot.nc), list(stands.points)).astype(np.float64),
                    rated=self.functions.rated,
                )
            )
            start = q[:, -1]
        impulses = [
            self.functions.second * (self._spread(self._struck(each)) @ part)
            for each, part in zip(self.landings, pieces_of[PARTS * count : -1], strict=True)
        ]
        return phases, impulses, distance

    def _exerted(self, stands: Standing) -> list[int]:
        """Places of the unknown forces among those of points and loops: loops always pull."""
        return [*stands.forces, *range(2 * self.request.robot.nc, self.functions.forces)]

    def _struck(self, landing: Standing) -> list[int]:
        """Places of the unknown impulses likewise; none where no point comes down."""
        return self._exerted(landing) if landing.points else []

    def _spread(self, places: list[int]) -> Any:
        """Matrix that puts unknown forces in units of the weight where they belong."""
        spread = np.zeros((self.functions.forces, len(places)))
        spread[places, np.arange(len(places))] = self.request.robot.weight
        return casadi.sparsify(casadi.DM(spread))

    def _placed(self, stands: Standing) -> Any:
        """Matrix that puts unknown places where they belong."""
        placed = np.zeros((self.request.robot.nc, len(stands.tangent)))
        placed[list(stands.tangent), np.arange(len(stands.tangent))] = 1.0
        return casadi.sparsify(casadi.DM(placed))

    def _build(self) -> None:
        request, functions = self.request, self.functions
        x = casadi.MX.sym("x", self.size)
        phases, impulses, distance = self.parts(x)
        linear = [*self._gaps(phases), *self._linear(phases, distance)]
        numbers = np.array([request.slope, request.friction])
        copies, lower, upper, kept = [], [], [], []
        self.labels: list[tuple[Row, int, float]] = []
        self.counts: list[int] = []
        for p, grid in enumerate(self.grids):
            y = path_variables(phases, p, grid, distance)
            weight = grid.weight * grid.pieces
            copies.append(Copies.of(functions.path, weight, x, y, numbers))
            low, high = self.path_bounds(p, grid)
            used = np.isfinite(low) | np.isfinite(high)
            lower.append(low.T[used.T])
            upper.append(high.T[used.T])
            kept.append(used.T.ravel())
            self.counts.append(int(used.sum()))
            for i, k in np.argwhere(used.T).tolist():
                self.labels.append((functions.path_rows[k], p, float(phases_of(grid)[i])))
        for p, impulse in enumerate(impulses):
            before = phases[p]
            after, piece = self._after(phases, p)
            _, arriving, _ = before.along(endings(request.phases[p].pieces))
            own = before.lengths[-1] * before.duration
            y = casadi.vertcat(before.q[:, -1], arriving[:, -1], after, impulse, own, piece)
            copies.append(Copies.of(functions.landing, np.zeros(1), x, y, numbers))
            low, high = self._landing_bounds(p)
            used = np.isfinite(low) | np.isfinite(high)
            lower.append(low[used])
            upper.append(high[used])
            kept.append(used)
            self.labels += [(functions.landing_rows[k], p, 1.0) for k in np.flatnonzero(used)]
        if functions.joining is not None:
            for p, phase in enumerate(request.phases):
                joins = phase.pieces - 1
                if not joins:
                    continue
                y = casadi.vertcat(
                    path_variables(phases, p, endings(phase.pieces), distance)[:, :-1],
                    path_variables(phases, p, beginnings(phase.pieces), distance)[:, 1:],
                )
                copies.append(Copies.of(functions.joining, np.zeros(joins), x, y, numbers))
                rows = functions.joining_rows * joins
                lower.append(np.zeros(len(rows)))
                upper.append(np.zeros(len(rows)))
                kept.append(np.full(len(rows), True))
                self.labels += [(row, p, 1.0) for row in rows]
        spending = functions.rounded if self.rounded else functions.spending
        if spending is not None:
            for p, phase in enumerate(request.phases):
                grid = gauss_points(phase.pieces, COUNTED)
                weight = grid.weight * grid.pieces
                y = casadi.vertcat(path_variables(phases, p, grid, distance), phases[p].spent)
                copies.append(Copies.of(spending, weight, x, y, numbers))
                rows = [] if self.rounded else functions.spending_rows * grid.share.size
                lower.append(np.zeros(len(rows)))
                upper.append(np.full(len(rows), np.inf))
                kept.append(np.full(spending.count * grid.share.size, not self.rounded))
                self.labels += [(row, p, 1.0) for row in rows]
        blocks = BlockProgram(x, casadi.vertcat(*linear), copies)
        count = sum(each.numel() for each in linear)
        self.linear = count
        self._lower = np.concatenate([np.zeros(count), *lower])
        self._upper = np.concatenate([np.zeros(count), *upper])
        places = np.flatnonzero(np.concatenate([np.ones(count, bool), *kept])).tolist()
        f, g = blocks.value(x)
        self.value = casadi.Function("value", [x], [f, g[places]])
        self.slopes = casadi.Function("slopes", [x], [blocks.jacobian(x)[places, :]])
        self._blocks, self._places = blocks, places

    @cached_property
    def _solver(self) -> Ipopt:
        """IPOPT with the derivatives of the program: no need of it to satisfy equations only."""
        x, blocks, places = casadi.MX.sym("x", self.size), self._blocks, self._places
        f, g = blocks.value(x)
        price, prices = casadi.MX.sym("price"), casadi.MX.sym("prices", len(places))
        all_prices = casadi.MX(g.numel(), 1)
        all_prices[places] = prices
        return Ipopt(
            x, f, g[places], gradient=blocks.gradient(x), jacobian=blocks.jacobian(x)[places, :],
            hessian=(price, prices, blocks.hessian(x, price, all_prices)),
            settings=(NEAR | {"mu_init": self.near} if self.near else SETTINGS)
            | (MORE_ITERATIONS if self.falls else MORE_ITERATIONS | ADAPTIVE),
        )  # fmt: skip

    def _gaps(self, phases: list[PhaseUnknowns]) -> list[Any]:
        """Pieces join within a phase; positions join everywhere."""
        gaps = []
        for unknowns in phases:
            pieces = unknowns.q.shape[1] - 1
            q_end, v_end, _ = unknowns.along(endings(pieces))
            ratio = casadi.sparsify(casadi.DM(np.diag(1.0 / (pieces * unknowns.lengths))))
            begin, end = unknowns.v @ ratio, v_end @ ratio
            gaps += [casadi.vec(unknowns.q[:, 1:] - q_end), casadi.vec(begin[:, 1:] - end[:, :-1])]
        return gaps

    def _linear(self, phases: list[PhaseUnknowns], distance: Any) -> list[Any]:
        """What is asked of the whole motion, equations that are affine."""
        request = self.request
        total = sum(each.duration for each in phases)
        rows = []
        if request.repeat is not Repeat.NEVER:
            rows.append(phases[0].q[0, 0])  # where it begins does not matter
        if request.speed is not None:
            rows.append(distance - request.speed * total)
        if request.total is not None:
            rows.append(total - request.total)
        if request.start is not None:
            piece = phases[0].lengths[0] * phases[0].duration
            rows.append(phases[0].v[:, 0] - piece * casadi.DM(request.start.v))
        if request.end is not None:
            pieces = request.phases[-1].pieces
            _, v_end, _ = phases[-1].along(endings(pieces))
            rows.append(phases[-1].q[:, -1] - casadi.DM(request.end.q))
            piece = phases[-1].lengths[-1] * phases[-1].duration
            rows.append(v_end[:, -1] - piece * casadi.DM(request.end.v))
        return rows

    def _after(self, phases: list[PhaseUnknowns], p: int) -> tuple[Any, Any]:
        """Velocity just after a phase by the share of a piece, and the duration of that piece."""
        following = phases[(p + 1) % len(phases)]
        piece, start = following.lengths[0] * following.duration, following.v[:, 0]
        last = p + 1 == len(phases)
        return self.request.wrapped_velocity(start) if last else start, piece

    def path_bounds(self, p: int, grid: Instants) -> tuple[Floats, Floats]:
        """Scaled bounds of the constraints along a phase, (rows, N) each; infinite if unused."""
        request, rows = self.request, self.functions.path_rows
        stands, count = request.standing[p], grid.share.size
        lower = np.repeat([[row.lower] for row in rows], count, axis=1)
        upper = np.repeat([[row.upper] for row in rows], count, axis=1)
        weighed, ends = grid.weight > 0.0, grid.share == 1.0
        stage = np.where(weighed, np.arange(count) % STAGES, -1)
        free = np.full(count, True)  # whether the end of the piece is not given
        if request.end is not None and p + 1 == len(request.phases):
            free = grid.piece < grid.pieces - 1
        # Only what jumps where pieces join is looked at again where the next one begins.
        again = (grid.share == 0.0) & (grid.piece > 0)
        for k, (row, jumps) in enumerate(zip(rows, self.functions.jumps, strict=True)):
            used: Any = True
            # A point that stands has no acceleration. Where a piece ends it is on the ground and at
            # rest, in the place of two of four accelerations: nothing drifts. A given state at the
            # end says the same.
            if row.kind is Kind.NORMAL_REST:
                used = ((stage == 1) | (stage == 2)) & (row.of[0] in stands.normal)
            elif row.kind is Kind.TANGENT_REST:
                used = ((stage == 1) | (stage == 2)) & (row.of[0] in stands.tangent)
            elif row.kind is Kind.PLACE:
                # A given state at the end says where a point is, not that this is its place.
                begins = (grid.piece == 0) & (grid.share == 0.0)
                told = free | (row.of[0] not in request.never_lifted)
                used = (begins | (ends & told)) & (row.of[0] in stands.tangent)
            elif row.kind is Kind.NORMAL_STILL:
                used = ends & free & (row.of[0] in stands.normal)
            elif row.kind is Kind.TANGENT_STILL:
                used = ends & free & (row.of[0] in stands.tangent)
            elif row.kind is Kind.MOTION:
                used = weighed
            elif row.kind is Kind.LOOP_REST:
                used = (stage == 1) | (stage == 2)
            elif row.kind in {Kind.LOOP_STILL, Kind.LOOP_CLOSED}:
                used = ends & free
            elif row.kind is Kind.PUSH:
                used = row.of[0] in stands.normal
                lower[k] = request.force_margin_of(p, row.of[0]) / request.robot.weight
            elif row.kind in {Kind.RANGE, Kind.OWN}:
                begins = (grid.piece == 0) & (grid.share == 0.0) & (p == 0)
                used = ~(ends & ~free) & ~(begins & (request.start is not None)) | jumps
            elif row.kind is Kind.FRICTION:
                used = not stands.points.isdisjoint(row.of)
            elif row.kind is Kind.HEIGHT:
                used = row.of[0] not in stands.points
                lower[k] = request.clearance_of(p, row.of[0], phases_of(grid))
                if row.of[0] in stands.normal:
                    used = ends & free
                    lower[k] = upper[k] = 0.0
            if not np.all(lower[k] == upper[k]):
                kept = FROM_STOPS if row.kind is Kind.RANGE else FROM_LIMITS
                if row.kind is Kind.OWN or (row.kind is Kind.FRICTION and request.friction == 0.0):
                    kept = 0.0
                span = np.minimum(kept, 0.5 * (upper[k] - lower[k]))
                lower[k], upper[k] = lower[k] + span, upper[k] - span
            used = used & (jumps | ~again)
            lower[k] = np.where(used, lower[k], -np.inf)
            upper[k] = np.where(used, upper[k], np.inf)
        return lower, upper

    def _landing_bounds(self, p: int) -> tuple[Floats, Floats]:
        """Scaled bounds of the constraints where a phase ends, (rows,) each; infinite if unused."""
        request, rows = self.request, self.functions.landing_rows
        before = request.standing[p]
        last = p + 1 == len(request.phases)
        after = request.standing_after if last else request.standing[p + 1]
        landing = self.landings[p]
        fresh, gone = after.points - before.points, before.points - after.points
        lower = np.array([row.lower for row in rows])
        upper = np.array([row.upper for row in rows])
        for k, row in enumerate(rows):
            point = row.of[0] if row.of else -1
            used = {
                Kind.MOMENTUM: True,
                Kind.TOUCH: point in fresh and point in after.normal,
                Kind.ARRIVE: point in fresh,
                Kind.NORMAL_STOP: point in landing.normal,
                Kind.TANGENT_STOP: point in landing.tangent,
                Kind.LOOP_STOP: bool(landing.points),
                Kind.LEAVE: bool(fresh) and point in gone,
                Kind.IMPULSE: point in landing.normal,
                Kind.IMPULSE_FRICTION: not landing.points.isdisjoint(row.of),
            }[row.kind]
            if row.kind is Kind.ARRIVE:
                upper[k] = -request.landing_speed
            if not used:
                lower[k], upper[k] = -np.inf, np.inf
        return lower, upper

    def multipliers_of(self, other: MotionProgram, multipliers: Floats) -> Floats:
        """Those of another program that has some of the instants of this one: of the others zero.

        The instants of a phase that both have are the first ones.
        """
        places = [0, other.linear, *(other.linear + np.cumsum(other.counts)).tolist()]
        parts = [multipliers[i:j] for i, j in pairwise(places)]
        fresh = [0, *(own - its for own, its in zip(self.counts, other.counts, strict=True))]
        parts = [np.append(part, np.zeros(new)) for part, new in zip(parts, fresh, strict=True)]
        return np.concatenate([*parts, multipliers[places[-1] :]])

    def solve(self, guess: Floats, multipliers: Floats | None = None) -> tuple[Floats, Floats, Any]:
        """Solve from a guess; return the unknowns, the multipliers and what IPOPT tells."""
        lower, upper = self._bounds
        more = {} if multipliers is None else {"lam_g0": multipliers}
        found, told = self._solver.solve(
            x0=np.clip(guess, lower, upper), lbx=lower, ubx=upper, lbg=self._lower,
            ubg=self._upper, **more,
        )  # fmt: skip
        return np.array(found["x"]).ravel(), np.array(found["lam_g"]).ravel(), told

    @cached_property
    def _bounds(self) -> tuple[Floats, Floats]:
        """Bounds of the unknowns: of durations and the distance."""
        lower, upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        for p, phase in enumerate(self.request.phases):
            place = self._ends[PARTS * (p + 1) - 1]
            lower[place], upper[place] = phase.duration
        lower[-1], upper[-1] = self.request.distance
        return lower, upper

    def missing(self, unknowns: Floats) -> tuple[float, float]:
        """Largest violations: of equations, and of limits, those of durations among them."""
        missing, (lower, upper) = np.abs(self.violations(unknowns)), self._bounds
        exact = self._lower == self._upper
        beyond = np.maximum(lower - unknowns, unknowns - upper).max()
        return (
            float(missing[exact].max(initial=0.0)),
            float(max(beyond, missing[~exact].max(initial=0.0))),
        )

    def violations(self, unknowns: Floats) -> Floats:
        """Scaled distances of the constraints outside of their bounds; positive if too low."""
        return outside(np.array(self.value(unknowns)[1]).ravel(), self._lower, self._upper)

    def polished(self, unknowns: Floats) -> Floats:
        """Satisfy the equations to rounding, by the least change of all that is not given.

        What is given is returned if that would break a limit by more than it breaks anything.
        """
        free = self._bounds[0] < self._bounds[1]
        found = satisfied(
            unknowns, lambda x: np.array(self.value(x)[1]).ravel(), self.slopes,
            (self._lower, self._upper), free,
        )  # fmt: skip
        before, after = (max(self.missing(each)) for each in (unknowns, found))
        return found if is_no_worse(after, before) else unknowns

    def packed(
        self, positions: list[Floats], velocities: list[Floats], accelerations: list[Floats],
        forces: list[Floats], durations: Floats, distance: float,
        impulses: list[Floats] | None = None,
    ) -> Floats:  # fmt: skip
        """Unknowns of a motion: at the ends of pieces, their beginnings and the Gauss points.

        Parameters
        ----------
        positions, velocities : list of (nv, K) array
            At the ends of the pieces, and at their beginnings.
        accelerations : list of (nv, K, STAGES) array
            At the Gauss points.
        forces : list of (forces, STAGES K) array
            Of contact points and loops, at the Gauss points (N).
        durations : (phases,) array
            Durations (s).
        distance : float
            Distance (m).
        impulses : list of (forces,) array, optional
            Impulses of every landing (N s).
        """
        nodes, _ = gauss(STAGES)
        basis = np.polynomial.legendre.legvander(2.0 * nodes - 1.0, STAGES - 1)
        request, found = self.request, []
        for p in range(len(request.phases)):
            rate = durations[p] / request.usual[p]
            n, pieces, _ = accelerations[p].shape
            values = np.moveaxis(accelerations[p], 2, 0).reshape(STAGES, -1)
            parts = np.linalg.solve(basis, values).reshape(STAGES, n, pieces)
            found += [
                positions[p].ravel(order="F"), rate * velocities[p].ravel(order="F"),
                rate**2 * parts.transpose(0, 2, 1).ravel(),
                (forces[p][self._exerted(request.standing[p])] / request.robot.weight).ravel("F"),
                self._places_at(positions[p][:, 0], request.standing[p]),
                np.zeros(self.powers * COUNTED * pieces), durations[p : p + 1],
            ]  # fmt: skip
        unit = request.robot.weight * self.functions.second
        given = impulses or [np.zeros(self.functions.forces)] * len(self.landings)
        found += [
            np.asarray(impulse)[self._struck(each)] / unit
            for each, impulse in zip(self.landings, given, strict=True)
        ]
        return self.counted(np.concatenate([*found, [distance]]))

    def counted(self, unknowns: Floats) -> Floats:
        """Return unknowns whose bounds of what motors spend are what they spend."""
        if self.functions.spending is None or self.rounded:
            return unknowns
        found, (phases, _, distance) = unknowns.copy(), self.parts(casadi.DM(unknowns))
        request = self.request
        for p, phase in enumerate(request.phases):
            grid = gauss_points(phase.pieces, COUNTED)
            y = path_variables(phases, p, grid, distance)
            y = casadi.vertcat(y, casadi.DM.zeros(self.powers, grid.share.size))
            numbers = casadi.repmat(casadi.DM([request.slope, request.friction]), 1, y.shape[1])
            _, missing = self.functions.spending.value.map(y.shape[1])(y, numbers)
            # Rows are those of one power and then those of the other, for every cost.
            spent = -np.array(missing).T.reshape(y.shape[1], -1, 2, request.robot.nu).min(axis=2)
            found[self._ends[PARTS * p + 5] : self._ends[PARTS * p + 6]] = spent.ravel()
        return found

    def _places_at(self, q: Floats, stands: Standing) -> Floats:
        """Where the points that stand are along the ground."""
        robot = self.request.robot
        along = np.array([np.cos(self.request.slope), np.sin(self.request.slope)])
        centers, angles = contact_positions(robot, q), link_poses(robot, q).angle
        rolled = robot.model.contact_radius * angles[robot.model.contact_link]
        places: Floats = (centers @ along - rolled)[list(stands.tangent)]
        return places

    def pieces(self, unknowns: Floats) -> list[tuple[Floats, Floats, Floats]]:
        """Coefficients (K, DEGREE + 1, nv), forces (STAGES K, forces) and breakpoints (s)."""
        phases, _, _ = self.parts(casadi.DM(unknowns))
        n, found = self.request.robot.nv, []
        for unknown in phases:
            pieces = unknown.v.shape[1]
            ends = float(unknown.duration) * breakpoints(pieces)
            q, v, a = (np.array(part) for part in (unknown.q[:, :-1], unknown.v, unknown.a))
            own = np.diff(ends)
            values = np.concatenate([q, v / own, a / np.tile(own, STAGES) ** 2], axis=1)
            values = values.reshape(n, DEGREE + 1, pieces).transpose(2, 1, 0)
            terms = [coefficients(each, length) for each, length in zip(values, own, strict=True)]
            found.append((np.array(terms), np.array(unknown.force).T, ends))
        return found
