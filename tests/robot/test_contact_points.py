"""Contact points and feet from geoms."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from heelstrike.robot import Robot, RobotWarning, read_mjcf

HINGE = '<joint axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/>'


def body_with(geoms: str, more: str = "", world: str = "") -> Robot:
    return read_mjcf(
        f'<mujoco><compiler angle="degree"/><worldbody>{world}'
        f'<body name="foot">{HINGE}{geoms}</body></worldbody>{more}</mujoco>'
    )


def discs(robot: Robot) -> np.ndarray:
    return np.column_stack([robot.model.contact_position, robot.model.contact_radius])


@pytest.mark.parametrize(
    ("geom", "expected"),
    [
        ('<geom size="0.1" pos="0.2 5 0.3"/>', [[0.2, 0.3, 0.1]]),
        (
            '<geom type="capsule" size="0.05" fromto="0.3 0 0 -0.1 0 0"/>',
            [[-0.1, 0.0, 0.05], [0.3, 0.0, 0.05]],
        ),
        # Across the plane the two ends of a capsule, or a wheel, are one disc.
        ('<geom type="capsule" size="0.05" fromto="0.3 -1 0.1 0.3 1 0.1"/>', [[0.3, 0.1, 0.05]]),
        ('<geom type="cylinder" size="0.2 0.01" euler="90 0 0"/>', [[0.0, 0.0, 0.2]]),
        (
            '<geom type="cylinder" size="0.1 0.3" pos="0 0 1"/>',
            [[-0.1, 0.7, 0.0], [0.1, 0.7, 0.0]],
        ),
        (
            '<geom type="box" size="0.1 0.04 0.01" pos="0.05 0 -0.06"/>',
            [[-0.05, -0.07, 0.0], [0.15, -0.07, 0.0]],
        ),
        # Turned by 90 degrees, the short side becomes the sole.
        (
            '<geom type="box" size="0.1 0.04 0.01" euler="0 90 0"/>',
            [[-0.01, -0.1, 0.0], [0.01, -0.1, 0.0]],
        ),
        # Turned about the vertical by 45 degrees, its outermost corners carry it.
        (
            '<geom type="box" size="0.1 0.1 0.01" euler="0 0 45"/>',
            [[-np.sqrt(0.02), -0.01, 0.0], [np.sqrt(0.02), -0.01, 0.0]],
        ),
    ],
)
def test_shapes(geom: str, expected: list[list[float]]) -> None:
    np.testing.assert_allclose(discs(body_with(geom)), expected, atol=1e-14)


@pytest.mark.parametrize("lean", [-40.0, -10.0, 10.0, 40.0])
def test_sole_of_a_leaning_box_is_its_bottom(lean: float) -> None:
    """Up to 45 degrees the bottom face of a square box stays the one that faces the ground."""
    found = discs(body_with(f'<geom type="box" size="0.1 0.1 0.1" euler="0 {lean} 0"/>'))[:, :2]
    c, s = np.cos(np.radians(lean)), np.sin(np.radians(lean))
    bottom = np.array([[-0.1, -0.1], [0.1, -0.1]]) @ np.array([[c, -s], [s, c]])
    np.testing.assert_allclose(found, bottom, atol=1e-14)


@pytest.mark.parametrize(
    "geom",
    [
        '<geom name="odd" type="ellipsoid" size="0.1 0.1 0.2"/>',
        '<geom name="odd" type="cylinder" size="0.1 0.1" euler="30 0 0"/>',
    ],
)
def test_shapes_without_contact_points_are_named(geom: str) -> None:
    with pytest.warns(RobotWarning, match="odd"):
        assert body_with(geom).nc == 0


def test_coinciding_points_are_one() -> None:
    robot = body_with(
        '<geom type="capsule" size="0.05" fromto="0 0 0 0.3 0 0"/>'
        '<geom type="capsule" size="0.05" fromto="0.3 0 0 0.3 0 0.4"/>'
    )
    np.testing.assert_allclose(
        discs(robot), [[0, 0, 0.05], [0.3, 0, 0.05], [0.3, 0.4, 0.05]], atol=1e-15
    )
    smaller = body_with('<geom size="0.05"/><geom size="0.04"/>')
    assert smaller.nc == 2


def test_geoms_that_collide_with_nothing_are_for_the_eye() -> None:
    assert body_with('<geom size="0.1" contype="0" conaffinity="0"/>').nc == 0


FLOOR = '<geom name="floor" type="plane" size="1 1 1" contype="{}" conaffinity="{}"/>'


@pytest.mark.parametrize(
    ("floor", "foot", "touches"),
    [
        ((0, 1), (1, 0), True),
        ((1, 0), (0, 1), True),
        ((1, 0), (1, 0), False),
        ((4, 4), (3, 3), False),
    ],
)
def test_a_floor_says_which_geoms_touch_it(
    floor: tuple[int, int], foot: tuple[int, int], touches: bool
) -> None:
    geom = '<geom size="0.1" contype="{}" conaffinity="{}"/>'.format(*foot)
    assert body_with(geom, world=FLOOR.format(*floor)).nc == touches


def test_pairs_and_excluded_bodies() -> None:
    blind = '<geom name="sole" size="0.1" contype="0" conaffinity="0"/>'
    pair = '<contact><pair geom1="floor" geom2="sole"/></contact>'
    assert body_with(blind, pair, FLOOR.format(0, 0)).nc == 1
    exclude = '<contact><exclude body1="world" body2="foot"/></contact>'
    assert body_with('<geom size="0.1"/>', exclude, FLOOR.format(1, 1)).nc == 0


def test_contact_switched_off() -> None:
    with pytest.warns(RobotWarning, match="switched off"):
        robot = body_with('<geom size="1"/>', '<option><flag contact="disable"/></option>')
    assert robot.nc == 0


def test_a_ground_of_its_own_is_left_out_and_said() -> None:
    with pytest.warns(RobotWarning, match="stairs"):
        body_with('<geom size="1"/>', world='<geom name="stairs" type="box" size="1 1 1"/>')
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        body_with('<geom size="1"/>', world=FLOOR.format(1, 1))


BIPED = """<mujoco><worldbody><body name="trunk" pos="0 0 1">
  <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint axis="0 1 0"/>
  <geom name="trunk" type="capsule" size="0.1" fromto="0 0 0 0 0 0.6"/>
  <body name="hand"><joint axis="0 1 0" pos="0 0 0.5"/><geom size="0.03" pos="0 0 0.1"/></body>
  {legs}
