"""The impulse that goes with given contact modes, and whether it solves the problem.

Knowing which contacts are open, stick or slip to which side turns the contact problem into
linear equations: zero normal velocity at closed contacts, zero tangential velocity at sticking
ones. They are often singular (two vertices of one flat foot) and then consistent, so the
elimination reveals the rank and the free directions, along which the least-norm split is chosen.
All solvers end here: what they contribute is the modes. The certificate has the last word.
"""

from __future__ import annotations

import math

from heelstrike.compilation import inner_kernel
from heelstrike.contact.certificate import certify
from heelstrike.contact.least_norm import split
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from heelstrike.contact.pivoting import pivot
from heelstrike.contact.workspace import (
    CONE,
    EQUATION,
    IMPULSE,
    LEAN,
    NORMAL,
    OFFSET,
    PIVOT_ROW,
    POINT,
    RESIDUAL,
    ROW_LABEL,
    SCALE,
    SKEWED,
    SLOPE,
    SOURCE,
    SPEED,
    TANGENT,
    TRIAL_MODE,
    VELOCITY,
    WEIGHT,
    ContactWorkspace,
    Floats,
    Integers,
)

RANK_TOLERANCE = 1e-12
"""Pivots of the unit-diagonal matrix below this count as zero."""

ROUNDING = 2e-15
"""Pivots of the unit-diagonal matrix below this are rounding."""

CONSISTENT = 1e-12
"""Equations that are left with less than this, relative to the largest, are met."""

REST_TOLERANCE = 1e-10
"""Velocities below this, relative to what they are summed from, count as zero."""

SHARP = 1e-13
"""Residuals above this are worth a step of iterative refinement."""


@inner_kernel
def assemble(count: int, friction: Floats, work: ContactWorkspace) -> int:
    """Write the equations of the modes under trial into the tableau; return their number.

    At a slipping contact the tangential impulse leans on the normal one and has no equation.
    """
    mode, equation = work.labels[TRIAL_MODE], work.labels[EQUATION]
    normal, tangent = work.labels[NORMAL], work.labels[TANGENT]
    slope, cone, lean = work.vectors[SLOPE], work.vectors[CONE], work.vectors[LEAN]
    scale, weight, offset = work.vectors[SCALE], work.vectors[WEIGHT], work.vectors[OFFSET]
    matrix, tableau = work.matrix, work.tableau
    size = 0
    for contact in range(count):
        if mode[contact] == OPEN:
            continue
        first = normal[contact]
        across = slope[contact]
        equation[size] = first
        lean[size] = 0.0
        if tangent[contact] >= 0:
            if mode[contact] == STICK:
                equation[size + 1] = first + 1
                lean[size + 1] = 0.0
                weight[size] = scale[first]
                weight[size + 1] = scale[first + 1]
                size += 2
                continue
            across = friction[contact]
            lean[size] = cone[contact]
            if mode[contact] == SLIP_FORWARD:
                lean[size] = -cone[contact]
        weight[size] = scale[first] * math.sqrt(1.0 + across * across)
        size += 1
    for i in range(size):
        row = equation[i]
        tableau[i, 0] = offset[row]
        for j in range(size):
            tableau[i, j + 1] = matrix[row, equation[j]]
            if lean[j] != 0.0:
                tableau[i, j + 1] += lean[j] * matrix[row, equation[j] + 1]
    return size


@inner_kernel
def eliminate(size: int, work: ContactWorkspace) -> int:
    """Solve the equations in the tableau as far as their rank allows; return their nullity.

    The solution with the free unknowns at zero goes to ``POINT``; ``PIVOT_ROW`` tells which
    unknowns stayed free. Symmetric equations pivot on the largest diagonal element, others on
    the largest of all.
    """
    pivot_row, taken, slope = work.labels[PIVOT_ROW], work.labels[ROW_LABEL], work.vectors[SLOPE]
    lean, weight, point = work.vectors[LEAN], work.vectors[WEIGHT], work.vectors[POINT]
    tableau = work.tableau
    symmetric = work.settings[SKEWED] == 0.0
    speeds = 0.0
    for i in range(size):
        pivot_row[i] = -1
        taken[i] = 0
        speeds = max(speeds, abs(tableau[i, 0]))
        contact = work.labels[SOURCE, work.labels[EQUATION, i]] // 2
        symmetric = symmetric and lean[i] == 0.0 and slope[contact] == 0.0
    nullity = size
    smallest = RANK_TOLERANCE
    while nullity > 0:
        largest = smallest
        row = size
        column = size
        for i in range(size):
            if taken[i] == 0:
                for j in range(i if symmetric else 0, i + 1 if symmetric else size):
                    if pivot_row[j] < 0 and abs(tableau[i, j + 1]) > largest:
                        largest = abs(tableau[i, j + 1])
                        row = i
                        column = j
        if row < size:
            pivot(tableau, size, size + 1, row, column + 1)
            taken[row] = 1
            pivot_row[column] = row
            nullity -= 1
            continue
        # What is left is singular. If it is not consistent, it was not quite singular.
        left = 0.0
        for i in range(size):
            if taken[i] == 0:
                left = max(left, abs(tableau[i, 0]))
        if smallest == ROUNDING or left <= CONSISTENT * speeds:
            break
        smallest = ROUNDING
    for j in range(size):
        point[j] = weight[j] * tableau[pivot_row[j], 0] if pivot_row[j] >= 0 else 0.0
    return nullity


