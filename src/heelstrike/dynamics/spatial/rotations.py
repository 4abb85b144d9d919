"""Rotations: unit quaternions, real part first, and matrices of nine numbers, row by row."""

from __future__ import annotations

from math import cos, sin, sqrt

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial.algebra import Vector
from heelstrike.robot.model import Floats

Quaternion = tuple[float, float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]

NO_TURN = 1e-300
"""Square of a speed (rad²/s²) that is added where one is divided by: it changes no other number,
and spares kernels the question whether anything turns."""


@kernel
def quaternion_at(q: Floats, first: int) -> Quaternion:
    """Return the quaternion that begins at a place of a vector."""
    return q[first], q[first + 1], q[first + 2], q[first + 3]


@kernel
def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Quaternion of the rotation `a` of what has been turned by `b`."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def turned_by(velocity: Vector, time: float) -> Quaternion:
    """Quaternion of the rotation at a constant angular velocity in a time."""
    x, y, z = velocity
    speed = sqrt(x * x + y * y + z * z + NO_TURN)
    half = 0.5 * speed * time
    factor = sin(half) / speed
    return cos(half), x * factor, y * factor, z * factor


@kernel
def write_unit(first: int, a: Quaternion, q: Floats) -> None:
    """Write a quaternion into a vector, its length made one."""
    inverse = 1.0 / sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + a[3] * a[3])
    q[first] = a[0] * inverse
    q[first + 1] = a[1] * inverse
    q[first + 2] = a[2] * inverse
    q[first + 3] = a[3] * inverse


@kernel
def matrix_of(a: Quaternion) -> Matrix:
    """Rotation matrix of a unit quaternion."""
    w, x, y, z = a
    return (
        w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z,
    )  # fmt: skip


@kernel
def matrix_about(axis: Vector, angle: float) -> Matrix:
    """Rotation matrix about a unit axis."""
    x, y, z = axis
    c, s = cos(angle), sin(angle)
    u = 1.0 - c
    return (
        c + u * x * x, u * x * y - s * z, u * x * z + s * y,
        u * x * y + s * z, c + u * y * y, u * y * z - s * x,
        u * x * z - s * y, u * y * z + s * x, c + u * z * z,
    )  # fmt: skip


@kernel
def matrix(rows: Floats, i: int) -> Matrix:
    """Return a matrix of an array."""
    return (
        rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4],
        rows[i, 5], rows[i, 6], rows[i, 7], rows[i, 8],
    )  # fmt: skip


@kernel
def write_matrix(i: int, value: Matrix, rows: Floats) -> None:
    """Write a matrix into an array."""
    rows[i, 0], rows[i, 1], rows[i, 2] = value[0], value[1], value[2]
    rows[i, 3], rows[i, 4], rows[i, 5] = value[3], value[4], value[5]
    rows[i, 6], rows[i, 7], rows[i, 8] = value[6], value[7], value[8]


@kernel
def matrix_product(a: Matrix, b: Matrix) -> Matrix:
    """Product of two matrices."""
    x = turned(a, (b[0], b[3], b[6]))
    y = turned(a, (b[1], b[4], b[7]))
    z = turned(a, (b[2], b[5], b[8]))
    return x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]


@kernel
def turned(a: Matrix, b: Vector) -> Vector:
    """Turn a vector by a matrix."""
    return (
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
        a[3] * b[0] + a[4] * b[1] + a[5] * b[2],
        a[6] * b[0] + a[7] * b[1] + a[8] * b[2],
    )
