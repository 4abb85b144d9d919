"""The same equations of motion in space as MuJoCo, on named robots and random trees.

Positions and velocities are the same numbers in both, so that nothing is converted. Both add a few
hundred products; 1e-11 relative to the largest entry leaves room for that and no more.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from spatial_cases import FREE, NAMED, RANDOM, SpatialCase

from heelstrike.dynamics import spatial

TOLERANCE = 1e-11
STATES = 30


def relative(ours: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1.0))


@pytest.mark.parametrize("case", [*NAMED, *RANDOM, *FREE], ids=lambda case: case.name)
def test_dynamics(case: SpatialCase) -> None:
    robot = case.robot()
    model = mujoco.MjModel.from_xml_string(case.xml)
    # Contacts, stops and actuators are not part of the equations compared here.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    data = mujoco.MjData(model)
    n = robot.nv
    assert (model.nq, model.nv) == (robot.nq, n)
    force = 20.0 * np.sin(np.arange(n) + 1.0)
    worst: dict[str, float] = {}
    body, link = int(model.jnt_bodyid[-1]), robot.nl - 1
    for q, v in case.states(STATES):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, force
        mujoco.mj_forward(model, data)
        full = np.zeros((n, n))
        mujoco.mj_fullM(model, data, full)
        poses = spatial.link_poses(robot, q)
        point = data.xipos[body]
        local = poses.rotation[link].T @ (point - poses.origin[link])
        translation, rotation = np.zeros((3, n)), np.zeros((3, n))
        mujoco.mj_jac(model, data, translation, rotation, point, body)
        rates = np.zeros((3, n)), np.zeros((3, n))
        mujoco.mj_jacDot(model, data, *rates, point, body)
        mujoco.mj_subtreeVel(model, data)
        total = np.zeros((3, n))
        mujoco.mj_jacSubtreeCom(model, data, total, 0)
        passive = spatial.passive_force(robot, q, v)
        momentum = np.concatenate(
            (robot.total_mass * data.subtree_linvel[0], data.subtree_angmom[0])
        )
        ours_and_theirs = {
            "mass": (spatial.mass_matrix(robot, q), full),
            "bias": (spatial.bias_force(robot, q, v), data.qfrc_bias),
            "passive": (passive, data.qfrc_passive),
            "acceleration": (spatial.forward_dynamics(robot, q, v, force + passive), data.qacc),
            "place": (spatial.point_position(robot, q, link, local), point),
            "jacobian": (
                spatial.point_jacobian(robot, q, link, local),
                np.vstack((translation, rotation)),
            ),
            "jdot": (
                spatial.point_bias_acceleration(robot, q, v, link, local),
                np.concatenate([rate @ v for rate in rates]),
            ),
            "center": (spatial.center_of_mass(robot, q), data.subtree_com[0]),
            "center jacobian": (spatial.center_of_mass_jacobian(robot, q), total),
            "momentum": (spatial.momentum(robot, q, v), momentum),
        }
        for name, (ours, theirs) in ours_and_theirs.items():
            worst[name] = max(worst.get(name, 0.0), relative(ours, theirs))
    assert max(worst.values()) <= TOLERANCE, worst


@pytest.mark.parametrize("case", [*RANDOM[:6], *FREE], ids=lambda case: case.name)
def test_positions(case: SpatialCase) -> None:
    robot = case.robot()
    model = mujoco.MjModel.from_xml_string(case.xml)
    draw = np.random.default_rng(3)
    for q, v in case.states(STATES):
        moved = q.copy()
        step = float(draw.uniform(-0.4, 0.4))
        mujoco.mj_integratePos(model, moved, v, step)
        assert relative(spatial.integrate(robot, q, v, step), moved) <= 1e-14
        found = np.zeros(robot.nv)
        mujoco.mj_differentiatePos(model, found, 1.0, q, moved)
        assert relative(spatial.difference(robot, q, moved), found) <= 1e-13
