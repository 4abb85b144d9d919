"""Gaps that may not become negative: those of the contact points, and those of the joint stops.

A joint stop is a contact without friction or restitution: its gap is the way left to the end of the
joint's range, its force a torque of the joint. What a contact is, and of what, the table of rows
tells (:mod:`heelstrike.sim.contacts.rows`).
"""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.kernels import point_bias_acceleration
from heelstrike.dynamics.places import place_of, velocity_at
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.candidates import write_own_rows
from heelstrike.sim.contacts.geometry import contact_rows, contact_velocity, write_unit_row
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, POINT, SECOND_FACE, STOP, Rows
from heelstrike.sim.contacts.writers import rate_of
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Faces
from heelstrike.sim.event_driven.smooth.faces import face_curvature
from heelstrike.sim.memory import Assembly, Equations


@kernel
def gap_now(contact: int, rows: Rows, state: Floats) -> float:
    """Gap of a contact point, on either face, or of a joint stop."""
    table = rows
    if table.kind[contact] == STOP:
        return table.side[contact] * (state[table.owner[contact]] - table.limit[contact])
    return table.gap[contact]


@kernel
def gap_velocity(
    contact: int, model: Model, contacts: Contacts, tree: Workspace, rows: Rows, seconds: Contacts,
    state: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Normal and tangential velocity of a contact point, on either face, or of a joint stop."""
    table = rows
    kind, owner = table.kind[contact], table.owner[contact]
    if kind == POINT:
        return contact_velocity(model, tree, contacts, owner)
    if kind == SECOND_FACE:
        return contact_velocity(model, tree, seconds, owner)
    if kind == CONSTRAINT:
        return rate_of(owner, 0, state[model.nq :], table.outside), 0.0
    return table.side[contact] * state[model.nq + owner], 0.0


@kernel
def gap_rows(
    model: Model, tree: Workspace, contacts: Contacts, rows: Rows, seconds: Contacts, contact: int,
    place: int, assembly: Assembly,
) -> None:  # fmt: skip
    """Write the Jacobian rows (normal, tangent) of a contact, stop or dry joint as a candidate."""
    table = rows
    kind, owner = table.kind[contact], table.owner[contact]
    if kind == POINT:
        contact_rows(model, tree, contacts, owner, place, assembly)
    elif kind == SECOND_FACE:
        contact_rows(model, tree, seconds, owner, place, assembly)
    elif kind == STOP:
        write_unit_row(owner, 2 * place, table.side[contact], assembly)
    elif kind == CONSTRAINT:
        write_own_rows(contact, place, table, assembly)
    else:
        write_unit_row(owner, 2 * place + 1, 1.0, assembly)


@dissolved_kernel
def free_gap_acceleration(
    model: Model, contacts: Contacts, equations: Equations, contact: int, place: int, rows: Rows,
    seconds: Contacts, breakaway: Floats, faces: Faces, assembly: Assembly,
) -> None:  # fmt: skip
    """Acceleration b = J v̇ + J̇ v of a contact, stop or dry joint, under ``equations.rate``.

    Of a contact point it is that of the gap and of the sliding velocity: for a rolling disc the
    acceleration of its centre and not of the material point that touches the ground. Of a dry
    joint the bound is written, too. The Jacobian rows must be those of the candidates'
    `place`.
    """
    along_normal = 0.0
    along_tangent = 0.0
    kind = rows.kind[contact]
    if kind in (POINT, SECOND_FACE):
        point = rows.owner[contact]
        its = seconds if kind == SECOND_FACE else contacts
        position, normal = its.position[point], its.normal[point]
        radius = model.contact_radius[point]
        center, acceleration = faces.center, faces.acceleration
        center[0] = position[0] + radius * normal[0]
        center[1] = position[1] + radius * normal[1]
        link = model.contact_link[point]
        point_bias_acceleration(equations.tree, link, center, acceleration)
        along_normal, along_tangent = into_frame(normal, (acceleration[0], acceleration[1]))
        along_tangent -= radius * acceleration[2]
        curvature = face_curvature(contact, radius, faces)
        if curvature != 0.0:
            velocity = velocity_at(equations.tree.velocity, link, place_of(equations.tree, center))
            _, along = into_frame(normal, velocity)
            along_normal += curvature * along * along
    elif kind == CONSTRAINT:
        along_normal = rows.outside.bias[rows.owner[contact], 0]
    jacobian, rate = assembly.jacobian, equations.rate
    for j in range(model.nv):
        along_normal += jacobian[2 * place, j] * rate[j]
        along_tangent += jacobian[2 * place + 1, j] * rate[j]
    assembly.problem.free[2 * place] = along_normal
    assembly.problem.free[2 * place + 1] = along_tangent
    if kind == DRY_JOINT:
        assembly.problem.bound[place] = breakaway[rows.owner[contact]]
