"""Certificates in space: what a contact solve is worth, measured on the original data.

A block c has the weight ``s_c = 1 / √max diag W_cc``. The data have the size::

    β = max |b_i| s_c                       [m/s kg^(1/2)]

over all rows i, each with the weight of its block; a normal velocity that opens counts a hundredth
(`OPENING`). Velocities count in units of ``β / s_c``,
impulses in units of ``β s_c``. In these units the residual is the largest natural map of a block
(:mod:`heelstrike.contact.spatial.cones`). Nothing in it comes from the size of the answer: an
impulse of 1e16 does not prove itself. Where rounding would show, velocities are summed again with
all rounding errors kept. A simulation that finds velocities without the matrix W bounds their
rounding (:mod:`heelstrike.sim.spatial.holding`).
"""

from __future__ import annotations

import math
from dataclasses import field

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.compensated import UNIT_ROUNDOFF, product_error, sum_error
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.spatial.cones import Triple, natural_map
from heelstrike.contact.spatial.modes import OPEN, SLIP, STICK, SpatialSolver, SpatialStatus
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockSettings,
    Floats,
    ScaledBlocks,
)
from heelstrike.field_texts import dataclass

VISIBLE_ROUNDING = 1e-13
"""Rounding of more than this, relative, is not left in the velocities."""

OPENING = 1e-2
"""Share with which a normal velocity that opens counts as data: a point 4 mm above the ground has
4 m/s over a step of 1 ms, needs no impulse, and would let all others be off by its size. It counts
at all because its rounding, 1e-16 of it, must stay far below the tolerance."""

AT_REST = 1e-10
"""Velocities below this, relative to the data, name a contact closed and sticking."""


@dataclass(frozen=True)
class SpatialCertificate:
    """The residual of a contact solve in space and how it came about.

    A certificate proves this much: there is an impulse close to the reported one that solves
    exactly, without any residual, the problem whose free velocities differ from the given ones by
    at most ``velocity_error``.
    """

    status: SpatialStatus
    """How the solve ended; ``status.text`` says it in words."""
    solver: SpatialSolver
    """The way whose answer is reported."""
    iterations: int
    """Newton steps and sweeps of all ways tried."""
    fallbacks: int
    """How many ways failed before the one reported."""
    natural_map: float
    """Largest natural map of a contact, relative to the size of the data."""
    rounding: float
    """How far the true residual of the impulse may exceed this."""
    tolerance: float
    """What the residual, rounding included, had to meet."""
    velocity_error: Floats = field(compare=False, repr=False)
    """(nc, 3) How far the contact velocities may be from a solution's, in the unit of the free
    velocity (m/s, or m/s²). Infinite if the residual is no smaller than the data."""

    @property
    def valid(self) -> bool:
        """Return whether the solve ended well and the residual is within tolerance."""
        return self.status is SpatialStatus.SOLVED and self.worst <= self.tolerance

    @property
    def worst(self) -> float:
        """Return the residual, rounding included."""
        return self.natural_map + self.rounding

    def __str__(self) -> str:
        return (
            f"{self.solver.value}: {self.status.text} (natural map {self.natural_map:.1e}, "
            f"rounding {self.rounding:.1e}, {self.iterations} iterations, "
            f"{self.fallbacks} fallbacks)"
        )


@kernel
def weigh_blocks(problem: BlockProblem, settings: BlockSettings, scaled: ScaledBlocks) -> None:
    """Write the weight of each block and the size of the data."""
    unit = settings.floor
    for block in range(problem.count):
        begin, end = problem.first[block], problem.first[block + 1]
        largest = 0.0
        for row in range(begin, end):
            largest = max(largest, problem.delassus[row, row])
        scale = 1.0 / math.sqrt(largest) if largest > 0.0 else 0.0
        scaled.scale[block] = scale
        kind, first = problem.set[block], problem.free[begin]
        opens = first > 0.0 and kind in (CONE, HALF_LINE)
        most = OPENING * first if opens else abs(first)
        for row in range(begin + 1, end):
            most = max(most, abs(problem.free[row]))
        unit = max(unit, most * scale)
    scaled.unit = unit


@kernel
def sum_products(
    rows: int, problem: BlockProblem, impulse: Floats, u: Floats, size: Floats
) -> None:
    """Write ``u = W impulse + free``, and the sizes of all terms added up."""
    delassus = problem.delassus
    for row in range(rows):
        u[row] = problem.free[row]
        size[row] = abs(problem.free[row])
    for column in range(rows):
        own = impulse[column]
        for row in range(rows):
            product = delassus[column, row] * own
            u[row] += product
            size[row] += abs(product)


@kernel
def sum_blocks(problem: BlockProblem, scaled: ScaledBlocks, answer: BlockAnswer) -> float:
    """Write ``velocity = W impulse + free``; return what rounding is left, relative to the data.

    ``scaled`` has the weights and the size of the data, and receives the sizes of the sums.
    """
    rows, first = problem.first[problem.count], problem.first
    impulse, velocity, delassus, free = (
        answer.impulse,
        answer.velocity,
        problem.delassus,
        problem.free,
    )
    sum_products(rows, problem, impulse, velocity, scaled.size)
    terms = rows + 2.0
    rounding = 0.0
    for block in range(problem.count):
        inverse = scaled.scale[block] / scaled.unit if scaled.unit > 0.0 else 0.0
        for row in range(first[block], first[block + 1]):
            size = scaled.size[row]
            left = terms * UNIT_ROUNDOFF * size * inverse
            if left > VISIBLE_ROUNDING:
                total, error = free[row], 0.0
                for column in range(rows):
                    product = delassus[column, row] * impulse[column]
                    if product == 0.0:
                        continue
                    error += product_error(delassus[column, row], impulse[column], product)
                    longer = total + product
                    error += sum_error(total, product, longer)
                    total = longer
                velocity[row] = total + error
                left = UNIT_ROUNDOFF * abs(velocity[row]) * inverse
                left += (2.0 * terms * UNIT_ROUNDOFF) ** 2 * size * inverse
            rounding = max(rounding, left)
    return rounding


