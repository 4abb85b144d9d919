"""The general way to solve a contact problem: the solvers in turn, each answer certified."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import separate_kernel
from heelstrike.contact.certificate import certify
from heelstrike.contact.compensated import UNIT_ROUNDOFF, product_error, sum_error
from heelstrike.contact.cone_certificate import MOST_STOPS, certificate_programs
from heelstrike.contact.modes import (
    COMBINATIONS,
    FISCHER_BURMEISTER,
    GAUSS_SEIDEL,
    ITERATION_LIMIT,
    LEMKE,
    OPEN,
    RAY,
    SOLVED,
    UNCERTIFIED,
    UNDECIDABLE,
    WARM_START,
)
from heelstrike.contact.solvers.active_set import correct_modes, evaluate, label
from heelstrike.contact.solvers.combinations import (
    begin_combinations,
    next_combination,
    note_residual,
)
from heelstrike.contact.solvers.elimination import LARGEST, elimination_programs
from heelstrike.contact.solvers.fischer_burmeister import fischer_burmeister
from heelstrike.contact.solvers.gauss_seidel import gauss_seidel
from heelstrike.contact.solvers.known_modes import AS_GOOD, CLEAN
from heelstrike.contact.solvers.lemke import lemke
from heelstrike.contact.solvers.reduction import reduce_problem, scale_matrix
from heelstrike.contact.solvers.standing import CODES, MOST_EQUATIONS, standing_programs
from heelstrike.contact.workspace import (
    Combinations,
    ContactAnswer,
    ContactProblem,
    ContactWorkspace,
    Dictionary,
    Equations,
    Floats,
    Integers,
    Iteration,
    ReducedProblem,
    Scaling,
    Settings,
    StickingRows,
    Tally,
)

NEARLY_SINGULAR = 1e-10
"""Pivots of the unit-diagonal matrix below this allow of impulses 1e5 times the data."""

MODE_CORRECTIONS = 4
"""How often modes that were guessed are corrected before a solver is asked: for a sixth of its
price, and six in seven guesses of feet that are set down and lifted come right."""

ROUNDS = 6
"""How often modes are named after the velocities and tried again."""


@kernel
def keep(problem: ContactProblem, trial: ContactAnswer, answer: ContactAnswer) -> None:
    """Copy the trial to the answer."""
    for i in range(problem.first[problem.count]):
        answer.impulse[i] = trial.impulse[i]
        answer.velocity[i] = trial.velocity[i]
    for i in range(3):
        answer.residual[i] = trial.residual[i]
    answer.rest = trial.rest
    for contact in range(problem.count):
        answer.mode[contact] = trial.mode[contact]


@kernel
def is_doubtful(count: int, worst: float, tolerance: float, scaling: Scaling) -> bool:
    """Whether an answer fails its certificate only because its impulses cannot be written down.

    Rounding them changes velocities by more than the tolerance, and they miss by no more than that.
    """
    rounding = UNIT_ROUNDOFF * scaling.effort
    return tolerance < worst and tolerance < rounding and worst <= count * rounding


@kernel
def is_clean(count: int, worst: float, settings: Settings, scaling: Scaling) -> bool:
    """Whether no better answer is to be had: the residual is nil, or the impulses are rounded."""
    rounding = count * UNIT_ROUNDOFF * scaling.effort if settings.patient == 0 else 0.0
    return worst <= min(settings.tolerance, max(CLEAN, rounding))


@kernel
def nearly_singular(problem: ContactProblem, reduced: ReducedProblem) -> bool:
    """Whether the matrix is singular to rounding, and not known to be so exactly.

    Whether an internal force changes no velocity, so that no impulse helps, or almost none, so that
    a huge one does, is then a question of the last digits. Elimination with complete pivoting; it
    is exact where no operation is rounded, as with two walls that face each other.
    """
    unknowns, source, scale, matrix = (
        reduced.unknowns,
        reduced.source,
        reduced.scale,
        reduced.matrix,
    )
    for i in range(unknowns):
        for j in range(unknowns):
            # Powers of two round nothing.
            shift = math.frexp(scale[i])[1] + math.frexp(scale[j])[1]
            matrix[i, j] = math.ldexp(problem.delassus[source[i], source[j]], shift)
    exact = True
    for step in range(unknowns):
        row = step
        column = step
        for i in range(step, unknowns):
            for j in range(step, unknowns):
                if abs(matrix[i, j]) > abs(matrix[row, column]):
                    row = i
                    column = j
        largest = abs(matrix[row, column])
        if largest < NEARLY_SINGULAR:
            return largest > 0.0 or not exact
        for j in range(unknowns):
            matrix[step, j], matrix[row, j] = matrix[row, j], matrix[step, j]
        for i in range(unknowns):
            matrix[i, step], matrix[i, column] = matrix[i, column], matrix[i, step]
        for i in range(step + 1, unknowns):
            factor = matrix[i, step] / matrix[step, step]
            for j in range(step, unknowns):
                product = factor * matrix[step, j]
                left = matrix[i, j] - product
                exact = exact and product_error(factor, matrix[step, j], product) == 0.0
                exact = exact and sum_error(matrix[i, j], -product, left) == 0.0
                matrix[i, j] = left
            exact = exact and matrix[i, step] == 0.0
    return False


def _signature() -> Any:
    return types.int64(
        ContactProblem.compiled_type(),
        types.int64[::1],
        ContactWorkspace.compiled_type(),
        ContactAnswer.compiled_type(),
    )


@kernel
def propose(
    solver: int, call: int, count: int, best: float, guess: Integers, reduced: ReducedProblem,
    tally: Tally, lemke_memory: Dictionary, iteration: Iteration, combinations: Combinations,
    mode: Integers,
) -> int:  # fmt: skip
    """Write the modes that a solver would have tried next, its ``call``-th, to `mode`.

    Returns ``SOLVED``, or how it ended if there are no more. ``guess`` are the modes of the best
    answer so far and ``best`` its residual.
    """
    if solver == LEMKE:
        return lemke(count, call, reduced, tally, lemke_memory, mode)
    if solver == FISCHER_BURMEISTER:
        return fischer_burmeister(count, call, reduced, tally, iteration, mode)
    if solver == GAUSS_SEIDEL:
        return gauss_seidel(count, call, reduced, tally, iteration, mode)
    if call == 0:
        begin_combinations(count, guess, best, combinations)
    found = next_combination(count, reduced.tangent, tally, combinations, mode)
    return SOLVED if found else UNCERTIFIED


@kernel
def seek(
    solver: int, problem: ContactProblem, best: float, work: ContactWorkspace, answer: ContactAnswer
) -> tuple[int, float]:
    """Try what a solver proposes until an answer is certified, and keep the best.

    Of modes that were guessed and corrected, or if patient, the answer has to be clean. Returns how
    it ended, and the residual of the answer, which was ``best`` so far.
    """
    settings, tally, reduced = work.settings, work.tally, work.reduced
    equations, trial = work.equations, work.trial
    outcome = SOLVED
    call = 0
    while True:
        if solver == WARM_START and call > 0:
            outcome = ITERATION_LIMIT
            if call <= settings.corrections:
                tally.iterations += 1
                outcome = correct_modes(
                    problem, reduced.tangent, work.scaling.root, equations, trial
                )
        elif solver != WARM_START:
            outcome = propose(
                solver, call, problem.count, best, answer.mode, reduced, tally, work.lemke,
                work.iteration, work.combinations, trial.mode,
            )  # fmt: skip
        if outcome != SOLVED:
            return outcome, best
        call += 1
        worst = evaluate(problem, settings, reduced, tally, work.scaling, equations, trial)
        if solver == COMBINATIONS:
            note_residual(problem.count, worst, trial.mode, work.combinations)
        # What a guess came to and was not believed for gives way, even if its residual is less.
        certified = solver != WARM_START and settings.patient == 0 and worst <= settings.tolerance
        if worst < best or certified:
            best = worst
            keep(problem, trial, answer)
        if certified:
            return SOLVED, best
        if is_clean(problem.count, worst, settings, work.scaling):
            return SOLVED, best


@kernel
def release(
    problem: ContactProblem, best: float, work: ContactWorkspace, answer: ContactAnswer
) -> tuple[bool, float]:
    """Let contacts at rest carry any impulse in their cone.

    So the answer is the same whichever solver found it: the split is of least norm among all. And
    a candidate that is not quite a solution may become one. Returns whether the modes are those of
    the answer now, and its residual.
    """
    reduced, scaling, trial = work.reduced, work.scaling, work.trial
    for _ in range(ROUNDS):
        if not label(problem, reduced.tangent, scaling, answer):
            return True, best
        for contact in range(problem.count):
            trial.mode[contact] = answer.mode[contact]
        worst = evaluate(
            problem, work.settings, reduced, work.tally, scaling, work.equations, trial
        )
        if not (worst < best or worst <= AS_GOOD):
            break
        best = worst
        keep(problem, trial, answer)
    return False, best


@separate_kernel(_signature)
def try_solvers(
    problem: ContactProblem, order: Integers, work: ContactWorkspace, answer: ContactAnswer
) -> int:
    """Try the modes of the answer, then the solvers in ``order``; return a ``SolveStatus`` value.

    Arguments are those of :func:`~heelstrike.contact.problem.solve_contact_kernel`.
    """
    tally, reduced, tolerance = work.tally, work.reduced, work.settings.tolerance
    patient = work.settings.patient != 0
    begin(problem, work.scaling.slope, work.reduced, work.trial, answer)
    status = UNCERTIFIED
    best = math.inf
    with_fallbacks = order.shape[0] > 1
    for attempt in range(-1, order.shape[0] + (1 if with_fallbacks else 0)):
        solver = WARM_START
        if attempt >= 0:
            solver = order[attempt] if attempt < order.shape[0] else COMBINATIONS
        if attempt == 0:
            scale_matrix(problem, work.scaling.slope, reduced)
        elif attempt > 0 and status != SOLVED:
            tally.fallbacks += 1
            tally.last_fallbacks += 1
        before = best
        tally.combinations += solver == COMBINATIONS
        outcome, best = seek(solver, problem, best, work, answer)
        agrees = outcome == UNCERTIFIED and best <= tolerance and not patient
        if attempt < 0 and outcome != SOLVED and not agrees:
            continue
        settled, best = release(problem, best, work, answer)
        if attempt < 0 and not settled:
            continue
        if best < before:
            tally.solver = solver
        if best <= tolerance:
            status = SOLVED
            if outcome == SOLVED or not patient:
                tally.shortcuts += attempt < 0
                break
        elif attempt == 0 or outcome == RAY:
            status = outcome if outcome != SOLVED else UNCERTIFIED
    if status != SOLVED:
        tally.failures += 1
        worst = certify(problem, work.settings, work.scaling, answer)
        if is_doubtful(problem.count, worst, tolerance, work.scaling) or (
            with_fallbacks and nearly_singular(problem, reduced)
        ):
            status = UNDECIDABLE
    for contact in range(problem.count):
        if reduced.prescribed[contact] != OPEN and answer.mode[contact] != OPEN:
            answer.mode[contact] = reduced.prescribed[contact]
    return status


@kernel
def begin(
    problem: ContactProblem, slope: Floats, reduced: ReducedProblem, trial: ContactAnswer,
    answer: ContactAnswer,
) -> None:  # fmt: skip
    """Put the modes of the answer on trial, and no impulse in their place."""
    for contact in range(problem.count):
        trial.mode[contact] = answer.mode[contact]
    for i in range(problem.first[problem.count]):
        answer.impulse[i] = 0.0
        answer.velocity[i] = problem.free[i]
    for i in range(3):
        answer.residual[i] = math.inf
    reduce_problem(problem, answer.mode, slope, reduced)


def contact_workspace(
    capacity: int, *, ready: bool = True, symmetric: bool = True
) -> ContactWorkspace:
    """Allocate the memory to solve contact problems of up to ``capacity`` contacts.

    Parameters
    ----------
    capacity : int
        Most contacts of a problem.
    ready : bool
        Whether to see to it that the solvers are compiled. Those who say no call
        ``try_solvers.finish()`` before they solve.
    symmetric : bool
        Whether matrices will be symmetric to the last digit, as programs take them.
    """
    if ready:
        try_solvers.finish()
    contacts = max(int(capacity), 1)
    rows = 2 * contacts
    most = max(LARGEST, MOST_EQUATIONS)
    certificates = certificate_programs() if symmetric else np.zeros((1, MOST_STOPS + 1), np.int64)
    work = ContactWorkspace.allocate(
        capacity=contacts,
        scaling=Scaling.allocate(capacity=contacts, most_stops=MOST_STOPS, programs=certificates),
        sticking=StickingRows.allocate(
            capacity=contacts,
            half=most * (most + 1) // 2,
            programs=elimination_programs(),
            standing=standing_programs()
            if symmetric
            else np.zeros((CODES, MOST_STOPS + 1), np.int64),
        ),
        equations=Equations.allocate(capacity=contacts, dual=Dictionary.allocate(pairs=rows)),
        lemke=Dictionary.allocate(pairs=2 * rows),
        solvers=try_solvers.address,
    )
    work.settings.tolerance = 1e-9
    work.settings.corrections = MODE_CORRECTIONS
    return work
