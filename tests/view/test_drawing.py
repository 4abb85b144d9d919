"""The shape of a robot follows from its tree."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import walking
from matplotlib.image import imread
from synthetic_runs import box, pendulum

from heelstrike.dynamics import contact_positions, link_poses
from heelstrike.errors import ViewError
from heelstrike.robot import Robot, builtin_robots, load_robot
from heelstrike.view import robot_picture
from heelstrike.view.drawing import Side, body, extent, legs_apart, skeleton
from heelstrike.view.style import BLUE, INK, VERMILION


def test_bravo7_is_drawn_from_sole_to_head() -> None:
    robot = walking.bravo7()
    bones = skeleton(robot)
    poses = link_poses(robot, robot.model.reference)
    segments = bones.segments(poses.origin, poses.angle)
    low, high = extent(segments)
    np.testing.assert_allclose(low, [-0.1, 0.0], atol=1e-12)
    # The trunk ends twice as high above the hip as its centre of mass.
    np.testing.assert_allclose(high, [0.1, 0.9538 + 2.0 * 0.3155], atol=1e-12)
    # Trunk, and for each leg thigh, shank and a sole of three sides.
    assert len(segments) == 1 + 2 * 5
    # The massless carriers of the floating base are not drawn.
    assert bones.link.min() == 2


def test_contact_points_are_on_the_drawing() -> None:
    robot = walking.bravo7()
    draw = np.random.default_rng(1)
    q = robot.model.reference + draw.normal(size=robot.nq)
    poses = link_poses(robot, q)
    ends = skeleton(robot).segments(poses.origin, poses.angle).reshape(-1, 2)
    for point in contact_positions(robot, q):
        assert np.hypot(*(ends - point).T).min() < 1e-12


def test_segments_of_many_poses_at_once() -> None:
    robot = walking.bravo7()
    bones = skeleton(robot)
    run = walking.walk(steps=1)
    poses = [link_poses(robot, q) for q in run.position[:5]]
    together = bones.segments(
        np.array([p.origin for p in poses]), np.array([p.angle for p in poses])
    )
    for segments, p in zip(together, poses, strict=True):
        np.testing.assert_array_equal(segments, bones.segments(p.origin, p.angle))


def test_legs_are_told_apart_and_the_near_one_is_in_front() -> None:
    robot = walking.bravo7()
    bones = skeleton(robot)
    assert list(bones.side) == sorted(bones.side)
    for link, side, color in zip(bones.link[:, 0], bones.side, bones.colors, strict=True):
        name = robot.link_names[link]
        if "left" in name:
            assert (side, color) == (Side.FAR, VERMILION)
        elif "right" in name:
            assert (side, color) == (Side.NEAR, BLUE)
        else:
            assert (side, color) == (Side.MIDDLE, INK)


def test_heavier_links_are_thicker() -> None:
    robot = walking.bravo7()
    bones = skeleton(robot)
    width = {
        robot.link_names[link]: w for link, w in zip(bones.link[:, 0], bones.width, strict=True)
    }
    assert width["trunk"] > width["right_thigh"] > width["right_shank"] > width["right_foot"]


@pytest.mark.parametrize("name", [name for name in builtin_robots() if name != "rimless_wheel"])
def test_portraits_show_both_legs(name: str, tmp_path: Path) -> None:
    pixels = imread(robot_picture(load_robot(name), tmp_path / "robot.png"))[..., :3]
    shown = []
    for color in ((0.0, 0.447, 0.698), (0.835, 0.369, 0.0)):
        shown.append((np.abs(pixels - color).max(axis=-1) < 0.02).sum())
    assert min(shown) > 300
    # Legs are alike, and only their roots and ankles may cross.
    assert min(shown) > 0.7 * max(shown)


def test_portraits_show_legs_that_differ(tmp_path: Path) -> None:
    robot = replace(load_robot("compass_gait"), mirror=None)
    q = legs_apart(robot)
    assert q[2] == -q[3] != 0.0


def test_a_wheel_has_spokes() -> None:
    robot = load_robot("rimless_wheel")
    bones = skeleton(robot)
    np.testing.assert_array_equal(bones.local[:, 0], 0.0)
    np.testing.assert_array_equal(bones.local[:, 1], robot.model.contact_position)


def test_a_trunk_is_drawn_from_the_hip_whatever_its_frame() -> None:
    """walker2d turns about its trunk's middle; compass_gait's slide has its frame on the floor."""
    robot = load_robot("walker2d")
    bones = skeleton(robot)
    trunk = bones.segments(*_reference_pose(robot))[bones.link[:, 0] == 2]
    np.testing.assert_allclose(trunk[0][:, 1], [1.01, 1.41], atol=1e-12)
    compass = load_robot("compass_gait")
    assert skeleton(compass).link.min() == 2  # the hip is a point: no bone


def _reference_pose(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    poses = link_poses(robot, robot.model.reference)
    return poses.origin, poses.angle


def test_robots_without_legs(tmp_path: Path) -> None:
    for robot in (pendulum(), box()):
        assert robot_picture(robot, tmp_path / f"{robot.name}.png").stat().st_size > 5000


def test_where_a_portrait_cannot_go(tmp_path: Path) -> None:
    with pytest.raises(ViewError, match="no folder"):
        robot_picture(walking.bravo7(), tmp_path / "nowhere" / "robot.png")


def test_a_foot_hangs_on_its_leg() -> None:
    """bravo7's feet are plates 5 cm under their ankles: bones lead there; walker2d's reach up."""
    for name, hangs in (("bravo7", True), ("walker2d", False)):
        robot = load_robot(name)
        shape = body(robot)
        for foot in robot.feet:
            own = (shape.link == foot.link).all(axis=1)
            at_ankle = (np.abs(shape.local[own]) < 1e-12).all(axis=-1).any()
            assert at_ankle == hangs
