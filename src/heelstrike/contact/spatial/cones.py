"""Projection onto the set of a block, and the natural map of its impulse and velocity.

With De Saxcé's velocity ``ũ = u + μ ‖u_t‖ n`` Coulomb's law says that ũ lies in the dual of the
cone K and is perpendicular to λ. That is so where the natural map vanishes::

    ‖λ − P_K(λ − ũ)‖

(De Saxcé and Feng 1998; Acary and Brogliato 2008). The other sets have no friction, and ũ = u.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.robot.model import Floats

Triple = tuple[float, float, float]


@kernel
def entries_of(values: Floats, begin: int, end: int) -> Triple:
    """Numbers of the rows of a block, zero for those that it does not have."""
    second = values[begin + 1] if begin + 1 < end else 0.0
    return values[begin], second, values[begin + 2] if begin + 2 < end else 0.0


@kernel
def project(kind: int, friction: float, bound: float, n: float, s: float, t: float) -> Triple:
    """Return the point of a set that is nearest to an impulse (n, s, t)."""
    if kind == LINE:
        return n, s, t
    if kind == HALF_LINE:
        return max(n, 0.0), 0.0, 0.0
    if kind == INTERVAL:
        return min(max(n, -bound), bound), 0.0, 0.0
    across = math.sqrt(s * s + t * t)
    if friction * across <= -n:
        return 0.0, 0.0, 0.0
    if across <= friction * n:
        return n, s, t
    pressed = (n + friction * across) / (1.0 + friction * friction)
    share = friction * pressed / across
    return pressed, share * s, share * t


@kernel
def natural_map(
    kind: int, friction: float, bound: float, impulse: Triple, velocity: Triple
) -> float:
    """Length of the natural map of a block."""
    n, s, t = impulse
    un, us, ut = velocity
    if kind == LINE:
        return math.sqrt(un * un + us * us + ut * ut)
    if kind == HALF_LINE:
        return abs(min(n, un))
    if kind == INTERVAL:
        beyond = n - un
        if abs(beyond) <= bound:
            return abs(un)
        return abs(n - bound) if beyond > 0.0 else abs(n + bound)
    un += friction * math.sqrt(us * us + ut * ut)
    across = math.sqrt((s - us) * (s - us) + (t - ut) * (t - ut))
    normal = n - un
    if friction * across <= -normal:
        return math.sqrt(n * n + s * s + t * t)
    if across <= friction * normal:
        return math.sqrt(un * un + us * us + ut * ut)
    pressed, first, second = project(CONE, friction, bound, normal, s - us, t - ut)
    n, s, t = n - pressed, s - first, t - second
    return math.sqrt(n * n + s * s + t * t)
