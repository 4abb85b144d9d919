"""The usual case, fast: contacts go on sticking, or stay open, as in the solve before.

Sticking contacts make one symmetric system. Vertices of one flat foot share their tangential row,
so that only the sum of their friction is determined; among all splits the equal one has the least
norm. Rows may depend on each other otherwise, as those of two feet under straight legs do. Whatever
is less usual - slip, or friction that this split cannot hold - is left to the general way, and the
certificate decides as always.
"""

from __future__ import annotations

from heelstrike.compilation import dissolved_kernel, kernel
from heelstrike.contact.certificate import certify
from heelstrike.contact.modes import OPEN, SLIDING_FORWARD, SLIP_BACKWARD, SLIP_FORWARD, STICK
from heelstrike.contact.workspace import (
    BASIS,
    EQUATION,
    PIVOT_ROW,
    POINT,
    REST_TOLERANCE,
    SHARERS,
    SIZE,
    SLOPE,
    ContactWorkspace,
    Floats,
    Integers,
)

SAME_ROW = 1e-14
"""Two rows are one if the inverse mass along their difference is less than this, relative."""

GOOD_PIVOT = 1e-7
"""Pivots that keep more than this of their diagonal are good."""

NO_PIVOT = 1e-11
"""Rows that keep less depend on those before; what lies between is left to the general way."""


@dissolved_kernel
def list_equations(
    count: int, delassus: Floats, friction: Floats, mode: Integers, work: ContactWorkspace
) -> int:
    """List the rows that shall have no velocity; return how many differ, or -1 to give up.

    ``EQUATION`` holds the row of each equation, ``PIVOT_ROW`` the equation of each row, -1 for
    none, and ``SHARERS`` how many rows share an equation.
    """
    source, equation, sharers = work.labels[EQUATION], work.labels[PIVOT_ROW], work.vectors[SHARERS]
    size = 0
    for contact in range(count):
        row = 2 * contact
        tangent = row + 1
        equation[row] = -1
        equation[tangent] = -1
        if mode[contact] == OPEN:
            continue
        has_friction = friction[contact] > 0.0
        if mode[contact] >= SLIDING_FORWARD or (has_friction and mode[contact] != STICK):
            return -1
        equation[row] = size
        source[size] = row
        sharers[size] = 1.0
        size += 1
        if not has_friction:
            continue
        for earlier in range(contact):
            other = 2 * earlier + 1
            if equation[other] >= 0:
                both = delassus[tangent, tangent] + delassus[other, other]
                if abs(both - 2.0 * delassus[tangent, other]) <= SAME_ROW * both:
                    equation[tangent] = equation[other]
                    sharers[equation[other]] += 1.0
                    break
        if equation[tangent] < 0:
            equation[tangent] = size
            source[size] = tangent
            sharers[size] = 1.0
            size += 1
    return size


@dissolved_kernel
def solve_equations(size: int, delassus: Floats, free: Floats, work: ContactWorkspace) -> bool:
    """Solve ``G x = -b`` over the listed rows, x of least norm to ``POINT``; return success.

    Elimination in the order of the rows, A = L D Lᵀ, with 1/D on the diagonal, zero for rows that
    depend on others.
    """
    source, matrix, x = work.labels[EQUATION], work.tableau, work.vectors[POINT]
    dependent = 0
    for i in range(size):
        total = -free[source[i]]
        for j in range(i):
            entry = delassus[source[i], source[j]]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            # Until row i is finished, its entries still carry their D.
            matrix[i, j] = entry
        pivot = delassus[source[i], source[i]]
        diagonal = pivot
        for j in range(i):
            ratio = matrix[i, j] * matrix[j, j]
            pivot -= ratio * matrix[i, j]
            total -= ratio * x[j]
            matrix[i, j] = ratio
        x[i] = total
        if pivot > GOOD_PIVOT * diagonal:
            matrix[i, i] = 1.0 / pivot
        elif abs(pivot) <= NO_PIVOT * diagonal:
            matrix[i, i] = 0.0
            dependent += 1
        else:
            return False
    for i in range(size):
        x[i] *= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for j in range(i):
            x[j] -= matrix[i, j] * x[i]
    if dependent > 0:
        shorten(size, work)
    return True


