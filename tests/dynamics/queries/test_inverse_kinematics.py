"""Joints of a leg from the place of its foot."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot.sole import soles

WITH_LEGS = ["bravo7", "geyer7", "human7", "rabbit", "spring_flamingo", "walker2d"]


@pytest.mark.parametrize("name", WITH_LEGS)
def test_a_pose_within_the_ranges_is_reached_from_the_reference_pose(name: str) -> None:
    robot, random = hs.load_robot(name), np.random.default_rng(11)
    model, start = robot.model, robot.reference_state().q
    for foot, leg in enumerate(dynamics.leg_joints(robot)):
        own, joints = robot.feet[foot], list(leg)
        point = soles(robot)[foot].ends.mean(axis=0)
        for _ in range(20):
            goal = start.copy()
            low, high = np.maximum(model.lower, -1.2), np.minimum(model.upper, 1.2)
            goal[joints] = random.uniform(low[joints], high[joints])
            place = dynamics.point_position(robot, goal, own.link, point)
            angle = dynamics.link_poses(robot, goal).angle[own.link]
            found = dynamics.inverse_kinematics(robot, start, own.name, [*place, angle])
            assert found.reached
            # The residual is that of the answer, by other means.
            again = dynamics.point_position(robot, found.q, own.link, point)
            np.testing.assert_allclose(again, place, atol=1e-9)
            assert np.all(found.q >= model.lower)
            assert np.all(found.q <= model.upper)
            others = np.setdiff1d(np.arange(robot.nq), joints)
            np.testing.assert_array_equal(found.q[others], start[others])
            if len(joints) > 2:
                turned = dynamics.link_poses(robot, found.q).angle[own.link]
                assert abs(turned - angle) < 1e-9


def test_a_straight_leg_is_shortened() -> None:
    robot = hs.load_robot("bravo7")
    straight = robot.reference_state().q.copy()
    straight[3:] = 0.0
    ankle = dynamics.link_poses(robot, straight).origin[robot.feet[0].link]
    target = [ankle[0], ankle[1] + 0.1, 0.0]
    found = dynamics.inverse_kinematics(robot, straight, 0, target, local=(0.0, 0.0))
    assert found.reached


def test_out_of_reach_gives_the_nearest_pose_and_what_is_missing() -> None:
    robot = hs.load_robot("bravo7")
    q = robot.reference_state().q
    hip = dynamics.link_poses(robot, q).origin[3]
    below = [hip[0], hip[1] - 5.0]
    found = dynamics.inverse_kinematics(robot, q, 0, below, local=(0.0, 0.0))
    ankle = dynamics.link_poses(robot, found.q).origin[robot.feet[0].link]
    length = np.linalg.norm(robot.model.offset[[4, 5]], axis=1).sum()
    assert not found.reached
    # The ankle depends on a straight leg below the hip: thigh and shank are missing of five metres.
    assert found.residual == pytest.approx(5.0 - length, abs=1e-9)
    np.testing.assert_allclose(ankle, [hip[0], hip[1] - length], atol=1e-4)


def test_an_angle_may_be_left_open() -> None:
    robot = hs.load_robot("bravo7")
    q = robot.reference_state().q
    low = [0.45, 0.25]  # within reach, but not with the sole turned by half a circle
    assert dynamics.inverse_kinematics(robot, q, 0, low).reached
    assert not dynamics.inverse_kinematics(robot, q, 0, [*low, 3.1]).reached


def test_what_cannot_be_asked() -> None:
    robot = hs.load_robot("bravo7")
    q = robot.reference_state().q
    with pytest.raises(RobotError, match="place"):
        dynamics.inverse_kinematics(robot, q, 0, 0.3)
    with pytest.raises(RobotError, match="foot"):
        dynamics.inverse_kinematics(robot, q, "third_foot", (0.0, 0.0))
    passive = hs.load_robot("compass_gait")
    with pytest.raises(RobotError, match="no actuated joint moves foot"):
        dynamics.inverse_kinematics(passive, passive.reference_state().q, 0, (0.0, 0.0))
