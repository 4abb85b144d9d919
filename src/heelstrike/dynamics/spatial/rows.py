"""Rows of Jacobians along chains, and the Delassus matrix J M⁻¹ Jᵀ from the ancestors they share.

A block of rows belongs to one chain, that of its last velocity: entry ``a`` of a row is that of
velocity ``chain[last, a]``. With M = Lᵀ D L the matrix is Y Yᵀ of the rows Y = J L⁻¹ D^(-1/2), and
of two blocks only the velocities that both chains share play a part.
"""

from __future__ import annotations

from math import sqrt

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial.algebra import (
    Vector,
    angular,
    cross,
    dot,
    less,
    spatial,
    sum_of,
    times,
    velocity_at,
)
from heelstrike.dynamics.spatial.equations import solve_lower
from heelstrike.dynamics.spatial.kinematics import place_of, point_bias, point_position
from heelstrike.dynamics.spatial.rotations import NO_TURN, Matrix, matrix, turned
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import SpatialModel

ALONG_X = 1e-24
"""Square of the sine of the angle from x up to which a normal is along it."""


@kernel
def contact_center(model: SpatialModel, work: SpatialWorkspace, contact: int) -> Vector:
    """World position of the centre of a contact sphere or rim."""
    at = model.contact_position
    local = at[contact, 0], at[contact, 1], at[contact, 2]
    return point_position(work, model.contact_link[contact], local)


@kernel
def contact_point(
    model: SpatialModel, work: SpatialWorkspace, contact: int, normal: Vector
) -> Vector:
    """World position of the point of a contact sphere or rim that comes first against a normal."""
    center = contact_center(model, work, contact)
    rim, radius = model.contact_rim[contact], model.contact_radius[contact]
    along = model.contact_axis
    local = along[contact, 0], along[contact, 1], along[contact, 2]
    axis = turned(matrix(work.rotation, model.contact_link[contact]), local)
    down = lowest_of_rim(axis, normal)
    return (
        center[0] + rim * down[0] - radius * normal[0],
        center[1] + rim * down[1] - radius * normal[1],
        center[2] + rim * down[2] - radius * normal[2],
    )


@kernel
def contact_bias(
    model: SpatialModel, work: SpatialWorkspace, contact: int, normal: Vector
) -> Vector:
    """Acceleration at v̇ = 0 of gap and sliding velocity of a contact, in world axes.

    It belongs to the point that touches, not to the material there: a sphere that rolls on the
    ground has none, although its lowest point is drawn towards its centre.
    """
    link = model.contact_link[contact]
    motion = spatial(work.velocity, link)
    w = angular(motion)
    arm = less(contact_point(model, work, contact, normal), contact_center(model, work, contact))
    of_center = point_bias(work, link, contact_center(model, work, contact))
    turning = angular(spatial(work.bias_acceleration, link))
    along = model.contact_axis
    local = along[contact, 0], along[contact, 1], along[contact, 2]
    axis = turned(matrix(work.rotation, link), local)
    moved = times(rate_of_lowest(axis, normal, cross(w, axis)), model.contact_rim[contact])
    return sum_of(of_center, sum_of(cross(turning, arm), cross(w, moved)))


@kernel
def rate_of_lowest(axis: Vector, normal: Vector, rate: Vector) -> Vector:
    """Rate of :func:`lowest_of_rim` by that of the axis."""
    part = dot(axis, normal)
    u = less(times(axis, part), normal)
    u_rate = sum_of(times(rate, part), times(axis, dot(rate, normal)))
    inverse = 1.0 / sqrt(dot(u, u) + NO_TURN)
    down = times(u, inverse)
    return times(less(u_rate, times(down, dot(down, u_rate))), inverse)


@kernel
def lowest_of_rim(axis: Vector, normal: Vector) -> Vector:
    """Unit vector from the middle of a rim to its lowest point; zero if all are equally low."""
    part = dot(axis, normal)
    x = axis[0] * part - normal[0]
    y = axis[1] * part - normal[1]
    z = axis[2] * part - normal[2]
    inverse = 1.0 / sqrt(x * x + y * y + z * z + NO_TURN)
    return x * inverse, y * inverse, z * inverse


