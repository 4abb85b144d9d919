"""Certificates: what a contact solve is worth, measured on the original data.

Residuals are relative to the size of the data, never that of the answer: otherwise an impulse of
1e16 would prove itself. Row i has the weight ``g_i = sqrt(G_ii)``, and the data have the size::

    beta = max_j |b_j| / g_j                [m/s kg^(1/2)]

Velocities count in units of ``g_i beta``, impulses in units of ``beta / g_i``. Multiplying rows of
the problem by any positive numbers (other units, another normal's length) changes neither. The
Delassus matrix is positive semidefinite, ``|G_ij| <= g_i g_j``, so that the impulse is summed from
velocities of at most ``effort = sum_j g_j |lambda_j| / beta`` in these units. Rounding hides
machine epsilon times that. Where it would show, the velocities are summed again with all rounding
errors kept, so that the residuals are those of the impulse as it is written down.
"""

from __future__ import annotations

import math
from dataclasses import field

import numpy as np

from heelstrike.compiler.compilation import dissolved_kernel, kernel, rare_kernel
from heelstrike.compiler.straight_line import play
from heelstrike.contact.compensated import UNIT_ROUNDOFF, product_error, sum_error
from heelstrike.contact.cone_certificate import EFFORT, LEAST, UNIT
from heelstrike.contact.modes import Solver, SolveStatus
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE, is_empty, room, row_of
from heelstrike.contact.workspace import (
    PROGRAM_ROWS,
    ContactAnswer,
    ContactProblem,
    Floats,
    Scaling,
    Settings,
)
from heelstrike.field_texts import dataclass

REST_TOLERANCE = 1e-10
"""Velocities below this, relative to the data and to what cancels in them, count as zero."""

VISIBLE = 1e-12
"""Rounding of more than this, relative, is not left in the velocities."""


@dataclass(frozen=True)
class Certificate:
    """The residuals of a contact solve and how it came about.

    The residuals are relative and have no unit. The velocity of row i is set against
    ``sqrt(G_ii) beta`` and its impulse against ``beta / sqrt(G_ii)``, where ``beta``, the size of
    the data, is the largest ``|b_j| / sqrt(G_jj)``, or the floor if that is larger.

    A certificate proves this much: there is an impulse close to the reported one that solves
    exactly, without any residual, the problem whose free velocities differ from the given ones by
    at most ``velocity_error``.
    """

    status: SolveStatus
    """How the solve ended; ``status.text`` says it in words."""
    solver: Solver
    """The solver whose answer is reported."""
    iterations: int
    """Iterations (pivots, Newton steps or sweeps) of all solvers tried."""
    fallbacks: int
    """How many solvers failed before the one reported."""
    complementarity: float
    """Largest of min(velocity, impulse) over the complementary pairs: normal velocity and normal
    impulse; slip to either side and the friction that still lacks to the cone's opposing edge."""
    cone: float
    """Largest excess of the friction over the cone, or of a normal impulse below zero."""
    non_penetration: float
    """Largest negative normal velocity."""
    rounding: float
    """How far the true residuals of the impulse may exceed these."""
    tolerance: float
    """What the residuals, rounding included, had to meet."""
    velocity_error: Floats = field(compare=False, repr=False)
    """(nc, 2) How far the contact velocities may be from a solution's, in the unit of the free
    velocity (m/s, or m/s²): the bound above, for each row. Infinite if the residuals are no smaller
    than the data."""

    @property
    def valid(self) -> bool:
        """Return whether the solve ended well and every residual is within tolerance."""
        return self.status is SolveStatus.SOLVED and self.worst <= self.tolerance

    @property
    def worst(self) -> float:
        """Return the largest residual, rounding included."""
        return max(self.complementarity, self.cone, self.non_penetration) + self.rounding

    def __str__(self) -> str:
        return (
            f"{self.solver.value}: {self.status.text} (complementarity "
            f"{self.complementarity:.1e}, cone {self.cone:.1e}, non-penetration "
            f"{self.non_penetration:.1e}, rounding {self.rounding:.1e}, "
            f"{self.iterations} iterations, {self.fallbacks} fallbacks)"
        )


