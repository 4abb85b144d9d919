"""Robots are drawn in one piece."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw
from scipy.ndimage import label
from scipy.sparse.csgraph import minimum_spanning_tree

from heelstrike.dynamics import link_poses
from heelstrike.robot import Robot, builtin_robots, load_robot
from heelstrike.robot.shapes.convex import convex_hull, nearest_points
from heelstrike.view.bars import bars, shortest
from heelstrike.view.drawing import body, extent

APART = """<robot name="apart">
  <link name="base">
    <inertial><mass value="9"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><origin xyz="0.03 0 0.2"/><geometry><box size="0.26 0.2 0.18"/></geometry>
    </collision>
    <collision><origin xyz="0.09 0 0"/><geometry><box size="0.04 0.2 0.05"/></geometry>
    </collision>
  </link>
  <joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/>
    <origin xyz="0 0 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="50" velocity="9"/>
  </joint>
  <link name="thigh">
    <inertial><origin xyz="0 0 -0.15"/><mass value="2"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.15"/><geometry><box size="0.06 0.06 0.15"/></geometry>
    </collision>
  </link>
  <joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/>
    <origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="50" velocity="9"/></joint>
  <link name="shank">
    <inertial><origin xyz="0 0 -0.15"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.16"/><geometry><cylinder radius="0.02" length="0.2"/></geometry>
    </collision>
    <collision><origin xyz="0 0 -0.3"/><geometry><sphere radius="0.03"/></geometry></collision>
  </link>
</robot>"""
"""A leg as some makers give it: shapes that collide, and end short of the joints."""


@pytest.fixture
def leg(tmp_path: Path) -> Robot:
    file = tmp_path / "apart.urdf"
    file.write_text(APART)
    return load_robot(file, floating=True)


def pieces(robot: Robot) -> int:
    """Count the patches of ink that a drawing of a robot, joints bent, consists of."""
    q = robot.model.reference + 0.2 * np.sin(np.arange(robot.nq))
    poses = link_poses(robot, q)
    shape = body(robot)
    segments = shape.segments(poses.origin, poses.angle)
    low, high = extent(segments)
    per_metre = 800.0 / float((high - low).max())
    places = ((segments - low) * per_metre + 10.0).tolist()
    sheet = Image.new("1", (820, 820))
    draw = ImageDraw.Draw(sheet)
    for piece in shape.pieces or [slice(i, i + 1) for i in range(len(segments))]:
        corners = [tuple(start) for start, _ in places[piece]]
        if len(corners) > 2:
            draw.polygon(corners, fill=1, outline=1)
        else:
            draw.line([tuple(end) for end in places[piece.start]], fill=1, width=3)
    return int(label(np.array(sheet), structure=np.ones((3, 3)))[1])


@pytest.mark.parametrize("name", builtin_robots())
def test_every_robot_of_the_library_is_one_piece(name: str) -> None:
    assert pieces(load_robot(name)) == 1


def test_shapes_short_of_the_joints_are_connected_to_them(leg: Robot) -> None:
    assert pieces(leg) == 1
    names = [leg.link_names[bar.link] for bar in bars(leg)]
    assert sorted(names) == ["base"] * 2 + ["shank"] * 2 + ["thigh"] * 2


@pytest.mark.parametrize("count", [3, 40])
def test_bars_are_as_short_as_they_can_be(count: int) -> None:
    """Beside SciPy's least spanning tree of all distances."""
    draw = np.random.default_rng(count)
    shapes = [
        convex_hull(0.05 * draw.normal(size=(9, 2)) + draw.normal(size=2)) for _ in range(count)
    ]
    between = np.zeros((count, count))
    for a, b in combinations(range(count), 2):
        start, end = nearest_points(shapes[a], shapes[b])
        between[a, b] = np.hypot(*(end - start)) + 1e-6  # zero would be no way
    length = sum(float(np.hypot(*(end - start))) for _, _, start, end in shortest(shapes))
    assert length == pytest.approx(minimum_spanning_tree(between).sum(), abs=count * 1e-6)


def test_bars_are_slimmer_than_what_they_connect(leg: Robot) -> None:
    thickness = {leg.link_names[bar.link]: 2.0 * bar.radius for bar in bars(leg)}
    assert thickness == pytest.approx({"base": 0.02, "thigh": 0.03, "shank": 0.02})


def test_what_touches_has_no_bars() -> None:
    """Of bravo7 the head alone stands apart; the feet, attached to bones, have theirs unused."""
    robot = load_robot("bravo7")
    (neck,) = [bar for bar in bars(robot) if robot.link_names[bar.link] == "trunk"]
    np.testing.assert_allclose(neck.corners[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(sorted(neck.corners[:, 1]), [0.62, 0.66], atol=0.005)
    assert not bars(load_robot("rabbit"))
