"""Small dense systems of equations, singular ones too.

A tableau, or dictionary, writes its basic variables in terms of the others: row i reads
``basic_i = tableau[i, 0] + sum_j tableau[i, j] * other_j`` with columns j from 1.
"""

from __future__ import annotations

import math

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.robot.model import Floats, Integers
from heelstrike.tolerances import NO_PIVOT

UNIT_PIVOT = 1e-12
"""Pivots of the unit-diagonal matrix below this count as zero."""

GOOD_PIVOT = 0.03
"""Diagonal pivots above this are taken as they come: elimination of a positive semidefinite
matrix is stable in any order, and only its rank needs the large pivots first."""

ROUNDED_PIVOT = 2e-15
"""Pivots of the unit-diagonal matrix below this are rounding."""

CONSISTENT = 1e-12
"""Equations that are left with less than this, relative to the largest, are met."""

SWEEPS, ROUNDED_FORCE = 100, 1e-14
"""How often forces are raised to zero at most, and part of the largest that is none."""

CUT_OFF = 100.0 * ROUNDED_FORCE
"""Part of the largest force by which one may pull in the end and be cut off: rounding of so many
sweeps."""


@kernel
def pivot(rows: int, columns: int, row: int, column: int, tableau: Floats) -> None:
    """Exchange the basic variable of ``row`` with the other variable of ``column``."""
    inverse = 1.0 / tableau[row, column]
    for j in range(columns):
        tableau[row, j] *= -inverse
    tableau[row, column] = inverse
    for i in range(rows):
        factor = tableau[i, column]
        if i != row and factor != 0.0:
            tableau[i, column] = 0.0
            for j in range(columns):
                tableau[i, j] += factor * tableau[row, j]


@kernel
def eliminate(
    size: int, symmetric: bool, tableau: Floats, pivot_row: Integers, taken: Integers
) -> int:
    """Solve equations ``c + A x = 0`` as far as their rank allows; return their nullity.

    Symmetric equations, positive semidefinite, pivot on a large diagonal element, others on the
    largest element of all.

    Parameters
    ----------
    size : int
        Number of equations, and of unknowns.
    symmetric : bool
        Whether A is.
    tableau : (size, size + 1) float
        c and A, of order one. Out: row ``pivot_row[j]`` is unknown j, in column 0 its value where
        the free ones are zero, in their columns what it gains by each; in the other columns the
        inverse of the part of A that was solved with.
    pivot_row : (size,) int
        Out: row of each unknown, -1 if it stays free.
    taken : (size,) int
        Out: whether each row holds an unknown.
    """
    speeds = 0.0
    for i in range(size):
        pivot_row[i] = -1
        taken[i] = 0
        speeds = max(speeds, abs(tableau[i, 0]))
    nullity = size
    smallest = UNIT_PIVOT
    while nullity > 0:
        largest = smallest
        row = size
        column = size
        for i in range(size):
            if taken[i] != 0:
                continue
            if symmetric:
                if tableau[i, i + 1] > largest:
                    largest = tableau[i, i + 1]
                    row = i
                    column = i
                    if largest > GOOD_PIVOT:
                        break
                continue
            for j in range(size):
                if abs(tableau[i, j + 1]) > largest and pivot_row[j] < 0:
                    largest = abs(tableau[i, j + 1])
                    row = i
                    column = j
        if row < size:
            pivot(size, size + 1, row, column + 1, tableau)
            taken[row] = 1
            pivot_row[column] = row
            nullity -= 1
            continue
        # What is left is singular. If it is not consistent, it was not quite singular.
        left = 0.0
        for i in range(size):
            if taken[i] == 0:
                left = max(left, abs(tableau[i, 0]))
        if smallest == ROUNDED_PIVOT or left <= CONSISTENT * speeds:
            break
        smallest = ROUNDED_PIVOT
    return nullity


