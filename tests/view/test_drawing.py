"""The shape of a robot follows from its tree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import walking
from matplotlib.image import imread
from robot_cases import NAMED, RobotCase
from synthetic_runs import box, pendulum

from heelstrike.dynamics import contact_positions, link_poses
from heelstrike.view import ViewError, robot_picture
from heelstrike.view.drawing import Side, extent, skeleton
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


@pytest.mark.parametrize("case", NAMED, ids=lambda case: case.name)
def test_portraits(case: RobotCase, tmp_path: Path) -> None:
    path = robot_picture(case.robot(), tmp_path / "robot.png")
    pixels = imread(path)[..., :3]
    # Both legs are to be seen: their colours cover some of the picture.
    for color in ((0.0, 0.447, 0.698), (0.835, 0.369, 0.0)):
        assert (np.abs(pixels - color).max(axis=-1) < 0.02).sum() > 300


def test_robots_without_legs(tmp_path: Path) -> None:
    for robot in (pendulum(), box()):
        assert robot_picture(robot, tmp_path / f"{robot.name}.png").stat().st_size > 5000


def test_where_a_portrait_cannot_go(tmp_path: Path) -> None:
    with pytest.raises(ViewError, match="no folder"):
        robot_picture(walking.bravo7(), tmp_path / "nowhere" / "robot.png")