@kernel
def entry_of(values: Floats, row: int, end: int, factor: float) -> float:
    """A number of a block times a factor, zero for rows that the block does not have."""
    return values[row] * factor if row < end else 0.0


@kernel
def certify_blocks(
    problem: BlockProblem, settings: BlockSettings, scaled: ScaledBlocks, answer: BlockAnswer
) -> float:
    """Compute the velocity that an impulse gives and its residual; return it, rounding included.

    Writes ``velocity``, ``residual`` and ``rounding`` of the answer, and names its modes by the
    velocity.
    """
    weigh_blocks(problem, settings, scaled)
    return judge_blocks(problem, sum_blocks(problem, scaled, answer), scaled, answer)


@kernel
def judge_blocks(
    problem: BlockProblem, rounding: float, scaled: ScaledBlocks, answer: BlockAnswer
) -> float:
    """Compute the residual of impulses and the velocity that they give; see `certify_blocks`.

    `rounding` says how far off the velocities may be, relative to the data; `scaled` has the
    weights.
    """
    unit = scaled.unit
    worst, most, nothing = 0.0, 0.0, 0.0
    impulse, velocity = answer.impulse, answer.velocity
    for block in range(problem.count):
        begin, end = problem.first[block], problem.first[block + 1]
        kind, friction, scale = problem.set[block], problem.friction[block], scaled.scale[block]
        for row in range(begin, end):
            nothing += 0.0 * velocity[row] + 0.0 * impulse[row]
        slows = scale / unit if unit > 0.0 else 0.0
        forces = 1.0 / (scale * unit) if slows > 0.0 else 0.0
        if slows == 0.0:  # no impulse moves it, or there are no data: what is not zero counts fully
            slows = forces = fully(velocity, impulse, begin, end)
        lam = (
            entry_of(impulse, begin, end, forces),
            entry_of(impulse, begin + 1, end, forces),
            entry_of(impulse, begin + 2, end, forces),
        )
        u = (
            entry_of(velocity, begin, end, slows),
            entry_of(velocity, begin + 1, end, slows),
            entry_of(velocity, begin + 2, end, slows),
        )
        worst = max(worst, natural_map(kind, friction, problem.bound[block] * forces, lam, u))
        size = abs(lam[0]) + abs(lam[1]) + abs(lam[2]) + abs(u[0]) + abs(u[1]) + abs(u[2])
        most = max(most, 8.0 * UNIT_ROUNDOFF * size + rounding * (1.0 + friction))
        answer.mode[block] = named(kind, AT_REST + 2.0 * rounding, u)
    if nothing != 0.0:
        worst = math.inf
    scaled.rounding = most
    answer.residual = worst
    answer.rounding = most
    return worst + most


@kernel
def named(kind: int, rest: float, u: Triple) -> int:
    """What a block does at a velocity, of which less than `rest` is none."""
    if kind == LINE:
        return STICK
    if kind == INTERVAL:
        return SLIP if abs(u[0]) > rest else STICK
    if u[0] > rest:
        return OPEN
    return SLIP if u[1] * u[1] + u[2] * u[2] > rest * rest else STICK


@kernel
def fully(velocity: Floats, impulse: Floats, begin: int, end: int) -> float:
    """What makes the largest number of a block one."""
    largest = 0.0
    for row in range(begin, end):
        largest = max(largest, abs(velocity[row]), abs(impulse[row]))
    return 1.0 / largest if largest > 0.0 else 0.0


def velocity_error_of(worst: float, problem: BlockProblem, scaled: ScaledBlocks) -> Floats:
    """How far the velocities just certified may be from a solution's, for each row.

    Let z be the projection in the natural map r = λ − z. It lies in the cone, and with the velocity
    ũ − r it meets Coulomb's law. To give it that velocity the free one moves by −r in the tangents,
    by (1 + μ) ‖r‖ at most in the normal, and by W r: a row of W feels a unit of impulse of another
    block by one unit of velocity of its own for each row of that block, at most.

    Parameters
    ----------
    worst : float
        Largest residual, rounding included.
    problem : BlockProblem
        The problem.
    scaled : ScaledBlocks
        As :func:`certify_blocks` left it.

    Returns
    -------
    (rows,) float
        In the unit of the free velocity.
    """
    blocks = problem.count
    first = problem.first[: blocks + 1]
    sizes = np.diff(first)
    if not worst < 1.0:
        return np.full(int(first[-1]), math.inf)
    moved = 1.0 + problem.friction[:blocks] + np.sum(np.sqrt(sizes))
    scale = scaled.scale[:blocks]
    unit = np.divide(scaled.unit, scale, out=np.zeros(blocks), where=scale > 0.0)
    bound: Floats = np.repeat(worst * moved * unit, sizes)
    return bound
