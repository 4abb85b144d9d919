"""Equations of motion of a tree in space: bias force, mass matrix, and its factor along chains.

Featherstone's algorithms (*Rigid Body Dynamics Algorithms*, 2008, chapters 5 and 6), in world axes
about the pivot. The ancestors of a velocity are those of every other that comes behind it on a
chain, in the same places: so rows that are kept along chains are eliminated entry by entry, without
a look at where they belong.
"""

from __future__ import annotations

from math import sqrt

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial.algebra import (
    INERTIA,
    Spatial,
    force_carried,
    momentum_of,
    plus,
    power,
    scaled,
    spatial,
    write,
)
from heelstrike.dynamics.spatial.configurations import turn_between
from heelstrike.dynamics.spatial.kinematics import forward_kinematics, link_velocities
from heelstrike.dynamics.spatial.rotations import quaternion_at
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import BALL, FREE, SpatialModel


@kernel
def force_on_link(work: SpatialWorkspace, i: int, acceleration: Spatial) -> Spatial:
    """Force that a link needs for the part of its acceleration that velocities do not make."""
    velocity = spatial(work.velocity, i)
    whole = plus(acceleration, spatial(work.bias_acceleration, i))
    carried = force_carried(velocity, momentum_of(work.inertia, i, velocity))
    return plus(momentum_of(work.inertia, i, whole), carried)


@kernel
def gather_forces(
    model: SpatialModel, acceleration: Floats, work: SpatialWorkspace, force: Floats
) -> None:
    """Generalised force of the forces on all links, each of which receives those beyond it.

    And of what motors turn with their joints, at the joints' acceleration.
    """
    for i in range(model.nl - 1, -1, -1):
        f = spatial(work.force, i)
        for k in range(model.first_velocity[i], model.last_velocity[i] + 1):
            force[k] = power(spatial(work.motion, k), f) + model.armature[k] * acceleration[k]
        parent = model.parent[i]
        if parent >= 0:
            write(parent, plus(spatial(work.force, parent), f), work.force)


@kernel
def inverse_dynamics(
    model: SpatialModel, acceleration: Floats, work: SpatialWorkspace, force: Floats
) -> None:
    """Generalised force that yields an acceleration: M(q) v̇ + H(q, v)."""
    gravity = model.gravity
    for i in range(model.nl):
        parent = model.parent[i]
        if parent < 0:
            a = (0.0, 0.0, 0.0, -gravity[0], -gravity[1], -gravity[2])
        else:
            a = spatial(work.acceleration, parent)
        first = model.first_velocity[i]
        for k in range(first, model.last_velocity[i] + 1):
            a = plus(a, scaled(spatial(work.motion, k), acceleration[k]))
        write(i, a, work.acceleration)
        write(i, force_on_link(work, i, a), work.force)
    gather_forces(model, acceleration, work, force)


@kernel
def bias_force(model: SpatialModel, work: SpatialWorkspace, force: Floats) -> None:
    """Centrifugal, Coriolis and gravitational forces H(q, v)."""
    gravity = model.gravity
    free_fall = (0.0, 0.0, 0.0, -gravity[0], -gravity[1], -gravity[2])
    for i in range(model.nl):
        write(i, force_on_link(work, i, free_fall), work.force)
    gather_forces(model, work.zero, work, force)


@kernel
def passive_force(model: SpatialModel, q: Floats, v: Floats, force: Floats) -> None:
    """Generalised force of joint dampers and springs on the robot.

    A spring on a ball or free joint pulls along the shortest turn back to where it is slack.
    """
    for k in range(model.nv):
        force[k] = -model.damping[k] * v[k]
    for i in range(model.nl):
        stiffness = model.stiffness[i]
        if stiffness == 0.0:
            continue
        at, to = model.first_position[i], model.first_velocity[i]
        kind = model.joint_kind[i]
        if kind == FREE:
            for k in range(3):
                force[to + k] -= stiffness * (q[at + k] - model.rest[at + k])
            at, to = at + 3, to + 3
        if kind <= BALL:
            turn = turn_between(quaternion_at(q, at), quaternion_at(model.rest, at))
            for k in range(3):
                force[to + k] += stiffness * turn[k]
        else:
            force[to] -= stiffness * (q[at] - model.rest[at])


