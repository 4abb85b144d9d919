"""Lemke's method with lexicographic anti-cycling.

In the plane the friction cone has two edges, so the frictional problem is a linear
complementarity problem without approximation. In the form of Stewart and Trinkle
(Int. J. Numer. Methods Eng. 39, 1996) and Anitescu and Potra (Nonlinear Dynamics 14, 1997) a
contact with friction brings four pairs::

    normal velocity                0 <= w_n            _|_  lambda_n >= 0
    tangential velocity + slip     0 <= w_t + sigma    _|_  beta_+   >= 0
    slip - tangential velocity     0 <= sigma - w_t    _|_  beta_-   >= 0
    friction still available       0 <= mu lambda_n - beta_+ - beta_-  _|_  sigma >= 0

with ``lambda_t = beta_+ - beta_-`` and ``sigma`` the slip speed; one without friction brings
the first, and a line the first twice, once in each direction. The matrix is copositive, so with
lexicographic pivoting a ray means that the problem has internal forces that the free velocity works
against, not that the method was unlucky.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, SLIP_FORWARD, SOLVED, STICK, UNCERTIFIED
from heelstrike.contact.sets import LINE
from heelstrike.contact.solvers.pivoting import pivot_to_solution
from heelstrike.contact.workspace import Dictionary, Floats, Integers, ReducedProblem, Tally

PATHS = 9
"""How many covering vectors are tried: what rounding spoils on one path it spares on another, and
where one path ends in a ray another may find a solution."""

NO_VELOCITY = 1e-11
"""Velocities below this, where the largest free one is one, are read as zero."""

GOLDEN = 0.6180339887498949


TIE, FINER_TIE, COARSER_TIE = 1e-11, 1e-13, 1e-9
"""How close two ratios tie: on the first path, and on the others in turn. The matrix has a diagonal
of one, and pivots leave some hundred times its rounding."""

SPREAD = 6.0
"""Powers of ten over which the entries of later covering vectors are spread."""


@kernel
def covering(path: int, row: int) -> float:
    """Return an entry of the covering vector of a path, from 1 to 2 at first, later to 1e6."""
    share = (GOLDEN * path * (row + 1)) % 1.0
    return 1.0 + share if path < 3 else 10.0 ** (SPREAD * share)


@kernel
def faces_of(contact: int, reduced: ReducedProblem) -> int:
    """How many velocities of a contact are held: with friction three, on a line both ways."""
    if reduced.tangent[contact] >= 0:
        return 3
    return 2 if reduced.set[contact] == LINE else 1


@kernel
def load_frictional(count: int, path: int, reduced: ReducedProblem, tableau: Floats) -> int:
    """Write the reduced problem as a dictionary; return the number of pairs.

    The pairs of a contact are consecutive, in the order of the module's docstring. The free
    velocity is scaled to one.
    """
    normal = reduced.normal
    offset, cone, matrix = reduced.offset, reduced.cone, reduced.matrix
    size = 0.0
    for i in range(reduced.unknowns):
        size = max(size, abs(offset[i]))
    size = 1.0 / size if size > 0.0 else 1.0
    pairs = 0
    for contact in range(count):
        faces = faces_of(contact, reduced)
        pairs += 4 if faces == 3 else faces
    for i in range(pairs):
        for j in range(pairs + 1):
            tableau[i, j] = 0.0
        tableau[i, pairs + 1] = covering(path, i)
    row = 0
    for contact in range(count):
        height = faces_of(contact, reduced)
        for i in range(height):
            own = normal[contact] + (min(i, 1) if height == 3 else 0)
            own_sign = -1.0 if i > 0 and i == height - 1 else 1.0
            tableau[row + i, 0] = own_sign * size * offset[own]
            column = 1
            for other in range(count):
                width = faces_of(other, reduced)
                for j in range(width):
                    entry = matrix[own, normal[other] + (min(j, 1) if width == 3 else 0)]
                    sign = -own_sign if j > 0 and j == width - 1 else own_sign
                    tableau[row + i, column + j] = sign * entry
                column += 4 if width == 3 else width
            if i > 0 and height == 3:
                tableau[row + i, row + 4] = 1.0
                tableau[row + 3, row + 1 + i] = -1.0
        if height == 3:
            tableau[row + 3, row + 1] = cone[contact]
        row += 4 if height == 3 else height
    return pairs


@kernel
def value(variable: int, dictionary: Dictionary) -> float:
    """Return the value of a variable in the final dictionary."""
    row = dictionary.place[variable]
    return dictionary.tableau[row, 0] if row >= 0 else 0.0


@kernel
def lemke(
    count: int,
    path: int,
    reduced: ReducedProblem,
    tally: Tally,
    dictionary: Dictionary,
    mode: Integers,
) -> int:
    """Find the contact modes of the reduced problem by Lemke's method.

    ``path``, from 0, chooses the covering vector and how close a tie is. Returns ``SOLVED`` with a
    proposal in ``mode``, whether it is a solution or how far the pivots came; after the last path,
    how that one ended.
    """
    if path == PATHS:
        return dictionary.status if dictionary.status != SOLVED else UNCERTIFIED
    tie = TIE
    if path % 3 == 1:
        tie = FINER_TIE
    elif path % 3 == 2:
        tie = COARSER_TIE
    pairs = load_frictional(count, path, reduced, dictionary.tableau)
    dictionary.status = pivot_to_solution(pairs, tie, tally, dictionary)
    place = dictionary.place
    row = 0
    for contact in range(count):
        frictional = reduced.tangent[contact] >= 0
        mode[contact] = STICK if place[pairs + row] >= 0 else OPEN
        if path == 0:
            # By the velocities. The other paths are for problems that rounding makes difficult,
            # and go by the basis.
            if mode[contact] == OPEN and value(row, dictionary) <= NO_VELOCITY:
                mode[contact] = STICK
            if mode[contact] == STICK and frictional:
                slip = 0.5 * (value(row + 1, dictionary) - value(row + 2, dictionary))
                if slip > NO_VELOCITY:
                    mode[contact] = SLIP_FORWARD
                elif slip < -NO_VELOCITY:
                    mode[contact] = SLIP_BACKWARD
        elif mode[contact] == STICK and frictional and place[pairs + row + 3] >= 0:
            # Slip. With the friction to both sides in the basis its speed is zero, though.
            forward = place[pairs + row + 2] >= 0
            backward = place[pairs + row + 1] >= 0
            if forward and not backward:
                mode[contact] = SLIP_FORWARD
            elif backward and not forward:
                mode[contact] = SLIP_BACKWARD
        row += 4 if frictional else faces_of(contact, reduced)
    return SOLVED
