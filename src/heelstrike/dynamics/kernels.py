"""Equations of motion of a planar tree, written once.

Every kernel here works on plain arrays, allocates nothing and never branches on a value of ``q``
or ``v``. Compiled by Numba it runs at machine speed; uncompiled, over arrays of CasADi symbols, it
yields the exact expression graph (see :mod:`heelstrike.dynamics.queries.symbolic`).

All spatial vectors are expressed in world axes at one common point, the pivot, so that motions and
inertias of different links add without any transformation. This is Featherstone's algorithm
family (*Rigid Body Dynamics Algorithms*, 2008, chapters 5 and 6) in the algebra of the plane:

- motion ``(w, vx, vz)``: rotation about +y and velocity of the body point at the pivot;
- a point at ``r = (x, z)`` from the pivot moves with ``(vx + w z, vz - w x)``;
- inertia ``(m, hx, hz, I)`` about the pivot: momentum ``p = (m vx + w hz, m vz - w hx)`` and
  moment of momentum ``L = I w + hz vx - hx vz``, positive about +y.

Call order for a state: :func:`forward_kinematics`, then :func:`link_velocities`, then the rest.
"""

from __future__ import annotations

from math import cos, sin

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.places import bias_at, place_of, velocity_at
from heelstrike.dynamics.planar import (
    linear_momentum_of,
    momentum_of,
    plus,
    power,
    scaled,
    spatial,
    write,
)
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model


@kernel
def integrate(model: Model, q: Floats, v: Floats, time: float, result: Floats) -> None:
    """Move positions with a constant velocity for a time; `result` (nq,) may be `q` itself.

    This and :func:`difference` alone know that the coordinates of a planar tree are plain numbers
    whose rates are its velocities.
    """
    for i in range(model.nq):
        result[i] = q[i] + time * v[i]


@kernel
def difference(model: Model, start: Floats, end: Floats, velocity: Floats) -> None:
    """Find the velocity that takes one position to another in a unit of time."""
    for i in range(model.nv):
        velocity[i] = end[i] - start[i]


@kernel
def forward_kinematics(model: Model, q: Floats, work: Workspace) -> None:
    """Poses of all links, their joint motions and inertias about the pivot (paper eq. 6)."""
    for i in range(model.nl):
        parent = model.parent[i]
        displacement = q[i] - model.reference[i]
        x = model.offset[i, 0] + model.axis[i, 1] * displacement
        z = model.offset[i, 1] + model.axis[i, 2] * displacement
        if parent < 0:
            work.angle[i] = model.axis[i, 0] * displacement
            work.origin[i, 0] = x
            work.origin[i, 1] = z
            work.motion[i, 1] = model.axis[i, 1]
            work.motion[i, 2] = model.axis[i, 2]
        else:
            c = work.cosine[parent]
            s = work.sine[parent]
            work.angle[i] = work.angle[parent] + model.axis[i, 0] * displacement
            work.origin[i, 0] = work.origin[parent, 0] + c * x + s * z
            work.origin[i, 1] = work.origin[parent, 1] - s * x + c * z
            work.motion[i, 1] = c * model.axis[i, 1] + s * model.axis[i, 2]
            work.motion[i, 2] = c * model.axis[i, 2] - s * model.axis[i, 1]
        if model.axis[i, 0] == 0.0 and parent >= 0:
            work.cosine[i] = work.cosine[parent]
            work.sine[i] = work.sine[parent]
        else:
            work.cosine[i] = cos(work.angle[i])
            work.sine[i] = sin(work.angle[i])
    work.pivot[0] = work.origin[model.pivot, 0]
    work.pivot[1] = work.origin[model.pivot, 1]
    for i in range(model.nl):
        x = work.origin[i, 0] - work.pivot[0]
        z = work.origin[i, 1] - work.pivot[1]
        work.motion[i, 0] = model.axis[i, 0]
        work.motion[i, 1] -= model.axis[i, 0] * z
        work.motion[i, 2] += model.axis[i, 0] * x
        c = work.cosine[i]
        s = work.sine[i]
        x += c * model.center_of_mass[i, 0] + s * model.center_of_mass[i, 1]
        z += c * model.center_of_mass[i, 1] - s * model.center_of_mass[i, 0]
        mass = model.mass[i]
        work.inertia[i, 0] = mass
        work.inertia[i, 1] = mass * x
        work.inertia[i, 2] = mass * z
        work.inertia[i, 3] = model.inertia[i] + mass * (x * x + z * z)


