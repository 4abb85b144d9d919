"""Find joint positions of a leg that bring a point of its foot to a place.

Damped least squares (Levenberg and Marquardt): a step δ = Jᵀ(J Jᵀ + λ)⁻¹ e brings the point nearer
by all that the joints can do, λ grows when it does not and shrinks when it does, and joints at the
end of their range stay out of it. A leg that is straight cannot be shortened by a small step, so
that from there, too, it is tried bent one way and the other. What comes out is judged by the
kinematics of the answer, not by how the search ended.
"""

from __future__ import annotations

import math

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, part
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.kernels import forward_kinematics, point_position
from heelstrike.dynamics.places import point_columns
from heelstrike.dynamics.planar import Spatial, power, solve_three, spatial, write
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot

# Steps that may be tried from one beginning, and a distance (m, rad) that is none.
MOST_STEPS = 100
NONE = 1e-14
# Damping as part of J Jᵀ: at first, at least, and where nothing is to be gained any more.
DAMPING = 1e-3
LEAST_DAMPING = 1e-13
MOST_DAMPING = 1e8
# A search that leaves more than this (m, rad) begins again with the joints turned by BEND (rad).
MISSED = 1e-9
BEND = 0.5


LIGHTER, HEAVIER = 0.01, 10.0
"""What the damping is multiplied by after a step that helps, and after one that does not."""

NO_MATRIX = 1e-300
"""Damping where no joint moves the pose, so that nothing is divided by zero."""

NEARER = 0.999
"""Part of what an answer misses, squared, below which another one is clearly nearer."""


class Reaching(Bundle):
    """What the search works on."""

    tree: Workspace = part(Workspace)
    """Kinematics of the pose that was tried last."""
    position: Floats = array("axes")
    """The point in that pose."""
    begin: Floats = array("nq")
    trial: Floats = array("nq")
    tried: Floats = array("nq")
    """begin, trial, tried: Where the search begins, a step further, and where another beginning led
    to."""
    columns: Floats = array("nv", 3)
    """Jacobian of the point and its link, one row a coordinate."""
    step: Floats = array("nv")
    """Step of each coordinate."""
    free: Integers = array("nv", of=int)
    """Whether a coordinate takes part in it."""


def leg_joints(robot: Robot) -> tuple[tuple[int, ...], ...]:
    """Return the actuated joints that move one foot only, of each foot from the hip down.

    Parameters
    ----------
    robot : Robot
        The robot.

    Returns
    -------
    tuple of tuple of int
        One a foot, in the order of ``robot.feet``.
    """
    driven = set(robot.model.actuator_joint.tolist())
    chains = [_chain(robot, foot.link) for foot in robot.feet]
    shared = [j for chain in chains for j in chain]
    return tuple(
        tuple(j for j in reversed(chain) if j in driven and shared.count(j) == 1)
        for chain in chains
    )


def _chain(robot: Robot, link: int) -> list[int]:
    """Return a link and all that carry it."""
    chain = []
    while link >= 0:
        chain.append(link)
        link = int(robot.model.parent[link])
    return chain


@kernel
def misfit(
    model: Model, q: Floats, link: int, local: Floats, target: Floats, rows: int, work: Reaching
) -> Spatial:
    """How far a point and its link are from where they shall be: x, z and, of three rows, angle."""
    forward_kinematics(model, q, work.tree)
    point_position(work.tree, link, local, work.position)
    turn = 0.0
    if rows == 3:
        turn = target[2] - work.tree.angle[link]
        turn -= 2.0 * math.pi * np.round(turn / (2.0 * math.pi))
    return target[0] - work.position[0], target[1] - work.position[1], turn


@kernel
def seek(missing: Spatial, damping: float, joints: Integers, work: Reaching) -> None:
    """Find the damped step that takes joints, as far as they are free, towards a pose."""
    xx, xz, xr, zz, zr, rr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(joints.shape[0]):
        joint = joints[k]
        if joint >= 0 and work.free[joint] == 1:
            x, z, turn = spatial(work.columns, joint)
            xx += x * x
            xz += x * z
            xr += x * turn
            zz += z * z
            zr += z * turn
            rr += turn * turn
    damped = damping * (xx + zz + rr) + NO_MATRIX
    pull = solve_three((xx + damped, xz, xr), (xz, zz + damped, zr), (xr, zr, rr + damped), missing)
    for k in range(joints.shape[0]):
        joint = joints[k]
        if joint >= 0:
            work.step[joint] = 0.0
            if work.free[joint] == 1:
                work.step[joint] = power(spatial(work.columns, joint), pull)


