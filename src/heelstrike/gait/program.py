"""The nonlinear program on a grid of phases, and its solution by IPOPT with exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from heelstrike.gait.clearance import ClearanceProfile
from heelstrike.gait.ipopt import Ipopt
from heelstrike.gait.transcription import Group, Transcription

Floats = NDArray[np.float64]

CONVERGED = 1e-8
"""Tolerance of IPOPT on scaled constraints and optimality."""
MOST_ITERATIONS = 100
"""Iterations after which a start is given up; those that succeed take about 25."""


def lobatto(intervals: int) -> tuple[Floats, Floats]:
    """Nodes on [0, 1], ends included, and weights of Gauss-Lobatto quadrature.

    The rule is exact for polynomials of degree ``2 * intervals - 1``, and its nodes are densest at
    the ends of the step, where the clearance of the swing foot is decided.
    """
    last = np.zeros(intervals + 1)
    last[-1] = 1.0
    inner = np.sort(legendre.Legendre(last).deriv().roots().real)
    inner = 0.5 * (inner - inner[::-1])  # symmetric to the last digit
    nodes = np.concatenate([[-1.0], inner, [1.0]])
    weights = 2.0 / (intervals * (intervals + 1) * legendre.legval(nodes, last) ** 2)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@dataclass(frozen=True)
class Solution:
    """Where IPOPT stopped.

    Attributes
    ----------
    unknowns : (n,) float
        The unknowns of the transcription.
    objective : float
        Value of the objective.
    converged : bool
        Whether it is an optimum within the tolerance.
    status : str
        IPOPT's own word for how it ended.
    iterations : int
        Number of iterations.
    multipliers : (m,) float
        Multipliers of the scaled constraints, in the order of :meth:`Program.values`.
    """

    unknowns: Floats
    objective: float
    converged: bool
    status: str
    iterations: int
    multipliers: Floats


PRICE_OF_EQUATIONS = 1000.0
"""Price of violating an equation in an elastic program; that of an inequality is 1. Equations say
what a periodic step is, so that they give way last."""
RESERVE = 1e-6
"""Scaled distance kept from every bound along the path, for the time between the nodes."""

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


class Program:
    """The program on a grid.

    Parameters
    ----------
    transcription : Transcription
        The functions.
    phases : (N,) float
        Phases at which the constraints along the path hold.
    weights : (N,) float
        Quadrature weights of the phases; zero for phases that only carry constraints.
    profile : ClearanceProfile
        Shape of the swing foot's clearance.
    elastic : bool
        Let every constraint be violated and minimise the sum of the scaled violations instead of
        the effort: shows which constraints are in conflict when there is no solution.
    """

    def __init__(
        self,
        transcription: Transcription,
        phases: Floats,
        weights: Floats,
        *,
        profile: ClearanceProfile,
        elastic: bool = False,
    ) -> None:
        self.transcription = transcription
        self.phases = phases
        self.weights = weights
        self.profile = profile
        self.elastic = elastic
        self._lower, self._upper = self._constraint_bounds()
        self._solver = self._build()

    def refined(self, phases: Floats) -> Program:
        """Return the same program with more phases that only carry constraints."""
        return Program(
            self.transcription,
            np.concatenate([self.phases, phases]),
            np.concatenate([self.weights, np.zeros(phases.size)]),
            profile=self.profile,
        )

    def relaxed(self) -> Program:
        """Return the elastic variant of the program."""
        return Program(
            self.transcription, self.phases, self.weights, profile=self.profile, elastic=True
        )

    def path_bounds(self, phases: Floats) -> tuple[Floats, Floats]:
        """Scaled bounds of the constraints along the path at phases, (rows, N) each."""
        rows = self.transcription.path.rows
        lower = np.array([[row.lower] for row in rows]).repeat(len(phases), axis=1)
        upper = np.array([[row.upper] for row in rows]).repeat(len(phases), axis=1)
        clearance = self.clearance(phases)
        for k, row in enumerate(rows):
            if row.group is Group.CLEARANCE:
                lower[k] = clearance
        return lower, upper

    def clearance(self, phases: Floats) -> Floats:
        """Least height of the swing foot at phases (m); none at the ends, where it stands."""
        height = self.transcription.request.clearance * self.profile.height(phases)
        return np.where((phases > 0.0) & (phases < 1.0), height, -np.inf)

    def _constraint_bounds(self) -> tuple[Floats, Floats]:
        touchdown = self.transcription.touchdown.rows
        lower, upper = self.path_bounds(self.phases)
        reserve = np.minimum(RESERVE, 0.5 * (upper - lower))
        return (
            np.concatenate([[row.lower for row in touchdown], (lower + reserve).ravel(order="F")]),
            np.concatenate([[row.upper for row in touchdown], (upper - reserve).ravel(order="F")]),
        )

    def _build(self) -> Ipopt:
        path, touchdown = self.transcription.path, self.transcription.touchdown
        count, size = len(self.phases), self.transcription.size
        at_touchdown = len(touchdown.rows)
        total = at_touchdown + len(path.rows) * count
        unknowns = casadi.MX.sym("unknowns", size + (2 * total if self.elastic else 0))
        x, excess = unknowns[:size], unknowns[size:]
        phases = casadi.DM(self.phases).T
        weights = casadi.DM(self.weights)

        costs, values = path.value.map(count)(x, phases)
        f = costs @ weights
        f_slope = path.gradient.map(count)(x, phases)[1] @ weights
        g = casadi.vertcat(touchdown.value(x)[1], casadi.vec(values))
        slopes = casadi.horzsplit(path.jacobian.map(count)(x, phases)[1], size)
        g_slope = casadi.vertcat(touchdown.jacobian(x)[1], *slopes)

        f_multiplier = casadi.MX.sym("f_multiplier")
        g_multiplier = casadi.MX.sym("g_multiplier", total)
        multipliers = casadi.vertcat(
            f_multiplier * weights.T,
            casadi.reshape(g_multiplier[at_touchdown:], len(path.rows), count),
        )
        if self.elastic:
            multipliers[0, :] = 0.0
        hessian = touchdown.hessian(x, casadi.vertcat(0.0, g_multiplier[:at_touchdown]))
        for block in casadi.horzsplit(path.hessian.map(count)(x, phases, multipliers), size):
            hessian = hessian + block

        if self.elastic:
            # Each constraint may be exceeded upwards or downwards; the sum of that is minimised.
            price = np.where(self._lower == self._upper, PRICE_OF_EQUATIONS, 1.0)
            prices = casadi.DM(np.concatenate([price, price]))
            f = casadi.dot(prices, excess)
            f_slope = casadi.vertcat(casadi.DM.zeros(size), prices)
            g = g + excess[:total] - excess[total:]
            identity = casadi.DM.eye(total)
            g_slope = casadi.horzcat(g_slope, identity, -identity)
            hessian = casadi.diagcat(hessian, casadi.DM(2 * total, 2 * total))
        none = casadi.MX.sym("none", 0)  # nlpsol's parameters, which we have no use for
        derivatives = {
            "grad_f": casadi.Function(
                "grad_f", [unknowns, none], [f, f_slope], ["x", "p"], ["f", "grad_f_x"]
            ),
            "jac_g": casadi.Function(
                "jac_g", [unknowns, none], [g, g_slope], ["x", "p"], ["g", "jac_g_x"]
            ),
            "hess_lag": casadi.Function(
                "hess_lag",
                [unknowns, none, f_multiplier, g_multiplier],
                [hessian],
                ["x", "p", "lam_f", "lam_g"],
                ["hess_gamma_x_x"],
            ),
        }
        return Ipopt({"x": unknowns, "f": f, "g": g}, {**SETTINGS, **derivatives})

    def solve(self, guess: Floats) -> Solution:
        """Solve from a guess of the unknowns.

        An elastic program starts with the violations of the guess taken up by the excesses.
        """
        request = self.transcription.request
        size = self.transcription.size
        lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
        lower[-2], upper[-2] = request.duration_bounds
        lower[-1], upper[-1] = request.length_bounds
        start = np.clip(guess, lower, upper)
        if self.elastic:
            missing = self.violations(start)
            start = np.concatenate([start, np.maximum(missing, 0.0), np.maximum(-missing, 0.0)])
            lower = np.concatenate([lower, np.zeros(2 * missing.size)])
            upper = np.concatenate([upper, np.full(2 * missing.size, np.inf)])
        found, statistics = self._solver.solve(
            x0=start, lbx=lower, ubx=upper, lbg=self._lower, ubg=self._upper
        )
        return Solution(
            unknowns=np.array(found["x"]).ravel()[:size],
            objective=float(found["f"]),
            converged=statistics["return_status"] == "Solve_Succeeded",
            status=str(statistics["return_status"]).replace("_", " ").lower(),
            iterations=int(statistics["iter_count"]),
            multipliers=np.array(found["lam_g"]).ravel(),
        )

    def values(self, unknowns: Floats) -> Floats:
        """Scaled values of all constraints: those at touchdown, then phase by phase."""
        path, touchdown = self.transcription.path, self.transcription.touchdown
        _, along = path.value.map(len(self.phases))(unknowns, self.phases[None, :])
        return np.concatenate(
            [np.array(touchdown.value(unknowns)[1]).ravel(), np.array(along).ravel(order="F")]
        )

    def violations(self, unknowns: Floats) -> Floats:
        """Scaled distances of all constraints outside of their bounds; positive if too low."""
        values = self.values(unknowns)
        return np.maximum(self._lower - values, 0.0) - np.maximum(values - self._upper, 0.0)
