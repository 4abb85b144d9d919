"""Rows of one entry of the table: how fast its gap changes, its Jacobian, its free acceleration.

A joint stop is a contact without friction or restitution: its gap is the way left to the end of
the joint's range, its force a torque of the joint. What an entry is, of what, where, and how far it
is away, the table of rows tells (:mod:`heelstrike.sim.contacts.rows`).
"""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.places import bias_at, place_of, velocity_at, write_point_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.candidates import write_own_rows
from heelstrike.sim.contacts.faces import CURVE
from heelstrike.sim.contacts.geometry import write_unit_row
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, STOP, Rows, is_of_ground
from heelstrike.sim.contacts.writers import rate_of


@kernel
def gap_velocity(
    entry: int, model: Model, tree: Workspace, rows: Rows, v: Floats
) -> tuple[float, float]:
    """Normal and tangential velocity of a contact point, on either face, or of what has a gap."""
    owner = rows.owner[entry]
    if rows.kind[entry] == STOP:
        return rows.side[entry] * v[owner], 0.0
    if rows.kind[entry] == CONSTRAINT:
        return rate_of(owner, 0, v, rows.outside), 0.0
    place = place_of(tree, rows.position[entry])
    velocity = velocity_at(tree.velocity, model.contact_link[owner], place)
    return into_frame(rows.normal[entry], velocity)


@kernel
def gap_rows(
    entry: int, place: int, model: Model, tree: Workspace, rows: Rows, first: Integers,
    leaf: Integers, jacobian: Floats,
) -> None:  # fmt: skip
    """Write the Jacobian rows of an entry as a candidate: the normal, and the tangent if any."""
    kind, owner = rows.kind[entry], rows.owner[entry]
    if kind == STOP:
        write_unit_row(owner, place, 0, rows.side[entry], first, leaf, jacobian)
    elif kind == CONSTRAINT:
        write_own_rows(entry, place, rows, first, leaf, jacobian)
    elif kind == DRY_JOINT:
        write_unit_row(owner, place, 1, 1.0, first, leaf, jacobian)
    else:
        link, position, normal = model.contact_link[owner], rows.position[entry], rows.normal[entry]
        leaf[place] = link
        write_point_rows(model, tree, link, position, normal, first[place], jacobian)


@kernel
def write_candidates(
    count: int, candidate: Integers, model: Model, tree: Workspace, rows: Rows, first: Integers,
    leaf: Integers, jacobian: Floats,
) -> None:  # fmt: skip
    """Write the Jacobian rows of the first `count` candidates."""
    for place in range(count):
        gap_rows(candidate[place], place, model, tree, rows, first, leaf, jacobian)


@dissolved_kernel
def free_gap_acceleration(
    entry: int, row: int, model: Model, tree: Workspace, rows: Rows, face: Integers,
    curvature: Floats, rate: Floats, jacobian: Floats, free: Floats,
) -> None:  # fmt: skip
    """Acceleration b = J v̇ + J̇ v of an entry, under v̇ = `rate`.

    Of a contact point it is that of the gap and of the sliding velocity: for a rolling disc the
    acceleration of its centre and not of the material point that touches the ground. Its Jacobian
    rows are those from `row` on.
    """
    along_normal = 0.0
    along_tangent = 0.0
    if rows.kind[entry] == CONSTRAINT:
        along_normal = rows.outside.bias[rows.owner[entry], 0]
    elif is_of_ground(entry, rows):
        point = rows.owner[entry]
        position, normal = rows.position[entry], rows.normal[entry]
        link, radius = model.contact_link[point], model.contact_radius[point]
        x, z = position[0] + radius * normal[0], position[1] + radius * normal[1]
        center = x - tree.pivot[0], z - tree.pivot[1]
        along_normal, along_tangent = into_frame(normal, bias_at(tree, link, center))
        along_tangent -= radius * tree.bias_acceleration[link, 0]
        here = curvature[entry] if face[entry] == CURVE else 0.0
        if face[entry] >= 0 and face[entry] % 2 == 1:
            here = 1.0 / radius
        if here != 0.0:  # the centre goes round a corner, or along a curve
            _, along = into_frame(normal, velocity_at(tree.velocity, link, center))
            along_normal += here * along * along
    for j in range(model.nv):
        along_normal += jacobian[row, j] * rate[j]
    free[row] = along_normal
    if rows.components[entry] == 2:
        for j in range(model.nv):
            along_tangent += jacobian[row + 1, j] * rate[j]
        free[row + 1] = along_tangent


@dissolved_kernel
def free_gap_accelerations(
    count: int, candidate: Integers, first: Integers, model: Model, tree: Workspace, rows: Rows,
    face: Integers, curvature: Floats, rate: Floats, jacobian: Floats, free: Floats,
) -> None:  # fmt: skip
    """Do :func:`free_gap_acceleration` for the first `count` candidates."""
    for place in range(count):
        free_gap_acceleration(
            candidate[place], first[place], model, tree, rows, face, curvature, rate, jacobian, free
        )
