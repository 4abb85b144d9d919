"""Where the links of a tree in space are, how they move, and their inertias about the pivot.

Call order for a state: :func:`forward_kinematics`, then :func:`link_velocities`, then the rest. No
kernel here branches on a value of ``q`` or ``v``; on the kinds of joints they do.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial.algebra import (
    Spatial,
    Vector,
    angular,
    carried,
    cross,
    less,
    of_two,
    plus,
    scaled,
    spatial,
    sum_of,
    times,
    vector,
    velocity_at,
    write,
    write_vector,
)
from heelstrike.dynamics.spatial.rotations import (
    Matrix,
    matrix,
    matrix_about,
    matrix_of,
    matrix_product,
    quaternion_at,
    quaternion_product,
    turned,
    write_matrix,
)
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import FREE, HINGE, SLIDE, SpatialModel

STILL: Spatial = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel
def forward_kinematics(model: SpatialModel, q: Floats, work: SpatialWorkspace) -> None:
    """Poses of all links, the motions of their joints, their inertias about the pivot."""
    for i in range(model.nl):
        place_link(model, i, q, work)
    pivot = vector(work.origin, model.pivot)
    work.pivot[0], work.pivot[1], work.pivot[2] = pivot
    for i in range(model.nl):
        from_pivot = less(vector(work.origin, i), pivot)
        write_motions(model, i, from_pivot, work)
        write_inertia(model, i, from_pivot, work)


@kernel
def place_link(model: SpatialModel, i: int, q: Floats, work: SpatialWorkspace) -> None:
    """Write rotation and origin of a link whose parent has its own."""
    kind = model.joint_kind[i]
    first = model.first_position[i]
    if kind == FREE:
        write_vector(i, (q[first], q[first + 1], q[first + 2]), work.origin)
        write_matrix(i, matrix_of(quaternion_at(q, first + 3)), work.rotation)
        return
    parent = model.parent[i]
    above, base = IDENTITY, (0.0, 0.0, 0.0)
    if parent >= 0:
        above, base = matrix(work.rotation, parent), vector(work.origin, parent)
    offset = vector(model.offset, i)
    if kind == HINGE:
        moved = q[first] - model.reference[first]
        own = matrix_product(above, matrix_about(vector(model.axis, i), moved))
    elif kind == SLIDE:
        moved = q[first] - model.reference[first]
        offset = sum_of(offset, times(vector(model.axis, i), moved))
        own = above
    else:
        turn = model.turn[i, 0], model.turn[i, 1], model.turn[i, 2], model.turn[i, 3]
        both = quaternion_product(turn, quaternion_at(q, first))
        own = matrix_product(above, matrix_of(both))
    write_matrix(i, own, work.rotation)
    write_vector(i, sum_of(base, turned(above, offset)), work.origin)


@kernel
def write_motions(model: SpatialModel, i: int, from_pivot: Vector, work: SpatialWorkspace) -> None:
    """Write the motions of a joint per unit of its velocities."""
    kind = model.joint_kind[i]
    first = model.first_velocity[i]
    rotation = matrix(work.rotation, i)
    if kind == HINGE:
        axis = turned(rotation, vector(model.axis, i))
        write(first, of_two(axis, cross(from_pivot, axis)), work.motion)
    elif kind == SLIDE:
        write(first, of_two((0.0, 0.0, 0.0), turned(rotation, vector(model.axis, i))), work.motion)
    else:
        if kind == FREE:
            write(first, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0), work.motion)
            write(first + 1, (0.0, 0.0, 0.0, 0.0, 1.0, 0.0), work.motion)
            write(first + 2, (0.0, 0.0, 0.0, 0.0, 0.0, 1.0), work.motion)
            first += 3
        for k in range(3):
            axis = work.rotation[i, k], work.rotation[i, 3 + k], work.rotation[i, 6 + k]
            write(first + k, of_two(axis, cross(from_pivot, axis)), work.motion)


@kernel
def write_inertia(model: SpatialModel, i: int, from_pivot: Vector, work: SpatialWorkspace) -> None:
    """Write mass, first and second moments of a link about the pivot, in world axes."""
    r = matrix(work.rotation, i)
    mass = model.mass[i]
    x, y, z = sum_of(from_pivot, turned(r, vector(model.center_of_mass, i)))
    xx, yy, zz = model.inertia[i, 0], model.inertia[i, 1], model.inertia[i, 2]
    xy, xz, yz = model.inertia[i, 3], model.inertia[i, 4], model.inertia[i, 5]
    # Rows of the rotation times the tensor.
    a = (
        r[0] * xx + r[1] * xy + r[2] * xz,
        r[0] * xy + r[1] * yy + r[2] * yz,
        (r[0] * xz + r[1] * yz + r[2] * zz),
    )
    b = (
        r[3] * xx + r[4] * xy + r[5] * xz,
        r[3] * xy + r[4] * yy + r[5] * yz,
        (r[3] * xz + r[4] * yz + r[5] * zz),
    )
    c = (
        r[6] * xx + r[7] * xy + r[8] * xz,
        r[6] * xy + r[7] * yy + r[8] * yz,
        (r[6] * xz + r[7] * yz + r[8] * zz),
    )
    inertia = work.inertia
    inertia[i, 0] = mass
    inertia[i, 1] = mass * x
    inertia[i, 2] = mass * y
    inertia[i, 3] = mass * z
    inertia[i, 4] = a[0] * r[0] + a[1] * r[1] + a[2] * r[2] + mass * (y * y + z * z)
    inertia[i, 5] = b[0] * r[3] + b[1] * r[4] + b[2] * r[5] + mass * (x * x + z * z)
    inertia[i, 6] = c[0] * r[6] + c[1] * r[7] + c[2] * r[8] + mass * (x * x + y * y)
    inertia[i, 7] = a[0] * r[3] + a[1] * r[4] + a[2] * r[5] - mass * x * y
    inertia[i, 8] = a[0] * r[6] + a[1] * r[7] + a[2] * r[8] - mass * x * z
    inertia[i, 9] = b[0] * r[6] + b[1] * r[7] + b[2] * r[8] - mass * y * z


@kernel
def link_velocities(model: SpatialModel, v: Floats, work: SpatialWorkspace) -> None:
    """Spatial velocities of all links and the accelerations they cause by themselves.

    A joint's motion is carried along by its parent; that of a free joint turns about a point that
    its own linear velocity moves.
    """
    for i in range(model.nl):
        kind = model.joint_kind[i]
        first = model.first_velocity[i]
        velocity, bias = STILL, STILL
        parent = model.parent[i]
        if parent >= 0:
            velocity = spatial(work.velocity, parent)
            bias = spatial(work.bias_acceleration, parent)
        if kind >= SLIDE:
            own = scaled(spatial(work.motion, first), v[first])
        else:
            if kind == FREE:
                velocity = (0.0, 0.0, 0.0, v[first], v[first + 1], v[first + 2])
                first += 3
            own = scaled(spatial(work.motion, first), v[first])
            own = plus(own, scaled(spatial(work.motion, first + 1), v[first + 1]))
            own = plus(own, scaled(spatial(work.motion, first + 2), v[first + 2]))
        write(i, plus(bias, carried(velocity, own)), work.bias_acceleration)
        write(i, plus(velocity, own), work.velocity)


@kernel
def point_position(work: SpatialWorkspace, link: int, local: Vector) -> Vector:
    """World position of a point fixed to a link; link -1 is the world."""
    if link < 0:
        return local
    return sum_of(vector(work.origin, link), turned(matrix(work.rotation, link), local))


@kernel
def place_of(work: SpatialWorkspace, position: Vector) -> Vector:
    """Return the vector from the pivot to a world position."""
    return position[0] - work.pivot[0], position[1] - work.pivot[1], position[2] - work.pivot[2]


@kernel
def point_velocity(work: SpatialWorkspace, link: int, position: Vector) -> Vector:
    """Velocity of the point of a link that is at a world position."""
    if link < 0:
        return 0.0, 0.0, 0.0
    return velocity_at(spatial(work.velocity, link), place_of(work, position))


@kernel
def point_bias(work: SpatialWorkspace, link: int, position: Vector) -> Vector:
    """Acceleration, at v̇ = 0, of the point of a link that is at a world position."""
    if link < 0:
        return 0.0, 0.0, 0.0
    place = place_of(work, position)
    motion = spatial(work.velocity, link)
    along = velocity_at(spatial(work.bias_acceleration, link), place)
    return sum_of(along, cross(angular(motion), velocity_at(motion, place)))


@kernel
def angular_velocity(work: SpatialWorkspace, link: int) -> Vector:
    """Angular velocity of a link, in world axes."""
    return angular(spatial(work.velocity, link))
