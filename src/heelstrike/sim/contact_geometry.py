"""From the state of a robot to its contact points, Jacobian rows and Delassus matrix."""

from __future__ import annotations

import math

from heelstrike.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground import GroundModel, ground_contact
from heelstrike.dynamics.kernels import (
    forward_kinematics,
    link_velocities,
    point_position,
    solve_factorized,
    solve_lower,
    state_equations,
)
from heelstrike.dynamics.straight_line import play
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.memory import Memory
from heelstrike.sim.programs import EQUATIONS, SOLVE


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
    """Delassus matrix G = J A⁻¹ Jᵀ of the first `count` candidates, from the factor of A.

    With A = Lᵀ D L it is the square of ``memory.half`` = D^(-1/2) L⁻ᵀ Jᵀ, whose rows are
    coordinates, so that the inner loops run over the candidates.
    """
    nv = model.parent.shape[0]
    rows = 2 * count
    half, factor, delassus = memory.half, memory.factor, memory.delassus
    for j in range(nv):
        for row in range(rows):
            half[j, row] = memory.jacobian[row, j]
    for i in range(nv - 1, -1, -1):
        j = model.parent[i]
        while j >= 0:
            entry = factor[i, j]
            for row in range(rows):
                half[j, row] -= entry * half[i, row]
            j = model.parent[j]
        root = math.sqrt(factor[i, i])
        memory.root[i] = root
        # Rows below hang on this one only through the loop above: it is finished.
        for row in range(rows):
            half[i, row] *= root
    for row in range(rows):
        for column in range(rows):
            delassus[row, column] = 0.0
        for j in range(nv):
            entry = half[j, row]
            if entry != 0.0:
                for column in range(rows):
                    delassus[row, column] += entry * half[j, column]


@kernel
def add_impulse(model: Model, memory: Memory, count: int, v: Floats) -> None:
    """Add A⁻¹ Jᵀ λ to a velocity, after :func:`assemble_delassus`."""
    change = memory.rate
    for j in range(model.parent.shape[0]):
        total = 0.0
        for row in range(2 * count):
            total += memory.half[j, row] * memory.impulse[row]
        change[j] = memory.root[j] * total
    solve_lower(model, memory.factor, change)
    for j in range(model.parent.shape[0]):
        v[j] += change[j]


@dissolved_kernel
def evaluate_equations(model: Model, q: Floats, v: Floats, memory: Memory) -> None:
    """Kinematics, factor of the mass matrix and bias force of a state."""
    program = memory.programs[EQUATIONS]
    tree, matrix, factor, bias = memory.tree, memory.mass_matrix, memory.factor, memory.bias
    if program != 0:
        play(program, (model, q, v, tree, matrix, factor, bias))
    else:
        state_equations(model, q, v, tree, matrix, factor, bias)


@dissolved_kernel
def solve_mass_matrix(model: Model, memory: Memory, x: Floats) -> None:
    """Replace x by A⁻¹ x."""
    if memory.programs[SOLVE] != 0:
        play(memory.programs[SOLVE], (model, memory.factor, x))
    else:
        solve_factorized(model, memory.factor, x)


@kernel
def observe(model: Model, ground: GroundModel, memory: Memory) -> None:
    """Kinematics, velocities and contact geometry of the state now."""
    forward_kinematics(model, memory.q, memory.tree)
    link_velocities(model, memory.v, memory.tree)
    locate_contacts(model, ground, memory)
