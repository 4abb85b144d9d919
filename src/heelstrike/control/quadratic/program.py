"""A quadratic programme as compiled code sees it: its data, its answer, its certificate."""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, cell
from heelstrike.robot.model import Floats, Integers

# What `Program.status` says.
SOLVED = 0
INFEASIBLE = 1
NOT_CONVEX = 2
TOO_MANY_ITERATIONS = 3


class Program(Bundle):
    """Least ½ xᵀH x + gᵀx with C x ≥ b.

    Of the m rows of C the first `equalities` hold with equality. Rows beyond `count` are not there.

    Attributes
    ----------
    hessian : (n, n) float
        H, symmetric and positive definite.
    gradient : (n,) float
        g.
    rows : (m, n) float
        C.
    bound : (m,) float
        b.
    level : (m,) int
        When a row may be given up if not all can be kept: never at 0, the greatest first.
    count, equalities : int
        Rows that count, and equalities among them.
    x : (n,) float
        The answer.
    multiplier : (m,) float
        Those of the rows, H x + g = Cᵀ multiplier; of inequalities not negative.
    status, iterations : int
        How solving it ended (0 solved, 1 infeasible, 2 not convex, 3 too many iterations), and
        after how many rows were taken up or dropped.
    relaxed : int
        Levels that were given up; see :func:`heelstrike.control.solve_or_relax`.
    stationarity, violation, complementarity : float
        The certificate: how far the answer is from the conditions of Karush, Kuhn and Tucker,
        relative to the size of the data.
    inverse, triangle : (n, n) float
    step, along, turned, dual : float
    active : (n,) int
    given_up : (m,) int
        Scratch of the solver.
    """

    hessian: Floats = array("n", "n")
    gradient: Floats = array("n")
    rows: Floats = array("m", "n")
    bound: Floats = array("m")
    level: Integers = array("m", of=int)
    count: int = cell(int)
    equalities: int = cell(int)
    x: Floats = array("n")
    multiplier: Floats = array("m")
    status: int = cell(int)
    iterations: int = cell(int)
    relaxed: int = cell(int)
    stationarity: float = cell(float)
    violation: float = cell(float)
    complementarity: float = cell(float)
    inverse: Floats = array("n", "n")
    triangle: Floats = array("n", "n")
    step: Floats = array("n")
    along: Floats = array("n")
    turned: Floats = array("n")
    dual: Floats = array("n + 1")
    active: Integers = array("n", of=int)
    given_up: Integers = array("m", of=int)
