"""``solve_contact(..., dimension=3)``: the contact problem of points in space."""

from __future__ import annotations

import threading

import numpy as np

from heelstrike.contact.sets import CONE
from heelstrike.contact.spatial.certificate import (
    SpatialCertificate,
    certify_blocks,
    velocity_error_of,
)
from heelstrike.contact.spatial.certified_solve import (
    WAYS,
    block_workspace,
    solve_block_problem,
)
from heelstrike.contact.spatial.impossible import proof_of_none
from heelstrike.contact.spatial.modes import (
    NEWTON,
    STICK,
    SpatialContactMode,
    SpatialSolver,
    SpatialStatus,
)
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockWorkspace,
    Floats,
    block_answer,
    block_problem,
)
from heelstrike.field_texts import dataclass

COMPONENTS = 3

KEPT_CONTACTS = 16
"""Problems of up to so many contacts are solved in memory that is kept."""

_kept = threading.local()


@dataclass(frozen=True)
class SpatialContactSolution:
    """The solution of a contact problem in space, with its certificate."""

    impulse: Floats
    """(nc, 3) Impulse (or force) on the robot at each contact: normal, t1, t2. Where all contacts
    stick or part and several impulses have the same effect, the one of least norm."""
    velocity: Floats
    """(nc, 3) Velocity (or acceleration) after it, ``G @ impulse + free``."""
    mode: tuple[SpatialContactMode, ...]
    """What each contact does."""
    certificate: SpatialCertificate
    """Status and residual; look at ``certificate.valid`` before using the impulse."""


def solve_in_space(
    delassus: Floats, free: Floats, friction: Floats, *, tolerance: float, floor: float,
    fallback: bool,
) -> SpatialContactSolution:  # fmt: skip
    """Solve checked data of points with three rows each.

    Parameters
    ----------
    delassus, free, friction : (nc * 3, nc * 3), (nc * 3,), (nc,) float
        The problem.
    tolerance, floor, fallback
        As those of :func:`~heelstrike.solve_contact`.

    Returns
    -------
    SpatialContactSolution
        With its certificate.
    """
    count = friction.size
    rows = COMPONENTS * count
    problem, work, answer = _memory(max(count, 1))
    problem.count = count
    work.settings.tolerance, work.settings.floor = tolerance, floor
    work.settings.ways = WAYS if fallback else NEWTON + 1
    problem.friction[:count] = friction
    problem.delassus[:rows, :rows] = delassus.T  # symmetric to rounding only
    problem.free[:rows] = free
    answer.mode[:] = STICK
    answer.impulse[:] = 0.0
    status = SpatialStatus(solve_block_problem(problem, work, answer))
    if status is not SpatialStatus.SOLVED and proof_of_none(delassus, free) is not None:
        status = SpatialStatus.IMPOSSIBLE
    worst = certify_blocks(problem, work.settings, work.scaled, answer)
    shape = (count, COMPONENTS)
    certificate = SpatialCertificate(
        status=status,
        solver=SpatialSolver.from_code(work.tally.solver),
        iterations=work.tally.iterations,
        fallbacks=work.tally.last_fallbacks,
        natural_map=answer.residual,
        rounding=work.scaled.rounding,
        tolerance=float(tolerance),
        velocity_error=velocity_error_of(worst, problem, work.scaled).reshape(shape),
    )
    return SpatialContactSolution(
        impulse=answer.impulse[:rows].reshape(shape).copy(),
        velocity=answer.velocity[:rows].reshape(shape).copy(),
        mode=tuple(SpatialContactMode(int(value)) for value in answer.mode[:count]),
        certificate=certificate,
    )


def _memory(count: int) -> tuple[BlockProblem, BlockWorkspace, BlockAnswer]:
    """Return memory to solve in; that of few contacts is kept, for each thread and number."""
    if not hasattr(_kept, "memory"):
        _kept.memory = {}
    kept: dict[int, tuple[BlockProblem, BlockWorkspace, BlockAnswer]] = _kept.memory
    if count not in kept:
        rows = COMPONENTS * count
        problem = block_problem(
            count, rows, first=COMPONENTS * np.arange(count + 1), set=np.full(count, CONE)
        )
        made = problem, block_workspace(count, rows), block_answer(count, rows)
        if count > KEPT_CONTACTS:
            return made
        kept[count] = made
    return kept[count]
