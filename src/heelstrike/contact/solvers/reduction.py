"""From the data of a contact problem to the scaled problem that the solvers work on.

A contact brings one unknown for its normal impulse and, if it has friction, one for its
tangential impulse. Every unknown is scaled so that the Delassus matrix has a unit diagonal:
impulses become ``d x`` and velocities ``y / d`` with ``d = 1 / sqrt(G_ii)``, in units of
the square root of energy. Complementarity and the cone survive any positive diagonal scaling
(the cone only changes its opening), and masses that differ by 1e7 no longer matter.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIDING_BACKWARD, SLIDING_FORWARD
from heelstrike.contact.workspace import (
    CONE,
    MATRIX,
    NORMAL,
    OFFSET,
    PRESCRIBED,
    SCALE,
    SLOPE,
    SOURCE,
    TANGENT,
    ContactWorkspace,
    Floats,
    Integers,
)


@kernel
def reduce_problem(
    count: int,
    delassus: Floats,
    free: Floats,
    friction: Floats,
    mode: Integers,
    work: ContactWorkspace,
) -> int:
    """List the unknowns and their scales in ``work``; return how many they are.

    The unknowns of a contact are consecutive, normal first. A contact whose sliding is
    prescribed has a normal unknown only, its friction following along.
    """
    normal, tangent, source = work.labels[NORMAL], work.labels[TANGENT], work.labels[SOURCE]
    prescribed, cone, slope = work.labels[PRESCRIBED], work.vectors[CONE], work.vectors[SLOPE]
    scale, offset = work.vectors[SCALE], work.vectors[OFFSET]
    unknowns = 0
    for contact in range(count):
        normal[contact] = unknowns
        tangent[contact] = -1
        prescribed[contact] = OPEN
        slope[contact] = 0.0
        components = 1
        if mode[contact] == SLIDING_FORWARD or mode[contact] == SLIDING_BACKWARD:
            prescribed[contact] = mode[contact]
            slope[contact] = friction[contact]
            if mode[contact] == SLIDING_FORWARD:
                slope[contact] = -friction[contact]
        elif friction[contact] > 0.0:
            tangent[contact] = unknowns + 1
            components = 2
        for component in range(components):
            row = 2 * contact + component
            weight = delassus[row, row]
            if not weight > 0.0:
                # Nothing moves it, or the matrix is not a Delassus matrix.
                weight = 0.0
                for j in range(2 * count):
                    weight = max(weight, max(abs(delassus[row, j]), abs(delassus[j, row])))
            source[unknowns] = row
            scale[unknowns] = 1.0 / math.sqrt(weight) if weight > 0.0 else 1.0
            offset[unknowns] = scale[unknowns] * free[row]
            unknowns += 1
        cone[contact] = 0.0
        if components == 2:
            cone[contact] = friction[contact] * scale[unknowns - 2] / scale[unknowns - 1]
    return unknowns


@kernel
def scale_matrix(unknowns: int, delassus: Floats, work: ContactWorkspace) -> None:
    """Write the scaled matrix of the listed unknowns; friction that is prescribed is part of it."""
    source, slope, scale = work.labels[SOURCE], work.vectors[SLOPE], work.vectors[SCALE]
    matrix = work.squares[MATRIX]
    for j in range(unknowns):
        column = source[j]
        along = slope[column // 2]
        for i in range(unknowns):
            entry = delassus[source[i], column]
            if along != 0.0:
                entry += along * delassus[source[i], column + 1]
            matrix[i, j] = scale[i] * entry * scale[j]
