"""Algebra of the plane: motions, forces and inertias at the pivot (:mod:`.kernels`).

A motion or force is (about +y, along x, along z), in an array a row for every link. Kernels that
speak in these words do not know how many numbers there are.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats

Spatial = tuple[float, float, float]


@kernel
def spatial(rows: Floats, i: int) -> Spatial:
    """Return a motion or force of an array."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@kernel
def write(i: int, value: Spatial, rows: Floats) -> None:
    """Write a motion or force into an array."""
    rows[i, 0], rows[i, 1], rows[i, 2] = value


@kernel
def plus(one: Spatial, other: Spatial) -> Spatial:
    """Add two motions or forces."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


@kernel
def scaled(value: Spatial, factor: float) -> Spatial:
    """Multiply a motion or force by a number."""
    return value[0] * factor, value[1] * factor, value[2] * factor


@kernel
def power(motion: Spatial, force: Spatial) -> float:
    """Power of a force on a motion."""
    return motion[0] * force[0] + motion[1] * force[1] + motion[2] * force[2]


@kernel
def linear_momentum_of(inertia: Floats, i: int, motion: Spatial) -> tuple[float, float]:
    """Linear momentum (x, z) of the rigid body `i` of (…, 4) that has a motion."""
    mass, hx, hz = inertia[i, 0], inertia[i, 1], inertia[i, 2]
    w, vx, vz = motion
    return mass * vx + w * hz, mass * vz - w * hx


@kernel
def momentum_of(inertia: Floats, i: int, motion: Spatial) -> Spatial:
    """Momentum of the rigid body `i` of (…, 4) that has a motion."""
    w, vx, vz = motion
    px, pz = linear_momentum_of(inertia, i, motion)
    return inertia[i, 3] * w + inertia[i, 2] * vx - inertia[i, 1] * vz, px, pz


@kernel
def cross(a: Spatial, b: Spatial) -> Spatial:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def solve_three(a: Spatial, b: Spatial, c: Spatial, right: Spatial) -> Spatial:
    """Solve [a b c] s = right, three equations with these columns."""
    bc = cross(b, c)
    determinant = power(a, bc)
    return (
        power(right, bc) / determinant,
        power(right, cross(c, a)) / determinant,
        power(right, cross(a, b)) / determinant,
    )
