"""Computed torque on a point foot: the joints follow the gait, the trunk follows from them.

The ground holds the stance foot but exerts no moment on it. Of the three unactuated accelerations,
two follow from the contact, J_u v̇_u + J_a v̇_a + J̇v = 0. The third goes along the direction n with
J_u n = 0, the trunk's turning about the foot; the motors do not reach it, nᵀ(A v̇ + H)_u = 0, so it
follows from the accelerations of the joints (partial feedback linearisation: M. W. Spong, *Partial
feedback linearization of underactuated mechanical systems*, 1994). The rest is as on a flat foot:
the unactuated rows of f = A v̇ + H give the contact force, the others the torques.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import separate_kernel
from heelstrike.control.computed_torque import (
    HEADER,
    MEMORY_HEADER,
    STANCE,
    START,
    has_landed,
    restart_at_touchdown,
    solve_three,
    solve_three_transposed,
)
from heelstrike.dynamics.kernels import inverse_dynamics, passive_force, point_bias_acceleration
from heelstrike.dynamics.workspace import Workspace
from heelstrike.gait.gait import Gait
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import CONTROLLER_SIGNATURE, Contacts

LATEST = 1  # the reference goes on along its polynomials until this time in a step, s


@kernel
def point_columns(
    model: Model, work: Workspace, link: int, position: Floats, columns: Floats
) -> None:
    """Jacobian (x, z) of a point of a link, one row a coordinate; the third column is zero."""
    x = position[0] - work.pivot[0]
    z = position[1] - work.pivot[1]
    for j in range(model.parent.shape[0]):
        for k in range(3):
            columns[j, k] = 0.0
    j = link
    while j >= 0:
        columns[j, 0] = work.motion[j, 1] + work.motion[j, 0] * z
        columns[j, 1] = work.motion[j, 2] - work.motion[j, 0] * x
        j = model.parent[j]


@kernel
def undriven_force(
    model: Model, acceleration: Floats, work: Workspace, passive: Floats, force: Floats
) -> None:
    """Force A v̇ + H − passive that motors and ground must supply."""
    inverse_dynamics(model, acceleration, work, force)
    for j in range(model.parent.shape[0]):
        force[j] -= passive[j]


@separate_kernel(lambda: CONTROLLER_SIGNATURE)
def point_foot_torque(
    t: float,
    q: Floats,
    v: Floats,
    contacts: Contacts,
    model: Model,
    tree: Workspace,
    scratch: Workspace,  # noqa: ARG001 - every controller of the compiled loop is called with it
    parameters: Floats,
    memory: Floats,
    torque: Floats,
) -> None:
    """Joint torques that make the joints follow the gait on a point foot."""
    nv = model.parent.shape[0]
    nu = model.actuator_joint.shape[0]
    # The blocks of the parameters.
    stiffness = parameters[HEADER : HEADER + nu]
    damping = parameters[HEADER + nu : HEADER + 2 * nu]
    place = HEADER + 2 * nu
    count = int(parameters[place])
    terms = int(parameters[place + 1])
    a = int(parameters[place + 2])
    b = int(parameters[place + 3])
    c = int(parameters[place + 4])
    points = parameters[place + 5 : place + 7]
    place += 7
    breakpoints = parameters[place : place + count + 1]
    place += count + 1
    pieces = parameters[place : place + 2 * count * terms * nu].reshape((2, count, terms, nu))
    place += 2 * count * terms * nu
    side = parameters[place : place + contacts.gap.shape[0]]
    # The blocks of the memory.
    place = MEMORY_HEADER
    acceleration = memory[place : place + nv]
    force = memory[place + nv : place + 2 * nv]
    passive = memory[place + 2 * nv : place + 3 * nv]
    other = memory[place + 3 * nv : place + 4 * nv]
    center = memory[place + 4 * nv : place + 4 * nv + 2]
    drift = memory[place + 4 * nv + 2 : place + 4 * nv + 5]
    columns = memory[place + 4 * nv + 5 : place + 7 * nv + 5].reshape((nv, 3))

    restart_at_touchdown(t, contacts, parameters, memory, side)
    stance = int(memory[STANCE])
    contact = int(points[stance])
    link = int(model.contact_link[contact])
    landed = has_landed(t, contacts, tree, link, parameters, memory, side)

    # Reference of this instant; past the end of a late step it goes on, then rests.
    phase = t - memory[START]
    late = phase > parameters[LATEST]
    if late:
        phase = parameters[LATEST]
    piece = 0
    while piece < count - 1 and phase >= breakpoints[piece + 1]:
        piece += 1
    phase -= breakpoints[piece]
    for i in range(nu):
        joint = model.actuator_joint[i]
        position = 0.0
        velocity = 0.0
        feedforward = 0.0
        for k in range(terms - 1, -1, -1):
            feedforward = feedforward * phase + 2.0 * velocity
            velocity = velocity * phase + position
            position = position * phase + pieces[stance, piece, k, i]
        if late:
            velocity = 0.0
            feedforward = 0.0
        acceleration[joint] = feedforward + stiffness[i] * (position - q[joint])
        if landed:
            acceleration[joint] += damping[i] * (velocity - v[joint])

    # Contact: the trunk's acceleration but for its turning about the foot.
    point = contacts.position[contact]
    normal = contacts.normal[contact]
    radius = model.contact_radius[contact]
    point_columns(model, tree, link, point, columns)
    columns[a, 2] = columns[b, 0] * columns[c, 1] - columns[c, 0] * columns[b, 1]
    columns[b, 2] = columns[c, 0] * columns[a, 1] - columns[a, 0] * columns[c, 1]
    columns[c, 2] = columns[a, 0] * columns[b, 1] - columns[b, 0] * columns[a, 1]
    center[0] = point[0] + radius * normal[0]
    center[1] = point[1] + radius * normal[1]
    point_bias_acceleration(tree, link, center, drift)
    x = -drift[0]
    z = -drift[1]
    for i in range(nu):
        joint = model.actuator_joint[i]
        x -= columns[joint, 0] * acceleration[joint]
        z -= columns[joint, 1] * acceleration[joint]
    acceleration[a], acceleration[b], acceleration[c] = solve_three(columns, a, b, c, x, z, 0.0)

    # Turning about the foot, without a motor; the force is linear in it.
    passive_force(model, q, v, passive)
    undriven_force(model, acceleration, tree, passive, force)
    for j in range(nv):
        acceleration[j] += columns[j, 2]
    undriven_force(model, acceleration, tree, passive, other)
    missing = 0.0
    inertia = 0.0
    for j in range(nv):
        missing += columns[j, 2] * force[j]
        inertia += columns[j, 2] * (other[j] - force[j])
    share = -missing / inertia
    for j in range(nv):
        force[j] += share * (other[j] - force[j])
    x, z, _ = solve_three_transposed(columns, a, b, c, force[a], force[b], force[c])
    for i in range(nu):
        joint = model.actuator_joint[i]
        torque[i] = force[joint] - (columns[joint, 0] * x + columns[joint, 1] * z)


def packed_blocks(robot: Robot, gait: Gait, unactuated: NDArray[np.int64]) -> Floats:
    """Parameters of the kernel after header and gains; what belongs to the robot's feet last."""
    count, terms, _ = gait.pieces.shape
    both = np.zeros((2, *gait.pieces.shape))
    both[gait.stance_foot] = gait.pieces
    both[1 - gait.stance_foot] = gait.mirrored_pieces()
    side = np.full(robot.nc, -1.0)
    for index, foot in enumerate(robot.feet):
        side[list(foot.contacts)] = index
    header = [count, terms, *unactuated, *(foot.contacts[0] for foot in robot.feet)]
    return np.concatenate(
        [np.array(header, dtype=np.float64), gait.breakpoints, both.ravel(), side]
    )


def memory_size(robot: Robot) -> int:
    """Length of the kernel's memory."""
    return MEMORY_HEADER + 7 * robot.nv + 5
