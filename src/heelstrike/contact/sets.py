"""Where impulses may lie: the set of each group of rows, projection onto it and distance to it.

====================  ==========================  =========================================
``CONE``              λ_n ≥ 0, ‖λ_t‖ ≤ μ λ_n      contact with friction: Coulomb's cone
``HALF_LINE``         λ_n ≥ 0                     contact without friction, joint stop
``LINE``              any λ_n                     closed loop, latch: the rows do not part at all
====================  ==========================  =========================================

A group has two rows, normal and tangent. Only cones have friction; that of other sets is zero. An
interval, ``|λ_t| ≤ l``, as dry friction has it, is the section of a cone at a normal impulse that
is known (:func:`press`).
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.compensated import product_error
from heelstrike.contact.workspace import ContactProblem

CONE = 0
HALF_LINE = 1
LINE = 2


@kernel
def press(group: int, limit: float, problem: ContactProblem) -> None:
    """Make a group's set the interval ``|λ_t| ≤ limit``.

    It is a cone whose normal row is coupled to nothing and pressed by just that::

        w_n = g λ_n − g limit ⟂ λ_n    so that λ_n = limit whatever else happens,  |λ_t| ≤ λ_n

    where g, the Delassus diagonal of the tangent, makes both rows of one size.
    """
    weight = problem.delassus[2 * group + 1, 2 * group + 1]
    problem.set[group] = CONE
    problem.friction[group] = 1.0
    problem.delassus[2 * group, 2 * group] = weight
    problem.free[2 * group] = -weight * limit


@kernel
def projected(
    problem: ContactProblem, group: int, normal: float, tangent: float
) -> tuple[float, float]:
    """Return an impulse moved into its set, exactly, along the normal first."""
    if normal < 0.0 and problem.set[group] != LINE:
        normal = 0.0
    limit = problem.friction[group] * normal
    return normal, min(max(tangent, -limit), limit)


@kernel
def contains(problem: ContactProblem, group: int, normal: float, tangent: float) -> bool:
    """Whether an impulse is in its set."""
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
