"""From the state of a robot to its contact points, Jacobian rows and Delassus matrix."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.straight_line import play
from heelstrike.contact.ground import GroundModel, path_curvature
from heelstrike.contact.workspace import ContactProblem
from heelstrike.dynamics.articulated import articulate, carry_along, solve_articulated
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.kernels import (
    bias_force,
    factorize,
    forward_kinematics,
    link_velocities,
    mass_matrix,
    solve_lower,
)
from heelstrike.dynamics.places import place_of, velocity_at, write_point_rows
from heelstrike.dynamics.planar import plus, power, scaled, spatial, write
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.points import locate_points
from heelstrike.sim.contacts.rows import Rows
from heelstrike.sim.contacts.straight_line import EQUATIONS, SOLVE
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Directions, Equations, Surface

EVERYWHERE = -1
"""Leaf of a candidate that acts on several links."""


@kernel
def locate_contacts(
    model: Model, ground: GroundModel, tree: Workspace, contacts: Contacts | Rows, surface: Surface
) -> None:
    """Contact points, gaps, normals and coefficients of the state now (eq. 6, 7)."""
    locate_points(model, ground, tree, contacts, surface.friction, surface.restitution)
    for i in range(model.nc if ground.curved == 1 else 0):
        radius, normal = model.contact_radius[i], contacts.normal[i]
        x, distance = contacts.position[i, 0] + radius * normal[0], contacts.gap[i] + radius
        surface.curvature[i] = path_curvature(ground, x, distance, normal)


@dissolved_kernel
def locate_in_straight_line(
    model: Model, ground: GroundModel, program: int, tree: Workspace, contacts: Contacts,
    surface: Surface,
) -> None:  # fmt: skip
    """Do the same as :func:`locate_contacts`, by a program if there is one for the ground."""
    if program != 0 and ground.friction.shape[0] == 1 and ground.curved == 0:
        play(program, (model, ground, tree, contacts, surface.friction, surface.restitution))
    else:
        locate_contacts(model, ground, tree, contacts, surface)


@kernel
def contact_velocity(
    model: Model, tree: Workspace, contacts: Contacts, contact: int
) -> tuple[float, float]:
    """Normal and tangential velocity of a contact point."""
    place = place_of(tree, contacts.position[contact])
    velocity = velocity_at(tree.velocity, model.contact_link[contact], place)
    return into_frame(contacts.normal[contact], velocity)


@kernel
def curvature_acceleration(
    model: Model, tree: Workspace, contacts: Contacts, contact: int, curvature: float
) -> float:
    """Acceleration of a gap because its point goes along ground that is curved (m/s²)."""
    radius, center = model.contact_radius[contact], contacts.position[contact]
    normal = contacts.normal[contact]
    x, z = place_of(tree, center)
    above = x + radius * normal[0], z + radius * normal[1]
    velocity = velocity_at(tree.velocity, model.contact_link[contact], above)
    _, along = into_frame(normal, velocity)
    return curvature * along * along


@kernel
def contact_rows(
    model: Model, tree: Workspace, contacts: Contacts, contact: int, place: int, first: Integers,
    directions: Directions,
) -> None:  # fmt: skip
    """Write the Jacobian rows (normal, tangent) of a contact point as candidate `place`.

    `first` tells where the rows of each candidate begin.
    """
    link = model.contact_link[contact]
    directions.leaf[place] = link
    write_point_rows(
        model, tree, link, contacts.position[contact], contacts.normal[contact], first[place],
        directions.jacobian,
    )  # fmt: skip


@kernel
def row_product(jacobian: Floats, row: int, v: Floats) -> float:
    """Jacobian row times a generalised velocity."""
    total = 0.0
    for j in range(v.shape[0]):
        total += jacobian[row, j] * v[j]
    return total


@kernel
def write_unit_row(
    joint: int, place: int, component: int, sign: float, first: Integers, leaf: Integers,
    jacobian: Floats,
) -> None:  # fmt: skip
    """Write the Jacobian rows of a candidate, a component of which is the velocity of a joint.

    Another one is zero.
    """
    for row in range(first[place], first[place + 1]):
        for j in range(jacobian.shape[1]):
            jacobian[row, j] = 0.0
    jacobian[first[place] + component, joint] = sign
    leaf[place] = joint


@dissolved_kernel
def halve_by_factor(
    model: Model, factor: Floats, place: int, row: int, directions: Directions
) -> None:
    """Write the two columns of ``half``, from `row` on, of a candidate, by A = Lᵀ D L."""
    parents, half, root = model.parent, directions.half, directions.root
    jacobian = directions.jacobian
    j = directions.leaf[place]
    while j >= 0:
        half[j, row] = jacobian[row, j]
        half[j, row + 1] = jacobian[row + 1, j]
        j = parents[j]
    j = directions.leaf[place]
    while j >= 0:
        normal = half[j, row]
        tangent = half[j, row + 1]
        half[j, row] = root[j] * normal
        half[j, row + 1] = root[j] * tangent
        i = parents[j]
        while i >= 0:
            half[i, row] -= factor[j, i] * normal
            half[i, row + 1] -= factor[j, i] * tangent
            i = parents[i]
        j = parents[j]


@dissolved_kernel
def halve_by_bodies(
    model: Model, motion: Floats, momentum: Floats, place: int, first: int, directions: Directions
) -> None:
    """Write the two columns of ``half``, from `first` on, of a candidate, by articulated bodies.

    They are what a force along its rows leaves to each joint on the way to the root.
    """
    parents, jacobian = model.parent, directions.jacobian
    root, half = directions.root, directions.half
    for row in range(first, first + 2):
        left = 0.0, 0.0, 0.0
        j = directions.leaf[place]
        while j >= 0:
            m0, m1, m2 = spatial(motion, j)
            entry = root[j] * (jacobian[row, j] + m0 * left[0] + m1 * left[1] + m2 * left[2])
            half[j, row] = entry
            left = plus(left, scaled(spatial(momentum, j), -root[j] * entry))
            j = parents[j]


@kernel
def halve_all_by_factor(model: Model, factor: Floats, row: int, directions: Directions) -> None:
    """Write a column of ``half`` for a row that has a part in any joint."""
    half = directions.half
    for j in range(model.nv):
        half[j, row] = directions.jacobian[row, j]
    for j in range(model.nv - 1, -1, -1):
        value = half[j, row]
        half[j, row] = directions.root[j] * value
        i = model.parent[j]
        while i >= 0:
            half[i, row] -= factor[j, i] * value
            i = model.parent[i]


@kernel
def halve_all_by_bodies(
    model: Model, motion: Floats, momentum: Floats, row: int, left: Floats, directions: Directions
) -> None:
    """Write a column of ``half`` for a row that has a part in any joint; `left` is scratch."""
    jacobian, root, half = directions.jacobian, directions.root, directions.half
    for i in range(model.nl):
        write(i, (0.0, 0.0, 0.0), left)
    for j in range(model.nv - 1, -1, -1):
        force = spatial(left, j)
        entry = root[j] * (jacobian[row, j] + power(spatial(motion, j), force))
        half[j, row] = entry
        parent = model.parent[j]
        if parent >= 0:
            rest = plus(force, scaled(spatial(momentum, j), -root[j] * entry))
            write(parent, plus(spatial(left, parent), rest), left)


@kernel
def assemble_delassus(
    model: Model, count: int, equations: Equations, directions: Directions, problem: ContactProblem
) -> None:
    """Delassus matrix G = J A⁻¹ Jᵀ of the first `count` candidates.

    With A = Lᵀ D L it is the square of ``half`` = D^(-1/2) L⁻ᵀ Jᵀ, whose rows are coordinates, so
    that the inner loops run over the candidates.
    """
    half, leaf, delassus, first = directions.half, directions.leaf, problem.delassus, problem.first
    factor, bodies, tree = equations.factor, equations.bodies, equations.tree
    motion, momentum = tree.motion, bodies.momentum
    straight = equations.programs[EQUATIONS] != 0
    nv, rows = model.nv, first[count]
    for j in range(nv):
        directions.root[j] = math.sqrt(factor[j, j] if straight else bodies.inverse[j])
        for row in range(rows):
            half[j, row] = 0.0
    for place in range(count):
        alone = first[place + 1] == first[place] + 1
        if alone or leaf[place] == EVERYWHERE:
            for row in range(first[place], first[place + 1]):
                if straight:
                    halve_all_by_factor(model, factor, row, directions)
                else:
                    halve_all_by_bodies(model, motion, momentum, row, tree.force, directions)
        elif straight:
            halve_by_factor(model, factor, place, first[place], directions)
        else:
            halve_by_bodies(model, motion, momentum, place, first[place], directions)
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
def add_impulse(
    model: Model, rows: int, impulse: Floats, directions: Directions, equations: Equations,
    v: Floats,
) -> None:  # fmt: skip
    """Add A⁻¹ Jᵀ λ to a velocity, after :func:`assemble_delassus`; λ has so many rows."""
    change, half = equations.force, directions.half
    for j in range(model.nv):
        total = 0.0
        for row in range(rows):
            total += half[j, row] * impulse[row]
        change[j] = directions.root[j] * total
    if equations.programs[EQUATIONS] != 0:
        solve_lower(model, equations.factor, change)
    else:
        carry_along(model, equations.bodies, equations.tree, change)
    for j in range(model.nv):
        v[j] += change[j]


@kernel
def weigh(model: Model, equations: Equations) -> None:
    """Find what A of the pose now is solved with, ``equations.added`` on its diagonal."""
    if equations.programs[EQUATIONS] != 0:
        mass_matrix(model, equations.tree, equations.mass_matrix)
        for i in range(model.nv):
            equations.mass_matrix[i, i] += equations.added[i]
        factorize(model, equations.mass_matrix, equations.factor)
    else:
        articulate(model, equations.tree, equations.added, equations.bodies)


@dissolved_kernel
def evaluate_equations(model: Model, q: Floats, v: Floats, equations: Equations) -> None:
    """Kinematics, bias force and what the mass matrix is solved with, of a state."""
    program = equations.programs[EQUATIONS]
    tree, bias = equations.tree, equations.bias
    if program != 0:
        play(program, (model, q, v, tree, equations.mass_matrix, equations.factor, bias))
    else:
        forward_kinematics(model, q, tree)
        link_velocities(model, v, tree)
        bias_force(model, tree, bias)
        weigh(model, equations)


@dissolved_kernel
def solve_mass_matrix(model: Model, equations: Equations, x: Floats) -> None:
    """Replace x by A⁻¹ x."""
    if equations.programs[SOLVE] != 0:
        play(equations.programs[SOLVE], (model, equations.factor, x))
    else:
        solve_articulated(model, equations.bodies, equations.tree, x)


@kernel
def observe(
    model: Model, ground: GroundModel, q: Floats, v: Floats, tree: Workspace, contacts: Contacts,
    surface: Surface,
) -> None:  # fmt: skip
    """Kinematics, velocities and contact points of a state."""
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    locate_contacts(model, ground, tree, contacts, surface)
