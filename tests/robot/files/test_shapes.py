"""Outlines of robots from the shapes of their files, and how they are kept."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs

FILE = """<mujoco model="shapes"><compiler angle="degree"/><asset>
<mesh name="wedge" vertex="0 -1 0  1 -1 0  0 -1 1  0 1 0  1 1 0  0 1 1  .2 0 .2"/>
<mesh name="shoe"
 vertex="-.1 -1 0  .1 -1 0  .15 -1 .02  0 -1 .1  -.1 1 0  .1 1 0  .15 1 .02  0 1 .1"/>
</asset><worldbody>
<geom type="plane" size="1 1 1"/>
<body name="trunk" pos="0 0 1"><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>
<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1" ref="1"/>
<joint name="pitch" axis="0 1 0"/>
{trunk}
<body name="foot" pos="0 0 -.5"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="ankle" axis="0 1 0"/>{foot}</body>
</body></worldbody></mujoco>"""
SEEN = 'contype="0" conaffinity="0"'


def load(tmp_path: Path, trunk: str, foot: str = "") -> hs.Robot:
    path = tmp_path / "robot.xml"
    path.write_text(FILE.format(trunk=trunk, foot=foot), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hs.RobotWarning)
        return hs.load_robot(path)


@pytest.mark.parametrize(
    ("shape", "radius", "corners"),
    [
        ('type="sphere" size=".1" pos="1 7 2"', 0.1, [(1, 2)]),
        ('type="capsule" size=".1" fromto="0 0 0 0 0 1"', 0.1, [(0, 0), (0, 1)]),
        ('type="capsule" size=".1" fromto="0 -1 0 0 1 0"', 0.1, [(0, 0)]),
        ('type="box" size=".1 .2 .3"', 0.0, [(-0.1, -0.3), (-0.1, 0.3), (0.1, -0.3), (0.1, 0.3)]),
        ('type="cylinder" size=".1 .3"', 0.0, [(-0.1, -0.3), (-0.1, 0.3), (0.1, -0.3), (0.1, 0.3)]),
        ('type="mesh" mesh="wedge"', 0.0, [(0, 0), (0, 1), (1, 0)]),
    ],
)
def test_shapes(shape: str, radius: float, corners: list[object], tmp_path: Path) -> None:
    (outline,) = load(tmp_path, f"<geom {shape} {SEEN}/>").outlines
    assert (outline.link, outline.radius) == (2, radius)
    found = outline.corners[np.lexsort(outline.corners.round(9).T[::-1])]
    # MuJoCo keeps the corners of meshes in single precision.
    np.testing.assert_allclose(found, corners, atol=1e-6 if "mesh" in shape else 1e-12)


def test_an_ellipsoid_casts_an_ellipse(tmp_path: Path) -> None:
    shape = f'<geom type="ellipsoid" size=".1 .2 .3" euler="0 30 0" {SEEN}/>'
    (outline,) = load(tmp_path, shape).outlines
    c, s = np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)
    x, z = (outline.corners @ [[c, s], [-s, c]]).T
    np.testing.assert_allclose((x / 0.1) ** 2 + (z / 0.3) ** 2, 1.0, rtol=1e-9)


def test_what_is_to_be_seen_is_drawn_and_what_collides_only_without_it(tmp_path: Path) -> None:
    box, ball = '<geom type="box" size=".1 .2 .3"/>', f'<geom size=".2" {SEEN}/>'
    robot = load(tmp_path, box + ball, box)
    assert [(each.link, each.radius) for each in robot.outlines] == [(2, 0.2), (3, 0.0)]


def test_a_mesh_stands_on_its_lowest_corners(tmp_path: Path) -> None:
    """Not on the ankle's, which the shoe keeps off the ground."""
    foot = (
        '<geom type="mesh" mesh="shoe" pos="0 0 -.5"/><geom type="mesh" mesh="shoe" pos="0 0 -.4"/>'
    )
    model = load(tmp_path, "", foot).model
    assert model.contact_link.tolist() == [3, 3, 3]
    expected = [(-0.1, -0.5), (0.1, -0.5), (0.15, -0.48)]
    np.testing.assert_allclose(model.contact_position, expected, atol=1e-6)


@pytest.mark.parametrize("name", ["bravo7", "walker2d"])
def test_saved_and_loaded_without_loss(name: str, tmp_path: Path) -> None:
    robot = hs.load_robot(name)
    assert robot.outlines
    run = hs.simulate(robot, state=robot.reference_state(), duration=0.002)
    runs = hs.load_run(run.save(tmp_path / "run.nc"))
    for again in (hs.load_robot(robot.save(tmp_path / "again.xml")), runs.robot):
        assert len(again.outlines) == len(robot.outlines)
        for one, other in zip(again.outlines, robot.outlines, strict=True):
            assert (one.link, one.radius) == (other.link, other.radius)
            np.testing.assert_array_equal(one.corners, other.corners)


def test_urdf_says_that_it_drops_them(tmp_path: Path) -> None:
    with pytest.warns(hs.RobotWarning, match="outlines, for pictures"):
        hs.load_robot("rabbit").save(tmp_path / "rabbit.urdf")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('data="0.07 ', 'data="-0.07 '), "outline:0:root_pitch must be a radius >= 0"),
        (('data="0.07 ', 'data="nan '), "which is not a finite number"),
    ],
)
def test_spoilt_outlines(change: tuple[str, str], said: str, tmp_path: Path) -> None:
    path = hs.load_robot("bravo7").save(tmp_path / "robot.xml")
    text = path.read_text(encoding="utf-8")
    assert change[0] in text
    path.write_text(text.replace(*change, 1), encoding="utf-8")
    with pytest.raises(hs.RobotError, match=said):
        hs.load_robot(path)


def test_lost_outlines_are_missed(tmp_path: Path) -> None:
    path = hs.load_robot("rabbit").save(tmp_path / "robot.xml")
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('name="outline:0:', 'name="note:0:', 1), encoding="utf-8")
    with pytest.warns(hs.RobotWarning, match="5 outlines were saved, of which 4 are there"):
        hs.load_robot(path)
