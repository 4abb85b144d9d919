"""What robots in space look like: solids of their files, as closed surfaces."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.robot.spatial.solids import Solid
from heelstrike.view.spatial.body import body_in_space

SHAPES = """
<mujoco model="shapes"><worldbody><body name="b" pos="0 0 1"><freejoint/>
  <geom type="box" size="0.1 0.2 0.3" pos="1 0 0" mass="1"/>
  <geom type="sphere" size="0.1" mass="1"/>
  <geom type="capsule" size="0.1 0.2" mass="1"/>
  <geom type="cylinder" size="0.1 0.2" mass="1"/>
  <geom type="ellipsoid" size="0.1 0.2 0.3" mass="1"/></body>
  <body name="seen" pos="0 1 1"><freejoint/><geom type="box" size="1 1 1" mass="1"/>
  <geom type="box" size="0.5 0.5 0.5" contype="0" conaffinity="0" mass="0"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> hs.SpatialRobot:
    path = tmp_path_factory.mktemp("shapes") / "shapes.xml"
    path.write_text(SHAPES)
    return hs.load_robot(path, dimension=3)


def volume(corners: np.ndarray, faces: np.ndarray) -> float:
    """Volume within a closed surface, whose triangles go anticlockwise from outside."""
    a, b, c = (corners[faces[:, k]] for k in range(3))
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0)


def test_surfaces_are_closed_and_hold_the_volume(robot: hs.SpatialRobot) -> None:
    ball = 4.0 / 3.0 * np.pi * 0.001
    # Balls of 42 and cylinders of 2 × 16 corners are smaller than round ones.
    expected = [
        (0.2 * 0.4 * 0.6, 1e-9),
        (ball, 0.15),
        (ball + np.pi * 0.01 * 0.4, 0.12),
        (np.pi * 0.01 * 0.4, 0.03),
        (ball * 6.0, 0.15),
        (1.0, 1e-9),  # what is seen, not what collides
    ]
    assert len(robot.solids) == len(expected)
    for solid, (whole, less) in zip(robot.solids, expected, strict=True):
        corners, faces = solid.surface()
        edges = Counter((int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3))
        assert set(edges.values()) == {1}
        assert all((b, a) in edges for a, b in edges)
        assert (1.0 - less) * whole <= volume(corners, faces) <= whole * (1.0 + 1e-9)
    assert robot.solids[0].corners[:, 0].min() == pytest.approx(0.9)  # where its geom is
    assert [solid.link for solid in robot.solids] == [0] * 5 + [1]


def test_what_is_flat_has_no_surface() -> None:
    flat = Solid(0, np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), 0.0)
    assert flat.surface()[1].shape == (0, 3)


def test_a_link_without_shapes_is_a_rod(tmp_path: Path) -> None:
    path = tmp_path / "bare.xml"
    path.write_text(
        """<mujoco model="bare"><worldbody><body name="a" pos="0 0 1"><freejoint/>
        <inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/><body name="b" pos="0 0 -0.5">
        <joint name="j" axis="0 1 0"/><inertial pos="0 0 -0.2" mass="1"
        diaginertia="0.1 0.1 0.1"/></body></body></worldbody></mujoco>"""
    )
    body = body_in_space(hs.load_robot(path, dimension=3))
    for link, low in ((0, -0.5), (1, -0.4)):
        own = body.corners[body.link == link]
        assert own[:, 2].min() == pytest.approx(low, abs=0.05)
        assert own[:, 2].max() == pytest.approx(0.0, abs=0.05)