@kernel
def triangulate(size: int, width: int, complete: bool, matrix: Floats, order: Integers) -> int:
    """Replace a matrix by its triangular factors; return its rank, if pivots are `complete`.

    Parameters
    ----------
    size, width : int
        Equations, and columns with those of right-hand sides, which are carried along.
    complete : bool
        Whether a pivot is the largest entry of all, and what is left behind the last is nothing; or
        the largest of its column, of a matrix that is regular.
    matrix : (size, width) float
        Out: U, and under its diagonal L, whose own diagonal is one.
    order : (size,) int
        The column that has come to each place, or the row that each was exchanged with.
    """
    for k in range(size):
        order[k] = k
    smallest = 0.0  # known with the first pivot, which is the largest entry
    for k in range(size):
        best, row, place = smallest, -1, k
        for i in range(k, size):
            for j in range(k, size if complete else k + 1):
                if abs(matrix[i, j]) > best:
                    best, row, place = abs(matrix[i, j]), i, j
        if complete and row < 0:
            return k
        if complete and k == 0:
            smallest = NO_PIVOT * best
        row = max(row, k)  # numbers that are none are handed on
        if row != k:
            for j in range(width):
                matrix[k, j], matrix[row, j] = matrix[row, j], matrix[k, j]
        if place != k:
            for i in range(size):
                matrix[i, k], matrix[i, place] = matrix[i, place], matrix[i, k]
        if complete:
            order[k], order[place] = order[place], order[k]
        else:
            order[k] = row
        for i in range(k + 1, size):
            ratio = matrix[i, k] / matrix[k, k]
            matrix[i, k] = ratio
            if ratio != 0.0:
                for j in range(k + 1, width):
                    matrix[i, j] -= ratio * matrix[k, j]
    return size


