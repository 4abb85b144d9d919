"""The general way to solve a contact problem: the solvers in turn, each answer certified."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from heelstrike.compiler.compilation import kernel, type_of
from heelstrike.compiler.separate_kernel import separate_kernel
from heelstrike.contact.certificate import certify
from heelstrike.contact.compensated import UNIT_ROUNDOFF, product_error, sum_error
from heelstrike.contact.modes import (
    COMBINATIONS,
    FISCHER_BURMEISTER,
    GAUSS_SEIDEL,
    LEMKE,
    OPEN,
    RAY,
    SOLVED,
    UNCERTIFIED,
    UNDECIDABLE,
    WARM_START,
)
from heelstrike.contact.solvers.active_set import evaluate, label
from heelstrike.contact.solvers.combinations import (
    begin_combinations,
    next_combination,
    note_residual,
)
from heelstrike.contact.solvers.fischer_burmeister import fischer_burmeister
from heelstrike.contact.solvers.gauss_seidel import gauss_seidel
from heelstrike.contact.solvers.lemke import PATHS, lemke
from heelstrike.contact.solvers.reduction import reduce_problem, scale_matrix
from heelstrike.contact.solvers.repetition import repeat
from heelstrike.contact.workspace import (
    EFFORT,
    FAILURES,
    FALLBACKS,
    IMPULSE,
    LAST_FALLBACKS,
    MATRIX,
    PRESCRIBED,
    RESIDUAL,
    REST_TOLERANCE,
    SCALE,
    SETTINGS,
    SHORTCUTS,
    SKEWED,
    SOURCE,
    SUCCEEDED,
    TOLERANCE,
    TRIAL_MODE,
    VELOCITY,
    ContactWorkspace,
    Floats,
    Integers,
    allocate_contact_workspace,
)

CLEAN = 1e-11
"""Modes with smaller residuals are taken at once; others may be nearly right, and better follow."""

AS_GOOD = 2.0 * REST_TOLERANCE
"""Residual up to which released contacts are preferred to a smaller residual without."""

NEARLY_SINGULAR = 1e-10
"""Pivots of the unit-diagonal matrix below this allow of impulses 1e5 times the data."""

ROUNDS = 6
"""How often modes are named after the velocities and tried again."""


@kernel
def keep(
    count: int,
    mode: Integers,
    impulse: Floats,
    velocity: Floats,
    residual: Floats,
    work: ContactWorkspace,
) -> None:
    """Copy the trial in the workspace to the caller's arrays."""
    for i in range(2 * count):
        impulse[i] = work.vectors[IMPULSE, i]
        velocity[i] = work.vectors[VELOCITY, i]
    for i in range(3):
        residual[i] = work.vectors[RESIDUAL, i]
    for contact in range(count):
        mode[contact] = work.labels[TRIAL_MODE, contact]


@kernel
def is_doubtful(count: int, worst: float, work: ContactWorkspace) -> bool:
    """Whether an answer fails its certificate only because its impulses cannot be written down.

    Rounding them changes velocities by more than the tolerance, and they miss by no more than that.
    """
    settings = work.vectors[SETTINGS]
    rounding = UNIT_ROUNDOFF * settings[EFFORT]
    return (
        settings[TOLERANCE] < worst and settings[TOLERANCE] < rounding and worst <= count * rounding
    )


@kernel
def nearly_singular(unknowns: int, delassus: Floats, work: ContactWorkspace) -> bool:
    """Whether the matrix is singular to rounding, and not known to be so exactly.

    Whether an internal force changes no velocity, so that no impulse helps, or almost none, so that
    a huge one does, is then a question of the last digits. Elimination with complete pivoting; it
    is exact where no operation is rounded, as with two walls that face each other.
    """
    source, scale = work.labels[SOURCE], work.vectors[SCALE]
    matrix = work.squares[MATRIX]
    for i in range(unknowns):
        for j in range(unknowns):
            # Powers of two round nothing.
            shift = math.frexp(scale[i])[1] + math.frexp(scale[j])[1]
            matrix[i, j] = math.ldexp(delassus[source[i], source[j]], shift)
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


@kernel
def stick_or_open(
    count: int,
    delassus: Floats,
    free: Floats,
    friction: Floats,
    tolerance: float,
    work: ContactWorkspace,
) -> bool:
    """Try the modes under trial the quick way, if no contact is prescribed to slide."""
    vectors, labels = work.vectors, work.labels
    if vectors[SETTINGS, SKEWED] != 0.0:
        return False
    for contact in range(count):
        if labels[PRESCRIBED, contact] != OPEN:
            return False
    return repeat(
        count,
        delassus,
        free,
        friction,
        labels[TRIAL_MODE],
        vectors[IMPULSE],
        vectors[VELOCITY],
        vectors[RESIDUAL],
        tolerance,
        work,
    )


def _signature() -> Any:
    matrix, vector, integers = types.float64[:, ::1], types.float64[::1], types.int64[::1]
    work = type_of(allocate_contact_workspace(1, np.zeros(1, np.int64)))
    return types.int64(
        types.int64,
        matrix,
        vector,
        vector,
        integers,
        integers,
        vector,
        vector,
        vector,
        work,
    )