@kernel
def link_velocities(model: Model, v: Floats, work: Workspace) -> None:
    """Spatial velocities of all links and the accelerations they cause by themselves.

    A joint's motion is carried along by its parent, so that it changes at the rate
    ``velocity x motion``; the sum of these along the chain is J̇v.
    """
    for i in range(model.nl):
        parent = model.parent[i]
        m0, m1, m2 = spatial(work.motion, i)
        w, vx, vz, bx, bz = 0.0, 0.0, 0.0, 0.0, 0.0
        if parent >= 0:
            w, vx, vz = spatial(work.velocity, parent)
            _, bx, bz = spatial(work.bias_acceleration, parent)
        write(i, (w + m0 * v[i], vx + m1 * v[i], vz + m2 * v[i]), work.velocity)
        bx = bx + (w * m2 - m0 * vz) * v[i]
        bz = bz + (m0 * vx - w * m1) * v[i]
        write(i, (0.0, bx, bz), work.bias_acceleration)


@kernel
def inverse_dynamics(model: Model, acceleration: Floats, work: Workspace, force: Floats) -> None:
    """Generalised force A(q) a + H(q, v) of the given joint acceleration (recursive Newton-Euler).

    Gravity enters as an upward acceleration of the world. Passive joint forces (damping, springs)
    are not part of H; see :func:`passive_force`.
    """
    for i in range(model.nl):
        a = 0.0, -model.gravity[0], -model.gravity[1]
        if model.parent[i] >= 0:
            a = spatial(work.acceleration, model.parent[i])
        a = plus(a, scaled(spatial(work.motion, i), acceleration[i]))
        write(i, a, work.acceleration)
        # The recursion above carries the part of the joints; the velocity part is ready.
        a = plus(a, spatial(work.bias_acceleration, i))
        w, vx, vz = spatial(work.velocity, i)
        px, pz = linear_momentum_of(work.inertia, i, (w, vx, vz))
        moment, fx, fz = momentum_of(work.inertia, i, a)
        write(i, (moment + vz * px - vx * pz, fx + w * pz, fz - w * px), work.force)
    for i in range(model.nl - 1, -1, -1):
        f = spatial(work.force, i)
        force[i] = power(spatial(work.motion, i), f) + model.armature[i] * acceleration[i]
        parent = model.parent[i]
        if parent >= 0:
            write(parent, plus(spatial(work.force, parent), f), work.force)


@kernel
def bias_force(model: Model, work: Workspace, force: Floats) -> None:
    """Centrifugal, Coriolis and gravitational forces, the paper's H(q, v) (eq. 1)."""
    inverse_dynamics(model, work.zero, work, force)


@kernel
def passive_force(model: Model, q: Floats, v: Floats, force: Floats) -> None:
    """Generalised force of joint dampers and springs on the robot."""
    for i in range(model.nv):
        force[i] = -model.damping[i] * v[i] - model.stiffness[i] * (q[i] - model.rest[i])


@kernel
def composite_inertias(model: Model, work: Workspace) -> None:
    """Inertias of the subtrees of all links, each as one rigid body, about the pivot."""
    for i in range(model.nl):
        for k in range(4):
            work.composite[i, k] = work.inertia[i, k]
    for i in range(model.nl - 1, 0, -1):
        parent = model.parent[i]
        if parent >= 0:
            for k in range(4):
                work.composite[parent, k] += work.composite[i, k]


@kernel
def mass_matrix(model: Model, work: Workspace, matrix: Floats) -> None:
    """Mass matrix, the paper's A(q) (eq. 1), by composite rigid bodies."""
    composite_inertias(model, work)
    for i in range(model.nv):
        for j in range(model.nv):
            matrix[i, j] = 0.0
    for i in range(model.nl - 1, -1, -1):
        motion = spatial(work.motion, i)
        p = momentum_of(work.composite, i, motion)
        matrix[i, i] = power(motion, p) + model.armature[i]
        j = model.parent[i]
        while j >= 0:
            entry = power(spatial(work.motion, j), p)
            matrix[i, j] = entry
            matrix[j, i] = entry
            j = model.parent[j]


@kernel
def factorize(model: Model, matrix: Floats, factor: Floats) -> None:
    """Factorise A = Lᵀ D L along the tree, without fill-in (Featherstone 2008, section 6.5).

    `factor` receives D⁻¹ on its diagonal and the strictly lower part of the unit matrix L, nonzero
    only where the column is an ancestor of the row.
    """
    for i in range(model.nv):
        factor[i, i] = matrix[i, i]
        j = model.parent[i]
        while j >= 0:
            factor[i, j] = matrix[i, j]
            j = model.parent[j]
    for k in range(model.nv - 1, -1, -1):
        inverse = 1.0 / factor[k, k]
        factor[k, k] = inverse
        i = model.parent[k]
        while i >= 0:
            ratio = factor[k, i] * inverse
            j = i
            while j >= 0:
                factor[i, j] -= ratio * factor[k, j]
                j = model.parent[j]
            factor[k, i] = ratio
            i = model.parent[i]


