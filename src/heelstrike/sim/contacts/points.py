"""Several contact points of a robot at once, without a branch: kernels for straight-line code.

`points` (k,) lists the contact points. Rows and components go point by point in that order, normal
before tangent. Arrays of (nc, 2) have an entry for every contact point of the robot; positions and
normals are those of :func:`~heelstrike.sim.contacts.geometry.locate_contacts`.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.dynamics.kernels import solve_factorized, solve_upper
from heelstrike.dynamics.places import place_of, velocity_at, write_point_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model


@kernel
def point_delassus(
    model: Model,
    points: Integers,
    tree: Workspace,
    position: Floats,
    normal: Floats,
    factor: Floats,
    rows: Floats,
    delassus: Floats,
) -> None:
    """Delassus matrix G = J A⁻¹ Jᵀ of the points, (2 k, 2 k); `rows` (2 k, nv) is scratch.

    With A = Lᵀ D L it is Y D⁻¹ Yᵀ, where Y = J L⁻¹.
    """
    for place in range(points.shape[0]):
        contact = points[place]
        link = model.contact_link[contact]
        write_point_rows(model, tree, link, position[contact], normal[contact], rows, 2 * place)
        solve_upper(model, factor, rows[2 * place])
        solve_upper(model, factor, rows[2 * place + 1])
    for row in range(rows.shape[0]):
        for column in range(row + 1):
            total = 0.0
            for j in range(model.parent.shape[0]):
                total += rows[row, j] * factor[j, j] * rows[column, j]
            delassus[row, column] = total
            delassus[column, row] = total


@kernel
def point_velocities(
    model: Model,
    points: Integers,
    tree: Workspace,
    position: Floats,
    normal: Floats,
    v: Floats,
    velocity: Floats,
) -> None:
    """Velocities (normal, tangent) of the points under the joint velocity v, into (nc, 2)."""
    link = tree.force  # scratch
    for i in range(model.parent.shape[0]):
        parent = model.parent[i]
        for k in range(3):
            link[i, k] = tree.motion[i, k] * v[i]
            if parent >= 0:
                link[i, k] += link[parent, k]
    for place in range(points.shape[0]):
        contact = points[place]
        i = model.contact_link[contact]
        velocity[contact, 0], velocity[contact, 1] = into_frame(
            normal[contact], velocity_at(link, i, place_of(tree, position[contact]))
        )


@kernel
def push_points(
    model: Model,
    points: Integers,
    tree: Workspace,
    position: Floats,
    normal: Floats,
    factor: Floats,
    impulse: Floats,
    force: Floats,
    v: Floats,
) -> None:
    """Add A⁻¹ Jᵀ λ to a velocity, λ (nc, 2) the impulses of the points; `force` is scratch.

    The impulses are gathered link by link, as moments about the pivot and resultants.
    """
    link = tree.force  # scratch
    for i in range(model.parent.shape[0]):
        for k in range(3):
            link[i, k] = 0.0
    for place in range(points.shape[0]):
        contact = points[place]
        i = model.contact_link[contact]
        fx, fz = out_of_frame(normal[contact], (impulse[contact, 0], impulse[contact, 1]))
        x, z = place_of(tree, position[contact])
        link[i, 0] += z * fx - x * fz
        link[i, 1] += fx
        link[i, 2] += fz
    for i in range(model.parent.shape[0] - 1, -1, -1):
        parent = model.parent[i]
        total = 0.0
        for k in range(3):
            total += tree.motion[i, k] * link[i, k]
            if parent >= 0:
                link[parent, k] += link[i, k]
        force[i] = total
    solve_factorized(model, factor, force)
    for i in range(model.parent.shape[0]):
        v[i] += force[i]