@separate_kernel(_signature)
def try_solvers(
    count: int,
    delassus: Floats,
    free: Floats,
    friction: Floats,
    order: Integers,
    mode: Integers,
    impulse: Floats,
    velocity: Floats,
    residual: Floats,
    work: ContactWorkspace,
) -> int:
    """Try the modes in ``mode``, then the solvers in ``order``; return a ``SolveStatus`` value.

    Arguments are those of :func:`~heelstrike.contact.problem.solve_contact_kernel`.
    """
    counters, labels, vectors = work.counters, work.labels, work.vectors
    tolerance = vectors[SETTINGS, TOLERANCE]
    clean = min(tolerance, CLEAN)
    for contact in range(count):
        labels[TRIAL_MODE, contact] = mode[contact]
    for i in range(2 * count):
        impulse[i] = 0.0
        velocity[i] = free[i]
    for i in range(3):
        residual[i] = math.inf
    unknowns = reduce_problem(count, delassus, free, friction, mode, work)

    status = UNCERTIFIED
    best = math.inf
    with_fallbacks = order.shape[0] > 1
    for attempt in range(-1, order.shape[0] + (1 if with_fallbacks else 0)):
        solver = WARM_START
        if attempt >= 0:
            solver = order[attempt] if attempt < order.shape[0] else COMBINATIONS
        outcome = UNCERTIFIED
        if attempt >= 0:
            if attempt == 0:
                scale_matrix(unknowns, delassus, work)
            elif status != SOLVED:
                counters[FALLBACKS] += 1
                counters[LAST_FALLBACKS] += 1
        before = best
        latest = False
        call = count - count
        proposing = True
        while proposing:
            if attempt < 0:
                proposing = False
            elif solver == LEMKE:
                outcome = lemke(count, unknowns, call, work)
                proposing = call + 1 < PATHS
            elif solver == FISCHER_BURMEISTER:
                outcome = fischer_burmeister(count, unknowns, call, work)
                proposing = outcome == SOLVED
            elif solver == GAUSS_SEIDEL:
                outcome = gauss_seidel(count, unknowns, call, work)
                proposing = outcome == SOLVED
            else:
                if call == 0:
                    begin_combinations(count, mode, best, work)
                proposing = next_combination(count, work)
                if not proposing:
                    break
            call += 1
            if attempt >= 0 and stick_or_open(count, delassus, free, friction, clean, work):
                keep(count, mode, impulse, velocity, residual, work)
                counters[SUCCEEDED] = solver
                return SOLVED
            worst = evaluate(count, delassus, free, friction, work)
            if solver == COMBINATIONS:
                note_residual(count, worst, work)
            latest = worst < best
            if latest:
                best = worst
                keep(count, mode, impulse, velocity, residual, work)
            if worst <= clean:
                break
        if attempt >= 0 or best <= clean:
            if not latest:
                certify(
                    count,
                    delassus,
                    free,
                    friction,
                    impulse,
                    velocity,
                    residual,
                    work,
                )
            # The same answer whichever solver found it: contacts at rest are released to carry
            # any impulse in their cone, so that the split is of least norm among all. And a
            # candidate that is not quite a solution may become one.
            for _ in range(ROUNDS):
                if not label(count, velocity, mode, work):
                    break
                for contact in range(count):
                    labels[TRIAL_MODE, contact] = mode[contact]
                worst = evaluate(count, delassus, free, friction, work)
                if not (worst < best or worst <= AS_GOOD):
                    break
                best = worst
                keep(count, mode, impulse, velocity, residual, work)
        if best < before and attempt >= 0:
            counters[SUCCEEDED] = solver
        if best <= tolerance and (attempt >= 0 or best <= clean):
            status = SOLVED
            if best <= clean:
                break
        elif attempt == 0 or outcome == RAY:
            status = outcome if outcome != SOLVED else UNCERTIFIED
    if status != SOLVED:
        counters[FAILURES] += 1
        worst = certify(count, delassus, free, friction, impulse, velocity, residual, work)
        if is_doubtful(count, worst, work) or (
            with_fallbacks and nearly_singular(unknowns, delassus, work)
        ):
            status = UNDECIDABLE
    elif attempt < 0:
        counters[SHORTCUTS] += 1
    for contact in range(count):
        if labels[PRESCRIBED, contact] != OPEN and mode[contact] != OPEN:
            mode[contact] = labels[PRESCRIBED, contact]
    return status


def contact_workspace(capacity: int, *, ready: bool = True) -> ContactWorkspace:
    """Allocate the memory to solve contact problems of up to ``capacity`` contacts.

    Parameters
    ----------
    capacity : int
        Most contacts of a problem.
    ready : bool
        Whether to see to it that the solvers are compiled. Those who say no call
        ``try_solvers.finish()`` before they solve.
    """
    if ready:
        try_solvers.finish()
    return allocate_contact_workspace(capacity, try_solvers.address)