@kernel
def solve_upper(model: Model, factor: Floats, x: Floats) -> None:
    """Replace x by L⁻ᵀ x."""
    for i in range(model.nv - 1, -1, -1):
        j = model.parent[i]
        while j >= 0:
            x[j] -= factor[i, j] * x[i]
            j = model.parent[j]


@kernel
def solve_lower(model: Model, factor: Floats, x: Floats) -> None:
    """Replace x by L⁻¹ x.

    The parent is last to be taken off, since it is last to be known.
    """
    for i in range(model.nv):
        parent = model.parent[i]
        if parent >= 0:
            j = model.parent[parent]
            while j >= 0:
                x[i] -= factor[i, j] * x[j]
                j = model.parent[j]
            x[i] -= factor[i, parent] * x[parent]


@kernel
def solve_factorized(model: Model, factor: Floats, x: Floats) -> None:
    """Replace x by A⁻¹ x."""
    solve_upper(model, factor, x)
    for i in range(model.nv):
        x[i] *= factor[i, i]
    solve_lower(model, factor, x)


@kernel
def acceleration_without_contact(
    model: Model, q: Floats, v: Floats, torque: Floats, bias: Floats, factor: Floats,
    force: Floats, v_dot: Floats,
) -> None:  # fmt: skip
    """Acceleration if nothing touches the robot; `force` is scratch."""
    passive_force(model, q, v, force)
    for i in range(model.nu):
        force[model.actuator_joint[i]] += torque[i]
    for i in range(model.nv):
        v_dot[i] = force[i] - bias[i]
    solve_factorized(model, factor, v_dot)


@kernel
def point_position(work: Workspace, link: int, local: Floats, position: Floats) -> None:
    """World position of a point fixed to a link."""
    c = work.cosine[link]
    s = work.sine[link]
    position[0] = work.origin[link, 0] + c * local[0] + s * local[1]
    position[1] = work.origin[link, 1] - s * local[0] + c * local[1]


@kernel
def point_jacobian(
    model: Model, work: Workspace, link: int, position: Floats, jacobian: Floats
) -> None:
    """Jacobian of a body point and of its link's rotation.

    Parameters
    ----------
    link : int
        Link that carries the point.
    position : (2,) float
        World position of the point.
    jacobian : (3, nv) float
        Receives the rows (x, z, rotation about +y): the paper's J_r, J_l (eq. 4, 5).
    """
    for j in range(model.nv):
        for k in range(3):
            jacobian[k, j] = 0.0
    place = place_of(work, position)
    j = link
    while j >= 0:
        jacobian[0, j], jacobian[1, j] = velocity_at(work.motion, j, place)
        jacobian[2, j] = work.motion[j, 0]
        j = model.parent[j]


@kernel
def point_velocity(work: Workspace, link: int, position: Floats, velocity: Floats) -> None:
    """Velocity (x, z) of a point of a link and angular velocity of the link, into (3,)."""
    velocity[0], velocity[1] = velocity_at(work.velocity, link, place_of(work, position))
    velocity[2] = work.velocity[link, 0]


@kernel
def point_bias_acceleration(
    work: Workspace, link: int, position: Floats, acceleration: Floats
) -> None:
    """J̇ v of :func:`point_jacobian`: acceleration of the point and link at zero v̇."""
    acceleration[0], acceleration[1] = bias_at(work, link, place_of(work, position))
    acceleration[2] = work.bias_acceleration[link, 0]


@kernel
def forward_dynamics(
    model: Model, force: Floats, work: Workspace, matrix: Floats, factor: Floats, v_dot: Floats
) -> None:
    """Acceleration under a generalised force: A⁻¹ (force − H), with `matrix` and `factor` filled.

    `force` holds all generalised forces but H: actuators, passive joint forces and Jᵀλ.
    """
    mass_matrix(model, work, matrix)
    factorize(model, matrix, factor)
    bias_force(model, work, v_dot)
    for i in range(model.nv):
        v_dot[i] = force[i] - v_dot[i]
    solve_factorized(model, factor, v_dot)


