"""Forward dynamics by articulated bodies: A⁻¹ x without A, in time proportional to the joints.

Featherstone's algorithm (*Rigid Body Dynamics Algorithms*, 2008, chapter 7) with all spatial
vectors at one common pivot, where nothing needs to be transformed. The subtree of a link, joints
free to move, resists an acceleration a of the link with the force I a − p. Through joint i with
motion s, driven by x_i, that force passes on to the parent without the part that moves the joint::

    U = I s       D = sᵀ U + armature       u = x_i + sᵀ p
    I_parent += I − U Uᵀ / D                p_parent += p − U u / D

and on the way back ``v̇_i = (u − Uᵀ a_parent) / D``, ``a = a_parent + s v̇_i``. The D are those of
A = Lᵀ D L (:func:`~heelstrike.dynamics.kernels.factorize`), and u = L⁻ᵀ x.

The inertia of an articulated body is a symmetric matrix, of a rigid one it is::

    | I    hz  −hx |
    | hz   m    0  |
    | −hx  0    m  |
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.planar import plus, power, scaled, spatial, write
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Model

Floats = NDArray[np.float64]


class ArticulatedBodies(Bundle):
    """The subtree of every link with its joints free to move."""

    inertia: Floats = array("nl", 6)
    """Their inertia about the pivot: rows of the upper triangle, in the order of spatial
    vectors."""
    momentum: Floats = array("nv", 3)
    """U, the momentum of the articulated body per unit velocity of its joint."""
    inverse: Floats = array("nv")
    """1 / D, what the joint accelerates per unit of force while its parent stays."""


@kernel
def articulate(model: Model, work: Workspace, added: Floats, bodies: ArticulatedBodies) -> None:
    """Find the articulated bodies of a pose, `added` (nv,) being added to the armatures.

    With h D + h² K added, A⁻¹ becomes that of the linearly implicit scheme.
    """
    parents, armature, rigid, motion = model.parent, model.armature, work.inertia, work.motion
    inertia, momentum, inverse = bodies.inertia, bodies.momentum, bodies.inverse
    for i in range(model.nl):
        inertia[i, 0] = rigid[i, 3]
        inertia[i, 1] = rigid[i, 2]
        inertia[i, 2] = -rigid[i, 1]
        inertia[i, 3] = rigid[i, 0]
        inertia[i, 4] = 0.0
        inertia[i, 5] = rigid[i, 0]
    for i in range(model.nl - 1, -1, -1):
        m0, m1, m2 = spatial(motion, i)
        i00, i01, i02 = spatial(inertia, i)
        i11, i12, i22 = inertia[i, 3], inertia[i, 4], inertia[i, 5]
        u0 = i00 * m0 + i01 * m1 + i02 * m2
        u1 = i01 * m0 + i11 * m1 + i12 * m2
        u2 = i02 * m0 + i12 * m1 + i22 * m2
        write(i, (u0, u1, u2), momentum)
        scale = 1.0 / (m0 * u0 + m1 * u1 + m2 * u2 + armature[i] + added[i])
        inverse[i] = scale
        parent = parents[i]
        if parent >= 0:
            g0 = scale * u0
            g1 = scale * u1
            g2 = scale * u2
            inertia[parent, 0] += i00 - u0 * g0
            inertia[parent, 1] += i01 - u0 * g1
            inertia[parent, 2] += i02 - u0 * g2
            inertia[parent, 3] += i11 - u1 * g1
            inertia[parent, 4] += i12 - u1 * g2
            inertia[parent, 5] += i22 - u2 * g2


@kernel
def solve_articulated(model: Model, bodies: ArticulatedBodies, work: Workspace, x: Floats) -> None:
    """Replace x by A⁻¹ x, after :func:`articulate`."""
    parents, motion, force = model.parent, work.motion, work.force
    momentum, inverse = bodies.momentum, bodies.inverse
    for i in range(model.nl):
        write(i, (0.0, 0.0, 0.0), force)
    for i in range(model.nl - 1, -1, -1):
        p0, p1, p2 = spatial(force, i)
        share = inverse[i] * (x[i] + motion[i, 0] * p0 + motion[i, 1] * p1 + motion[i, 2] * p2)
        x[i] = share
        parent = parents[i]
        if parent >= 0:
            u0, u1, u2 = spatial(momentum, i)
            left = p0 - u0 * share, p1 - u1 * share, p2 - u2 * share
            write(parent, plus(spatial(force, parent), left), force)
    carry_along(model, bodies, work, x)


@kernel
def carry_along(model: Model, bodies: ArticulatedBodies, work: Workspace, x: Floats) -> None:
    """Second half of :func:`solve_articulated`: x holds u / D and receives accelerations."""
    parents, motion, acceleration = model.parent, work.motion, work.acceleration
    momentum, inverse = bodies.momentum, bodies.inverse
    for i in range(model.nl):
        parent = parents[i]
        own = x[i]
        a = 0.0, 0.0, 0.0
        if parent >= 0:
            a = spatial(acceleration, parent)
            own -= inverse[i] * power(spatial(momentum, i), a)
            x[i] = own
        write(i, plus(a, scaled(spatial(motion, i), own)), acceleration)
