"""Constraints that hold at all times of a step, not only at the instants of the program.

These grow by the instants at which a constraint fails, and the program is solved again: the
exchange method of semi-infinite programming.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heelstrike.errors import GaitNotFoundError
from heelstrike.gait.infeasible import nearest_to_feasible
from heelstrike.gait.polynomials import Instants
from heelstrike.gait.program import Program, Solution
from heelstrike.robot.model import Floats, Integers

FINER = 10
"""Constraints are checked this many times between two instants of the program."""
ROUNDS = 16
"""Times that instants are added where a constraint is violated between those of the program. A gait
of bravo7 down stairs takes 12: the phase at which its foot is too low moves with each."""


def held_between_nodes(
    program: Program, solution: Solution, *, near_only: bool = False
) -> tuple[Floats, bool]:
    """Add instants where constraints fail, until they hold everywhere.

    Parameters
    ----------
    program : Program
        The program on its first instants.
    solution : Solution
        Its optimum, or a point that satisfies its constraints.
    near_only : bool
        Whether to give up where no optimum is found near the last, instead of beginning again.

    Returns
    -------
    unknowns : (n,) float
        Unknowns of a motion that satisfies the constraints at all times.
    optimal : bool
        Whether it is an optimum.

    Raises
    ------
    GaitNotFoundError
        If none is found.
    """
    fine = checked_instants(program)
    for _ in range(ROUNDS):
        unknowns = program.polished(solution.unknowns)
        missed = _missed(program, unknowns, fine)
        if not missed.share.size:
            return unknowns, solution.converged
        program = replace(program, instants=program.instants.joined(missed))
        solution = solved_again(program, unknowns, solution.multipliers, near_only=near_only)
    request = program.request
    raise GaitNotFoundError(
        f"robot {request.robot.name!r}: a gait with {request} satisfies the constraints at "
        f"{np.count_nonzero(program.instants.weight)} phases of a step but not between them. Try "
        "more intervals, or a slower step."
    )


def solved_again(
    program: Program,
    unknowns: Floats,
    multipliers: Floats | None = None,
    *,
    near_only: bool = False,
) -> Solution:
    """Solve a program from the optimum of another, on other instants; if that fails, begin again.

    Raises
    ------
    GaitNotFoundError
        If no point satisfies its constraints, or no optimum is near and nothing else is wanted.
    """
    solution = replace(program, near=True).solve(unknowns, multipliers)
    if solution.converged:
        return solution
    if near_only:
        raise GaitNotFoundError("no optimum was found near the given gait")
    feasible = nearest_to_feasible(program)
    solution = replace(program, inside=True).solve(feasible)
    return solution if program.satisfied_by(solution) else program.at(feasible)


def checked_instants(program: Program) -> Instants:
    """Instants between those of the program, with the ends of all pieces.

    Both sides of a joint of two pieces are there, since accelerations jump, and the corners of the
    clearance profile.
    """
    instants = program.instants
    corners = np.array(program.profile.corners) * instants.pieces
    pieces, shares = [], []
    for piece in range(instants.pieces):
        nodes = instants.share[(instants.piece == piece) & (instants.weight > 0.0)]
        nodes = np.unique([0.0, *nodes, 1.0])
        inner = nodes[:-1, None] + np.diff(nodes)[:, None] * (np.arange(FINER) / FINER)
        inside = corners[np.floor(corners) == piece] - piece
        shares.append(np.unique([*inner.ravel(), 1.0, *inside]))
        pieces.append(np.full(shares[-1].size, piece))
    return _without_weight(instants.pieces, np.concatenate(pieces), np.concatenate(shares))


def _without_weight(pieces: int, piece: Integers, share: Floats) -> Instants:
    return Instants(pieces, piece, share, np.zeros(share.size))


def _missed(program: Program, unknowns: Floats, fine: Instants) -> Instants:
    """Where a constraint along the path is violated most, one instant a lapse."""
    missed = set()
    excess = _excess(program, unknowns, fine)
    for piece in range(fine.pieces):
        share = fine.share[fine.piece == piece]
        for k, row in enumerate(excess[:, fine.piece == piece]):
            before, after = np.append(-np.inf, row[:-1]), np.append(row[1:], -np.inf)
            highest = np.isfinite(row) & (row >= before) & (row >= after)
            for top in np.flatnonzero(highest).tolist():
                around = slice(max(top - 1, 0), top + 2)
                peak, expected = _peak(share[around], row[around])
                if expected > 0.0:
                    both = np.array([peak, share[top]])
                    there = _without_weight(fine.pieces, np.full(2, piece), both)
                    found = _excess(program, unknowns, there)[k]
                    if found.max() > 0.0:
                        missed.add((piece, float(both[np.argmax(found)])))
    ordered = np.array(sorted(missed)).reshape(-1, 2)
    return _without_weight(fine.pieces, ordered[:, 0].astype(np.int64), ordered[:, 1])


def _excess(program: Program, unknowns: Floats, instants: Instants) -> Floats:
    """How far every constraint along the path is violated at instants, (rows, N), scaled."""
    motion = program.motion(unknowns, instants)
    values = np.array(
        program.transcription.path.map(instants.share.size)(
            *motion, unknowns[-1], program.request.under_foot
        )[1]
    )
    lower, upper = program.path_bounds(instants)
    excess: Floats = np.maximum(lower - values, values - upper)
    return excess


def _peak(shares: Floats, excess: Floats) -> tuple[float, float]:
    """Place and height of a maximum, from the parabola through the highest point's neighbours."""
    k = int(np.argmax(excess))
    if shares.size < 3 or k != 1 or not np.all(np.isfinite(excess)):
        return float(shares[k]), float(excess[k])
    (a, b, c), (fa, fb, fc) = shares, excess
    rise, fall = (fb - fa) / (b - a), (fc - fb) / (c - b)
    bend = (fall - rise) / (c - a)
    if not bend < 0.0:
        return float(b), float(fb)
    top = 0.5 * (a + b) - 0.5 * rise / bend
    return float(top), float(fb + (top - b) * (rise + bend * (top - a)))