@kernel
def composite_inertias(model: SpatialModel, work: SpatialWorkspace) -> None:
    """Inertias of the subtrees of all links, each as one rigid body, about the pivot."""
    for i in range(model.nl):
        for k in range(INERTIA):
            work.composite[i, k] = work.inertia[i, k]
    for i in range(model.nl - 1, 0, -1):
        parent = model.parent[i]
        if parent >= 0:
            for k in range(INERTIA):
                work.composite[parent, k] += work.composite[i, k]


@kernel
def mass_rows(model: SpatialModel, work: SpatialWorkspace, rows: Floats) -> None:
    """Mass matrix by composite rigid bodies, each row along the chain of its velocity.

    `rows` (nv, longest) receives entries 0 … ``depth[k]`` of every row.
    """
    composite_inertias(model, work)
    for k in range(model.nv):
        p = momentum_of(work.composite, model.velocity_joint[k], spatial(work.motion, k))
        depth = model.depth[k]
        for a in range(depth + 1):
            rows[k, a] = power(spatial(work.motion, model.chain[k, a]), p)
        rows[k, depth] += model.armature[k]


@kernel
def spread(model: SpatialModel, rows: Floats, matrix: Floats) -> None:
    """Write a symmetric matrix (nv, nv) whose rows are kept along chains."""
    for i in range(model.nv):
        for j in range(model.nv):
            matrix[i, j] = 0.0
    for i in range(model.nv):
        for a in range(model.depth[i] + 1):
            j = model.chain[i, a]
            matrix[i, j] = rows[i, a]
            matrix[j, i] = rows[i, a]


@kernel
def mass_matrix(
    model: SpatialModel, work: SpatialWorkspace, tree: TreeFactor, matrix: Floats
) -> None:
    """Mass matrix (nv, nv), by :func:`mass_rows`."""
    mass_rows(model, work, tree.matrix)
    spread(model, tree.matrix, matrix)


@kernel
def factorize(model: SpatialModel, tree: TreeFactor) -> None:
    """Factorise M = Lᵀ D L along the tree, without fill-in."""
    factor = tree.factor
    for k in range(model.nv):
        for a in range(model.depth[k] + 1):
            factor[k, a] = tree.matrix[k, a]
    for k in range(model.nv - 1, -1, -1):
        depth = model.depth[k]
        inverse = 1.0 / factor[k, depth]
        factor[k, depth] = inverse
        tree.root[k] = sqrt(inverse)
        for a in range(depth - 1, -1, -1):
            i = model.chain[k, a]
            ratio = factor[k, a] * inverse
            for b in range(a + 1):
                factor[i, b] -= ratio * factor[k, b]
            factor[k, a] = ratio


@kernel
def solve_upper(model: SpatialModel, tree: TreeFactor, x: Floats) -> None:
    """Replace x by L⁻ᵀ x."""
    for k in range(model.nv - 1, -1, -1):
        own = x[k]
        for a in range(model.depth[k]):
            x[model.chain[k, a]] -= tree.factor[k, a] * own


@kernel
def solve_lower(model: SpatialModel, tree: TreeFactor, x: Floats) -> None:
    """Replace x by L⁻¹ x."""
    for k in range(model.nv):
        total = x[k]
        for a in range(model.depth[k]):
            total -= tree.factor[k, a] * x[model.chain[k, a]]
        x[k] = total


@kernel
def solve_factorized(model: SpatialModel, tree: TreeFactor, x: Floats) -> None:
    """Replace x by M⁻¹ x."""
    solve_upper(model, tree, x)
    for k in range(model.nv):
        x[k] *= tree.factor[k, model.depth[k]]
    solve_lower(model, tree, x)


@kernel
def state_equations(
    model: SpatialModel,
    q: Floats,
    v: Floats,
    work: SpatialWorkspace,
    tree: TreeFactor,
    bias: Floats,
) -> None:
    """Everything that follows from a state: kinematics, factor of the mass matrix, bias force."""
    forward_kinematics(model, q, work)
    link_velocities(model, v, work)
    mass_rows(model, work, tree.matrix)
    factorize(model, tree)
    bias_force(model, work, bias)


@kernel
def forward_dynamics(
    model: SpatialModel, force: Floats, work: SpatialWorkspace, tree: TreeFactor, v_dot: Floats
) -> None:
    """Acceleration under a generalised force: M⁻¹ (force − H), with `tree` filled.

    `force` holds all generalised forces but H: actuators, passive joint forces and Jᵀλ.
    """
    mass_rows(model, work, tree.matrix)
    factorize(model, tree)
    bias_force(model, work, v_dot)
    for k in range(model.nv):
        v_dot[k] = force[k] - v_dot[k]
    solve_factorized(model, tree, v_dot)
