"""Algebra of space: motions, forces and inertias at the pivot, in world axes.

A motion is (angular velocity, velocity of the body point at the pivot), a force is (moment about
the pivot, resultant), each six numbers; in an array a row for every link. An inertia is ten: mass,
first moments, second moments xx, yy, zz, xy, xz, yz. At one common point and in common axes they
add without any transformation. This is the algebra of :mod:`heelstrike.dynamics.planar` with more
numbers.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats

Vector = tuple[float, float, float]
Spatial = tuple[float, float, float, float, float, float]

INERTIA = 10
"""Numbers of an inertia."""


@kernel
def vector(rows: Floats, i: int) -> Vector:
    """Return the vector of a row."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@kernel
def write_vector(i: int, value: Vector, rows: Floats) -> None:
    """Write a vector into a row."""
    rows[i, 0], rows[i, 1], rows[i, 2] = value


@kernel
def sum_of(a: Vector, b: Vector) -> Vector:
    """Add two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def less(a: Vector, b: Vector) -> Vector:
    """Take one vector from another."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def times(a: Vector, factor: float) -> Vector:
    """Multiply a vector by a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def spatial(rows: Floats, i: int) -> Spatial:
    """Return a motion or force of an array."""
    return rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4], rows[i, 5]


@kernel
def of_two(a: Vector, b: Vector) -> Spatial:
    """Join the two halves of a motion or force."""
    return a[0], a[1], a[2], b[0], b[1], b[2]


@kernel
def angular(value: Spatial) -> Vector:
    """Angular velocity of a motion, or moment of a force."""
    return value[0], value[1], value[2]


@kernel
def linear(value: Spatial) -> Vector:
    """Velocity of a motion at the pivot, or resultant of a force."""
    return value[3], value[4], value[5]


@kernel
def write(i: int, value: Spatial, rows: Floats) -> None:
    """Write a motion or force into an array."""
    rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4], rows[i, 5] = value


@kernel
def plus(one: Spatial, other: Spatial) -> Spatial:
    """Add two motions or forces."""
    return (
        one[0] + other[0], one[1] + other[1], one[2] + other[2],
        one[3] + other[3], one[4] + other[4], one[5] + other[5],
    )  # fmt: skip


@kernel
def scaled(value: Spatial, factor: float) -> Spatial:
    """Multiply a motion or force by a number."""
    return (
        value[0] * factor, value[1] * factor, value[2] * factor,
        value[3] * factor, value[4] * factor, value[5] * factor,
    )  # fmt: skip


@kernel
def power(motion: Spatial, force: Spatial) -> float:
    """Power of a force on a motion."""
    return (
        (motion[0] * force[0] + motion[1] * force[1] + motion[2] * force[2])
        + (motion[3] * force[3] + motion[4] * force[4] + motion[5] * force[5])
    )  # fmt: skip


@kernel
def carried(carrier: Spatial, motion: Spatial) -> Spatial:
    """Rate of a motion that is carried along by another: v × m (Featherstone 2008, eq. 2.29)."""
    w, m = angular(carrier), angular(motion)
    turned = cross(w, m)
    return of_two(turned, sum_of(cross(w, linear(motion)), cross(linear(carrier), m)))


@kernel
def force_carried(carrier: Spatial, force: Spatial) -> Spatial:
    """Rate of a force that is carried along by a motion: v ×* f (Featherstone 2008, eq. 2.31)."""
    w, f = angular(carrier), linear(force)
    moment = sum_of(cross(w, angular(force)), cross(linear(carrier), f))
    return of_two(moment, cross(w, f))


@kernel
def linear_momentum_of(inertia: Floats, i: int, motion: Spatial) -> Vector:
    """Linear momentum of the rigid body `i` of (…, 10) that has a motion."""
    first = inertia[i, 1], inertia[i, 2], inertia[i, 3]
    return less(times(linear(motion), inertia[i, 0]), cross(first, angular(motion)))


@kernel
def momentum_of(inertia: Floats, i: int, motion: Spatial) -> Spatial:
    """Momentum of the rigid body `i` of (…, 10) that has a motion."""
    x, y, z, vx, vy, vz = motion
    hx, hy, hz = inertia[i, 1], inertia[i, 2], inertia[i, 3]
    xy, xz, yz = inertia[i, 7], inertia[i, 8], inertia[i, 9]
    mass = inertia[i, 0]
    return (
        inertia[i, 4] * x + xy * y + xz * z + hy * vz - hz * vy,
        xy * x + inertia[i, 5] * y + yz * z + hz * vx - hx * vz,
        xz * x + yz * y + inertia[i, 6] * z + hx * vy - hy * vx,
        mass * vx - hy * z + hz * y,
        mass * vy - hz * x + hx * z,
        mass * vz - hx * y + hy * x,
    )


@kernel
def velocity_at(motion: Spatial, place: Vector) -> Vector:
    """Velocity that a motion gives to the body point at a place, a vector from the pivot."""
    x, y, z, vx, vy, vz = motion
    return (
        vx + y * place[2] - z * place[1],
        vy + z * place[0] - x * place[2],
        vz + x * place[1] - y * place[0],
    )
