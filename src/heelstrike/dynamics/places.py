"""Motion at a point of a body: one Jacobian column, one velocity, one force.

A spatial motion (:mod:`heelstrike.dynamics.kernels`) gives every point of its body a velocity. Of
a joint's motion per unit of its coordinate that is a column of the point's Jacobian, of a link's
velocity the velocity of the point. Points are handed on as places, vectors from the pivot.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.planar import write
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model

Vector = tuple[float, float]


@kernel
def place_of(work: Workspace, position: Floats) -> Vector:
    """Return the vector from the pivot to a world position."""
    return position[0] - work.pivot[0], position[1] - work.pivot[1]


@kernel
def velocity_at(motion: Floats, i: int, place: Vector) -> Vector:
    """Velocity (x, z) that the spatial motion `i` of (…, 3) gives to the point at a place."""
    x, z = place
    return motion[i, 1] + motion[i, 0] * z, motion[i, 2] - motion[i, 0] * x


@kernel
def bias_at(work: Workspace, link: int, place: Vector) -> Vector:
    """Acceleration (x, z) at v̇ = 0 of the point of a link at a place."""
    turn = work.velocity[link, 0]
    vx, vz = velocity_at(work.velocity, link, place)
    ax, az = velocity_at(work.bias_acceleration, link, place)
    return ax + turn * vz, az - turn * vx


@kernel
def point_at(work: Workspace, link: int, x: float, z: float) -> Vector:
    """World position of the point (x, z) of a link; link -1 is the world."""
    if link < 0:
        return x, z
    c, s = work.cosine[link], work.sine[link]
    return work.origin[link, 0] + c * x + s * z, work.origin[link, 1] - s * x + c * z


@kernel
def point_velocity(work: Workspace, link: int, at: Vector) -> Vector:
    """Velocity (x, z) of the point of a link that is at a world position."""
    if link < 0:
        return 0.0, 0.0
    return velocity_at(work.velocity, link, (at[0] - work.pivot[0], at[1] - work.pivot[1]))


@kernel
def point_bias(work: Workspace, link: int, at: Vector) -> Vector:
    """Acceleration (x, z) at v̇ = 0 of the point of a link that is at a world position."""
    if link < 0:
        return 0.0, 0.0
    return bias_at(work, link, (at[0] - work.pivot[0], at[1] - work.pivot[1]))


@kernel
def add_point_row(
    model: Model, work: Workspace, link: int, at: Vector, along: Vector, row: Floats
) -> None:
    """Add to a row what the velocities make of that, along a direction, of a point at a position.

    The direction may be of any length: minus one takes away, as at the other end of a rod.
    """
    place = at[0] - work.pivot[0], at[1] - work.pivot[1]
    j = link
    while j >= 0:
        x, z = velocity_at(work.motion, j, place)
        row[j] += along[0] * x + along[1] * z
        j = model.parent[j]


@kernel
def write_point_rows(
    model: Model,
    work: Workspace,
    link: int,
    position: Floats,
    normal: Floats,
    first: int,
    rows: Floats,
) -> None:
    """Write the Jacobian of a point of a link in the contact frame of a normal.

    Parameters
    ----------
    position, normal : (axes,) float
        Point and normal in world axes.
    rows : (…, nv) float
        Receives the rows (normal, tangent), `first` and those that follow.
    """
    for j in range(model.nv):
        for k in range(model.axes):
            rows[first + k, j] = 0.0
    place = place_of(work, position)
    j = link
    while j >= 0:
        column = into_frame(normal, velocity_at(work.motion, j, place))
        rows[first, j] = column[0]
        rows[first + 1, j] = column[1]
        j = model.parent[j]


@kernel
def point_columns(
    model: Model, work: Workspace, link: int, position: Floats, columns: Floats
) -> None:
    """Jacobian (x, z, rotation) of a point of a link, one row a coordinate."""
    for j in range(model.nv):
        write(j, (0.0, 0.0, 0.0), columns)
    place = place_of(work, position)
    j = link
    while j >= 0:
        x, z = velocity_at(work.motion, j, place)
        write(j, (x, z, work.motion[j, 0]), columns)
        j = model.parent[j]


@kernel
def add_point_force(
    model: Model, work: Workspace, link: int, position: Floats, force: Vector, total: Floats
) -> None:
    """Add Jᵀ f of a force (x, z) at a world position of a link to a generalised force."""
    place = place_of(work, position)
    j = link
    while j >= 0:
        column = velocity_at(work.motion, j, place)
        total[j] += force[0] * column[0]
        total[j] += force[1] * column[1]
        j = model.parent[j]
