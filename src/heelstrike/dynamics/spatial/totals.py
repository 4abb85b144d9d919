"""Sums over all links of a robot in space: centre of mass, momentum, energy."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial.algebra import (
    Spatial,
    Vector,
    angular,
    cross,
    dot,
    less,
    linear,
    linear_momentum_of,
    momentum_of,
    plus,
    power,
    spatial,
    sum_of,
    times,
)
from heelstrike.dynamics.spatial.configurations import turn_between
from heelstrike.dynamics.spatial.equations import composite_inertias
from heelstrike.dynamics.spatial.kinematics import STILL
from heelstrike.dynamics.spatial.rotations import quaternion_at
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import BALL, FREE, SpatialModel

Moments = tuple[float, float, float, float]


@kernel
def first_moments(model: SpatialModel, work: SpatialWorkspace) -> Moments:
    """Mass of the robot and its first moments about the pivot."""
    mass, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(model.nl):
        mass = mass + work.inertia[i, 0]
        x = x + work.inertia[i, 1]
        y = y + work.inertia[i, 2]
        z = z + work.inertia[i, 3]
    return mass, x, y, z


@kernel
def center_of_mass(model: SpatialModel, work: SpatialWorkspace, position: Floats) -> None:
    """World position of the robot's centre of mass."""
    mass, x, y, z = first_moments(model, work)
    position[0] = work.pivot[0] + x / mass
    position[1] = work.pivot[1] + y / mass
    position[2] = work.pivot[2] + z / mass


@kernel
def about_center(moments: Moments, momentum: Spatial) -> Vector:
    """Moment of momentum about the centre of mass."""
    mass, x, y, z = moments
    moved = cross((x, y, z), linear(momentum))
    return less(angular(momentum), times(moved, 1.0 / mass))


@kernel
def momentum(model: SpatialModel, work: SpatialWorkspace, result: Floats) -> None:
    """Linear momentum and moment of momentum about the robot's centre of mass, (6,)."""
    total = STILL
    for i in range(model.nl):
        total = plus(total, momentum_of(work.inertia, i, spatial(work.velocity, i)))
    result[0], result[1], result[2] = linear(total)
    result[3], result[4], result[5] = about_center(first_moments(model, work), total)


@kernel
def momentum_matrix(model: SpatialModel, work: SpatialWorkspace, matrix: Floats) -> None:
    """Centroidal momentum matrix, (6, nv): :func:`momentum` per unit of every velocity.

    A joint moves its subtree as one rigid body.
    """
    moments = first_moments(model, work)
    composite_inertias(model, work)
    for k in range(model.nv):
        p = momentum_of(work.composite, model.velocity_joint[k], spatial(work.motion, k))
        matrix[0, k], matrix[1, k], matrix[2, k] = linear(p)
        matrix[3, k], matrix[4, k], matrix[5, k] = about_center(moments, p)


@kernel
def center_of_mass_jacobian(model: SpatialModel, work: SpatialWorkspace, jacobian: Floats) -> None:
    """Jacobian (3, nv) of the centre of mass: linear momentum per unit of velocity, over mass."""
    mass, _, _, _ = first_moments(model, work)
    composite_inertias(model, work)
    for k in range(model.nv):
        p = linear_momentum_of(work.composite, model.velocity_joint[k], spatial(work.motion, k))
        jacobian[0, k], jacobian[1, k], jacobian[2, k] = times(p, 1.0 / mass)


@kernel
def center_of_mass_bias_acceleration(
    model: SpatialModel, work: SpatialWorkspace, acceleration: Floats
) -> None:
    """J̇v of :func:`center_of_mass_jacobian`: acceleration of the centre of mass at v̇ = 0.

    The momentum of a link changes at the rate that its own acceleration gives, and is turned with
    it.
    """
    mass, total = 0.0, (0.0, 0.0, 0.0)
    for i in range(model.nl):
        motion = spatial(work.velocity, i)
        p = linear_momentum_of(work.inertia, i, motion)
        f = linear_momentum_of(work.inertia, i, spatial(work.bias_acceleration, i))
        mass = mass + work.inertia[i, 0]
        total = sum_of(total, sum_of(f, cross(angular(motion), p)))
    acceleration[0], acceleration[1], acceleration[2] = times(total, 1.0 / mass)


@kernel
def kinetic_energy(model: SpatialModel, v: Floats, work: SpatialWorkspace, energy: Floats) -> None:
    """Kinetic energy of the links and of the rotors (armature), summed link by link."""
    total = 0.0
    for i in range(model.nl):
        motion = spatial(work.velocity, i)
        total = total + 0.5 * power(motion, momentum_of(work.inertia, i, motion))
    for k in range(model.nv):
        total = total + 0.5 * model.armature[k] * v[k] * v[k]
    energy[0] = total


@kernel
def potential_energy(
    model: SpatialModel, q: Floats, work: SpatialWorkspace, energy: Floats
) -> None:
    """Energy of the links in the gravity field and of the joint springs; zero at the origin."""
    gravity = model.gravity[0], model.gravity[1], model.gravity[2]
    pivot = work.pivot[0], work.pivot[1], work.pivot[2]
    mass, x, y, z = first_moments(model, work)
    total = -dot(gravity, sum_of((x, y, z), times(pivot, mass)))
    for i in range(model.nl):
        at = model.first_position[i]
        kind = model.joint_kind[i]
        stretch = 0.0
        if model.stiffness[i] == 0.0:
            continue
        if kind == FREE:
            for k in range(3):
                stretch += (q[at + k] - model.rest[at + k]) ** 2
            at += 3
        if kind <= BALL:
            turn = turn_between(quaternion_at(q, at), quaternion_at(model.rest, at))
            stretch += dot(turn, turn)
        else:
            stretch += (q[at] - model.rest[at]) ** 2
        total += 0.5 * model.stiffness[i] * stretch
    energy[0] = total
