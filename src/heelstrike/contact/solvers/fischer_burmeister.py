"""The Fischer-Burmeister equations (the paper's eq. 17), solved by a semismooth Newton method.

Complementarity ``a >= 0, b >= 0, a b = 0`` is the equation ``phi(a, b) = 0`` with
``phi(a, b) = a + b - sqrt(a^2 + b^2)``. The normal pair is written so directly. Friction is a
variable between two bounds that move with the normal impulse, ``-mu x_n <= x_t <= mu x_n``, and
uses the function twice (Billups, 1995)::

    phi(x_t + mu x_n, -phi(mu x_n - x_t, -y_t)) = 0

One equation an unknown. The Jacobian is singular wherever contacts are redundant, so steps are
those of Levenberg and Marquardt, with a backtracking, nonmonotone line search on the squared
residual. Whenever the iterate points to other modes than before, these are proposed for an exact
solve. A start that leads nowhere is followed by others, further out and with other damping.
"""

from __future__ import annotations

import math

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
from heelstrike.contact.workspace import Integers, Iteration, ReducedProblem, Tally
from heelstrike.dynamics.dense import solve_positive

STEPS = 30
"""Newton steps from one starting point."""

STARTS = 40
"""Starting points before giving up."""

GROWTH = 4.0
"""How far a step may raise the squared residual. One that must fall gets stuck in valleys that
are not solutions; on random problems that costs five failures for one."""

GOLDEN = 0.6180339887498949


KINK = 0.3
"""A derivative of the function where it has none: 1 - 1/√2, that of equal arguments."""

OUTWARDS = 20.0
"""Powers of two in which starting points go outwards, then start again."""

DAMPING_FLOOR, WEAKEST, RANGE = 1e-15, -12.0, 10.0
"""Least damping, rounding of a matrix of diagonal one; the powers of ten in which it grows with the
starts, first and number."""

LEAST_STEP = 1e-8
"""Part of a step from which on shorter ones are not tried: the root of rounding."""

DECREASE = 1e-4
"""Part of the predicted decrease that is asked for (Armijo's constant)."""

SOLVED_MERIT = 1e-30
"""Half the sum of squares of residuals that are rounding, 1e-15."""


@kernel
def read_iterate(count: int, reduced: ReducedProblem, iteration: Iteration, mode: Integers) -> bool:
    """Write the modes that an iterate and its velocity point to; return whether any changed."""
    normal, tangent, cone = reduced.normal, reduced.tangent, reduced.cone
    iterate, speed = iteration.x, iteration.speed
    changed = False
    for contact in range(count):
        first = normal[contact]
        name = STICK
        if iterate[first] < speed[first] and reduced.set[contact] != LINE:
            name = OPEN
        elif tangent[contact] >= 0:
            limit = cone[contact] * iterate[first]
            if speed[first + 1] > limit + iterate[first + 1]:
                name = SLIP_FORWARD
            elif -speed[first + 1] > limit - iterate[first + 1]:
                name = SLIP_BACKWARD
        changed = changed or name != mode[contact]
        mode[contact] = name
    return changed