@kernel
def hold_back(model: Model, q: Floats, joints: Integers, work: Reaching) -> bool:
    """Take out joints that the step would take beyond the range whose end they are at."""
    changed = False
    for k in range(joints.shape[0]):
        joint = joints[k]
        if joint >= 0 and work.free[joint] == 1:
            down = q[joint] <= model.lower[joint] and work.step[joint] < 0.0
            up = q[joint] >= model.upper[joint] and work.step[joint] > 0.0
            if down or up:
                work.free[joint] = 0
                changed = True
    return changed


@kernel
def approach(
    model: Model, joints: Integers, link: int, local: Floats, target: Floats, rows: int,
    work: Reaching, q: Floats,
) -> float:  # fmt: skip
    """Go from a pose towards the target until nothing is gained; return how far it is from it."""
    missing = misfit(model, q, link, local, target, rows, work)
    left = power(missing, missing)
    damping, fresh = DAMPING, True
    for _ in range(MOST_STEPS):
        if left <= NONE * NONE or damping > MOST_DAMPING:
            break
        if fresh:
            point_columns(model, work.tree, link, work.position, work.columns)
            if rows < 3:
                for j in range(model.nv):
                    write(j, (work.columns[j, 0], work.columns[j, 1], 0.0), work.columns)
        for k in range(joints.shape[0]):
            if joints[k] >= 0:
                work.free[joints[k]] = 1
        seek(missing, damping, joints, work)
        while hold_back(model, q, joints, work):
            seek(missing, damping, joints, work)
        for j in range(model.nq):
            work.trial[j] = q[j]
        for k in range(joints.shape[0]):
            joint = joints[k]
            if joint >= 0:
                turned = q[joint] + work.step[joint]
                work.trial[joint] = min(max(turned, model.lower[joint]), model.upper[joint])
        found = misfit(model, work.trial, link, local, target, rows, work)
        size = power(found, found)
        fresh = size < left
        if fresh:
            missing, left = found, size
            damping = max(LIGHTER * damping, LEAST_DAMPING)
            for j in range(model.nq):
                q[j] = work.trial[j]
        else:
            damping *= HEAVIER
    return left


@kernel
def bend(model: Model, joints: Integers, angle: float, begin: Floats, q: Floats) -> None:
    """Turn the hinges of a leg by an angle, one this way and the next the other."""
    for j in range(model.nq):
        q[j] = begin[j]
    for k in range(joints.shape[0]):
        joint = joints[k]
        if joint >= 0 and model.axis[joint, 0] != 0.0:
            turned = begin[joint] + angle
            q[joint] = min(max(turned, model.lower[joint]), model.upper[joint])
            angle = -angle


@kernel
def reach(
    model: Model, joints: Integers, link: int, local: Floats, target: Floats,
    work: Reaching, q: Floats,
) -> float:  # fmt: skip
    """Move the joints of a leg so that a point of its foot comes to a pose.

    Parameters
    ----------
    joints : (n,) int
        Joints that may move; those below zero are none.
    link : int
    local : (2,) float
        The foot, and its point in the foot's axes (m).
    target : (3,) float
        Where the point shall be, (x, z) in m, and the foot's angle in rad. An angle that is not a
        number may be any, and so may that of a leg of fewer than three joints.
    q : (nq,) float
        Positions to begin with; receives those that were found, within the joints' ranges.

    Returns
    -------
    float
        What is missing of the pose of the answer: the larger of metres and radians.
    """
    count = 0
    for k in range(joints.shape[0]):
        joint = joints[k]
        if joint >= 0:
            count += 1
            q[joint] = min(max(q[joint], model.lower[joint]), model.upper[joint])
    rows = 3 if count >= 3 and target[2] == target[2] else 2
    for j in range(model.nq):
        work.begin[j] = q[j]
    left = approach(model, joints, link, local, target, rows, work, q)
    for way in (BEND, -BEND):
        if left > MISSED * MISSED:
            bend(model, joints, way, work.begin, work.tried)
            other = approach(model, joints, link, local, target, rows, work, work.tried)
            # Where no pose reaches, the first answer counts unless another is clearly nearer.
            if other < NEARER * left:
                left = other
                for j in range(model.nq):
                    q[j] = work.tried[j]
    x, z, turn = misfit(model, q, link, local, target, rows, work)
    return max(math.hypot(x, z), abs(turn))
