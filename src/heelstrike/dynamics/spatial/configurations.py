"""How velocities move positions in space: the two kernels that know what positions are."""

from __future__ import annotations

from math import atan2, copysign, sqrt

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial.algebra import Vector
from heelstrike.dynamics.spatial.rotations import (
    NO_TURN,
    Quaternion,
    quaternion_at,
    quaternion_product,
    turned_by,
    write_unit,
)
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import BALL, FREE, SpatialModel


@kernel
def integrate(model: SpatialModel, q: Floats, v: Floats, time: float, result: Floats) -> None:
    """Move positions with a constant velocity for a time; `result` (nq,) may be `q` itself.

    Angular velocities are in body axes, so that their turn comes first, within the body.
    Quaternions are of length one afterwards.
    """
    for i in range(model.nj):
        at, to = model.first_position[i], model.first_velocity[i]
        kind = model.joint_kind[i]
        if kind == FREE:
            for k in range(3):
                result[at + k] = q[at + k] + time * v[to + k]
            at, to = at + 3, to + 3
        if kind <= BALL:
            own = turned_by((v[to], v[to + 1], v[to + 2]), time)
            write_unit(at, quaternion_product(quaternion_at(q, at), own), result)
        else:
            result[at] = q[at] + time * v[to]


@kernel
def difference(model: SpatialModel, start: Floats, end: Floats, velocity: Floats) -> None:
    """Find the velocity that takes one position to another in a unit of time, the shortest way."""
    for i in range(model.nj):
        at, to = model.first_position[i], model.first_velocity[i]
        kind = model.joint_kind[i]
        if kind == FREE:
            for k in range(3):
                velocity[to + k] = end[at + k] - start[at + k]
            at, to = at + 3, to + 3
        if kind <= BALL:
            turn = turn_between(quaternion_at(start, at), quaternion_at(end, at))
            velocity[to], velocity[to + 1], velocity[to + 2] = turn
        else:
            velocity[to] = end[at] - start[at]


@kernel
def turn_between(start: Quaternion, end: Quaternion) -> Vector:
    """Rotation vector, in the axes of the start, that takes one orientation to another."""
    back = start[0], -start[1], -start[2], -start[3]
    w, x, y, z = quaternion_product(back, end)
    sine = sqrt(x * x + y * y + z * z + NO_TURN)
    # Of the two signs of a quaternion, that which turns less.
    factor = copysign(2.0 * atan2(sine, abs(w)) / sine, w)
    return x * factor, y * factor, z * factor
