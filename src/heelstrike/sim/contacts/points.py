"""Several contact points of a robot at once, without a branch: kernels for straight-line code.

`points` (k,) lists the contact points. Rows and components go point by point in that order, normal
before tangent. Arrays of (nc, 2) have an entry for every contact point of the robot.
"""

from __future__ import annotations

from math import sqrt

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel, ground_contact
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.dynamics.kernels import point_position, solve_factorized, solve_upper
from heelstrike.dynamics.places import place_of, velocity_at, write_point_rows
from heelstrike.dynamics.planar import plus, power, scaled, spatial, write
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.rows import Rows
from heelstrike.sim.controller.interface import Contacts


@kernel
def locate_points(
    model: Model, ground: GroundModel, tree: Workspace, contacts: Contacts | Rows,
    friction: Floats, restitution: Floats,
) -> None:  # fmt: skip
    """All contact points, gaps, normals and coefficients of the state now (eq. 6, 7).

    On ground of one straight segment it has no branch.
    """
    for i in range(model.nc):
        point, normal = contacts.position[i], contacts.normal[i]
        point_position(tree, model.contact_link[i], model.contact_position[i], point)
        radius = model.contact_radius[i]
        contacts.gap[i], mu, bounce = ground_contact(ground, point[0], point[1], radius, normal)
        friction[i] = model.friction_scale[i] * mu
        restitution[i] = model.restitution_scale[i] * bounce
        point[0] -= radius * normal[0]
        point[1] -= radius * normal[1]


@kernel
def point_delassus(
    model: Model, points: Integers, tree: Workspace, contacts: Contacts, factor: Floats,
    rows: Floats, delassus: Floats,
) -> None:  # fmt: skip
    """Delassus matrix G = J A⁻¹ Jᵀ of the points; `rows` (2 k, nv) is scratch.

    It is written into the first 2 k rows and columns of a matrix that may have room for more.

    With A = Lᵀ D L it is Z Zᵀ, where Z = J L⁻¹ D^(-1/2): symmetric to the last digit.
    """
    for place in range(points.shape[0]):
        contact, first = points[place], 2 * place
        position, normal = contacts.position[contact], contacts.normal[contact]
        write_point_rows(model, tree, model.contact_link[contact], position, normal, first, rows)
        solve_upper(model, factor, rows[first])
        solve_upper(model, factor, rows[first + 1])
    for j in range(model.nv):
        root = sqrt(factor[j, j])
        for row in range(rows.shape[0]):
            rows[row, j] *= root
    for row in range(rows.shape[0]):
        for column in range(rows.shape[0]):
            total = 0.0
            for j in range(model.nv):
                total += rows[row, j] * rows[column, j]
            delassus[row, column] = total


@kernel
def point_velocities(
    model: Model, points: Integers, contacts: Contacts, v: Floats, tree: Workspace, velocity: Floats
) -> None:
    """Velocities (normal, tangent) of the points under the joint velocity v, into (nc, 2)."""
    link = tree.force  # scratch
    for i in range(model.nl):
        motion = scaled(spatial(tree.motion, i), v[i])
        if model.parent[i] >= 0:
            motion = plus(motion, spatial(link, model.parent[i]))
        write(i, motion, link)
    for place in range(points.shape[0]):
        contact = points[place]
        at = velocity_at(
            link, model.contact_link[contact], place_of(tree, contacts.position[contact])
        )
        normal, tangent = into_frame(contacts.normal[contact], at)
        velocity[contact, 0] = normal
        velocity[contact, 1] = tangent


@kernel
def push_points(
    model: Model, points: Integers, contacts: Contacts, factor: Floats, impulse: Floats,
    tree: Workspace, force: Floats, v: Floats,
) -> None:  # fmt: skip
    """Add A⁻¹ Jᵀ λ to a velocity, λ (nc, 2) the impulses of the points; `force` is scratch.

    The impulses are gathered link by link, as moments about the pivot and resultants.
    """
    link = tree.force  # scratch
    for i in range(model.nl):
        write(i, (0.0, 0.0, 0.0), link)
    for place in range(points.shape[0]):
        contact = points[place]
        i = model.contact_link[contact]
        fx, fz = out_of_frame(contacts.normal[contact], (impulse[contact, 0], impulse[contact, 1]))
        x, z = place_of(tree, contacts.position[contact])
        write(i, plus(spatial(link, i), (z * fx - x * fz, fx, fz)), link)
    for i in range(model.nl - 1, -1, -1):
        parent = model.parent[i]
        own = spatial(link, i)
        force[i] = power(spatial(tree.motion, i), own)
        if parent >= 0:
            write(parent, plus(spatial(link, parent), own), link)
    solve_factorized(model, factor, force)
    for i in range(model.nv):
        v[i] += force[i]
