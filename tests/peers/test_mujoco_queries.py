"""Every query against MuJoCo, on all built-in robots and 200 random trees of 2 to 30 joints.

MuJoCo works in three dimensions from the same file. Both sides add a few hundred products; 1e-10
relative to the largest entry leaves room for that and no more.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from robot_cases import MANY, NAMED, RobotCase

from heelstrike import dynamics

TOLERANCE = 1e-10


def error(ours: Any, theirs: Any) -> float:
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    assert ours.shape == theirs.shape
    return float(np.abs(ours - theirs).max(initial=0.0) / np.abs(theirs).max(initial=1.0))


def plane(rows: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Rows x, z of a translation and y of a rotation."""
    return np.stack((rows[0], rows[2], turn[1]))


class Peer:
    """MuJoCo's answers for one robot."""

    def __init__(self, case: RobotCase) -> None:
        self.model = mujoco.MjModel.from_xml_string(case.xml)
        # Contacts, stops, dry friction and actuators are not part of the equations compared here.
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        self.gravity = self.model.opt.gravity.copy()
        self.data = mujoco.MjData(self.model)
        self.move(self.model.qpos0, np.zeros(self.model.nv))
        self.reference = self.data.xpos.copy(), self.data.xmat.reshape(-1, 3, 3).copy()

    def move(self, q: np.ndarray, v: np.ndarray, *, weightless: bool = False) -> None:
        self.model.opt.gravity[:] = 0.0 if weightless else self.gravity
        self.data.qpos[:], self.data.qvel[:] = q, v
        mujoco.mj_forward(self.model, self.data)


@pytest.mark.parametrize("case", [*NAMED, *MANY], ids=lambda case: case.name)
def test_queries(case: RobotCase) -> None:
    robot = case.robot()
    peer = Peer(case)
    model, data = peer.model, peer.data
    poses = dynamics.link_poses(robot, model.qpos0)
    worst: dict[str, float] = {}

    def check(name: str, ours: Any, theirs: Any) -> None:
        worst[name] = max(worst.get(name, 0.0), error(ours, theirs))

    n = robot.nv
    for q, v in case.states(3):
        acceleration = np.cos(np.arange(n) + q[0])
        force = 20.0 * np.sin(np.arange(n) + 1.0)
        peer.move(q, 0.0 * v)
        check("gravity force", dynamics.gravity_force(robot, q), data.qfrc_bias)
        peer.move(q, v, weightless=True)
        check("coriolis force", dynamics.coriolis_force(robot, q, v), data.qfrc_bias)
        data.qfrc_applied[:] = force
        peer.move(q, v)
        data.qfrc_applied[:] = 0.0
        passive = dynamics.passive_force(robot, q, v)
        check("acceleration", dynamics.forward_dynamics(robot, q, v, force + passive), data.qacc)
        full = np.zeros((n, n))
        mujoco.mj_fullM(model, data, full)
        check("mass matrix", dynamics.mass_matrix(robot, q), full)
        check("bias force", dynamics.bias_force(robot, q, v), data.qfrc_bias)
        check("passive force", passive, data.qfrc_passive)
        check("kinetic energy", dynamics.kinetic_energy(robot, q, v), data.energy[1])
        check("potential energy", dynamics.potential_energy(robot, q), data.energy[0])
        check("centre of mass", dynamics.center_of_mass(robot, q), data.subtree_com[0, ::2])
        rows = np.zeros((3, n))
        mujoco.mj_jacSubtreeCom(model, data, rows, 0)
        check("centre of mass Jacobian", dynamics.center_of_mass_jacobian(robot, q), rows[::2])
        mujoco.mj_subtreeVel(model, data)
        check(
            "centre of mass velocity",
            dynamics.center_of_mass_velocity(robot, q, v),
            data.subtree_linvel[0, ::2],
        )
        moment = data.subtree_angmom[0, 1]
        check("angular momentum", dynamics.angular_momentum(robot, q, v), moment)
        check("momentum matrix", (dynamics.momentum_matrix(robot, q) @ v)[2], moment)
        for joint in range(n):
            body = int(model.jnt_bodyid[joint])
            if joint + 1 < n and model.jnt_bodyid[joint + 1] == body:
                continue  # the last joint of a body carries it
            places, turns = peer.reference
            local = places[body, ::2] - poses.origin[joint]
            here = data.xpos[body]
            check("position", dynamics.point_position(robot, q, joint, local), here[::2])
            turn = data.xmat[body].reshape(3, 3) @ turns[body].T
            angle = dynamics.link_poses(robot, q).angle[joint]
            check("angle", [np.sin(angle), np.cos(angle)], [turn[0, 2], turn[0, 0]])
            velocity = np.zeros(6)
            kind = mujoco.mjtObj.mjOBJ_XBODY
            mujoco.mj_objectVelocity(model, data, kind, body, velocity, 0)
            moved = dynamics.point_velocity(robot, q, v, joint, local)
            check("velocity", moved, plane(velocity[3:], velocity[:3]))
            link = dynamics.link_velocities(robot, q, v)
            check("angular velocity", link.angular[joint], velocity[1])
            rows, turned = np.zeros((3, n)), np.zeros((3, n))
            mujoco.mj_jac(model, data, rows, turned, here, body)
            jacobian = dynamics.point_jacobian(robot, q, joint, local)
            check("Jacobian", jacobian, plane(rows, turned))
            mujoco.mj_jacDot(model, data, rows, turned, here, body)
            bias = dynamics.point_bias_acceleration(robot, q, v, joint, local)
            check("Jacobian bias", bias, plane(rows @ v, turned @ v))
        data.qacc[:] = acceleration
        mujoco.mj_inverse(model, data)
        inverse = dynamics.inverse_dynamics(robot, q, v, acceleration) - passive
        check("inverse dynamics", inverse, data.qfrc_inverse)
    assert max(worst.values()) <= TOLERANCE, worst


def test_the_forest_is_what_it_should_be() -> None:
    robots = [case.robot() for case in MANY]
    joints = {robot.nv for robot in robots}
    assert len(robots) == 200
    assert min(joints) <= 3
    assert max(joints) == 30
    assert any(np.unique(robot.model.parent).size < robot.nv - 1 for robot in robots)  # branches
    kinds = np.concatenate([robot.model.axis[:, 0] for robot in robots])
    assert np.any(kinds == 0.0)
    assert np.any(kinds != 0.0)
