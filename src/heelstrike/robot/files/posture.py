"""Where the joints of a file stand: its own reference, the pose asked for, what follows from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.files.options import Options
from heelstrike.robot.files.snapping import IN_PLANE
from heelstrike.robot.model import Floats
from heelstrike.wording import meant

FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's mjtJoint
LONGEST_TRAIN = 20  # joints each of which follows the one before


def positions(model: Any, options: Options, label: str) -> Floats:
    """Positions of all joints: those of the file, the pose asked for, and what follows from it."""
    q = np.array(model.qpos0, dtype=np.float64)
    names = {joint_name(model, joint): joint for joint in range(model.njnt)}
    pose = options.pose or {}
    for name, value in pose.items():
        if name not in names:
            guess = meant(name, list(names))
            raise RobotError(f"{label}: pose names {name!r}, and there is no such joint.{guess}")
        joint = names[name]
        if model.jnt_type[joint] not in (SLIDE, HINGE):
            raise RobotError(f"{label}: pose names {name!r}, a joint that no one number moves.")
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
        if not low - IN_PLANE <= value <= high + IN_PLANE:
            raise RobotError(
                f"{label}: pose puts joint {name!r} at {value:g}, outside its range {low:.4g} … "
                f"{high:.4g} (rad, m)."
            )
        q[model.jnt_qposadr[joint]] = value
    coupled = list(followers(model))
    for _ in coupled[:LONGEST_TRAIN]:
        for joint, leader, factors in coupled:
            if joint_name(model, joint) not in pose:
                place = model.jnt_qposadr[joint]
                there = 0.0
                if leader >= 0:
                    address = model.jnt_qposadr[leader]
                    there = float(q[address] - model.qpos0[address])
                q[place] = model.qpos0[place] + sum(c * there**k for k, c in enumerate(factors))
    return q


def followers(model: Any) -> Iterator[tuple[int, int, Floats]]:
    """Joints that the file couples to others (-1: to nothing), with polynomials of their motion."""
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EQUALITY):
        return
    for one in range(model.neq):
        joint = int(model.eq_obj1id[one])
        if (
            model.eq_type[one] == mujoco.mjtEq.mjEQ_JOINT
            and model.eq_active0[one]
            and model.jnt_type[joint] in (SLIDE, HINGE)
        ):
            yield joint, int(model.eq_obj2id[one]), np.array(model.eq_data[one, :5])


def turn(model: Any, pose: Any, quarters: int) -> None:
    """Turn everything that is attached to the world by quarters of a turn, to look along x."""
    import mujoco

    if quarters == 0:
        return
    angle = -0.5 * np.pi * quarters
    c, s = round(np.cos(angle)), round(np.sin(angle))
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    quaternion = np.array([np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)])

    def rotated(before: Floats) -> Floats:
        after = np.zeros(4)
        mujoco.mju_mulQuat(after, quaternion, np.asarray(before, dtype=np.float64))
        return after

    for body in np.flatnonzero(model.body_parentid == 0)[1:]:
        model.body_pos[body] = matrix @ model.body_pos[body]
        model.body_quat[body] = rotated(model.body_quat[body])
        joint = model.body_jntadr[body]
        if joint >= 0 and model.jnt_type[joint] == FREE:
            place = model.jnt_qposadr[joint]
            pose.qpos[place : place + 3] = matrix @ pose.qpos[place : place + 3]
            pose.qpos[place + 3 : place + 7] = rotated(pose.qpos[place + 3 : place + 7])
    model.opt.gravity[:] = matrix @ model.opt.gravity


def joint_name(model: Any, joint: int) -> str:
    """Name of a joint; a nameless one is called after the body that it moves."""
    given: str = model.joint(joint).name
    if given:
        return given
    body = model.jnt_bodyid[joint]
    several = model.body_jntnum[body] > 1
    ending = f"_{joint - model.body_jntadr[body]}" if several else ""
    return (model.body(body).name or f"body {body}") + ending
