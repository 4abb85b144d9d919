"""The least-norm split: of all impulses with the same effect, the shortest that the cones allow."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SOLVED, STICK
from heelstrike.contact.sets import LINE, contains
from heelstrike.contact.solvers.pivoting import pivot_to_solution
from heelstrike.contact.workspace import (
    ContactProblem,
    Equations,
    Floats,
    Integers,
    ReducedProblem,
    Tally,
)

TIE = 1e-13
"""How close two ratios tie in the pivots of the split."""

MARGIN = 1e-14
"""How far the cones are opened, relative to the scaled unknowns, where rounding has closed them;
a hundred times as far if that is not enough, and once more."""


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
    count, size, delassus = problem.count, equations.size, problem.delassus
    equation, lean, weight = equations.unknown, equations.lean, equations.weight
    basis, image, kind = equations.basis, equations.image, equations.moves
    for k in range(found):
        largest = 0.0
        for i in range(2 * count):
            image[k, i] = 0.0
        for j in range(size):
            column = reduced.source[equation[j]]
            scaled = basis[k, j] / weight[j]
            largest = max(largest, abs(scaled))
            along = scaled * reduced.scale[equation[j]]
            for i in range(2 * count):
                diagonal = delassus[i, i]
                entry = along * delassus[i, column]
                if lean[j] != 0.0:
                    entry += along * lean[j] * delassus[i, column + 1]
                image[k, i] += entry / math.sqrt(diagonal) if diagonal > 0.0 else entry
        for other in range(k):
            if kind[other] == 1:
                along = 0.0
                for i in range(2 * count):
                    along += image[k, i] * image[other, i]
                for i in range(2 * count):
                    image[k, i] -= along * image[other, i]
                for j in range(size):
                    basis[k, j] -= along * basis[other, j]
        length = 0.0
        for i in range(2 * count):
            length += image[k, i] * image[k, i]
        length = math.sqrt(length)
        kind[k] = 1 if length > 1e-9 * largest else 0
        if kind[k] == 1:
            for i in range(2 * count):
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
    count, size, friction = problem.count, equations.size, problem.friction
    tangent, point, step, weight = (
        reduced.tangent,
        equations.point,
        equations.step,
        equations.weight,
    )
    basis, edges, dual = equations.basis, equations.edge, equations.dual.tableau
    nullity = free_directions(equations)
    dropped = nullity
    if hold:
        nullity = keep_velocity(problem, nullity, reduced, equations)
    dropped -= nullity
    project(size, nullity, basis, point)

    longest = 0.0  # impulse
    largest = 0.0  # scaled unknown
    inside = True
    place = 0
    for contact in range(count):
        if mode[contact] == OPEN:
            continue
        first = place
        place += 2 if tangent[contact] >= 0 and mode[contact] == STICK else 1
        across = point[place - 1] if place == first + 2 else 0.0
        inside = inside and contains(problem, contact, point[first], across)
        for i in range(first, place):
            longest = max(longest, abs(point[i]))
            largest = max(largest, abs(point[i]) / weight[i])
    if inside:
        return dropped > 0

    # Edge i of a cone: edges[i, :nullity] @ step + edges[i, nullity] >= 0, of unit length.
    number = size - size
    place = 0
    for contact in range(count):
        if mode[contact] == OPEN:
            continue
        sides = 2 if tangent[contact] >= 0 and mode[contact] == STICK else 1
        for side in range(0 if problem.set[contact] == LINE else sides):
            along = friction[contact] if sides == 2 else 1.0
            across = 2.0 * side - 1.0 if sides == 2 else 0.0
            second = place + sides - 1
            length = 0.0
            for k in range(nullity):
                part = along * basis[k, place] + across * basis[k, second]
                edges[number, k] = part
                length += part * part
            length = math.sqrt(length)
            if length > 1e-12:
                for k in range(nullity):
                    edges[number, k] /= length
                room = along * point[place] + across * point[second]
                edges[number, nullity] = room / (length * longest)
                edges[number, nullity + 1] = largest * weight[place] / (length * longest)
                number += 1
        place += sides
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
        if pivot_to_solution(number, TIE, tally, equations.dual) == SOLVED:
            break
        if attempt == 3:
            return dropped > 0
        margin = MARGIN if attempt == 0 else 100.0 * margin
    for k in range(nullity):
        step[k] = 0.0
    for i in range(number):
        row = equations.dual.place[number + i]
        if row >= 0:
            for k in range(nullity):
                step[k] += longest * dual[row, 0] * edges[i, k]
    for k in range(nullity):
        for j in range(size):
            point[j] += step[k] * basis[k, j]
    return dropped > 0
