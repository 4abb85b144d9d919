"""What a compiled controller can ask its robot, against the same questions in numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.robot.sole import soles
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import controlled_robot

POINT = np.array([0.03, -0.11])


class Place(hs.Bundle):
    """Which link, foot and contact is asked about, and where."""

    link: int = hs.number(int)
    local: Any = hs.array(2)
    foot: int = hs.number(int)
    contact: int = hs.number(int)
    target: Any = hs.array(3)


class Answers(hs.Bundle):
    """What was answered."""

    position: Any = hs.array(2)
    point_velocity: Any = hs.array(3)
    point_bias: Any = hs.array(3)
    link_pose: Any = hs.array(3)
    foot_pose: Any = hs.array(3)
    foot_velocity: Any = hs.array(3)
    foot_bias: Any = hs.array(3)
    foot_wrench: Any = hs.array(3)
    foot_gap: float = hs.cell(float)
    contact_velocity: Any = hs.array(2)
    contact_bias: Any = hs.array(2)
    center_jacobian: Any = hs.array(2, "nv")
    center_bias: Any = hs.array(2)
    momentum: Any = hs.array(3)
    momentum_matrix: Any = hs.array(3, "nv")
    q: Any = hs.array("nq")
    residual: float = hs.cell(float)
    mass: float = hs.cell(float)


@hs.controller
def asks(state, contacts, robot, parameters: Place, memory: Answers, torque):
    """Ask everything."""
    torque[:] = 0.0
    link, foot, contact = parameters.link, parameters.foot, parameters.contact
    at = memory.position
    robot.point_position(state, link, parameters.local, at)
    robot.point_velocity(state, link, at, memory.point_velocity)
    robot.point_bias_acceleration(state, link, at, memory.point_bias)
    robot.link_pose(state, link, memory.link_pose)
    robot.foot_pose(state, foot, memory.foot_pose)
    robot.foot_velocity(state, foot, memory.foot_velocity)
    robot.foot_bias_acceleration(state, foot, memory.foot_bias)
    robot.foot_wrench(state, contacts, foot, memory.foot_wrench)
    memory.foot_gap = robot.foot_gap(contacts, foot)
    robot.contact_velocity(state, contacts, contact, memory.contact_velocity)
    robot.contact_bias_acceleration(state, contacts, contact, memory.contact_bias)
    robot.center_of_mass_jacobian(state, memory.center_jacobian)
    robot.center_of_mass_bias_acceleration(state, memory.center_bias)
    robot.momentum(state, memory.momentum)
    robot.momentum_matrix(state, memory.momentum_matrix)
    middle = 0.5 * (robot.foot_sole[foot, 0] + robot.foot_sole[foot, 1])
    memory.residual = robot.inverse_kinematics(state, foot, middle, parameters.target, memory.q)
    memory.mass = robot.mass


@pytest.mark.parametrize("name", ["bravo7", "geyer7", "rabbit"])
def test_compiled_queries_are_those_in_numpy(name: str) -> None:
    robot, random = hs.load_robot(name), np.random.default_rng(5)
    q = robot.reference_state().q + random.uniform(-0.3, 0.3, robot.nq)
    v = random.normal(size=robot.nv)
    ground = hs.Ground(slope=0.1)
    touching = hs.contact_kinematics(robot, q, v, ground)
    force = random.uniform(1.0, 9.0, (robot.nc, 2))
    seen = Contacts(
        position=touching.position, normal=touching.normal, gap=touching.gap, force=force
    )
    foot, contact = 1, robot.nc - 1
    link = robot.feet[foot].link - 1
    local = soles(robot)[foot].ends.mean(axis=0)
    there = dynamics.point_position(robot, q, robot.feet[foot].link, local)
    target = np.array([there[0] + 0.02, there[1] + 0.03, 0.1])
    law = asks(
        Place(link=link, local=POINT, foot=foot, contact=contact, target=target), robot=robot
    )
    law.torque(0.0, hs.State(q, v), seen)
    found = law.remembered
    origin = np.zeros(2)
    poses = dynamics.link_poses(robot, q)
    own = robot.feet[foot]
    lever = touching.position - poses.origin[own.link]
    pressed = np.zeros(3)
    for i in own.contacts:
        normal, tangent = touching.normal[i], np.array([1.0, -1.0]) * touching.normal[i, ::-1]
        world = force[i, 0] * normal + force[i, 1] * tangent
        pressed += [*world, lever[i, 1] * world[0] - lever[i, 0] * world[1]]
    wanted = {
        "position": dynamics.point_position(robot, q, link, POINT),
        "point_velocity": dynamics.point_velocity(robot, q, v, link, POINT),
        "point_bias": dynamics.point_bias_acceleration(robot, q, v, link, POINT),
        "link_pose": [*poses.origin[link], poses.angle[link]],
        "foot_pose": [*poses.origin[own.link], poses.angle[own.link]],
        "foot_velocity": dynamics.point_velocity(robot, q, v, own.link, origin),
        "foot_bias": dynamics.point_bias_acceleration(robot, q, v, own.link, origin),
        "foot_wrench": pressed,
        "foot_gap": touching.gap[list(own.contacts)].min(),
        "contact_velocity": touching.velocity[contact],
        "contact_bias": touching.bias_acceleration[contact],
        "center_jacobian": dynamics.center_of_mass_jacobian(robot, q),
        "center_bias": dynamics.center_of_mass_bias_acceleration(robot, q, v),
        "momentum": dynamics.momentum(robot, q, v),
        "momentum_matrix": dynamics.momentum_matrix(robot, q),
        "q": dynamics.inverse_kinematics(robot, q, foot, target).q,
        "mass": robot.total_mass,
    }
    for each, value in wanted.items():
        np.testing.assert_allclose(
            getattr(found, each), value, rtol=1e-11, atol=1e-11, err_msg=each
        )
    assert found.residual < 1e-9
    assert np.abs(found.q - q).max() > 0.01


def test_a_controller_knows_legs_and_soles() -> None:
    robot = hs.load_robot("bravo7")
    view = controlled_robot(robot)
    assert view.leg_joint.tolist() == [[3, 4, 5], [6, 7, 8]]
    heel, toe = view.foot_sole[0]
    np.testing.assert_allclose(toe - heel, [0.2, 0.0], atol=1e-15)  # as the paper's robot
    assert heel[1] < 0.0  # below the ankle
