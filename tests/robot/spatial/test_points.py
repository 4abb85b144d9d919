"""Contact points in space: what each shape of a file becomes, and meshes by few corners."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import heelstrike as hs
from heelstrike.dynamics import spatial
from heelstrike.errors import RobotError
from heelstrike.robot import RobotWarning, SpatialRobot
from heelstrike.robot.shapes.solids import few_corners, hull_corners


def with_geoms(geoms: str, folder: Path, assets: str = "", **how: Any) -> SpatialRobot:
    path = folder / "robot.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/>{assets}<worldbody><geom type="plane" size="9 9 1"/>'
        '<body name="body" pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass="1" '
        f'diaginertia="1 1 1"/>{geoms}</body></worldbody></mujoco>',
        encoding="utf-8",
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        robot = hs.load_robot(path, **how)
    assert isinstance(robot, SpatialRobot)
    return robot


def places(robot: SpatialRobot) -> list[list[float]]:
    return sorted((robot.model.contact_position.round(9) + 0.0).tolist())


def test_spheres_and_capsules(tmp_path: Path) -> None:
    robot = with_geoms(
        '<geom size="0.2" pos="1 2 3"/><geom type="capsule" size="0.1" fromto="0 0 0 0 0.5 0"/>',
        tmp_path,
    )
    assert places(robot) == [[0, 0, 0], [0, 0.5, 0], [1, 2, 3]]
    assert sorted(robot.model.contact_radius) == [0.1, 0.1, 0.2]
    assert not robot.model.contact_rim.any()
    assert robot.model.first_contact.tolist() == [0, 3]
    assert robot.model.reach[0] == pytest.approx(14**0.5 + 0.2)


def test_a_box_has_eight_corners(tmp_path: Path) -> None:
    turned = 'quat="0.7071067811865476 0 0 0.7071067811865476"'  # a quarter about z
    robot = with_geoms(f'<geom type="box" size="0.1 0.2 0.3" {turned}/>', tmp_path)
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    assert places(robot) == sorted((signs * [0.2, 0.1, 0.3]).tolist())


def test_a_lying_cylinder_rolls_on_its_rims(tmp_path: Path) -> None:
    robot = with_geoms('<geom type="cylinder" size="0.3" fromto="0 -0.1 0 0 0.1 0"/>', tmp_path)
    assert places(robot) == [[0, -0.1, 0], [0, 0.1, 0]]
    np.testing.assert_allclose(robot.model.contact_rim, 0.3)
    # Wherever it has rolled and however it leans, the lowest point is that of the solid.
    angle = np.linspace(0.0, 2.0 * np.pi, 100_001)
    circle = np.column_stack((np.cos(angle), 0.0 * angle, np.sin(angle)))
    draw = np.random.default_rng(0)
    for _ in range(10):
        q = np.append(draw.normal(size=3), draw.normal(size=4))
        q[3:] /= np.linalg.norm(q[3:])
        rotation = spatial.link_poses(robot, q).rotation[0]
        found = spatial.lowest_positions(robot, q)
        for place, end in zip(found, robot.model.contact_position, strict=True):
            rim = q[:3] + (end + 0.3 * circle) @ rotation.T
            assert place[2] == pytest.approx(rim[:, 2].min(), abs=1e-9)
            assert np.linalg.norm(rim - place, axis=1).min() < 1e-4


def test_a_standing_cylinder_has_points_round_its_ends(tmp_path: Path) -> None:
    robot = with_geoms('<geom type="cylinder" size="0.3 0.1"/>', tmp_path)
    assert robot.nc == 16
    place = robot.model.contact_position
    np.testing.assert_allclose(np.hypot(place[:, 0], place[:, 1]), 0.3)
    np.testing.assert_allclose(np.abs(place[:, 2]), 0.1)


def test_a_mesh_is_its_hull(tmp_path: Path) -> None:
    cube = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
    inside = "0.1 0.2 0.3 0 0 0"
    robot = with_geoms(
        '<geom type="mesh" mesh="cube" pos="5 0 0"/>',
        tmp_path,
        f'<asset><mesh name="cube" vertex="{cube} {inside}"/></asset>',
    )
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    assert places(robot) == sorted((signs + np.array([5, 0, 0])).tolist())


def test_meshes_of_a_link_share_few_points(tmp_path: Path) -> None:
    draw = np.random.default_rng(6)
    points = draw.normal(size=(200, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    vertices = " ".join(map(repr, points.ravel().tolist()))
    asset = f'<asset><mesh name="round" vertex="{vertices}"/></asset>'
    two = '<geom type="mesh" mesh="round"/><geom type="mesh" mesh="round" pos="3 0 0"/>'
    assert with_geoms(two, tmp_path, asset).nc == 32
    assert with_geoms(two, tmp_path, asset, mesh_points=12).nc == 12
    with pytest.warns(RobotWarning, match="the 12 corners that stand for the meshes .* by up to"):
        hs.load_robot(tmp_path / "robot.xml", mesh_points=12)
    with pytest.raises(RobotError, match="mesh_points is 6 or more, not 5"):
        hs.load_robot(tmp_path / "robot.xml", mesh_points=5)


def test_what_has_no_points_is_told(tmp_path: Path) -> None:
    with_geoms('<geom name="egg" type="ellipsoid" size="1 2 3"/>', tmp_path)
    with pytest.warns(RobotWarning) as told:
        hs.load_robot(tmp_path / "robot.xml")
    assert any("cannot touch the ground here" in str(each.message) for each in told)
    assert any("egg" in str(each.message) for each in told)


def test_feet_are_low_leaves_with_points() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        robot = hs.load_robot("bravo7", dimension=3, floating=True)
    assert [foot.name for foot in robot.feet] == ["right_foot", "left_foot"]
    assert [foot.contacts for foot in robot.feet] == [tuple(range(8)), tuple(range(8, 16))]


# Few corners


def support(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    return (points @ directions.T).max(axis=0)


@pytest.mark.parametrize("most", [8, 32])
def test_few_corners_miss_the_solid_by_what_is_said(most: int) -> None:
    draw = np.random.default_rng(1)
    points = draw.normal(size=(500, 3))
    points /= np.linalg.norm(points, axis=1)[:, None] * [1.0, 2.0, 4.0]
    corners, reach = few_corners(points, most)
    assert len(corners) == most
    directions = draw.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    missed = support(points, directions) - support(corners, directions)
    assert missed.min() >= -1e-12  # they are corners of it
    # The greatest miss over all directions is how far the solid reaches beyond the corners.
    assert 0.9 * reach <= missed.max() <= reach + 1e-9


def test_a_simple_solid_keeps_its_corners() -> None:
    cube = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    corners, reach = few_corners(np.vstack((cube, 0.3 * cube)), 32)
    assert sorted(corners.tolist()) == sorted(cube.tolist())
    assert reach == 0.0


def test_flat_and_thin_hulls() -> None:
    square = np.array([[0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0], [0.5, 0.5, 0.5]])
    assert sorted(hull_corners(square).round(9).tolist()) == sorted(square[:4].tolist())
    line = np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]])
    assert hull_corners(line).tolist() == [line[0].tolist(), line[2].tolist()]
    assert len(hull_corners(np.zeros((3, 3)))) == 1
    draw = np.random.default_rng(2)
    disc = draw.normal(size=(400, 2))
    disc /= np.linalg.norm(disc, axis=1)[:, None]
    corners, reach = few_corners(np.column_stack((disc, np.zeros(400))), 32)
    assert len(corners) == 32
    assert reach < 0.02


def test_hull_of_a_solid_is_that_of_qhull() -> None:
    points = np.random.default_rng(3).normal(size=(60, 3))
    expected = points[ConvexHull(points).vertices]
    assert sorted(hull_corners(points).tolist()) == sorted(expected.tolist())