@inner_kernel
def expand(count: int, friction: Floats, work: ContactWorkspace) -> None:
    """Write ``POINT`` out as an impulse inside the cones, exactly.

    The point is in units of impulse; along a slipping contact it measures the whole impulse.
    """
    mode, tangent, slope = work.labels[TRIAL_MODE], work.labels[TANGENT], work.vectors[SLOPE]
    point, impulse = work.vectors[POINT], work.vectors[IMPULSE]
    place = 0
    for contact in range(count):
        row = 2 * contact
        impulse[row] = 0.0
        impulse[row + 1] = 0.0
        if mode[contact] == OPEN:
            continue
        along = max(point[place], 0.0)
        limit = friction[contact]
        place += 1
        if tangent[contact] >= 0 and mode[contact] == STICK:
            limit *= along
            impulse[row] = along
            impulse[row + 1] = min(max(point[place], -limit), limit)
            place += 1
            continue
        across = slope[contact]
        if tangent[contact] >= 0:
            across = -limit if mode[contact] == SLIP_FORWARD else limit
        impulse[row] = along / math.sqrt(1.0 + across * across)
        impulse[row + 1] = across * impulse[row]


@inner_kernel
def evaluate(
    count: int, delassus: Floats, free: Floats, friction: Floats, work: ContactWorkspace
) -> float:
    """Find the impulse of the modes in ``TRIAL_MODE`` and return its largest residual.

    The impulse, its velocity and residuals are left in the workspace. Where rounding shows, up
    to two steps of iterative refinement sharpen them.
    """
    equation, pivot_row, source = work.labels[EQUATION], work.labels[PIVOT_ROW], work.labels[SOURCE]
    point, weight, scale = work.vectors[POINT], work.vectors[WEIGHT], work.vectors[SCALE]
    impulse, velocity, speed = work.vectors[IMPULSE], work.vectors[VELOCITY], work.vectors[SPEED]
    size = assemble(count, friction, work)
    nullity = eliminate(size, work)
    if nullity > 0:
        split(count, size, nullity, friction, work)
    worst = math.inf
    for attempt in range(3):
        expand(count, friction, work)
        worst = certify(
            count,
            delassus,
            free,
            friction,
            work.vectors[SLOPE],
            impulse,
            velocity,
            work.vectors[RESIDUAL],
        )
        if worst < SHARP or not worst < 1e-6 or attempt == 2:
            break
        for j in range(size):
            speed[j] = scale[equation[j]] * velocity[source[equation[j]]]
        for j in range(size):
            if pivot_row[j] >= 0:
                correction = 0.0
                for k in range(size):
                    if pivot_row[k] >= 0:
                        correction -= work.tableau[pivot_row[j], k + 1] * speed[pivot_row[k]]
                point[j] += weight[j] * correction
    return worst


@inner_kernel
def label(
    count: int,
    delassus: Floats,
    free: Floats,
    impulse: Floats,
    velocity: Floats,
    mode: Integers,
    work: ContactWorkspace,
) -> bool:
    """Name every contact's mode from its velocity; return whether an unknown was released.

    A contact that a solver calls open or slipping, but whose velocity is zero, may carry any
    impulse in its cone. Only with all of these admitted is the least-norm split unique.
    """
    released = False
    speeds = 0.0
    for i in range(2 * count):
        speeds = max(speeds, abs(free[i]))
    for contact in range(count):
        row = 2 * contact
        normal_size = speeds + abs(free[row])
        tangent_size = speeds + abs(free[row + 1])
        for j in range(2 * count):
            normal_size += abs(delassus[row, j] * impulse[j])
            tangent_size += abs(delassus[row + 1, j] * impulse[j])
        name = STICK
        if velocity[row] > REST_TOLERANCE * normal_size:
            name = OPEN
        elif velocity[row + 1] > REST_TOLERANCE * tangent_size:
            name = SLIP_FORWARD
        elif velocity[row + 1] < -REST_TOLERANCE * tangent_size:
            name = SLIP_BACKWARD
        if mode[contact] == OPEN:
            released = released or name != OPEN
        elif mode[contact] != STICK and work.labels[TANGENT, contact] >= 0:
            released = released or name == STICK
        mode[contact] = name
    return released