@kernel
def certify(
    problem: ContactProblem, settings: Settings, scaling: Scaling, answer: ContactAnswer
) -> float:
    """Compute the velocity an impulse gives and the residuals; return the largest of them.

    The residuals are complementarity, cone and non-penetration, scaled as in :class:`Certificate`;
    what is returned includes rounding. ``scaling.slope`` is not zero where a contact is
    prescribed to slide; its friction then lies on the given edge and its tangential velocity is not
    constrained.

    Writes ``velocity``, ``residual`` and ``rest`` of the answer, and the rest of the scaling.
    """
    count = problem.count
    impulse, velocity, residual = answer.impulse, answer.velocity, answer.residual
    root, slope = scaling.root, scaling.slope
    cones = cones_of(problem, settings, scaling)
    if cones > 0 and not any_slides(count, slope):
        worst = certify_at_once(cones, problem, settings, scaling, answer)
        if worst < math.inf:
            return worst
    weigh(problem, settings, impulse, scaling)
    unit = scaling.unit
    rounding = rounding_of(count, scaling.effort)
    sharply = rounding > VISIBLE
    if sharply:
        rounding = sum_velocities_sharply(problem, impulse, scaling, velocity)
    else:
        sum_velocities(problem, impulse, velocity)
    scaling.rounding = rounding
    answer.rest = REST_TOLERANCE * unit * (1.0 + scaling.effort)
    inverse = 1.0 / unit if unit > 0.0 else 0.0
    complementarity = cone = non_penetration = 0.0
    first, end = problem.first, 0
    nothing = 0.0 * unit  # and stays nothing unless a number is infinite or none
    for contact in range(count):
        normal, end = end, row_of(contact + 1, first)
        tangent = normal + 1
        normal_impulse = impulse[normal]
        if problem.set[contact] == INTERVAL:
            normal_impulse = problem.bound[contact]

        force_scale = 0.0
        if problem.set[contact] != INTERVAL:
            speed = relative_speed(velocity[normal], root[normal], inverse)
            force_scale = root[normal] * inverse
            # An impulse that moves nothing is no better for being small.
            force = normal_impulse * force_scale if force_scale > 0.0 else sign(normal_impulse)
            non_penetration = max(non_penetration, -speed)
            complementarity = max(complementarity, min(speed, force))
            if force <= 0.0:
                if problem.set[contact] == LINE:
                    non_penetration = max(non_penetration, speed)
                else:
                    cone = max(cone, -force)

        if end == tangent:
            nothing += 0.0 * velocity[normal] + 0.0 * normal_impulse
            continue
        upper, lower = room(problem, contact, normal_impulse, impulse[tangent], sharply)
        nothing += 0.0 * velocity[normal] + 0.0 * velocity[tangent] + 0.0 * (upper + lower)
        if is_empty(problem, contact, tangent):
            continue
        if root[tangent] > 0.0:
            force_scale = root[tangent] * inverse
        else:
            force_scale = scale_beside(force_scale, upper, lower, problem.friction[contact])
        if slope[contact] != 0.0:
            cone = max(cone, abs(upper if slope[contact] > 0.0 else lower) * force_scale)
            continue
        cone = max(cone, -min(upper, lower) * force_scale)
        speed = relative_speed(velocity[tangent], root[tangent], inverse)
        slips = max(min(speed, lower * force_scale), min(-speed, upper * force_scale))
        complementarity = max(complementarity, slips)
    # Impulses without any cause in the data count as much as numbers that are none.
    if nothing != 0.0 or not scaling.effort + rounding < math.inf:
        non_penetration = math.inf
    residual[0] = complementarity
    residual[1] = cone
    residual[2] = non_penetration
    return max(complementarity, max(cone, non_penetration)) + rounding


@rare_kernel
def scale_beside(normal_scale: float, upper: float, lower: float, friction: float) -> float:
    """What makes friction that moves nothing comparable: the normal impulse's unit, or its own.

    ``upper`` and ``lower`` are what it lacks to the edges of its cone.
    """
    if friction > 0.0 and normal_scale > 0.0:
        return normal_scale / friction
    both = 0.5 * (abs(upper + lower) + abs(lower - upper))
    return 1.0 / both if both > 0.0 else 0.0


