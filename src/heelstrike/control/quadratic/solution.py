"""solve_quadratic_program(): the solver of the whole-body controllers, from Python."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.control.quadratic.dual_active_set import solve_or_relax
from heelstrike.control.quadratic.program import (
    INFEASIBLE,
    NOT_CONVEX,
    SOLVED,
    Program,
)
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

MOST_EQUALITIES = 62
"""Equalities of a programme at most: their signs are the bits of a word."""


@dataclass(frozen=True, kw_only=True)
class QuadraticSolution:
    """The answer to a quadratic programme, with its certificate."""

    x: Floats
    """(n,) The answer."""
    multiplier: Floats
    """(m,) Those of the rows: H x + g = Cᵀ multiplier."""
    iterations: int
    """Rows taken up or dropped on the way."""
    stationarity: float
    violation: float
    complementarity: float
    """stationarity, violation, complementarity: How far x and multipliers are from the conditions
    of Karush, Kuhn and Tucker, found from the data alone and relative to its size."""


@takes(ControllerError)
def solve_quadratic_program(
    hessian: ArrayLike,
    gradient: ArrayLike,
    rows: ArrayLike | None = None,
    bound: ArrayLike | None = None,
    *,
    equalities: int = 0,
) -> QuadraticSolution:
    """Minimise ½ xᵀH x + gᵀx with C x ≥ b, for a few unknowns, by a dual active-set method.

    Compiled controllers use the kernel :func:`heelstrike.control.solve_or_relax` with a
    :class:`heelstrike.control.Program` in their memory.

    Parameters
    ----------
    hessian : (n, n) array
        H, symmetric and positive definite.
    gradient : (n,) array
        g.
    rows : (m, n) array, optional
        C.
    bound : (m,) array, optional
        b.
    equalities : int
        The first so many rows hold with equality.

    Returns
    -------
    QuadraticSolution
        The answer and its certificate.

    Raises
    ------
    ControllerError
        If shapes do not fit, numbers are not finite, H is not positive definite, or the rows
        contradict each other.

    Examples
    --------
    >>> import heelstrike as hs
    >>> found = hs.solve_quadratic_program([[2, 0], [0, 2]], [-2, -5], [[-1, -1]], [-2])
    >>> found.x, found.multiplier
    (array([0.25, 1.75]), array([1.5]))
    """
    H, g = np.array(hessian, dtype=np.float64), np.array(gradient, dtype=np.float64)
    n = g.size
    C = np.zeros((0, n)) if rows is None else np.array(rows, dtype=np.float64)
    b = np.zeros(len(C)) if bound is None else np.array(bound, dtype=np.float64)
    shapes = (H.shape, g.shape, C.shape, b.shape)
    if shapes != ((n, n), (n,), (len(C), n), (len(C),)) or n == 0:
        raise ControllerError(
            f"a quadratic programme of n unknowns and m rows needs a hessian (n, n), a gradient "
            f"(n,), rows (m, n) and a bound (m,); got {H.shape}, {g.shape}, {C.shape}, {b.shape}"
        )
    if not all(np.all(np.isfinite(each)) for each in (H, g, C, b)):
        raise ControllerError("the numbers of a quadratic programme must be finite")
    if not np.allclose(H, H.T, rtol=1e-12, atol=0.0):
        raise ControllerError("the hessian of a quadratic programme must be symmetric")
    if not 0 <= equalities <= min(len(C), MOST_EQUALITIES):
        raise ControllerError(
            f"equalities must lie between 0 and the number of rows, and be {MOST_EQUALITIES} at "
            f"most; got {equalities} of {len(C)} rows"
        )
    program = Program.allocate(n=n, m=len(C))
    program.hessian[:], program.gradient[:] = H, g
    program.rows[:], program.bound[:] = C, b
    program.count, program.equalities = len(C), equalities
    solve_or_relax(program)
    if program.status != SOLVED:
        reasons = {
            INFEASIBLE: "the rows contradict each other: no x keeps them all",
            NOT_CONVEX: "the hessian is not positive definite: there is no single least",
        }
        reason = reasons.get(program.status, "it took too many iterations: scale the rows alike")
        raise ControllerError(f"the quadratic programme has no solution: {reason}")
    return QuadraticSolution(
        x=program.x.copy(), multiplier=program.multiplier.copy(), iterations=program.iterations,
        stationarity=program.stationarity, violation=program.violation,
        complementarity=program.complementarity,
    )  # fmt: skip
