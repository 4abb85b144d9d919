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
    """

    hessian: Floats = array("n", "n")
    """H, symmetric and positive definite."""
    gradient: Floats = array("n")
    """g."""
    rows: Floats = array("m", "n")
    """C."""
    bound: Floats = array("m")
    """b."""
    level: Integers = array("m", of=int)
    """When a row may be given up if not all can be kept: never at 0, the greatest first."""
    count: int = cell(int)
    equalities: int = cell(int)
    """count, equalities: Rows that count, and equalities among them."""
    x: Floats = array("n")
    """The answer."""
    multiplier: Floats = array("m")
    """Those of the rows, H x + g = Cᵀ multiplier; of inequalities not negative."""
    status: int = cell(int)
    iterations: int = cell(int)
    """status, iterations: How solving it ended (0 solved, 1 infeasible, 2 not convex, 3 too many
    iterations), and after how many rows were taken up or dropped."""
    relaxed: int = cell(int)
    """Levels that were given up; see :func:`heelstrike.control.solve_or_relax`."""
    stationarity: float = cell(float)
    violation: float = cell(float)
    complementarity: float = cell(float)
    """stationarity, violation, complementarity: The certificate: how far the answer is from the
    conditions of Karush, Kuhn and Tucker, relative to the size of the data."""
    inverse: Floats = array("n", "n")
    triangle: Floats = array("n", "n")
    step: Floats = array("n")
    along: Floats = array("n")
    turned: Floats = array("n")
    dual: Floats = array("n + 1")
    active: Integers = array("n", of=int)
    given_up: Integers = array("m", of=int)
    """inverse, triangle, step, along, turned, dual, active, given_up: Scratch of the solver."""