@kernel
def contact_frame(normal: Vector) -> Matrix:
    """Normal and tangents of a contact, row by row.

    The first tangent is world x less its part along the normal, made a unit vector (world y where
    the normal is along x); the second is normal × first: world y on level ground.
    """
    nx, ny, nz = normal
    across = ny * ny + nz * nz
    if across > ALONG_X:
        length = sqrt(across)
        first = length, -nx * ny / length, -nx * nz / length
    else:
        first = 0.0, 1.0, 0.0
    sx, sy, sz = cross(normal, first)
    return nx, ny, nz, first[0], first[1], first[2], sx, sy, sz


@kernel
def write_point_rows(
    model: SpatialModel,
    work: SpatialWorkspace,
    link: int,
    position: Vector,
    frame: Matrix,
    first: int,
    rows: Floats,
) -> None:
    """Write the Jacobian of the point of a link at a world position, in the axes of a frame.

    `rows` (…, longest) receives three rows from `first` on, along the chain of the link.
    """
    place = place_of(work, position)
    last = model.last_velocity[link]
    for a in range(model.depth[last] + 1):
        motion = spatial(work.motion, model.chain[last, a])
        column = turned(frame, velocity_at(motion, place))
        rows[first, a] = column[0]
        rows[first + 1, a] = column[1]
        rows[first + 2, a] = column[2]


@kernel
def write_velocity_row(model: SpatialModel, k: int, sign: float, row: int, rows: Floats) -> None:
    """Write the row of a velocity alone, times a sign, along its own chain."""
    depth = model.depth[k]
    for a in range(depth):
        rows[row, a] = 0.0
    rows[row, depth] = sign


@kernel
def along_rows(
    model: SpatialModel, last: int, first: int, count: int, rows: Floats, v: Floats, result: Floats
) -> None:
    """Write J v of a block of rows into its entries of a result."""
    if count == 3:
        n, s, t = 0.0, 0.0, 0.0
        for a in range(model.depth[last] + 1):
            own = v[model.chain[last, a]]
            n += rows[first, a] * own
            s += rows[first + 1, a] * own
            t += rows[first + 2, a] * own
        result[first], result[first + 1], result[first + 2] = n, s, t
        return
    for r in range(first, first + count):
        total = 0.0
        for a in range(model.depth[last] + 1):
            total += rows[r, a] * v[model.chain[last, a]]
        result[r] = total


@kernel
def add_row_forces(
    model: SpatialModel, last: int, first: int, count: int, rows: Floats, force: Floats,
    total: Floats,
) -> None:  # fmt: skip
    """Add Jᵀ λ of a block of rows, of its entries of a force, to a vector over the velocities."""
    if count == 3:
        n, s, t = force[first], force[first + 1], force[first + 2]
        for a in range(model.depth[last] + 1):
            k = model.chain[last, a]
            added = total[k] + rows[first, a] * n + rows[first + 1, a] * s
            total[k] = added + rows[first + 2, a] * t
        return
    for r in range(first, first + count):
        own = force[r]
        for a in range(model.depth[last] + 1):
            total[model.chain[last, a]] += rows[r, a] * own


@kernel
def whiten_rows(
    model: SpatialModel, tree: TreeFactor, last: int, first: int, count: int, rows: Floats
) -> None:
    """Replace a block of rows J by Y = J L⁻¹ D^(-1/2), of which J M⁻¹ Jᵀ is Y Yᵀ."""
    for a in range(model.depth[last], -1, -1):
        k = model.chain[last, a]
        root = tree.root[k]
        for r in range(first, first + count):
            own = rows[r, a]
            for b in range(a):
                rows[r, b] -= tree.factor[k, b] * own
            rows[r, a] = own * root


@kernel
def write_diagonal(
    model: SpatialModel, count: int, first: Integers, last: Integers, rows: Floats, matrix: Floats
) -> None:
    """Write the diagonal of J M⁻¹ Jᵀ of blocks of whitened rows; see :func:`write_delassus`."""
    for i in range(count):
        end = model.depth[last[i]] + 1
        r = first[i]
        if first[i + 1] - r == 3:
            n, s, t = 0.0, 0.0, 0.0
            for a in range(end):
                n += rows[r, a] * rows[r, a]
                s += rows[r + 1, a] * rows[r + 1, a]
                t += rows[r + 2, a] * rows[r + 2, a]
            matrix[r, r], matrix[r + 1, r + 1], matrix[r + 2, r + 2] = n, s, t
            continue
        for m in range(r, first[i + 1]):
            total = 0.0
            for a in range(end):
                total += rows[m, a] * rows[m, a]
            matrix[m, m] = total


