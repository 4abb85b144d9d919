"""Constraints that hold at all phases of a step, not only at those of the optimiser's grid.

The grid grows by the phases at which a constraint fails, and the program is solved again: the
exchange method of semi-infinite programming.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import InfeasibleGaitError
from heelstrike.gait.infeasible import nearest_to_feasible
from heelstrike.gait.program import Program, Solution

Floats = NDArray[np.float64]

FINER = 10
"""Constraints are checked on a grid this many times finer than the optimiser's."""
ROUNDS = 8
"""Times that phases are added where a constraint is violated between the nodes of the grid."""


def held_between_nodes(program: Program, solution: Solution) -> Floats:
    """Add phases where constraints fail between the nodes, until they hold everywhere.

    Parameters
    ----------
    program : Program
        The program on its first grid.
    solution : Solution
        Its optimum.

    Returns
    -------
    (n,) float
        Unknowns of the optimum that satisfies the constraints at all phases.

    Raises
    ------
    InfeasibleGaitError
        If there is none.
    """
    fine = checked_phases(program)
    for _ in range(ROUNDS):
        unknowns = _polished(program, solution.unknowns)
        missed = _missed(program, unknowns, fine)
        if not missed.size:
            return unknowns
        program = program.refined(missed)
        solution = program.solve(unknowns)
        if not solution.converged:
            solution = program.solve(nearest_to_feasible(program))
        if not solution.converged:
            break
    request = program.transcription.request
    raise InfeasibleGaitError(
        f"robot {request.robot.name!r}: a gait with {request} satisfies the constraints at "
        f"{request.intervals + 1} phases of a step but not between them ({solution.status}). Try "
        "more intervals, or a slower step."
    )


def checked_phases(program: Program) -> Floats:
    """Grid finer than that of the quadrature, with the corners of the clearance profile."""
    nodes = program.phases[program.weights > 0.0]
    share = np.arange(FINER) / FINER
    inner = nodes[:-1, None] + np.diff(nodes)[:, None] * share
    return np.unique(np.concatenate([inner.ravel(), nodes[-1:], program.profile.corners]))


def _missed(program: Program, unknowns: Floats, fine: Floats) -> Floats:
    """Phases off the grid where a constraint along the path is violated most, one a lapse."""
    missed = set()
    for k, row in enumerate(_excess(program, unknowns, fine)):
        before, after = np.append(-np.inf, row[:-1]), np.append(row[1:], -np.inf)
        for top in np.flatnonzero(np.isfinite(row) & (row >= before) & (row >= after)).tolist():
            around = slice(max(top - 1, 0), top + 2)
            phase, expected = _peak(fine[around], row[around])
            if expected > 0.0:
                both = np.array([phase, fine[top]])
                excess = _excess(program, unknowns, both)[k]
                if excess.max() > 0.0:
                    missed.add(float(both[np.argmax(excess)]))
    return np.array(sorted(missed))


def _excess(program: Program, unknowns: Floats, phases: Floats) -> Floats:
    """How far every constraint along the path is violated at phases, (rows, N), scaled."""
    _, values = program.transcription.path.value.map(phases.size)(unknowns, phases[None, :])
    lower, upper = program.path_bounds(phases)
    excess: Floats = np.maximum(lower - np.array(values), np.array(values) - upper)
    return excess


def _peak(phases: Floats, excess: Floats) -> tuple[float, float]:
    """Place and height of a maximum, from the parabola through the highest point's neighbours."""
    k = int(np.argmax(excess))
    if phases.size < 3 or k != 1 or not np.all(np.isfinite(excess)):
        return float(phases[k]), float(excess[k])
    (a, b, c), (fa, fb, fc) = phases, excess
    rise, fall = (fb - fa) / (b - a), (fc - fb) / (c - b)
    bend = (fall - rise) / (c - a)
    if not bend < 0.0:
        return float(b), float(fb)
    top = 0.5 * (a + b) - 0.5 * rise / bend
    return float(top), float(fb + (top - b) * (rise + bend * (top - a)))


def _polished(program: Program, unknowns: Floats) -> Floats:
    """Satisfy the equations at touchdown to rounding, by the least change of the unknowns."""
    touchdown = program.transcription.touchdown
    request = program.transcription.request
    equations = [k for k, row in enumerate(touchdown.rows) if row.lower == row.upper]
    target = np.array([touchdown.rows[k].lower for k in equations])
    free = np.ones(unknowns.size, dtype=bool)
    free[-2] = request.duration_bounds[0] < request.duration_bounds[1]
    free[-1] = request.length_bounds[0] < request.length_bounds[1]
    polished = unknowns.copy()
    for _ in range(3):
        value, jacobian = (np.array(part) for part in touchdown.jacobian(polished))
        residual = target - value.ravel()[equations]
        polished[free] += np.linalg.lstsq(jacobian[equations][:, free], residual, rcond=None)[0]
    return polished
