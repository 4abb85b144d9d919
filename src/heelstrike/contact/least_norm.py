"""The least-norm split: of all impulses with the same effect, the shortest that the cones allow."""

from __future__ import annotations

import math

from heelstrike.compilation import inner_kernel
from heelstrike.contact.modes import OPEN, SOLVED, STICK
from heelstrike.contact.pivoting import pivot_to_solution
from heelstrike.contact.workspace import (
    PIVOT_ROW,
    PLACE,
    POINT,
    STEP,
    TANGENT,
    TRIAL_MODE,
    WEIGHT,
    ContactWorkspace,
    Floats,
)

MARGIN = 1e-14
"""How far the cones are opened, relative to the impulse, where rounding has closed them."""


@inner_kernel
def project(size: int, nullity: int, work: ContactWorkspace) -> None:
    """Orthonormalise the free directions and remove them from ``POINT``."""
    pivot_row, weight, point = work.labels[PIVOT_ROW], work.vectors[WEIGHT], work.vectors[POINT]
    tableau, basis = work.tableau, work.basis
    found = 0
    for free in range(size):
        if pivot_row[free] >= 0:
            continue
        for j in range(size):
            row = pivot_row[j]
            basis[found, j] = weight[j] * tableau[row, free + 1] if row >= 0 else 0.0
        basis[found, free] = weight[free]
        for _ in range(2):  # twice is enough (Kahan, Parlett)
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
        found += 1


@inner_kernel
def split(count: int, size: int, nullity: int, friction: Floats, work: ContactWorkspace) -> None:
    """Move ``POINT`` along the free directions to the least norm that the cones allow.

    The shortest step that brings the point inside is a least-distance problem. Its dual is a
    linear complementarity problem whose unknowns are the edges of the cones that hold the point
    back; Lemke's pivots solve it. Where no step would do, the projection stands, and the
    certificate of the solve tells.
    """
    project(size, nullity, work)
    mode, tangent = work.labels[TRIAL_MODE], work.labels[TANGENT]
    point, step = work.vectors[POINT], work.vectors[STEP]
    basis, edges, dual = work.basis, work.edges, work.dual

    longest = 0.0
    inside = True
    place = 0
    for contact in range(count):
        if mode[contact] == OPEN:
            continue
        along = point[place]
        longest = max(longest, abs(along))
        place += 1
        if tangent[contact] >= 0 and mode[contact] == STICK:
            inside = inside and abs(point[place]) <= friction[contact] * along
            longest = max(longest, abs(point[place]))
            place += 1
        else:
            inside = inside and along >= 0.0
    if inside:
        return

    # Edge i of a cone: edges[i, :nullity] @ step + edges[i, nullity] >= 0, of unit length.
    number = size - size
    place = 0
    for contact in range(count):
        if mode[contact] == OPEN:
            continue
        sides = 2 if tangent[contact] >= 0 and mode[contact] == STICK else 1
        for side in range(sides):
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
                number += 1
        place += sides
    for attempt in range(2):
        for i in range(number):
            for j in range(number):
                entry = 0.0
                for k in range(nullity):
                    entry += edges[i, k] * edges[j, k]
                dual[i, j + 1] = entry
            dual[i, 0] = edges[i, nullity] + attempt * MARGIN
            dual[i, number + 1] = 1.0
        if pivot_to_solution(dual, number, 1e-12, work) == SOLVED:
            break
        if attempt == 1:
            return
    for k in range(nullity):
        step[k] = 0.0
    for i in range(number):
        row = work.labels[PLACE, number + i]
        if row >= 0:
            for k in range(nullity):
                step[k] += longest * dual[row, 0] * edges[i, k]
    for k in range(nullity):
        for j in range(size):
            point[j] += step[k] * basis[k, j]
