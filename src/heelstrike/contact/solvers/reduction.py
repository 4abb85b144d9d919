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
from heelstrike.contact.workspace import ContactProblem, Floats, Integers, ReducedProblem


@kernel
def reduce_problem(
    problem: ContactProblem, mode: Integers, slope: Floats, reduced: ReducedProblem
) -> None:
    """List the unknowns and their scales; write the slope of contacts that are to slide, (nc,).

    The unknowns of a contact are consecutive, normal first. A contact whose sliding is
    prescribed has a normal unknown only, its friction following along.
    """
    delassus, scale = problem.delassus, reduced.scale
    unknowns = 0
    for contact in range(problem.count):
        reduced.normal[contact] = unknowns
        reduced.tangent[contact] = -1
        reduced.prescribed[contact] = OPEN
        slope[contact] = 0.0
        reduced.set[contact] = problem.set[contact]
        friction = problem.friction[contact]
        components = 1
        if mode[contact] == SLIDING_FORWARD or mode[contact] == SLIDING_BACKWARD:
            reduced.prescribed[contact] = mode[contact]
            slope[contact] = -friction if mode[contact] == SLIDING_FORWARD else friction
        elif friction > 0.0:
            reduced.tangent[contact] = unknowns + 1
            components = 2
        for component in range(components):
            row = problem.first[contact] + component
            weight = delassus[row, row]
            if not weight > 0.0:
                # Nothing moves it, or the matrix is not a Delassus matrix.
                weight = 0.0
                for j in range(problem.first[problem.count]):
                    weight = max(weight, max(abs(delassus[row, j]), abs(delassus[j, row])))
            reduced.source[unknowns] = row
            scale[unknowns] = 1.0 / math.sqrt(weight) if weight > 0.0 else 1.0
            reduced.offset[unknowns] = scale[unknowns] * problem.free[row]
            unknowns += 1
        reduced.cone[contact] = 0.0
        if components == 2:
            reduced.cone[contact] = friction * scale[unknowns - 2] / scale[unknowns - 1]
    reduced.unknowns = unknowns


@kernel
def scale_matrix(problem: ContactProblem, slope: Floats, reduced: ReducedProblem) -> None:
    """Write the scaled matrix of the listed unknowns; friction that is prescribed is part of it."""
    delassus, source, scale = problem.delassus, reduced.source, reduced.scale
    for contact in range(problem.count):
        along, last = slope[contact], reduced.normal[contact]
        if reduced.tangent[contact] >= 0:
            last = reduced.tangent[contact]
        for j in range(reduced.normal[contact], last + 1):
            column = source[j]
            for i in range(reduced.unknowns):
                entry = delassus[source[i], column]
                if along != 0.0:
                    entry += along * delassus[source[i], column + 1]
                reduced.matrix[i, j] = scale[i] * entry * scale[j]
