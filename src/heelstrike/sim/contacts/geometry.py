"""From the state of a robot to its contact points, Jacobian rows and Delassus matrix."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.straight_line import play
from heelstrike.contact.ground import GroundModel, ground_contact
from heelstrike.dynamics.articulated import articulate, carry_along, solve_articulated
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.kernels import (
    bias_force,
    factorize,
    forward_kinematics,
    link_velocities,
    mass_matrix,
    point_position,
    solve_lower,
)
from heelstrike.dynamics.places import place_of, velocity_at, write_point_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.straight_line import EQUATIONS, SOLVE
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
    return into_frame(normal, velocity_at(tree.velocity, link, place_of(tree, position)))


@kernel
def contact_rows(model: Model, memory: Memory, contact: int, place: int) -> None:
    """Write the Jacobian rows (normal, tangent) of a contact point as candidate `place`."""
    link, contacts = model.contact_link[contact], memory.contacts
    memory.leaf[place] = link
    write_point_rows(
        model, memory.tree, link, contacts.position[contact], contacts.normal[contact],
        memory.jacobian, 2 * place,
    )  # fmt: skip


@kernel
def row_product(memory: Memory, row: int, v: Floats) -> float:
    """Jacobian row times a generalised velocity."""
    total = 0.0
    for j in range(memory.v.shape[0]):
        total += memory.jacobian[row, j] * v[j]
    return total


@kernel
def write_unit_row(memory: Memory, joint: int, row: int, sign: float) -> None:
    """Write the Jacobian rows of the candidate of `row`, of which this is the velocity of a joint.

    The other row of the two is zero.
    """
    place = row // 2
    for j in range(memory.v.shape[0]):
        memory.jacobian[2 * place, j] = 0.0
        memory.jacobian[2 * place + 1, j] = 0.0
    memory.jacobian[row, joint] = sign
    memory.leaf[place] = joint


@dissolved_kernel
def halve_by_factor(model: Model, memory: Memory, place: int) -> None:
    """Write the columns of ``memory.half`` that belong to a candidate, by A = Lᵀ D L."""
    parents, factor, half = model.parent, memory.factor, memory.half
    row = 2 * place
    j = memory.leaf[place]
    while j >= 0:
        half[j, row] = memory.jacobian[row, j]
        half[j, row + 1] = memory.jacobian[row + 1, j]
        j = parents[j]
    j = memory.leaf[place]
    while j >= 0:
        normal = half[j, row]
        tangent = half[j, row + 1]
        half[j, row] = memory.root[j] * normal
        half[j, row + 1] = memory.root[j] * tangent
        i = parents[j]
        while i >= 0:
            half[i, row] -= factor[j, i] * normal
            half[i, row + 1] -= factor[j, i] * tangent
            i = parents[i]
        j = parents[j]


@dissolved_kernel
def halve_by_bodies(model: Model, memory: Memory, place: int) -> None:
    """Write the columns of ``memory.half`` that belong to a candidate, by articulated bodies.

    They are what a force along its rows leaves to each joint on the way to the root.
    """
    parents, motion, root, half = model.parent, memory.tree.motion, memory.root, memory.half
    jacobian, momentum = memory.jacobian, memory.bodies.momentum
    row = 2 * place
    n0 = 0.0
    n1 = 0.0
    n2 = 0.0
    t0 = 0.0
    t1 = 0.0
    t2 = 0.0
    j = memory.leaf[place]
    while j >= 0:
        m0 = motion[j, 0]
        m1 = motion[j, 1]
        m2 = motion[j, 2]
        normal = root[j] * (jacobian[row, j] + m0 * n0 + m1 * n1 + m2 * n2)
        tangent = root[j] * (jacobian[row + 1, j] + m0 * t0 + m1 * t1 + m2 * t2)
        half[j, row] = normal
        half[j, row + 1] = tangent
        normal *= root[j]
        tangent *= root[j]
        n0 -= momentum[j, 0] * normal
        n1 -= momentum[j, 1] * normal
        n2 -= momentum[j, 2] * normal
        t0 -= momentum[j, 0] * tangent
        t1 -= momentum[j, 1] * tangent
        t2 -= momentum[j, 2] * tangent
        j = parents[j]


@kernel
def assemble_delassus(model: Model, memory: Memory, count: int) -> None:
    """Delassus matrix G = J A⁻¹ Jᵀ of the first `count` candidates.

    With A = Lᵀ D L it is the square of ``memory.half`` = D^(-1/2) L⁻ᵀ Jᵀ, whose rows are
    coordinates, so that the inner loops run over the candidates.
    """
    half, delassus = memory.half, memory.problem.delassus
    straight = memory.programs[EQUATIONS] != 0
    nv = model.parent.shape[0]
    rows = 2 * count
    for j in range(nv):
        memory.root[j] = math.sqrt(memory.factor[j, j] if straight else memory.bodies.inverse[j])
        for row in range(rows):
            half[j, row] = 0.0
    for place in range(count):
        if straight:
            halve_by_factor(model, memory, place)
        else:
            halve_by_bodies(model, memory, place)
    for row in range(rows):
        empty = True
        for j in range(nv):
            entry = half[j, row]
            if entry == 0.0:
                continue
            if empty:
                for column in range(rows):
                    delassus[row, column] = entry * half[j, column]
            else:
                for column in range(rows):
                    delassus[row, column] += entry * half[j, column]
            empty = False
        if empty:
            for column in range(rows):
                delassus[row, column] = 0.0


@kernel
def add_impulse(model: Model, memory: Memory, count: int, v: Floats) -> None:
    """Add A⁻¹ Jᵀ λ to a velocity, after :func:`assemble_delassus`."""
    change, half, impulse = memory.force, memory.half, memory.answer.impulse
    for j in range(model.parent.shape[0]):
        total = 0.0
        for row in range(2 * count):
            total += half[j, row] * impulse[row]
        change[j] = memory.root[j] * total
    if memory.programs[EQUATIONS] != 0:
        solve_lower(model, memory.factor, change)
    else:
        carry_along(model, memory.tree, memory.bodies, change)
    for j in range(model.parent.shape[0]):
        v[j] += change[j]


@kernel
def weigh(model: Model, memory: Memory) -> None:
    """Find what A of the pose now is solved with, ``memory.added`` on its diagonal.

    A short robot's programs leave the factor of A behind, a long one's loops articulated bodies
    (:mod:`heelstrike.sim.contacts.straight_line`); all that solves with A takes what there is.
    """
    if memory.programs[EQUATIONS] != 0:
        mass_matrix(model, memory.tree, memory.mass_matrix)
        for i in range(model.parent.shape[0]):
            memory.mass_matrix[i, i] += memory.added[i]
        factorize(model, memory.mass_matrix, memory.factor)
    else:
        articulate(model, memory.tree, memory.added, memory.bodies)


@dissolved_kernel
def evaluate_equations(model: Model, q: Floats, v: Floats, memory: Memory) -> None:
    """Kinematics, bias force and what the mass matrix is solved with, of a state."""
    program = memory.programs[EQUATIONS]
    tree, bias = memory.tree, memory.bias
    if program != 0:
        play(program, (model, q, v, tree, memory.mass_matrix, memory.factor, bias))
    else:
        forward_kinematics(model, q, tree)
        link_velocities(model, v, tree)
        bias_force(model, tree, bias)
        weigh(model, memory)


@dissolved_kernel
def solve_mass_matrix(model: Model, memory: Memory, x: Floats) -> None:
    """Replace x by A⁻¹ x."""
    if memory.programs[SOLVE] != 0:
        play(memory.programs[SOLVE], (model, memory.factor, x))
    else:
        solve_articulated(model, memory.tree, memory.bodies, x)


@kernel
def observe(model: Model, ground: GroundModel, memory: Memory) -> None:
    """Kinematics, velocities and contact geometry of the state now."""
    forward_kinematics(model, memory.q, memory.tree)
    link_velocities(model, memory.v, memory.tree)
    locate_contacts(model, ground, memory)