@kernel
def kinetic_energy(model: Model, v: Floats, work: Workspace, energy: Floats) -> None:
    """Kinetic energy of the links and of the rotors (armature), summed link by link."""
    energy[0] = 0.0
    for i in range(model.nl):
        w, vx, vz = spatial(work.velocity, i)
        energy[0] += 0.5 * (
            work.inertia[i, 3] * w * w
            + work.inertia[i, 0] * (vx * vx + vz * vz)
            + 2.0 * w * (work.inertia[i, 2] * vx - work.inertia[i, 1] * vz)
            + model.armature[i] * v[i] * v[i]
        )


@kernel
def potential_energy(model: Model, q: Floats, work: Workspace, energy: Floats) -> None:
    """Energy of the links in the gravity field and of the joint springs; zero at the origin."""
    energy[0] = 0.0
    for i in range(model.nl):
        mass = work.inertia[i, 0]
        stretch = q[i] - model.rest[i]
        energy[0] += (
            -model.gravity[0] * (work.inertia[i, 1] + mass * work.pivot[0])
            - model.gravity[1] * (work.inertia[i, 2] + mass * work.pivot[1])
            + 0.5 * model.stiffness[i] * stretch * stretch
        )


@kernel
def first_moments(model: Model, work: Workspace) -> tuple[float, float, float]:
    """Mass of the robot and its first moments (x, z) about the pivot."""
    mass = 0.0
    hx = 0.0
    hz = 0.0
    for i in range(model.nl):
        mass = mass + work.inertia[i, 0]
        hx = hx + work.inertia[i, 1]
        hz = hz + work.inertia[i, 2]
    return mass, hx, hz


@kernel
def center_of_mass(model: Model, work: Workspace, position: Floats) -> None:
    """World position of the robot's centre of mass."""
    mass, hx, hz = first_moments(model, work)
    position[0] = work.pivot[0] + hx / mass
    position[1] = work.pivot[1] + hz / mass


@kernel
def momentum(model: Model, work: Workspace, result: Floats) -> None:
    """Linear momentum (x, z) and moment of momentum about the robot's centre of mass (+y)."""
    mass, hx, hz = first_moments(model, work)
    total = 0.0, 0.0, 0.0
    for i in range(model.nl):
        total = plus(total, momentum_of(work.inertia, i, spatial(work.velocity, i)))
    moment, px, pz = total
    result[0] = px
    result[1] = pz
    result[2] = moment - (hz * px - hx * pz) / mass


@kernel
def momentum_matrix(model: Model, work: Workspace, matrix: Floats) -> None:
    """Centroidal momentum matrix, (3, nv): :func:`momentum` per unit velocity of every joint.

    A joint moves its subtree as one rigid body. Rows x and z over the mass of the robot are the
    Jacobian of the centre of mass.
    """
    mass, hx, hz = first_moments(model, work)
    composite_inertias(model, work)
    for i in range(model.nl - 1, -1, -1):
        moment, px, pz = momentum_of(work.composite, i, spatial(work.motion, i))
        matrix[0, i] = px
        matrix[1, i] = pz
        matrix[2, i] = moment - (hz * px - hx * pz) / mass


@kernel
def state_equations(
    model: Model,
    q: Floats,
    v: Floats,
    tree: Workspace,
    matrix: Floats,
    factor: Floats,
    bias: Floats,
) -> None:
    """Everything that follows from a state: kinematics, factor of the mass matrix, bias force."""
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    mass_matrix(model, tree, matrix)
    factorize(model, matrix, factor)
    bias_force(model, tree, bias)


@kernel
def center_of_mass_jacobian(model: Model, work: Workspace, jacobian: Floats) -> None:
    """Jacobian (axes, nv) of the centre of mass: linear momentum per unit velocity, over mass."""
    mass, _, _ = first_moments(model, work)
    composite_inertias(model, work)
    for i in range(model.nv):
        px, pz = linear_momentum_of(work.composite, i, spatial(work.motion, i))
        jacobian[0, i] = px / mass
        jacobian[1, i] = pz / mass


@kernel
def center_of_mass_bias_acceleration(model: Model, work: Workspace, acceleration: Floats) -> None:
    """J̇v of :func:`center_of_mass_jacobian`: acceleration of the centre of mass at v̇ = 0.

    The momentum of a link changes at the rate that its own acceleration gives, and is turned with
    it.
    """
    mass = 0.0
    x = 0.0
    z = 0.0
    for i in range(model.nl):
        motion = spatial(work.velocity, i)
        px, pz = linear_momentum_of(work.inertia, i, motion)
        fx, fz = linear_momentum_of(work.inertia, i, spatial(work.bias_acceleration, i))
        mass = mass + work.inertia[i, 0]
        x = x + fx + motion[0] * pz
        z = z + fz - motion[0] * px
    acceleration[0] = x / mass
    acceleration[1] = z / mass
