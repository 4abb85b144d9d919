"""The least-norm split: of all impulses with the same effect, the shortest that the cones allow."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SOLVED, STICK
from heelstrike.contact.sets import LINE, contains, row_of
from heelstrike.contact.solvers.pivoting import pivot_to_solution
from heelstrike.contact.workspace import (
    ContactProblem,
    Equations,
    Floats,
    Integers,
    ReducedProblem,
    Tally,
)

SPLIT_TIE = 1e-13
"""How close two ratios tie in the pivots of the split."""

CONE_MARGIN = 1e-14
"""How far the cones are opened, relative to the scaled unknowns, where rounding has closed them;
a hundred times as far if that is not enough, and once more."""


STILL_MOVES = 1e-9
"""A direction changes a velocity if it does so by more than this part of its largest unknown: the
elimination that found it stops at pivots of 1e-12, and leaves the root of that at worst."""

NO_EDGE = 1e-12
"""Length of an edge in terms of the free directions up to which they do not move it."""

WIDER = 100.0
"""How much further the cones are opened each time."""


@kernel
def free_directions(equations: Equations) -> int:
    """Write the free directions of the solved equations to ``basis``; return how many."""
    pivot_row, weight, size = equations.pivot_row, equations.weight, equations.size
    tableau, basis = equations.tableau, equations.basis
    found = 0
    for free in range(size):
        if pivot_row[free] < 0:
            for j in range(size):
                row = pivot_row[j]
                basis[found, j] = weight[j] * tableau[row, free + 1] if row >= 0 else 0.0
            basis[found, free] = weight[free]
            found += 1
    return found


@kernel
def keep_velocity(
    problem: ContactProblem, found: int, reduced: ReducedProblem, equations: Equations
) -> int:
    """Reduce the free directions to those that change no velocity; return how many.

    Where contacts slip the equations leave their slip speed open, so a free direction may change
    it. Elimination on the velocities that the directions cause leaves the combinations without.
    """
    rows, size = row_of(problem.count, problem.first), equations.size
    delassus = problem.delassus
    equation, ratio, weight = equations.unknown, equations.friction_ratio, equations.weight
    basis, image, kind = equations.basis, equations.image, equations.moves
    for k in range(found):
        largest = 0.0
        for i in range(rows):
            image[k, i] = 0.0
        for j in range(size):
            column = row_of(row_of(j, equation), reduced.source)
            scaled = basis[k, j] / weight[j]
            largest = max(largest, abs(scaled))
            along = scaled * reduced.scale[row_of(j, equation)]
            across = along * ratio[j]
            for i in range(rows):
                image[k, i] += along * delassus[i, column]
            if across != 0.0:
                for i in range(rows):
                    image[k, i] += across * delassus[i, column + 1]
        for i in range(rows):
            diagonal = delassus[i, i]
            if diagonal > 0.0:
                image[k, i] /= math.sqrt(diagonal)
        for other in range(k):
            if kind[other] == 1:
                along = 0.0
                for i in range(rows):
                    along += image[k, i] * image[other, i]
                for i in range(rows):
                    image[k, i] -= along * image[other, i]
                for j in range(size):
                    basis[k, j] -= along * basis[other, j]
        length = 0.0
        for i in range(rows):
            length += image[k, i] * image[k, i]
        length = math.sqrt(length)
        kind[k] = 1 if length > STILL_MOVES * largest else 0
        if kind[k] == 1:
            for i in range(rows):
                image[k, i] /= length
            for j in range(size):
                basis[k, j] /= length
    kept = 0
    for k in range(found):
        if kind[k] == 0:
            for j in range(size):
                basis[kept, j] = basis[k, j]
            kept += 1
    return kept


@kernel
def project(size: int, nullity: int, basis: Floats, point: Floats) -> None:
    """Orthonormalise the free directions and remove them from the point."""
    for found in range(nullity):
        for _ in range(2 if found > 0 else 0):  # twice is enough (Kahan, Parlett)
            for k in range(found):
                along = 0.0
                for j in range(size):
                    along += basis[k, j] * basis[found, j]
                for j in range(size):
                    basis[found, j] -= along * basis[k, j]
        length = 0.0
        along = 0.0
        for j in range(size):
            length += basis[found, j] * basis[found, j]
            along += basis[found, j] * point[j]
        inverse = 1.0 / math.sqrt(length)
        along /= length
        for j in range(size):
            point[j] -= along * basis[found, j]
            basis[found, j] *= inverse


@kernel
def split(
    problem: ContactProblem,
    mode: Integers,
    hold: bool,
    reduced: ReducedProblem,
    tally: Tally,
    equations: Equations,
) -> bool:
    """Move the point along the free directions to the least norm that the cones allow.

    The shortest step that brings the point inside is a least-distance problem. Its dual is a
    linear complementarity problem whose unknowns are the edges of the cones that hold the point
    back; Lemke's pivots solve it. Where no step would do, the projection stands, and the
    certificate of the solve tells.

    If ``hold``, directions that would change a velocity are left out; returns whether any were.
    """
    found = free_directions(equations)
    nullity = keep_velocity(problem, found, reduced, equations) if hold else found
    project(equations.size, nullity, equations.basis, equations.point)
    longest = excess(problem, mode, reduced.tangent, equations)
    if longest > 0.0:
        number = list_edges(problem, mode, reduced.tangent, nullity, longest, equations)
        step_inside(number, nullity, longest, tally, equations)
    return nullity < found


@kernel
def excess(
    problem: ContactProblem, mode: Integers, tangent: Integers, equations: Equations
) -> float:
    """Return the largest impulse of the point, or zero if all of them are in their sets."""
    point = equations.point
    longest = 0.0
    inside = True
    place = 0
    for contact in range(problem.count):
        if mode[contact] == OPEN:
            continue
        first = place
        place += 2 if tangent[contact] >= 0 and mode[contact] == STICK else 1
        across = point[place - 1] if place == first + 2 else 0.0
        inside = inside and contains(problem, contact, point[first], across)
        for i in range(first, place):
            longest = max(longest, abs(point[i]))
    return 0.0 if inside else longest


@kernel
def list_edges(
    problem: ContactProblem, mode: Integers, tangent: Integers, nullity: int, longest: float,
    equations: Equations,
) -> int:  # fmt: skip
    """Write the edges of the cones in terms of the free directions; return how many there are.

    Edge i: ``edge[i, :nullity] @ step + edge[i, nullity] >= 0``, of unit length, steps in units of
    the ``longest`` impulse; what is next to it opens the cone by a margin.
    """
    point, weight, basis, edges = (
        equations.point, equations.weight, equations.basis, equations.edge,
    )  # fmt: skip
    largest = 0.0  # scaled unknown
    for i in range(equations.size):
        largest = max(largest, abs(point[i]) / weight[i])
    number = 0
    place = 0
    for contact in range(problem.count):
        if mode[contact] == OPEN:
            continue
        sides = 2 if tangent[contact] >= 0 and mode[contact] == STICK else 1
        for side in range(0 if problem.set[contact] == LINE else sides):
            along = problem.friction[contact] if sides == 2 else 1.0
            across = 2.0 * side - 1.0 if sides == 2 else 0.0
            second = place + sides - 1
            length = 0.0
            for k in range(nullity):
                part = along * basis[k, place] + across * basis[k, second]
                edges[number, k] = part
                length += part * part
            length = math.sqrt(length)
            if length > NO_EDGE:
                for k in range(nullity):
                    edges[number, k] /= length
                room = along * point[place] + across * point[second]
                edges[number, nullity] = room / (length * longest)
                edges[number, nullity + 1] = largest * weight[place] / (length * longest)
                number += 1
        place += sides
    return number


@kernel
def step_inside(
    number: int, nullity: int, longest: float, tally: Tally, equations: Equations
) -> None:
    """Move the point by the shortest step along the free directions that no edge holds back."""
    point, step, basis = equations.point, equations.step, equations.basis
    edges, dual = equations.edge, equations.dual.tableau
    margin = 0.0
    for attempt in range(4):
        for i in range(number):
            for j in range(number):
                entry = 0.0
                for k in range(nullity):
                    entry += edges[i, k] * edges[j, k]
                dual[i, j + 1] = entry
            dual[i, 0] = edges[i, nullity] + margin * edges[i, nullity + 1]
            dual[i, number + 1] = 1.0
        if pivot_to_solution(number, SPLIT_TIE, tally, equations.dual) == SOLVED:
            break
        if attempt == 3:
            return
        margin = CONE_MARGIN if attempt == 0 else WIDER * margin
    for k in range(nullity):
        step[k] = 0.0
    for i in range(number):
        row = equations.dual.place[number + i]
        if row >= 0:
            for k in range(nullity):
                step[k] += longest * dual[row, 0] * edges[i, k]
    for k in range(nullity):
        for j in range(equations.size):
            point[j] += step[k] * basis[k, j]