@kernel
def sign(value: float) -> float:
    """Return 1 above zero and -1 below; it has no unit."""
    return 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)


@kernel
def weigh(problem: ContactProblem, settings: Settings, impulse: Floats, scaling: Scaling) -> None:
    """Write the weights of the rows, the size of the data, beta, and the effort."""
    delassus, free, root = problem.delassus, problem.free, scaling.root
    skewed = settings.skewed != 0
    unit, effort = settings.floor, 0.0
    rows = row_of(problem.count, problem.first)
    for i in range(rows):
        weight = delassus[i, i]
        if skewed:
            weight = general_weight(rows, i, delassus)
        size = math.sqrt(weight) if weight > 0.0 else 0.0
        root[i] = size
        if weight > 0.0 and abs(free[i]) > unit * size:  # a few are divided, not all
            unit = abs(free[i]) / size
        effort += size * abs(impulse[i])
    note_size(unit, effort, scaling)


@kernel
def note_size(unit: float, effort: float, scaling: Scaling) -> None:
    """Keep the size of the data, and the effort in units of it."""
    if effort > 0.0:
        effort = effort / unit if unit > 0.0 else math.inf
    scaling.effort = effort
    scaling.unit = unit


@dissolved_kernel
def rounding_of(count: int, effort: float) -> float:
    """What rounding may hide where velocities are summed as usual."""
    return (2.0 * count + 2.0) * UNIT_ROUNDOFF * (1.0 + effort)


@kernel
def cones_of(problem: ContactProblem, settings: Settings, scaling: Scaling) -> int:
    """How many contacts a problem has for which there is a program, 0 if there is none.

    There is for few of them with stops behind, each cone of two rows and each half-line of one.
    """
    count = problem.count
    cones = row_of(count, problem.first) - count
    fits = 0 < cones < scaling.programs.shape[0] and count - cones < scaling.programs.shape[1]
    if not fits or problem.delassus.shape[1] != PROGRAM_ROWS or settings.skewed != 0:
        return 0
    others = 0
    for contact in range(cones):
        others |= problem.set[contact] ^ CONE
    for stop in range(cones, count):
        others |= problem.set[stop] ^ HALF_LINE
    return cones if others == 0 and scaling.programs[cones, count - cones] != 0 else 0


@kernel
def any_slides(count: int, slope: Floats) -> bool:
    """Whether any contact is prescribed to slide."""
    slides = 0
    for contact in range(count):
        slides += slope[contact] != 0.0
    return slides > 0


@dissolved_kernel
def certify_at_once(
    cones: int, problem: ContactProblem, settings: Settings, scaling: Scaling,
    answer: ContactAnswer,
) -> float:  # fmt: skip
    """Do what :func:`certify` does by a program; return the largest residual.

    It is infinite where something moves a row but no impulse does, where rounding shows, or where a
    number is none: then loops have to look.
    """
    count, size, residual = problem.count, scaling.size, answer.residual
    size[UNIT] = settings.floor
    scratch = scaling.root  # nothing is read or written there
    play(
        scaling.programs[cones, count - cones],
        (
            problem.delassus, problem.free, problem.friction, scaling.held, answer.impulse,
            scaling.root, answer.velocity, residual, size, scratch, scratch, scratch,
        ),
    )  # fmt: skip
    note_size(size[UNIT], size[EFFORT], scaling)
    rounding = rounding_of(count, scaling.effort)
    if not (size[LEAST] > 0.0 and rounding <= VISIBLE):
        return math.inf
    scaling.rounding = rounding
    answer.rest = REST_TOLERANCE * scaling.unit * (1.0 + scaling.effort)
    return max(residual[0], max(residual[1], residual[2])) + rounding


@rare_kernel
def general_weight(size: int, row: int, matrix: Floats) -> float:
    """Weight of a row of any matrix: the least that keeps ``|M_ij| <= sqrt(weight_i weight_j)``.

    That of a semidefinite matrix is its diagonal.
    """
    diagonal = max(matrix[row, row], 0.0)
    weight = diagonal
    for j in range(size):
        entry = max(abs(matrix[row, j]), abs(matrix[j, row]))
        if entry > math.sqrt(diagonal) * math.sqrt(max(matrix[j, j], 0.0)):
            weight = max(weight, entry)
    return weight