@kernel
def shorten(size: int, work: ContactWorkspace) -> None:
    """Take from the solution what lies along directions that change no velocity.

    There is one such direction n for every row that depends on others, Lᵀ n = e. They are made
    orthogonal one after the other, in the norm of the impulses: what m rows share in equal parts
    counts 1/m.
    """
    matrix, x, basis = work.tableau, work.vectors[POINT], work.squares[BASIS]
    sharers = work.vectors[SHARERS]
    found = 0
    for row in range(size):
        if matrix[row, row] != 0.0:
            continue
        direction = basis[found]
        for i in range(size):
            direction[i] = 0.0
        direction[row] = 1.0
        for i in range(row, -1, -1):
            for j in range(i):
                direction[j] -= matrix[i, j] * direction[i]
        for earlier in range(found):
            remove_part(size, basis[earlier], sharers, direction)
        remove_part(size, direction, sharers, x)
        found += 1


@kernel
def remove_part(size: int, direction: Floats, sharers: Floats, vector: Floats) -> None:
    """Make a vector orthogonal to a direction."""
    part = 0.0
    length = 0.0
    for i in range(size):
        part += direction[i] * vector[i] / sharers[i]
        length += direction[i] * direction[i] / sharers[i]
    for i in range(size):
        vector[i] -= part / length * direction[i]


@dissolved_kernel
def share_impulses(count: int, friction: Floats, impulse: Floats, work: ContactWorkspace) -> bool:
    """Write the solution out to all rows in equal shares; return whether it is in the cones."""
    equation, sharers, x = work.labels[PIVOT_ROW], work.vectors[SHARERS], work.vectors[POINT]
    for row in range(2 * count):
        place = equation[row]
        impulse[row] = x[place] / sharers[place] if place >= 0 else 0.0
    for contact in range(count):
        normal = impulse[2 * contact]
        if not (normal >= 0.0 and abs(impulse[2 * contact + 1]) <= friction[contact] * normal):
            return False
    return True


@dissolved_kernel
def moves_as_named(
    count: int, friction: Floats, mode: Integers, velocity: Floats, work: ContactWorkspace
) -> bool:
    """Whether the velocity has every contact do what its mode says.

    A contact without friction takes the name of its velocity.
    """
    size = work.vectors[SIZE]
    for contact in range(count):
        normal = 2 * contact
        tangent = normal + 1
        departs = velocity[normal] > REST_TOLERANCE * size[normal]
        if departs != (mode[contact] == OPEN):
            return False
        if departs:
            continue
        if abs(velocity[tangent]) > REST_TOLERANCE * size[tangent]:
            if friction[contact] > 0.0:
                return False
            mode[contact] = SLIP_FORWARD if velocity[tangent] > 0.0 else SLIP_BACKWARD
    return True


@dissolved_kernel
def repeat(
    count: int,
    delassus: Floats,
    free: Floats,
    friction: Floats,
    mode: Integers,
    impulse: Floats,
    velocity: Floats,
    residual: Floats,
    tolerance: float,
    work: ContactWorkspace,
) -> bool:
    """Solve the contact problem if its contacts do what ``mode`` says; return success.

    Arguments are those of :func:`~heelstrike.contact.problem.solve_contact_kernel`. After a
    success they hold the one solution of least norm, certified to ``tolerance``.
    """
    size = list_equations(count, delassus, friction, mode, work)
    if size < 0 or not solve_equations(size, delassus, free, work):
        return False
    if not share_impulses(count, friction, impulse, work):
        return False
    worst = certify(
        count,
        delassus,
        free,
        friction,
        work.vectors[SLOPE],
        impulse,
        velocity,
        residual,
        work.vectors[SIZE],
    )
    return worst <= tolerance and moves_as_named(count, friction, mode, velocity, work)