@kernel
def equations(count: int, size: float, reduced: ReducedProblem, iteration: Iteration) -> float:
    """Evaluate the equations and their Jacobian; return half the sum of their squares.

    ``size`` scales the free velocity to one.
    """
    normal, tangent, cone, matrix = reduced.normal, reduced.tangent, reduced.cone, reduced.matrix
    iterate, speed = iteration.x, iteration.speed
    value, tableau, unknowns = iteration.value, iteration.slope, reduced.unknowns
    merit = 0.0
    for i in range(unknowns):
        speed[i] = reduced.offset[i] / size
        for j in range(unknowns):
            speed[i] += matrix[i, j] * iterate[j]
    for contact in range(count):
        first = normal[contact]
        if reduced.set[contact] == LINE:
            value[first] = speed[first]
            merit += 0.5 * value[first] * value[first]
            for j in range(unknowns):
                tableau[first, j] = matrix[first, j]
            continue
        force = iterate[first]
        root = math.sqrt(force * force + speed[first] * speed[first])
        value[first] = force + speed[first] - root
        merit += 0.5 * value[first] * value[first]
        by_speed = 1.0 - speed[first] / root if root > 0.0 else KINK
        for j in range(unknowns):
            tableau[first, j] = by_speed * matrix[first, j]
        tableau[first, first] += 1.0 - force / root if root > 0.0 else KINK
        if tangent[contact] < 0:
            continue
        # Inner: room to the upper edge against backward slip; outer: room to the lower edge.
        second = first + 1
        opening = cone[contact] if force > 0.0 else 0.0
        upper = opening * force - iterate[second]
        lower = opening * force + iterate[second]
        inner_root = math.sqrt(upper * upper + speed[second] * speed[second])
        inner = speed[second] - upper + inner_root
        root = math.sqrt(lower * lower + inner * inner)
        value[second] = lower + inner - root
        merit += 0.5 * value[second] * value[second]
        by_lower = 1.0 - lower / root if root > 0.0 else KINK
        by_inner = 1.0 - inner / root if root > 0.0 else KINK
        by_upper = by_inner * (upper / inner_root - 1.0 if inner_root > 0.0 else -KINK)
        by_speed = by_inner * (speed[second] / inner_root + 1.0 if inner_root > 0.0 else KINK)
        for j in range(unknowns):
            tableau[second, j] = by_speed * matrix[second, j]
        tableau[second, first] += opening * (by_lower + by_upper)
        tableau[second, second] += by_lower - by_upper
    return merit


@kernel
def newton_step(unknowns: int, damping: float, iteration: Iteration) -> None:
    """Solve ``(V^T V + damping I) step = -V^T equations`` for the Jacobian V."""
    step, value = iteration.step, iteration.value
    tableau, square = iteration.slope, iteration.square
    for i in range(unknowns):
        step[i] = 0.0
        for j in range(unknowns):
            square[i, j] = 0.0
        square[i, i] = damping
    for k in range(unknowns):
        for i in range(unknowns):
            factor = tableau[k, i]
            if factor != 0.0:
                step[i] -= factor * value[k]
                for j in range(unknowns):
                    square[i, j] += factor * tableau[k, j]
    solve_positive(unknowns, square, step)


@kernel
def fischer_burmeister(
    count: int,
    call: int,
    reduced: ReducedProblem,
    tally: Tally,
    iteration: Iteration,
    mode: Integers,
) -> int:
    """Iterate on the reduced problem until other modes are to be tried than before.

    Returns ``SOLVED`` with a proposal in ``mode``, to be called again (``call`` counts
    from 0) if it does not hold, or ``ITERATION_LIMIT``.
    """
    iterate, step, unknowns = iteration.x, iteration.step, reduced.unknowns
    size = 0.0
    for i in range(unknowns):
        size = max(size, abs(reduced.offset[i]))
    if size == 0.0:
        size = 1.0
    if call == 0:
        iteration.number = 0
    while iteration.number < STEPS * STARTS:
        start = float(iteration.number // STEPS)
        if iteration.number % STEPS == 0:
            for i in range(unknowns):
                iterate[i] = 2.0 ** (start % OUTWARDS) * ((GOLDEN * start * (i + 1)) % 1.0)
            for contact in range(count):
                second = reduced.tangent[contact]
                if second >= 0:
                    share = 2.0 * ((GOLDEN * start * (second + 1)) % 1.0) - 1.0
                    iterate[second] = share * reduced.cone[contact] * iterate[second - 1]
        iteration.number += 1
        tally.iterations += 1
        merit = equations(count, size, reduced, iteration)
        changed = read_iterate(count, reduced, iteration, mode)
        growing = 10.0 ** (WEAKEST + start % RANGE)
        newton_step(unknowns, DAMPING_FLOOR + growing * min(merit, 1.0), iteration)
        for i in range(unknowns):
            iterate[i] += step[i]
        along = 1.0
        while (
            along > LEAST_STEP
            and equations(count, size, reduced, iteration) > (GROWTH - DECREASE * along) * merit
        ):
            along *= 0.5
            for i in range(unknowns):
                iterate[i] -= along * step[i]
        if along <= LEAST_STEP or merit < SOLVED_MERIT:
            # Stuck, or solved without the modes being right: on to the next starting point.
            iteration.number = (int(start) + 1) * STEPS
        if changed or call == 0:
            return SOLVED
    return ITERATION_LIMIT
