"""The same equations of motion as MuJoCo, on named robots and random trees.

MuJoCo works in three dimensions from the same file, so that nothing of ours is in its answer. Both
add a few hundred products; 1e-10 relative to the largest entry leaves room for that and no more.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from robot_cases import NAMED, RANDOM, RobotCase

from heelstrike import dynamics

TOLERANCE = 1e-10
STATES = 200


def relative(ours: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1.0))


@pytest.mark.parametrize("case", [*NAMED, *RANDOM], ids=lambda case: case.name)
def test_dynamics(case: RobotCase) -> None:
    robot = case.robot()
    model = mujoco.MjModel.from_xml_string(case.xml)
    # Contacts, stops and actuators are not part of the equations compared here.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    data = mujoco.MjData(model)
    n = robot.nv
    assert model.nv == n
    force = 20.0 * np.sin(np.arange(n) + 1.0)
    worst = dict.fromkeys(("mass", "bias", "passive", "acceleration", "jacobian", "jdot"), 0.0)
    body = int(model.jnt_bodyid[-1])
    link = n - 1
    slides = float(model.jnt_type[-1] == mujoco.mjtJoint.mjJNT_SLIDE)
    for q, v in case.states(STATES):
        data.qpos[:] = q
        data.qvel[:] = v
        data.qfrc_applied[:] = force
        mujoco.mj_forward(model, data)
        full = np.zeros((n, n))
        mujoco.mj_fullM(model, data, full)
        # MuJoCo notes where the joint was before it moved; our link frame moves with a slide.
        anchor = data.xanchor[-1] + slides * (q[-1] - model.qpos0[-1]) * data.xaxis[-1]
        point = anchor + np.array([0.1, 0.0, -0.2])
        translation = np.zeros((3, n))
        rotation = np.zeros((3, n))
        mujoco.mj_jac(model, data, translation, rotation, point, body)
        translation_rate = np.zeros((3, n))
        rotation_rate = np.zeros((3, n))
        mujoco.mj_jacDot(model, data, translation_rate, rotation_rate, point, body)

        angle = dynamics.link_poses(robot, q).angle[link]
        c, s = np.cos(angle), np.sin(angle)
        local = np.array([c * 0.1 - s * -0.2, s * 0.1 + c * -0.2])
        jacobian = dynamics.point_jacobian(robot, q, link, local)
        bias = dynamics.point_bias_acceleration(robot, q, v, link, local)
        passive = dynamics.passive_force(robot, q, v)
        acceleration = dynamics.forward_dynamics(robot, q, v, force + passive)
        ours_and_theirs = {
            "mass": (dynamics.mass_matrix(robot, q), full),
            "bias": (dynamics.bias_force(robot, q, v), data.qfrc_bias),
            "passive": (passive, data.qfrc_passive),
            "acceleration": (acceleration, data.qacc),
            "jacobian": (
                jacobian,
                np.vstack((translation[0], translation[2], rotation[1])),
            ),
            "jdot": (
                bias,
                np.array(
                    [
                        (translation_rate @ v)[0],
                        (translation_rate @ v)[2],
                        (rotation_rate @ v)[1],
                    ]
                ),
            ),
        }
        for name, (ours, theirs) in ours_and_theirs.items():
            worst[name] = max(worst[name], relative(ours, theirs))
    assert max(worst.values()) <= TOLERANCE, worst
