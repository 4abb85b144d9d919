"""From the state of a robot to its contact points, Jacobian rows and Delassus matrix."""

from __future__ import annotations

from heelstrike.compilation import kernel
from heelstrike.contact.ground import GroundModel, ground_contact
from heelstrike.dynamics.kernels import (
    forward_kinematics,
    link_velocities,
    point_position,
    solve_upper,
)
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.memory import Memory


@kernel
def locate_contacts(model: Model, ground: GroundModel, memory: Memory) -> None:
    """Contact points, gaps, normals and ground coefficients of the state now (eq. 6, 7)."""
    contacts = memory.contacts
    for i in range(model.contact_link.shape[0]):
        point = contacts.position[i]
        point_position(memory.tree, model.contact_link[i], model.contact_position[i], point)
        radius = model.contact_radius[i]
        normal = contacts.normal[i]
        gap, friction, restitution = ground_contact(ground, point[0], point[1], radius, normal)
        contacts.gap[i] = gap
        memory.friction[i] = friction
        memory.restitution[i] = restitution
        point[0] -= radius * normal[0]
        point[1] -= radius * normal[1]


@kernel
def contact_velocity(
    link: int, position: Floats, normal: Floats, tree: Workspace
) -> tuple[float, float]:
    """Normal and tangential velocity of a point of a link."""
    x = position[0] - tree.pivot[0]
    z = position[1] - tree.pivot[1]
    vx = tree.velocity[link, 1] + tree.velocity[link, 0] * z
    vz = tree.velocity[link, 2] - tree.velocity[link, 0] * x
    return normal[0] * vx + normal[1] * vz, normal[1] * vx - normal[0] * vz


@kernel
def contact_rows(model: Model, memory: Memory, contact: int, place: int) -> None:
    """Write the Jacobian rows (normal, tangent) of a contact point as candidate `place`."""
    tree = memory.tree
    jacobian = memory.jacobian
    x = memory.contacts.position[contact, 0] - tree.pivot[0]
    z = memory.contacts.position[contact, 1] - tree.pivot[1]
    nx = memory.contacts.normal[contact, 0]
    nz = memory.contacts.normal[contact, 1]
    normal_row = 2 * place
    tangent_row = normal_row + 1
    for j in range(model.parent.shape[0]):
        jacobian[normal_row, j] = 0.0
        jacobian[tangent_row, j] = 0.0
    j = model.contact_link[contact]
    while j >= 0:
        jx = tree.motion[j, 1] + tree.motion[j, 0] * z
        jz = tree.motion[j, 2] - tree.motion[j, 0] * x
        jacobian[normal_row, j] = nx * jx + nz * jz
        jacobian[tangent_row, j] = nz * jx - nx * jz
        j = model.parent[j]


@kernel
def row_product(memory: Memory, row: int, v: Floats) -> float:
    """Jacobian row times a generalised velocity."""
    total = 0.0
    for j in range(memory.v.shape[0]):
        total += memory.jacobian[row, j] * v[j]
    return total


@kernel
def assemble_delassus(model: Model, memory: Memory, count: int) -> None:
    """Delassus matrix G = J A⁻¹ Jᵀ of the first `count` candidates, from the factor of A."""
    nv = model.parent.shape[0]
    half = memory.half
    for row in range(2 * count):
        for j in range(nv):
            half[row, j] = memory.jacobian[row, j]
        solve_upper(model, memory.factor, half[row])
    for row in range(2 * count):
        for column in range(row + 1):
            entry = 0.0
            for j in range(nv):
                entry += half[row, j] * half[column, j] / memory.factor[j, j]
            memory.delassus[row, column] = entry
            memory.delassus[column, row] = entry


@kernel
def observe(model: Model, ground: GroundModel, memory: Memory) -> None:
    """Kinematics, velocities and contact geometry of the state now."""
    forward_kinematics(model, memory.q, memory.tree)
    link_velocities(model, memory.v, memory.tree)
    locate_contacts(model, ground, memory)
