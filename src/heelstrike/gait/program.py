"""The nonlinear program of a step, and its solution by IPOPT with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
import scipy.sparse.linalg

from heelstrike.field_texts import dataclass
from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.polynomials import Instants, coefficients, gauss, lobatto
from heelstrike.gait.request import Request
from heelstrike.gait.starts import Start
from heelstrike.gait.transcription import Group, Row, Transcription
from heelstrike.interruption import deferred_interrupts
from heelstrike.robot.model import Floats

CONVERGED = 1e-8
"""Tolerance of IPOPT on scaled constraints and optimality."""
MOST_ITERATIONS = 100
"""Iterations after which a start is given up; those that succeed take about 25."""
POINTS = 4
"""Gauss points in every piece of a motion that must satisfy an equation along the path."""
PRICE_OF_EQUATIONS = 1000.0
"""Price of violating an equation in an elastic program; that of an inequality is 1. Equations say
what a periodic step is, so that they give way last."""
SHIFT = 1e-12
"""Added to the squares of the singular values of equations (scaled) that may be dependent."""
RESERVE = 1e-6
"""Scaled distance kept from every bound along the path, for the time between the instants."""

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
        pieces, degree, (nodes, weights) = 1, 3, lobatto(request.intervals)
    else:
        pieces, degree, (nodes, weights) = request.intervals, POINTS + 1, gauss(POINTS)
    return degree, Instants(
        pieces,
        np.repeat(np.arange(pieces), nodes.size),
        np.tile(nodes, pieces),
        np.tile(weights, pieces) / pieces,
    )


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
    """(m,) Multipliers of the scaled constraints, in the order of :meth:`Program.labelled_rows`."""


@dataclass(eq=False)
class Program:
    """The program on a mesh of equal pieces.

    Unknowns are, of all free coordinates, the positions at the end and the velocities at the
    beginning of every piece, and the parts of its acceleration; then the step's duration and
    length. The positions at its beginning are the mirror image of those at its end. Where a piece
    ends, the next one begins: those equations always hold, also in an elastic program.
    """

    transcription: Transcription
    """The functions."""
    profile: ClearanceProfile
    """Shape of the swing foot's clearance."""
    degree: int
    """Degree of the polynomials."""
    instants: Instants
    """When the constraints along the path hold. Equations among them hold where the instants have a
    weight; the others only carry inequalities."""
    elastic: bool = False
    """Let every constraint be violated and minimise the sum of the scaled violations instead of the
    effort: shows which constraints are in conflict when there is no solution."""

    def __post_init__(self) -> None:
        self.request = self.transcription.request
        n, pieces = self.transcription.size, self.instants.pieces
        self._ends = Instants(pieces, np.arange(pieces), np.ones(pieces), np.zeros(pieces))
        sizes = [n * pieces, n * pieces, n * pieces * (self.degree - 1), 1, 1]
        self._places = [0, *np.cumsum(sizes).tolist()]
        self._gaps = n * (2 * pieces - 1)
        self._lower, self._upper = self._bounds()
        self._build()

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
            if row.group is Group.CLEARANCE:
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
        """Positions, velocities and parts of the acceleration, (n, ...); duration and length."""
        if isinstance(unknowns, np.ndarray):
            unknowns = casadi.DM(unknowns)
        n = self.transcription.size
        q, v, a, duration, length = (unknowns[k:end] for k, end in pairwise(self._places))
        q, v, a = (casadi.reshape(part, n, -1) for part in (q, v, a))
        start = self.transcription.mirror.position(q[:, -1])
        return casadi.horzcat(start, q), v, a, duration, length

    def along(self, unknowns: Any, instants: Instants) -> tuple[Any, Any, Any]:
        """Positions, velocities and accelerations at instants, (n, N) each."""
        q, v, a, duration, _ = self._parts(unknowns)
        h = duration / instants.pieces
        values = casadi.horzcat(q[:, :-1], h * v, h**2 * a)
        position, velocity, acceleration = (
            values @ casadi.sparsify(casadi.DM(instants.matrix(self.degree, order)))
            for order in range(3)
        )
        return position, velocity / h, acceleration / h**2

    def motion(self, unknowns: Floats, instants: Instants) -> list[Floats]:
        """Return the numbers of :meth:`along`."""
        return [np.array(part) for part in self.along(unknowns, instants)]

    def at_touchdown(self, unknowns: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Return q(T), v(T), v(0), duration and length, as the transcription takes them."""
        q, v, _, duration, length = self._parts(unknowns)
        _, ends, _ = self.along(unknowns, self._ends)
        return q[:, -1], ends[:, -1], v[:, 0], duration, length

    def effort(self, unknowns: Floats) -> float:
        """∫ΓᵀΓ dt over the step, in N²m²s."""
        return float(self._evaluated(unknowns)[0])

    def pieces(self, unknowns: Floats) -> Floats:
        """Coefficients of the free coordinates in the time of each piece, (K, degree + 1, n)."""
        n, count = self.transcription.size, self.instants.pieces
        q, v, a, duration, _ = (np.array(part) for part in self._parts(unknowns))
        values = np.concatenate([q[:, :-1], v, a], axis=1).reshape(n, self.degree + 1, count)
        return coefficients(values.transpose(2, 1, 0), float(duration[0, 0]) / count)

    def _build(self) -> None:
        gaps, total = self._gaps, self._lower.size - self._gaps
        unknowns = casadi.MX.sym("unknowns", self.size + (2 * total if self.elastic else 0))
        x = unknowns[: self.size]
        f, g = self._evaluated(x)
        if self.request.free_step:
            f = f / x[-1]
        if self.elastic:
            # Each constraint may be exceeded upwards or downwards; the sum of that is minimised.
            low, high = unknowns[self.size : -total], unknowns[-total:]
            price = np.where(self._lower == self._upper, PRICE_OF_EQUATIONS, 1.0)[gaps:]
            f = casadi.dot(price, low + high)
            g = casadi.vertcat(g[:gaps], g[gaps:] + low - high)
        self._solver = Ipopt({"x": unknowns, "f": f, "g": g}, SETTINGS)

    def solve(self, guess: Floats) -> Solution:
        """Solve from a guess of the unknowns.

        An elastic program starts with the violations of the guess taken up by the excesses.
        """
        size, more = self.size, 2 * (self._lower.size - self._gaps) if self.elastic else 0
        low, high = np.array([self.request.duration_bounds, self.request.length_bounds]).T
        lower = np.concatenate([np.full(size - 2, -np.inf), low, np.zeros(more)])
        upper = np.concatenate([np.full(size - 2, np.inf), high, np.full(more, np.inf)])
        start = np.clip(guess, lower[:size], upper[:size])
        if self.elastic:
            missing = self.violations(start)
            start = np.concatenate([start, np.maximum(missing, 0.0), np.maximum(-missing, 0.0)])
        found, statistics = self._solver.solve(
            x0=start, lbx=lower, ubx=upper, lbg=self._lower, ubg=self._upper
        )
        return Solution(
            unknowns=np.array(found["x"]).ravel()[:size],
            objective=float(found["f"]),
            converged=statistics["return_status"] == "Solve_Succeeded",
            ended=str(statistics["return_status"]).replace("_", " ").lower(),
            multipliers=np.array(found["lam_g"]).ravel()[self._gaps :],
        )

    def sampled(self, start: Start) -> Floats:
        """Unknowns of a motion to start from."""
        q, v, a = start.motion(np.linspace(0.0, 1.0, self.instants.pieces + 1))
        rest = np.zeros(self._places[3] - self._places[2])
        rest[: v[:, 1:].size] = a[:, 1:].ravel(order="F")
        parts = [part.ravel(order="F") for part in (q[:, 1:], v[:, :-1], rest)]
        return np.concatenate([*parts, [start.duration, start.length]])

    def _evaluated(self, x: Any) -> tuple[Any, Any]:
        """Effort, and gaps between the pieces followed by scaled values of the constraints."""
        q, v, _, _, _ = self._parts(x)
        q_end, v_end, _ = self.along(x, self._ends)
        gaps = casadi.veccat(q[:, 1:] - q_end, v[:, 1:] - v_end[:, :-1])
        count = self.instants.share.size
        effort, along = self.transcription.path.map(count)(*self.along(x, self.instants))
        touchdown = self.transcription.touchdown(*self.at_touchdown(x))
        cost = x[-2] * (effort @ casadi.DM(self.instants.weight))
        return cost, casadi.veccat(gaps, touchdown, along)

    def violations(self, unknowns: Floats) -> Floats:
        """Scaled distances of the constraints outside of their bounds; positive if too low."""
        values = np.array(self._evaluated(unknowns)[1]).ravel()
        missing = np.maximum(self._lower - values, 0.0) - np.maximum(values - self._upper, 0.0)
        return missing[self._gaps :]

    def polished(self, unknowns: Floats) -> Floats:
        """Satisfy the equations to rounding, by the least change of the unknowns."""
        x = casadi.MX.sym("x", self.size)
        exact = np.flatnonzero(self._lower == self._upper).tolist()
        residual = self._evaluated(x)[1][exact] - casadi.DM(self._lower[exact])
        equations = casadi.Function("equations", [x], [residual, casadi.jacobian(residual, x)])
        step = np.ptp([self.request.duration_bounds, self.request.length_bounds], axis=1) > 0.0
        free = np.append(np.full(self.size - 2, True), step)
        polished = unknowns.copy()
        for _ in range(3):
            missing, slope = equations(polished)
            rows = slope.sparse()[:, free]
            # Equations may depend on each other: then, and only then, does the shift matter.
            normal = rows @ rows.T + SHIFT * scipy.sparse.identity(residual.numel(), format="csc")
            polished[free] -= rows.T @ scipy.sparse.linalg.spsolve(
                normal, np.array(missing).ravel()
            )
        return polished


class Ipopt:
    """A nonlinear program for IPOPT, in a form that Ctrl-C can stop.

    CasADi looks for signals in the functions that IPOPT evaluates, takes what they raise for a
    failure of the function, and returns; nobody learns that there was a Ctrl-C. So the signal is
    held back, and IPOPT stopped after the iteration in which it came.

    Parameters
    ----------
    problem : mapping
        CasADi expressions of the unknowns ``x``, the objective ``f`` and the constraints ``g``.
    options : mapping
        Options of ``casadi.nlpsol``.
    """

    def __init__(self, problem: Mapping[str, Any], options: Mapping[str, Any]) -> None:
        self._watch = _Watch(problem["x"].numel(), problem["g"].numel())
        self._solver = casadi.nlpsol(
            "gait", "ipopt", dict(problem), {**options, "iteration_callback": self._watch}
        )

    def solve(self, **arguments: Any) -> tuple[Any, Any]:
        """Solve it; return what ``casadi.nlpsol`` found, and its statistics.

        Raises
        ------
        KeyboardInterrupt
            At Ctrl-C, once the iteration under way has ended.
        """
        with deferred_interrupts() as interrupted:
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