</body></worldbody></mujoco>"""

LEG = """<body name="{side}_shank"><joint axis="0 1 0"/>
  <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.9" contype="0" conaffinity="0"/>
  {end}</body>"""


def biped(end: str) -> Robot:
    legs = "".join(LEG.format(side=s, end=end.format(side=s)) for s in ("right", "left"))
    return read_mjcf(BIPED.format(legs=legs))


def test_feet_are_the_low_leaves_with_contact_points() -> None:
    """The hand ends a branch and can touch the ground, but hangs too high to be a foot."""
    robot = biped(
        '<body name="{side}_foot" pos="0 0 -0.9"><joint axis="0 1 0"/>'
        '<geom type="box" size="0.1 0.05 0.02" pos="0.03 0 -0.05"/></body>'
    )
    assert [foot.name for foot in robot.feet] == ["right_foot", "left_foot"]
    for foot in robot.feet:
        names = [robot.contact_names[i] for i in foot.contacts]
        assert names == [f"{foot.name}_heel", f"{foot.name}_toe"]
        assert robot.link_names[foot.link] == foot.name
    assert "hand_0" in robot.contact_names
    assert len(set(robot.contact_names)) == robot.nc


def test_a_shank_with_a_point_is_a_foot() -> None:
    robot = biped('<geom size="0.001" pos="0 0 -0.9"/>')
    assert [foot.name for foot in robot.feet] == ["right_shank", "left_shank"]
    assert robot.contact_names[-1] == "left_shank_0"


def test_a_robot_may_have_no_contact_points() -> None:
    robot = body_with("")
    assert robot.nc == 0
    assert robot.feet == ()
    assert robot.model.contact_position.shape == (0, 2)
    assert robot.model.contact_link.dtype == np.int64
