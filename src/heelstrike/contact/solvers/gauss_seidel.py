"""Block Gauss-Seidel: one contact after the other is solved exactly, the others held fixed.

Simple, and on many contacts often good enough for the modes to be right long before the impulses
are; those are proposed for an exact solve whenever they change.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import (
    ITERATION_LIMIT,
    OPEN,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SOLVED,
    STICK,
)
from heelstrike.contact.sets import LINE
from heelstrike.contact.workspace import Floats, Integers, Iteration, ReducedProblem, Tally

SWEEPS = 2000
"""Sweeps over all contacts before giving up."""


DEPENDENT_ROWS = 1e-14
"""Determinant of the two rows of a contact, of diagonal one, up to which they are one row."""


@kernel
def solve_block(contact: int, reduced: ReducedProblem, iterate: Floats) -> int:
    """Solve one contact of the reduced problem for its own impulse; return its mode."""
    offset, matrix, unknowns = reduced.offset, reduced.matrix, reduced.unknowns
    first = reduced.normal[contact]
    second = reduced.tangent[contact]
    rest = offset[first] - matrix[first, first] * iterate[first]
    for j in range(unknowns):
        rest += matrix[first, j] * iterate[j]
    inertia = matrix[first, first]
    if reduced.set[contact] == LINE:
        iterate[first] = -rest / inertia if inertia > 0.0 else 0.0
        return STICK
    if second < 0:
        iterate[first] = max(-rest / inertia, 0.0) if inertia > 0.0 else 0.0
        return STICK if rest < 0.0 else OPEN
    coupling = matrix[first, second]
    across = matrix[second, second]
    rest -= coupling * iterate[second]
    slip = offset[second] - coupling * iterate[first] - across * iterate[second]
    for j in range(unknowns):
        slip += matrix[second, j] * iterate[j]
    iterate[first] = 0.0
    iterate[second] = 0.0
    if rest >= 0.0:
        return OPEN
    cone = reduced.cone[contact]
    determinant = inertia * across - coupling * coupling
    if determinant > DEPENDENT_ROWS:
        force = (coupling * slip - across * rest) / determinant
        friction = (coupling * rest - inertia * slip) / determinant
        if abs(friction) <= cone * force:
            iterate[first] = force
            iterate[second] = friction
            return STICK
    for name in range(SLIP_FORWARD, SLIP_BACKWARD + 1):
        ratio = -cone if name == SLIP_FORWARD else cone
        effective = inertia + ratio * coupling
        if effective > 0.0:
            force = -rest / effective
            if ratio * (slip + (coupling + ratio * across) * force) <= 0.0:
                iterate[first] = force
                iterate[second] = ratio * force
                return name
    iterate[first] = -rest / inertia if inertia > 0.0 else 0.0
    return STICK


@kernel
def gauss_seidel(
    count: int,
    call: int,
    reduced: ReducedProblem,
    tally: Tally,
    iteration: Iteration,
    mode: Integers,
) -> int:
    """Sweep over the reduced problem until other modes are to be tried than before.

    The sweeps start from no impulse. Returns ``SOLVED`` with a proposal in ``mode``, to be called
    again (``call`` counts from 0) if it does not hold, or ``ITERATION_LIMIT``.
    """
    if call == 0:
        iteration.number = 0
        for i in range(reduced.unknowns):
            iteration.x[i] = 0.0
    while iteration.number < SWEEPS:
        iteration.number += 1
        tally.iterations += 1
        changed = call == 0
        for contact in range(count):
            name = solve_block(contact, reduced, iteration.x)
            changed = changed or name != mode[contact]
            mode[contact] = name
        if changed:
            return SOLVED
    return ITERATION_LIMIT