@kernel
def write_delassus(
    model: SpatialModel, count: int, first: Integers, last: Integers, rows: Floats, matrix: Floats
) -> None:
    """Write J M⁻¹ Jᵀ of blocks of whitened rows.

    Parameters
    ----------
    count : int
        Number of blocks.
    first : (count + 1,) int
        First row of each block, of one to three rows, and behind the last.
    last : (count,) int
        Last velocity of the chain of each.
    rows : (…, longest) float
        What :func:`whiten_rows` left.
    matrix : (…, …) float
        Receives the matrix, both halves of it.
    """
    for i in range(count):
        for j in range(i + 1):
            shared = model.shared[last[i], last[j]]
            r, s = first[i], first[j]
            if first[i + 1] - r == 3 and first[j + 1] - s == 3:
                write_block(shared, r, s, rows, matrix)
                continue
            if first[i + 1] - r == 1 and first[j + 1] - s == 3:
                write_against_block(shared, r, s, rows, matrix)
                continue
            for m in range(r, first[i + 1]):
                for n in range(s, first[j + 1]):
                    total = 0.0
                    for a in range(shared):
                        total += rows[m, a] * rows[n, a]
                    matrix[m, n] = total
                    matrix[n, m] = total


@kernel
def write_against_block(shared: int, r: int, s: int, rows: Floats, matrix: Floats) -> None:
    """Write the products of one row and three others, which share so many velocities."""
    first, second, third = 0.0, 0.0, 0.0
    for a in range(shared):
        own = rows[r, a]
        first += own * rows[s, a]
        second += own * rows[s + 1, a]
        third += own * rows[s + 2, a]
    matrix[r, s], matrix[r, s + 1], matrix[r, s + 2] = first, second, third
    matrix[s, r], matrix[s + 1, r], matrix[s + 2, r] = first, second, third


@kernel
def write_block(shared: int, r: int, s: int, rows: Floats, matrix: Floats) -> None:
    """Write the products of three rows and three others, which share so many velocities."""
    nn, nt, nu = 0.0, 0.0, 0.0
    tn, tt, tu = 0.0, 0.0, 0.0
    un, ut, uu = 0.0, 0.0, 0.0
    for a in range(shared):
        n, t, u = rows[r, a], rows[r + 1, a], rows[r + 2, a]
        x, y, z = rows[s, a], rows[s + 1, a], rows[s + 2, a]
        nn += n * x
        nt += n * y
        nu += n * z
        tn += t * x
        tt += t * y
        tu += t * z
        un += u * x
        ut += u * y
        uu += u * z
    matrix[r, s], matrix[r, s + 1], matrix[r, s + 2] = nn, nt, nu
    matrix[r + 1, s], matrix[r + 1, s + 1], matrix[r + 1, s + 2] = tn, tt, tu
    matrix[r + 2, s], matrix[r + 2, s + 1], matrix[r + 2, s + 2] = un, ut, uu
    matrix[s, r], matrix[s + 1, r], matrix[s + 2, r] = nn, nt, nu
    matrix[s, r + 1], matrix[s + 1, r + 1], matrix[s + 2, r + 1] = tn, tt, tu
    matrix[s, r + 2], matrix[s + 1, r + 2], matrix[s + 2, r + 2] = un, ut, uu


@kernel
def velocity_change(
    model: SpatialModel, tree: TreeFactor, count: int, first: Integers, last: Integers,
    rows: Floats, impulse: Floats, change: Floats,
) -> None:  # fmt: skip
    """Change of velocity M⁻¹ Jᵀ λ by the impulses of blocks of whitened rows."""
    for k in range(model.nv):
        change[k] = 0.0
    for i in range(count):
        add_row_forces(model, last[i], first[i], first[i + 1] - first[i], rows, impulse, change)
    for k in range(model.nv):
        change[k] *= tree.root[k]
    solve_lower(model, tree, change)
