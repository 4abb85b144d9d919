"""The general way to solve a contact problem: the solvers in turn, each answer certified."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from heelstrike.compilation import kernel, type_of
from heelstrike.contact.active_set import evaluate, label
from heelstrike.contact.certificate import certify
from heelstrike.contact.fischer_burmeister import fischer_burmeister
from heelstrike.contact.gauss_seidel import gauss_seidel
from heelstrike.contact.lemke import PATHS, lemke
from heelstrike.contact.modes import FISCHER_BURMEISTER, LEMKE, OPEN, RAY, SOLVED, UNCERTIFIED
from heelstrike.contact.reduction import reduce_problem, scale_matrix
from heelstrike.contact.repetition import repeat
from heelstrike.contact.workspace import (
    FAILURES,
    FALLBACKS,
    IMPULSE,
    LAST_FALLBACKS,
    PRESCRIBED,
    RESIDUAL,
    REST_TOLERANCE,
    SETTINGS,
    SHORTCUTS,
    SIZE,
    SKEWED,
    SLOPE,
    SUCCEEDED,
    TOLERANCE,
    TRIAL_MODE,
    VELOCITY,
    ContactWorkspace,
    Floats,
    Integers,
    allocate_contact_workspace,
)
from heelstrike.separate_kernel import separate_kernel

CLEAN = 1e-11
"""Modes with smaller residuals are taken at once; others may be nearly right, and better follow."""

AS_GOOD = 2.0 * REST_TOLERANCE
"""Residual up to which released contacts are preferred to a smaller residual without."""

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
    for attempt in range(-1, order.shape[0]):
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
            elif order[attempt] == LEMKE:
                outcome = lemke(count, unknowns, call, work)
                proposing = call + 1 < PATHS
            elif order[attempt] == FISCHER_BURMEISTER:
                outcome = fischer_burmeister(count, unknowns, call, work)
                proposing = outcome == SOLVED
            else:
                outcome = gauss_seidel(count, unknowns, call, work)
                proposing = outcome == SOLVED
            call += 1
            if attempt >= 0 and stick_or_open(count, delassus, free, friction, clean, work):
                keep(count, mode, impulse, velocity, residual, work)
                counters[SUCCEEDED] = order[attempt]
                return SOLVED
            worst = evaluate(count, delassus, free, friction, work)
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
                    vectors[SLOPE],
                    impulse,
                    velocity,
                    residual,
                    vectors[SIZE],
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
            counters[SUCCEEDED] = order[attempt]
        if best <= tolerance and (attempt >= 0 or best <= clean):
            status = SOLVED
            if best <= clean:
                break
        elif attempt == 0 or outcome == RAY:
            status = outcome if outcome != SOLVED else UNCERTIFIED
    if status != SOLVED:
        counters[FAILURES] += 1
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
