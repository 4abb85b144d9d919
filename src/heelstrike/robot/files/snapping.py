"""Axes that miss the plane by rounding, turned into it: 1.57 for a right angle, digits of a CAD."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.robot.model import Floats

SLIDE, HINGE = 2, 3  # MuJoCo's mjtJoint

IN_PLANE = 2e-3
"""Angle (rad) up to which an axis counts as one in the plane: 3.14 for π is off by 1.6e-3."""

SAID = 1e-6  # rad; a smaller turn is not worth a word
EXACT = 1e-12  # rad; below, there is nothing to turn


def snap(model: Any, pose: Any) -> dict[int, float]:
    """Turn bodies whose hinges are within `IN_PLANE` of the y axis, so that they point along it.

    Every body is turned with the one that carries it, so that rounding does not add up along a
    leg, and a joint is judged by what its own rotation misses.

    Parameters
    ----------
    model : mujoco.MjModel
        The compiled file; orientations of its bodies are changed.
    pose : mujoco.MjData
        World poses of its joints and bodies, which are those from before and must be renewed.

    Returns
    -------
    dict of int to float
        Joints that were turned by more than `SAID`, and by how much (rad).
    """
    import mujoco

    turn = np.tile(np.eye(3), (model.nbody, 1, 1))
    snapped: dict[int, float] = {}
    for body in range(1, model.nbody):
        parent = model.body_parentid[body]
        own = turn[parent]
        first = model.body_jntadr[body]
        for joint in range(first, first + model.body_jntnum[body]):
            axis = own @ pose.xaxis[joint]
            kind = model.jnt_type[joint]
            off = float(np.hypot(axis[0], axis[2]) if kind == HINGE else abs(axis[1]))
            if kind not in (HINGE, SLIDE) or not EXACT < off <= IN_PLANE:
                continue
            if off > SAID:
                snapped[joint] = off
            if kind == HINGE:
                own = _rotation(axis, np.array([0.0, np.sign(axis[1]), 0.0])) @ own
        turn[body] = own
        if not np.array_equal(own, turn[parent]):
            before = pose.xmat[parent].reshape(3, 3)
            change = np.zeros(4)
            mujoco.mju_mat2Quat(change, ((turn[parent] @ before).T @ own @ before).ravel())
            turned = np.zeros(4)
            mujoco.mju_mulQuat(turned, change, model.body_quat[body])
            model.body_quat[body] = turned
    return snapped


def _rotation(start: Floats, end: Floats) -> Floats:
    """Return the smallest rotation that takes one unit vector to another, not its opposite."""
    x, y, z = np.cross(start, end)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Floats = np.eye(3) + skew + skew @ skew / (1.0 + start @ end)
    return rotation