@kernel
def substitute(size: int, matrix: Floats, order: Integers, x: Floats) -> None:
    """Replace x by the solution of equations whose matrix was triangulated by its columns."""
    for k in range(size):
        x[k], x[order[k]] = x[order[k]], x[k]
    for i in range(size):
        for j in range(i):
            x[i] -= matrix[i, j] * x[j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= matrix[i, j] * x[j]
        x[i] /= matrix[i, i]


@kernel
def solve_to_rank(size: int, system: Floats, column: Integers, unknown: Floats) -> int:
    """Solve equations of any kind, their right-hand side in the last column, by complete pivoting.

    Returns the rank; unknowns that the equations leave free are zero.
    """
    rank = triangulate(size, size + 1, True, system, column)
    for k in range(size - 1, -1, -1):
        total = 0.0
        if k < rank:
            total = system[k, size]
            for j in range(k + 1, rank):
                total -= system[k, j] * unknown[column[j]]
            total /= system[k, k]
        unknown[column[k]] = total
    return rank


class LinearEquations(Bundle):
    """Equations A x = b in a few unknowns, for the memory of a law.

    Examples
    --------
    >>> from heelstrike.control import LinearEquations
    >>> equations = LinearEquations.allocate(unknowns=2)
    >>> equations.system[:] = [[2.0, 1.0, 3.0], [1.0, 3.0, 4.0]]
    >>> equations.solve(), equations.x
    (2, array([1., 1.]))
    """

    system: Floats = array("unknowns", "unknowns + 1")
    """A, and b in the last column. Solving uses them up."""
    x: Floats = array("unknowns")
    """The answer."""
    order: Integers = array("unknowns", of=int)
    """Scratch."""

    @kernel
    def solve(self) -> int:
        """Write the answer into `x`, by complete pivoting; return the rank of A.

        If it is less than the number of unknowns, those that are left free are zero, and the
        equations may contradict each other.
        """
        return solve_to_rank(self.x.shape[0], self.system, self.order, self.x)


@kernel
def shorten(
    first: int, size: int, rank: int, unit: Floats, ratio: Floats, column: Integers, system: Floats,
    unknown: Floats,
) -> None:  # fmt: skip
    """Choose among the solutions of equations that :func:`solve_to_rank` left open the shortest.

    Which unknowns that leaves free, and zero, depends on rounding where pivots tie; the shortest
    solution does not, and changes no faster than the equations do. Unknowns from `first` on count
    for their length, each for that of a force with `ratio` as much across it; those before follow.

    Parameters
    ----------
    first, size, rank : int
        First unknown that counts, number of unknowns, rank of the equations.
    unit : (size,) float
        What an unknown of the system stands for in `unknown`.
    ratio : (size - first,) float
        Force across each unknown, for one along it.
    column : (size,) int
    system : (size, size + 1) float
        What elimination left. Out: the free directions in the rows from `rank` on, orthogonal to
        each other and of length one, or zero if no unknown that counts has a part in them.
    unknown : (size,) float
        A solution. Out: the shortest.
    """
    for free in range(rank, size):
        direction = system[free]
        for other in range(rank, size):
            direction[column[other]] = 1.0 if other == free else 0.0
        for k in range(rank - 1, -1, -1):
            total = -system[k, free]
            for j in range(k + 1, rank):
                total -= system[k, j] * direction[column[j]]
            direction[column[k]] = total / system[k, k]
        for i in range(size):
            direction[i] *= unit[i]
        for earlier in range(rank, free):
            remove(system[earlier], first, size, ratio, direction)
        length = math.sqrt(product(direction, direction, first, size, ratio))
        for i in range(size):
            direction[i] = direction[i] / length if length > 0.0 else 0.0
        remove(direction, first, size, ratio, unknown)


@kernel
def product(one: Floats, other: Floats, first: int, size: int, ratio: Floats) -> float:
    """Product of two vectors, as :func:`shorten` reckons lengths."""
    total = 0.0
    for i in range(first, size):
        total += (1.0 + ratio[i - first] * ratio[i - first]) * one[i] * other[i]
    return total


@kernel
def remove(direction: Floats, first: int, size: int, ratio: Floats, vector: Floats) -> None:
    """Make a vector orthogonal to a direction of length one, as :func:`shorten` reckons them."""
    along = product(direction, vector, first, size, ratio)
    for i in range(size):
        vector[i] -= along * direction[i]


@kernel
def raise_to_zero(
    first: int, size: int, rank: int, presses: Integers, system: Floats, unknown: Floats
) -> None:
    """Move what :func:`shorten` chose as little as lets nothing pull that can only press.

    Hildreth's method: in turn, each such force is raised to zero along the free directions, or let
    back as far as it has been raised. If no solution has them all, some are left below zero.

    Parameters
    ----------
    first, size, rank : int
        As there.
    presses : (size - first,) int
        Whether each unknown from `first` on must not be negative.
    system : (size, size + 1) float
        The free directions, in the rows from `rank` on. Its last column is used up.
    unknown : (size,) float
        The solution.
    """
    largest = 0.0
    for i in range(first, size):
        system[i, size] = 0.0
        largest = max(largest, abs(unknown[i]))
    for _ in range(SWEEPS):
        moved = 0.0
        for i in range(first, size):
            square = 0.0
            for free in range(rank, size):
                square += system[free, i] * system[free, i]
            if presses[i - first] == 0 or square < NO_PIVOT:
                continue
            raised = max(-unknown[i] / square, -system[i, size])
            if raised == 0.0:
                continue
            system[i, size] += raised
            for free in range(rank, size):
                along = raised * system[free, i]
                for j in range(size):
                    unknown[j] += along * system[free, j]
            moved = max(moved, abs(raised) * square)
        if moved <= ROUNDED_FORCE * largest:
            break
    for i in range(first, size):
        if presses[i - first] == 1 and 0.0 > unknown[i] > -CUT_OFF * largest:
            unknown[i] = 0.0


@dissolved_kernel
def solve_positive(size: int, matrix: Floats, x: Floats) -> None:
    """Replace x by the solution of equations whose matrix, its lower half given, is positive."""
    for i in range(size):
        for j in range(i):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry
        for j in range(i):
            ratio = matrix[i, j] * matrix[j, j]
            matrix[i, i] -= ratio * matrix[i, j]
            x[i] -= ratio * x[j]
            matrix[i, j] = ratio
        matrix[i, i] = 1.0 / matrix[i, i]
    for j in range(size - 1, -1, -1):
        total = x[j] * matrix[j, j]
        for i in range(j + 1, size):
            total -= matrix[i, j] * x[i]
        x[j] = total
