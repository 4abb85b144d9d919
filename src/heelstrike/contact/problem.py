"""The contact problem and its one entry: certified, with fallbacks.

Given the Delassus matrix G, the free term b and a friction coefficient per contact, find the
impulse with ``w = G lambda + b`` and, at every contact, ``0 <= w_n _|_ lambda_n >= 0`` and
``|lambda_t| <= mu lambda_n`` opposing ``w_t`` as far as it can.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.contact.certificate import Certificate, certify, velocity_error
from heelstrike.contact.modes import OPEN, SOLVED, WARM_START, ContactMode, Solver, SolveStatus
from heelstrike.contact.sets import CONE, INTERVAL, press
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.known_modes import repeat
from heelstrike.contact.workspace import (
    ContactAnswer,
    ContactProblem,
    ContactWorkspace,
    Floats,
    Integers,
    contact_problem,
)
from heelstrike.errors import ContactProblemError
from heelstrike.field_texts import dataclass

if TYPE_CHECKING:
    from heelstrike.contact.spatial.problem import SpatialContactSolution


@kernel
def solve_contact_kernel(
    order: Integers, problem: ContactProblem, work: ContactWorkspace, answer: ContactAnswer
) -> int:
    """Solve one contact problem inside compiled code; return a ``SolveStatus`` value.

    The modes of the answer are tried first. Unless their answer is certified and contradicts none
    of them, the solvers in ``order`` are called in turn until one is certified; if patient, until
    one is clean, and an answer that is certified but not clean stands if those after it do no
    better, and does not count as a fallback.

    Parameters
    ----------
    order : (any,) int64
        Solver codes to try in turn (:class:`~heelstrike.contact.modes.Solver`).
    problem : ContactProblem
        Of intervals the normal rows are written here, and may hold anything.
    work : ContactWorkspace
        Buffers; ``tally`` is updated, ``settings`` are read.
    answer : ContactAnswer
        In: guessed modes (``SLIDING_FORWARD`` and ``SLIDING_BACKWARD`` are prescriptions, not
        guesses). Out: the solution, or after a failure the candidate with the smallest residuals,
        always finite if the data are; modes are told by the velocity, and a contact prescribed to
        slide keeps its mode or becomes ``OPEN``.
    """
    tally, settings, scaling = work.tally, work.settings, work.scaling
    tally.solves += 1
    tally.iterations = 0
    tally.last_fallbacks = 0
    tally.solver = WARM_START
    for contact in range(problem.count):
        scaling.slope[contact] = 0.0
        if problem.set[contact] == INTERVAL:
            press(contact, problem)
    if settings.skewed == 0 and repeat(problem, settings, work.sticking, scaling, answer):
        tally.shortcuts += 1
        return SOLVED
    return int(call_at(work.solvers[0], (problem, order, work, answer)))


@dataclass(frozen=True)
class ContactSolution:
    """The solution of a contact problem, with its certificate."""

    impulse: Floats
    """(nc, 2) Normal and tangential impulse (or force) on the robot at each contact; where several
    have the same effect, the one of least norm."""
    velocity: Floats
    """(nc, 2) Normal and tangential velocity (or acceleration) after it, ``G @ impulse + free``."""
    mode: tuple[ContactMode, ...]
    """What each contact does."""
    certificate: Certificate
    """Status and residuals; look at ``certificate.valid`` before using the impulse."""


KEPT_CONTACTS = 16
"""Problems of up to so many contacts are solved in memory that is kept."""

_kept = threading.local()

DEFAULT_ORDER = (Solver.LEMKE, Solver.FISCHER_BURMEISTER, Solver.GAUSS_SEIDEL)
"""The order in which solvers are tried; a chosen solver moves to the front."""


def solver_order(solver: str | Solver, *, fallback: bool = True) -> Integers:
    """Return the codes of the solvers to try: the one asked for, then the others in order.

    Raises
    ------
    ContactProblemError
        If the solver's name is not known.
    """
    first = _solver(solver)
    others = tuple(other for other in DEFAULT_ORDER if other is not first) if fallback else ()
    return np.array([choice.code for choice in (first, *others)], np.int64)


@overload
def solve_contact(
    delassus: ArrayLike, free: ArrayLike, friction: ArrayLike, *,
    dimension: Literal[2] = 2, solver: str | Solver = Solver.LEMKE, tolerance: float = 1e-9,
    floor: float = 0.0, fallback: bool = True,
) -> ContactSolution: ...  # fmt: skip


@overload
def solve_contact(
    delassus: ArrayLike, free: ArrayLike, friction: ArrayLike, *,
    dimension: Literal[3], solver: str | Solver = Solver.LEMKE, tolerance: float = 1e-9,
    floor: float = 0.0, fallback: bool = True,
) -> SpatialContactSolution: ...  # fmt: skip


@takes(ContactProblemError)
def solve_contact(
    delassus: ArrayLike,
    free: ArrayLike,
    friction: ArrayLike,
    *,
    dimension: int = 2,
    solver: str | Solver = Solver.LEMKE,
    tolerance: float = 1e-9,
    floor: float = 0.0,
    fallback: bool = True,
) -> ContactSolution | SpatialContactSolution:
    """Solve a contact problem with Coulomb friction, in the plane or in space.

    Find the impulse ``lambda`` with ``w = G lambda + b`` and, at every contact,
    ``0 <= w_n _|_ lambda_n >= 0`` and ``|lambda_t| <= mu lambda_n`` opposing ``w_t`` as far as
    it can (the paper's eq. 15-16, 20-21 and 24-25).

    Parameters
    ----------
    delassus : (nc * 2, nc * 2) array_like
        ``G = J M^-1 J^T``, symmetric and positive semidefinite, often singular; components
        ordered n0 t0 n1 t1 ...; [1/kg] for points. In space (nc * 3, nc * 3), normal and two
        tangents of each contact.
    free : (nc * 2,) or (nc, 2) array_like
        Velocity without contact impulses [m/s], or acceleration [m/s^2]; three for each contact in
        space.
    friction : (nc,) array_like or float
        Friction coefficient of each contact, zero for none.
    dimension : {2, 3}
        The plane, or space, where the cones of friction are round.
    solver : {"lemke", "fischer_burmeister", "gauss_seidel"}
        The solver to try first, in the plane. In space the ways to solve have one order.
    tolerance : float
        Largest relative residual that is accepted, see :class:`Certificate`.
    floor : float
        Smallest size of the data that residuals are set against, as velocity times the root of
        the mass it belongs to [m/s kg^(1/2)]: what is known of the free velocities. With zero
        the smallest velocities are solved as sharply as large ones.
    fallback : bool
        Whether the other solvers are tried, in the order Lemke, Fischer-Burmeister,
        Gauss-Seidel, when the first fails, and in the end combinations of contact modes.

    Returns
    -------
    ContactSolution or SpatialContactSolution
        With a certificate that says whether, and how well, the problem is solved. A failed
        solve returns the candidate with the smallest residuals and a status other than
        ``SOLVED``; it does not raise.

    Raises
    ------
    ContactProblemError
        If the data are malformed: shapes, NaN, negative friction, an asymmetric matrix, an
        unknown solver, a dimension that is neither 2 nor 3.

    Examples
    --------
    A block of 2 kg, falling at 1 m/s and sliding at 0.2 m/s, meets ground with friction 0.5:

    >>> solution = solve_contact([[0.5, 0.0], [0.0, 0.5]], [-1.0, 0.2], 0.5)
    >>> solution.impulse
    array([[ 2. , -0.4]])
    >>> solution.mode[0].name, solution.certificate.valid
    ('STICK', True)
    """
    if dimension not in (2, 3):
        raise ContactProblemError(f"dimension is 2 or 3, got {dimension}")
    matrix, offset, coefficient = _checked(delassus, free, friction, dimension)
    count = coefficient.size
    check_accuracy(tolerance, floor)
    order = solver_order(solver, fallback=fallback)
    if dimension == 3:
        from heelstrike.contact.spatial.problem import solve_in_space

        return solve_in_space(
            matrix, offset, coefficient, tolerance=tolerance, floor=floor, fallback=fallback
        )
    mode = np.full(count, OPEN, np.int64)
    impulse, velocity, certificate = run_solvers(
        matrix,
        offset,
        coefficient,
        order,
        mode,
        tolerance=tolerance,
        floor=floor,
        semidefinite=_may_be_semidefinite(matrix),
    )
    return ContactSolution(
        impulse=impulse.reshape(count, 2),
        velocity=velocity.reshape(count, 2),
        mode=tuple(ContactMode(int(value)) for value in mode),
        certificate=certificate,
    )


def run_solvers(
    delassus: Floats,
    free: Floats,
    friction: Floats,
    order: Integers,
    mode: Integers,
    *,
    tolerance: float,
    floor: float = 0.0,
    semidefinite: bool = True,
    sets: Integers | None = None,
) -> tuple[Floats, Floats, Certificate]:
    """Call the kernel on checked data with fresh memory; return impulse, velocity, certificate.

    ``semidefinite`` tells that the matrix is symmetric and no entry exceeds the root of the product
    of its diagonal entries, ``sets`` where the impulse of each contact may lie (cones by default).
    """
    count = friction.size
    matrix, matrix_shift = _near_one(delassus, even=True)
    offset, offset_shift = _near_one(free)
    work = _memory(count)
    work.settings.tolerance = tolerance
    work.settings.floor = np.ldexp(floor, offset_shift - matrix_shift // 2)
    work.settings.corrections = 0  # nobody has guessed the modes
    work.settings.patient = 1
    work.settings.skewed = 0 if semidefinite else 1
    problem = contact_problem(
        count, count=count, delassus=matrix, free=offset, friction=friction,
        set=np.full(count, CONE, np.int64) if sets is None else sets,
    )  # fmt: skip
    answer = ContactAnswer.allocate(capacity=count, mode=mode)
    status = SolveStatus(solve_contact_kernel(order, problem, work, answer))
    # The solvers leave in the workspace what belongs to the last candidate, not to the best one.
    worst = certify(problem, work.settings, work.scaling, answer)
    error = velocity_error(worst, friction, work.scaling)
    impulse, velocity, residual = answer.impulse, answer.velocity, answer.residual
    with np.errstate(over="ignore"):
        impulse = np.ldexp(impulse, matrix_shift - offset_shift)
        velocity = np.ldexp(velocity, -offset_shift)
        error = np.ldexp(error, -offset_shift)
    if not (np.all(np.isfinite(impulse)) and np.all(np.isfinite(velocity))):
        # It cannot be written down in the units it is asked for.
        impulse, velocity, residual[2] = np.zeros(2 * count), free.copy(), np.inf
        status = SolveStatus.UNDECIDABLE
    certificate = Certificate(
        status=status,
        solver=Solver.from_code(work.tally.solver),
        iterations=work.tally.iterations,
        fallbacks=work.tally.last_fallbacks,
        complementarity=float(residual[0]),
        cone=float(residual[1]),
        non_penetration=float(residual[2]),
        rounding=work.scaling.rounding,
        tolerance=float(tolerance),
        velocity_error=error,
    )
    return impulse, velocity, certificate


def _memory(count: int) -> ContactWorkspace:
    """Return memory to solve in; that of few contacts is kept, one for each thread."""
    if count > KEPT_CONTACTS:
        return contact_workspace(count, symmetric=False)
    if not hasattr(_kept, "memory"):
        _kept.memory = contact_workspace(KEPT_CONTACTS, symmetric=False)
    memory: ContactWorkspace = _kept.memory
    return memory


def _near_one(values: Floats, *, even: bool = False) -> tuple[Floats, int]:
    """Multiply numbers by the power of two that brings the largest near one; return its exponent.

    No product of such numbers overflows, and none is rounded that is above 1e-290 of the largest.
    """
    largest = float(np.max(np.abs(values), initial=0.0))
    shift = -int(np.frexp(largest)[1]) if largest > 0.0 else 0
    if even:
        shift -= shift % 2
    return np.ldexp(values, shift), shift


def _may_be_semidefinite(matrix: Floats) -> bool:
    """Whether no entry is larger than its diagonal allows, rounding apart."""
    root = np.sqrt(np.diag(matrix))
    return bool(np.all(np.abs(matrix) <= (1.0 + 1e-8) * np.outer(root, root)))


def check_accuracy(tolerance: float, floor: float) -> None:
    """Refuse a tolerance or a floor that makes no sense.

    Raises
    ------
    ContactProblemError
        If the tolerance is not between 0 and 1, or the floor is negative or not a number.
    """
    if not 0.0 < tolerance < 1.0:
        raise ContactProblemError(f"tolerance must be between 0 and 1; got {tolerance}")
    if not 0.0 <= floor < np.inf:
        raise ContactProblemError(f"floor must be a number ≥ 0; got {floor}")


def check_finite(**arrays: Floats) -> None:
    """Refuse infinite entries and such that are no numbers.

    Raises
    ------
    ContactProblemError
        With the name of the array and the place of the entry.
    """
    for name, values in arrays.items():
        for where in np.argwhere(~np.isfinite(values)):
            raise ContactProblemError(
                f"{name}{where.tolist()} is {values[tuple(where)]}; all entries must be finite"
            )


def _solver(solver: str | Solver) -> Solver:
    choices = ", ".join(choice.value for choice in DEFAULT_ORDER)
    try:
        choice = Solver(solver)
    except ValueError:
        choice = Solver.WARM_START
    if choice not in DEFAULT_ORDER:
        raise ContactProblemError(f"unknown contact solver {solver!r}; choose one of: {choices}")
    return choice


def _checked(
    delassus: ArrayLike, free: ArrayLike, friction: ArrayLike, rows: int = 2
) -> tuple[Floats, Floats, Floats]:
    try:
        matrix = np.array(delassus, dtype=np.float64, order="C")
        offset = np.array(free, dtype=np.float64, order="C").reshape(-1)
        coefficient = np.array(friction, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise ContactProblemError(
            f"delassus, free and friction must be arrays of real numbers: {error}"
        ) from error
    if offset.size % rows:
        needs = "two (normal, tangent)" if rows == 2 else "three (normal and two tangents)"
        raise ContactProblemError(
            f"free has {offset.size} entries, but every contact needs {needs}"
        )
    count = offset.size // rows
    size = rows * count
    if matrix.shape != (size, size) and not (count == 0 and matrix.size == 0):
        raise ContactProblemError(
            f"delassus has shape {matrix.shape}, but free has {count} contacts, which needs "
            f"({size}, {size})"
        )
    if coefficient.ndim == 0:
        coefficient = np.full(count, float(coefficient))
    if coefficient.shape != (count,):
        raise ContactProblemError(
            f"friction has shape {coefficient.shape}; give one number, or one for each of the "
            f"{count} contacts"
        )
    check_finite(delassus=matrix, free=offset, friction=coefficient)
    if np.any(coefficient < 0.0):
        contact = int(np.argmin(coefficient))
        raise ContactProblemError(
            f"friction[{contact}] is {coefficient[contact]}; a friction coefficient cannot be "
            "negative"
        )
    diagonal = np.diag(matrix)
    if np.any(diagonal < 0.0):
        row = int(np.argmin(diagonal))
        raise ContactProblemError(
            f"delassus[{row}, {row}] is {diagonal[row]}; J M^-1 J^T cannot have a negative "
            "diagonal entry"
        )
    bound = np.outer(np.sqrt(diagonal), np.sqrt(diagonal))
    asymmetry = np.abs(matrix - matrix.T) > 1e-8 * bound + np.finfo(float).tiny
    if np.any(asymmetry):
        row, column = (int(index) for index in np.argwhere(asymmetry)[0])
        raise ContactProblemError(
            f"delassus is not symmetric: entry [{row}, {column}] is {matrix[row, column]}, but "
            f"[{column}, {row}] is {matrix[column, row]}"
        )
    return matrix.reshape(size, size), offset, coefficient
