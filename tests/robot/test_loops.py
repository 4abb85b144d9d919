"""Loops and couplings of robots: built, closed, mirrored, looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import walking
from mechanisms import four_bar, geared, parallel_ankles

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.gait.gait import actuated_joints, fingerprint
from heelstrike.robot import Robot, RobotBuilder, inspect_robot
from heelstrike.robot.inspection import facts


def pair() -> RobotBuilder:
    build = RobotBuilder("pair")
    build.hinge("front", None, at=(0.5, 0), mass=1, inertia=0.01)
    build.hinge("rear", None, mass=1, inertia=0.01)
    return build


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda b: b.loop("front", "rest", at=(0, 0)), "a loop joins link 'rest', which there is"),
        (lambda b: b.loop("front", "front", at=(0, 0)), "a loop joins link 'front' to itself"),
        (lambda b: b.loop("front", None, at=(0, np.nan)), "at must be finite"),
        (lambda b: b.loop("front", None, at=(0, 0), other_at=0), "other_at must be a pair"),
        (lambda b: b.couple("front", "knee"), "no joint 'knee' to couple. Joints are: front, rear"),
        (lambda b: b.couple("front", "front"), "joint 'front' cannot follow itself"),
        (lambda b: b.couple("front", "rear", []), "polynomial of one to 5 coefficients"),
        (lambda b: b.couple("front", "rear", range(6)), "polynomial of one to 5 coefficients"),
        (lambda b: b.couple("front", "rear", [np.inf]), "coefficient of its polynomial must be"),
    ],
)
def test_what_cannot_be_joined_is_refused(
    wrong: Callable[[RobotBuilder], None], words: str
) -> None:
    with pytest.raises(hs.RobotError, match=f"^pair: .*{words}"):
        wrong(pair())


def test_a_joint_follows_one_other_only() -> None:
    build = pair()
    build.couple("front", "rear")
    with pytest.raises(hs.RobotError, match="joint 'front' follows another already"):
        build.couple("front", None, [0.1])


def test_a_hinge_is_where_it_is_in_the_reference() -> None:
    robot = four_bar()
    np.testing.assert_allclose(robot.model.loop_position, [[[0.5, 0.3], [0.0, 0.5]]], atol=1e-15)
    np.testing.assert_allclose(dynamics.loop_displacement(robot, np.zeros(3)), 0.0, atol=1e-15)
    build = pair()
    build.loop("rear", "front", at=(0.1, 0.0), other_at=(-0.3, 0.0))
    np.testing.assert_allclose(dynamics.loop_displacement(build.build(), [0, 0]), [-0.1, 0.0])


def test_robots_with_other_loops_are_others() -> None:
    robot = four_bar()
    moved = robot.model.replaced(loop_position=robot.model.loop_position + 0.01)
    other = Robot(**{**vars(robot), "model": moved})
    assert fingerprint(robot) != fingerprint(other)
    assert robot.loop_names == ("coupler-rocker",)
    assert geared().coupling_names == ("rear",)


def test_closing_keeps_what_shall_stay_and_moves_the_rest() -> None:
    robot = parallel_ankles()
    wished = robot.state({"left_ankle": 0.2, "right_ankle": -0.1}, {"left_ankle": 1.0})
    state = robot.closed(wished, keep=["left_ankle", "right_ankle"])
    kept = [robot.joint_index(name) for name in ("left_ankle", "right_ankle")]
    np.testing.assert_array_equal(state.q[kept], [0.2, -0.1])
    np.testing.assert_array_equal(state.v[kept], [1.0, 0.0])
    assert np.abs(dynamics.loop_displacement(robot, state.q)).max() < 1e-12
    assert np.abs(dynamics.loop_jacobian(robot, state.q) @ state.v).max() < 1e-12
    np.testing.assert_array_equal(robot.closed(state).q, state.q)


def test_closing_is_the_shortest_way_by_the_masses() -> None:
    """v⁺ = v − A⁻¹ Jᵀ (J A⁻¹ Jᵀ)⁻¹ J v is an impact; its momentum changes along Jᵀ only."""
    robot = four_bar()
    state = robot.closed(robot.state(velocity={"crank": 1.0, "rocker": -0.5}))
    change = state.v - [1.0, 0.0, -0.5]
    push = dynamics.mass_matrix(robot, state.q) @ change
    jacobian = dynamics.loop_jacobian(robot, state.q)
    along = jacobian.T @ np.linalg.lstsq(jacobian.T, push)[0]
    np.testing.assert_allclose(push, along, rtol=0, atol=1e-14)
    assert np.abs(change).max() > 0.1


def test_closing_keeps_to_the_ranges_of_joints() -> None:
    """The shortest way alone would bend the left knee backwards by 0.026 rad."""
    robot = parallel_ankles()
    wished = robot.perturbed(robot.reference_state(), seed=0, position=0.2)
    state = robot.closed(wished)
    assert state.q[robot.joint_index("left_knee")] == 0.0
    assert np.abs(dynamics.loop_displacement(robot, state.q)).max() < 1e-12


def test_what_cannot_be_closed_is_said() -> None:
    robot = four_bar()
    with pytest.raises(hs.RobotError, match="while crank, coupler stay: coupler-rocker along"):
        robot.closed(robot.state({"crank": 0.5}), keep=["crank", "coupler"])
    build = pair()
    build.couple("front", "rear", [0.0, 1.0])
    build.couple("rear", None, [0.2])
    built = build.build()
    np.testing.assert_allclose(built.closed(built.reference_state()).q, [0.2, 0.2])
    with pytest.raises(hs.RobotError, match=r"coupling of rear stays open by 0\.2"):
        built.closed(built.reference_state(), keep=["rear"])


def test_a_robot_stands_with_closed_loops() -> None:
    robot = parallel_ankles()
    state = robot.standing(hs.Ground(slope=0.1))
    gaps = hs.contact_kinematics(robot, state.q, state.v, hs.Ground(slope=0.1)).gap
    np.testing.assert_allclose(gaps, 0.0, atol=1e-9)
    assert np.abs(dynamics.loop_displacement(robot, state.q)).max() < 1e-9
    assert hs.simulate(robot, state=state, ground=hs.Ground(slope=0.1), duration=0.01).completed


def test_loops_have_mirror_images_or_the_robot_has_none() -> None:
    robot = parallel_ankles()
    assert robot.mirror is not None
    one = robot.model.replaced(
        loop_link=robot.model.loop_link[:1], loop_position=robot.model.loop_position[:1]
    )
    lame = Robot(**{**vars(robot), "model": one})
    told = [str(found) for found in inspect_robot(lame).findings]
    assert any("loop of right_rod and right_ankle has no mirror image" in each for each in told)
    build = RobotBuilder("legs")
    trunk = build.floating_base("trunk", (0, 1), mass=5, inertia=0.1)
    for side, sense in (("left", 1), ("right", -1)):
        thigh = build.hinge(f"{side}_hip", trunk, mass=2, inertia=0.02, sense=sense)
        build.hinge(f"{side}_knee", thigh, at=(0, -0.4), mass=1, inertia=0.01)
        build.couple(f"{side}_knee", f"{side}_hip", [0.1, 2.0 * sense, 0.3])
    assert build.build().mirror is not None


def test_an_inspection_tells_of_them() -> None:
    text = inspect_robot(geared((0.1, -2.0, 0.0, 0.5))).text()
    assert "coupled: rear = 0.1 + -2 front + 0.5 front^3" in text
    assert facts(inspect_robot(four_bar()))["loops"] == ["coupler-rocker"]


def test_what_knows_trees_only_says_so() -> None:
    words = "has loop right_rod-right_ankle, loop left_rod-left_ankle"
    robot = parallel_ankles()
    gait = replace(walking.gait(), robot=robot.name, joint_names=actuated_joints(robot))
    with pytest.raises(hs.ControllerError, match=f"whole-body control knows robots .* {words}"):
        hs.WholeBody(robot, gait)
