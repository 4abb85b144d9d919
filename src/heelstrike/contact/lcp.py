"""Linear complementarity problems, solved by the same kernels as contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.contact.certificate import Certificate
from heelstrike.contact.modes import OPEN, Solver
from heelstrike.contact.problem import check_accuracy, check_finite, run_solvers, solver_order
from heelstrike.contact.workspace import Floats
from heelstrike.errors import ContactProblemError
from heelstrike.field_texts import dataclass


@dataclass(frozen=True)
class LcpSolution:
    """The solution of a linear complementarity problem."""

    z: Floats
    w: Floats
    """z, w: (n,) The solution and ``w = M @ z + q``."""
    certificate: Certificate
    """Status and residuals; ``complementarity`` is the largest of min(w_i, z_i),
    ``non_penetration`` the largest negative w_i and ``cone`` the largest negative z_i, all
    relative."""


@takes(ContactProblemError)
def solve_lcp(
    M: ArrayLike,
    q: ArrayLike,
    *,
    solver: str | Solver = Solver.LEMKE,
    tolerance: float = 1e-9,
    floor: float = 0.0,
    fallback: bool = True,
) -> LcpSolution:
    """Solve a linear complementarity problem: ``w = M z + q``, ``0 <= w _|_ z >= 0``.

    An entry of ``z`` is a contact without friction here, so the solvers, the fallbacks and the
    certificate are those of :func:`solve_contact`. ``M`` need not be symmetric.

    Parameters
    ----------
    M : (n, n) array_like
        Any square matrix. Lemke's method is sure to find a solution, or to prove by a ray that
        there is none, if it is copositive-plus, for example positive semidefinite.
    q : (n,) array_like
        The constant term.
    solver : {"lemke", "fischer_burmeister", "gauss_seidel"}
        The solver to try first.
    tolerance : float
        Largest relative residual that is accepted, see :class:`Certificate`. Where a diagonal
        entry is not positive, the largest entry of its row and column takes its place there.
    floor : float
        Smallest size of the data that residuals are set against, see :func:`solve_contact`.
    fallback : bool
        Whether the other solvers are tried when the first fails.

    Returns
    -------
    LcpSolution
        With a certificate; a failed solve does not raise.

    Raises
    ------
    ContactProblemError
        If the data are malformed.

    Examples
    --------
    >>> solution = solve_lcp([[2.0, 1.0], [1.0, 2.0]], [-5.0, -6.0])
    >>> solution.z
    array([1.33333333, 2.33333333])
    >>> solution.certificate.valid
    True
    """
    order = solver_order(solver, fallback=fallback)
    check_accuracy(tolerance, floor)
    try:
        matrix = np.array(M, dtype=np.float64)
        constant = np.array(q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ContactProblemError(f"M and q must be arrays of real numbers: {error}") from error
    if constant.ndim != 1 or matrix.shape != (constant.size, constant.size):
        raise ContactProblemError(
            f"M has shape {matrix.shape} and q has shape {constant.shape}; they must be (n, n) "
            "and (n,)"
        )
    check_finite(M=matrix, q=constant)
    count = constant.size
    delassus = np.zeros((2 * count, 2 * count))
    delassus[::2, ::2] = matrix
    free = np.zeros(2 * count)
    free[::2] = constant
    mode = np.full(count, OPEN, np.int64)
    impulse, velocity, certificate = run_solvers(
        delassus,
        free,
        np.zeros(count),
        order,
        mode,
        tolerance=tolerance,
        floor=floor,
        semidefinite=False,
    )
    return LcpSolution(z=impulse[::2].copy(), w=velocity[::2].copy(), certificate=certificate)
