"""Where impulses may lie: the set of each group of rows, projection onto it and distance to it.

====================  ==========================  =========================================
``CONE``              λ_n ≥ 0, ‖λ_t‖ ≤ μ λ_n      contact with friction: Coulomb's cone
``HALF_LINE``         λ_n ≥ 0                     contact without friction, joint stop
``LINE``              any λ_n                     closed loop, latch: the rows do not part at all
``INTERVAL``          ‖λ_t‖ ≤ bound               dry friction of a joint
====================  ==========================  =========================================

A group has two rows, normal and tangent, or the normal alone. Only cones have friction; that of
half-lines and lines is zero, and they need no tangent. An interval is the section of a cone of
friction 1 where the normal impulse is the bound, and has no normal row: what stands in its place
belongs to the solvers (:func:`press`).
"""

from __future__ import annotations

import enum

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.compensated import product_error
from heelstrike.contact.workspace import ContactProblem, Integers

CONE, HALF_LINE, LINE, INTERVAL = range(4)

EVERY_ROW = 2**31 - 1
"""No problem has more rows."""


class ImpulseSet(enum.IntEnum):
    """Where the impulses of a constraint may lie.

    ``CONE`` is contact with friction: it presses, and rubs by at most μ times that. ``HALF_LINE``
    presses or pulls, but never both, and lets go: a stop, a cable. ``LINE`` holds either way and
    never lets go: a closed loop, a pin. ``INTERVAL`` rubs with a force up to a bound: dry friction.
    """

    CONE = CONE
    HALF_LINE = HALF_LINE
    LINE = LINE
    INTERVAL = INTERVAL


@kernel
def row_of(place: int, rows: Integers) -> int:
    """Row of a problem from a list of them, such as those that its groups begin with.

    The compiler is told that it is not negative: at every use of it as an index it would ask.
    """
    return rows[place] & EVERY_ROW


@kernel
def components_of(kind: int) -> int:
    """How many rows a group needs by its set."""
    return 1 if kind in (HALF_LINE, LINE) else 2


@kernel
def is_empty(problem: ContactProblem, group: int, tangent: int) -> bool:
    """Whether the second row of a group is empty: that of a stop or a loop."""
    return problem.set[group] in (HALF_LINE, LINE) and problem.delassus[tangent, tangent] == 0.0


@kernel
def press(group: int, problem: ContactProblem) -> None:
    """Write the normal row of an interval for the solvers, to whom it is the section of a cone.

    The row is coupled to nothing and pressed by just the bound::

        w_n = g λ_n − g bound ⟂ λ_n    so that λ_n = bound whatever else happens,  |λ_t| ≤ λ_n

    where g, the Delassus diagonal of the tangent, makes both rows of one size.
    """
    normal = problem.first[group]
    weight = problem.delassus[normal + 1, normal + 1]
    for i in range(problem.first[problem.count]):
        problem.delassus[normal, i] = problem.delassus[i, normal] = 0.0
    problem.delassus[normal, normal] = weight
    problem.free[normal] = -weight * problem.bound[group]


@kernel
def projected(
    problem: ContactProblem, group: int, normal: float, tangent: float
) -> tuple[float, float]:
    """Return an impulse moved into its set, exactly, along the normal first."""
    if problem.set[group] == INTERVAL:
        normal = problem.bound[group]
    elif normal < 0.0 and problem.set[group] != LINE:
        normal = 0.0
    limit = problem.friction[group] * normal
    return normal, min(max(tangent, -limit), limit)


@kernel
def contains(problem: ContactProblem, group: int, normal: float, tangent: float) -> bool:
    """Whether an impulse is in its set."""
    if problem.set[group] == INTERVAL:
        return abs(tangent) <= problem.bound[group]
    if normal < 0.0:
        return problem.set[group] == LINE and tangent == 0.0
    return abs(tangent) <= problem.friction[group] * normal


@kernel
def room(
    problem: ContactProblem, group: int, normal: float, tangent: float, sharply: bool
) -> tuple[float, float]:
    """What the tangential impulse lacks to the upper and to the lower edge of its cone.

    Negative outside; ``sharply`` in twice the precision.
    """
    friction = problem.friction[group]
    limit = friction * normal
    beyond = product_error(friction, normal, limit) if sharply else 0.0
    return (limit - tangent) + beyond, (limit + tangent) + beyond