@kernel
def relative_speed(velocity: float, root: float, inverse: float) -> float:
    """Return a velocity in units of the data's; one that no impulse can change counts fully."""
    if root > 0.0:
        return velocity / root * inverse
    return sign(velocity)


@kernel
def sum_velocities(problem: ContactProblem, impulse: Floats, velocity: Floats) -> None:
    """Write ``velocity = G impulse + free``."""
    delassus, free, rows = problem.delassus, problem.free, row_of(problem.count, problem.first)
    last = rows - 1
    for i in range(0, rows, 2):
        # Four sums run side by side: those of two rows, and where all contacts have a tangent, of
        # friction and the rest. The last of an odd number of rows is its own neighbour.
        beside = min(i + 1, last)
        even, odd, even_beside, odd_beside = free[i], 0.0, free[beside], 0.0
        for pair in range(rows // 2):
            first, second = impulse[2 * pair], impulse[2 * pair + 1]
            even += delassus[i, 2 * pair] * first
            odd += delassus[i, 2 * pair + 1] * second
            even_beside += delassus[beside, 2 * pair] * first
            odd_beside += delassus[beside, 2 * pair + 1] * second
        if rows % 2 == 1:
            even += delassus[i, last] * impulse[last]
            even_beside += delassus[beside, last] * impulse[last]
        velocity[i] = even + odd
        velocity[beside] = even_beside + odd_beside


@rare_kernel
def sum_velocities_sharply(
    problem: ContactProblem, impulse: Floats, scaling: Scaling, velocity: Floats
) -> float:
    """Write ``velocity = G impulse + free`` in twice the precision; return what rounding is left.

    What is left is relative to the data's velocities. ``scaling.effort`` becomes the
    largest sum of magnitudes of any row, in the same unit.
    """
    rows, delassus, free = problem.first[problem.count], problem.delassus, problem.free
    root, unit = scaling.root, scaling.unit
    terms = 2.0 * problem.count + 1.0
    effort = 0.0
    rounding = 0.0
    for i in range(rows):
        total = free[i]
        error = 0.0
        magnitude = abs(free[i])
        for j in range(rows):
            product = delassus[i, j] * impulse[j]
            if product == 0.0:
                continue
            error += product_error(delassus[i, j], impulse[j], product)
            longer = total + product
            error += sum_error(total, product, longer)
            total = longer
            magnitude += abs(product)
        velocity[i] = total + error
        size = root[i] * unit
        if size > 0.0:
            effort = max(effort, magnitude / size)
            left = UNIT_ROUNDOFF * abs(velocity[i])
            left += (2.0 * terms * UNIT_ROUNDOFF) ** 2 * magnitude
            rounding = max(rounding, left / size)
        elif not magnitude < math.inf:
            rounding = math.inf
    if scaling.effort < math.inf:
        scaling.effort = effort
    return rounding


def velocity_error(worst: float, friction: Floats, scaling: Scaling) -> Floats:
    """How far the velocities just certified may be from a solution's; see :class:`Certificate`.

    To make the answer exact, let every residual vanish. Velocities that are no larger than the
    worst residual r become zero by moving the free ones. Impulses outside their cones, or without a
    right to be there, move by at most r in units of the data; and friction by mu g_t / g_n times
    that where the normal impulse that holds it vanishes. A row feels such a unit of impulse by at
    most its own unit of velocity, which moves its free velocity once more.

    Parameters
    ----------
    worst : float
        Largest residual, rounding included.
    friction : (nc,) float
        Friction coefficients of contacts that have a tangent all.
    scaling : Scaling
        As :func:`certify` left it.

    Returns
    -------
    (nc, 2) float
        In the unit of the free velocity.
    """
    root = scaling.root[: 2 * friction.size]
    lever = np.zeros(friction.size)
    np.divide(friction * root[1::2], root[::2], out=lever, where=root[::2] > 0.0)
    if not worst < 1.0:
        return np.full((friction.size, 2), math.inf)
    moved = worst * (1.0 + np.sum(2.0 + lever))
    bound: Floats = (moved * scaling.unit * root).reshape(friction.size, 2)
    return bound
