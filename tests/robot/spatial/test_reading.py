"""Robots in space out of files: which dimension, which joints, which inertia, what is told."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import JointKind, RobotWarning, SpatialRobot

INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.2 0.25"/>'


def mjcf(bodies: str, more: str = "") -> str:
    return (
        f'<mujoco model="made up"><compiler angle="radian"/><worldbody>{bodies}</worldbody>'
        f"{more}</mujoco>"
    )


def link(joints: str, rest: str = "", name: str = "link") -> str:
    return f'<body name="{name}">{joints}{INERTIAL}{rest}</body>'


PLANAR = mjcf(link('<joint name="hip" axis="0 1 0"/>'))
SPATIAL = mjcf(link('<joint name="hip" axis="0 1 0"/><joint name="roll" axis="1 0 0"/>'))
FREE = mjcf(link('<freejoint name="base"/>', '<geom name="ball" size="0.1"/>'))


def load(text: str, folder: Path, ending: str = "xml", **how: Any) -> Any:
    path = folder / f"robot.{ending}"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        return hs.load_robot(path, **how)


def said(text: str, folder: Path, ending: str = "xml", **how: Any) -> str:
    path = folder / f"robot.{ending}"
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        hs.load_robot(path, dimension=3, **how)
    return "\n".join(str(one.message) for one in caught)


# Which dimension


def test_a_file_tells_its_dimension(tmp_path: Path) -> None:
    assert isinstance(load(PLANAR, tmp_path), hs.Robot)
    assert isinstance(load(SPATIAL, tmp_path), SpatialRobot)
    assert isinstance(load(FREE, tmp_path), SpatialRobot)
    assert isinstance(hs.load_robot("bravo7"), hs.Robot)


def test_a_robot_of_the_plane_that_leaves_it_is_told(tmp_path: Path) -> None:
    """Who slips in one axis of a planar robot hears why it has become one of space."""
    path = tmp_path / "robot.xml"
    path.write_text(SPATIAL, encoding="utf-8")
    with pytest.warns(RobotWarning, match=r"joint 'roll' .* turns about .* three dimensions"):
        hs.load_robot(path)
    assert "leaves the" not in said(SPATIAL, tmp_path)  # which asks for dimension=3
    path.write_text(FREE, encoding="utf-8")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        hs.load_robot(path)
    assert not any("leaves" in str(one.message) for one in caught)


def test_a_dimension_that_is_asked_for(tmp_path: Path) -> None:
    lifted = load(PLANAR, tmp_path, dimension=3)
    assert isinstance(lifted, SpatialRobot)
    np.testing.assert_array_equal(lifted.model.axis, [[0.0, 1.0, 0.0]])
    locked = load(SPATIAL, tmp_path, dimension=2)
    assert isinstance(locked, hs.Robot)
    assert [joint.name for joint in locked.locked] == ["roll"]
    assert isinstance(load(SPATIAL, tmp_path, projected=True), hs.Robot)
    assert isinstance(load(FREE, tmp_path, floating=True), hs.Robot)  # as ever


def test_what_contradicts_itself_is_refused(tmp_path: Path) -> None:
    for how, words in (
        ({"dimension": 4}, "dimension is 2 or 3"),
        ({"dimension": 3, "projected": True}, "two dimensions"),
        ({"dimension": 3, "mirror": "average"}, "plane only"),
    ):
        with pytest.raises(RobotError, match=words):
            load(PLANAR, tmp_path, **how)


def test_an_error_of_a_file_in_space_is_told_once(tmp_path: Path) -> None:
    motor = '<actuator><motor joint="hip"/><motor joint="hip"/></actuator>'
    with pytest.raises(RobotError, match="driven by two actuators"):
        load(SPATIAL.replace("</mujoco>", motor + "</mujoco>"), tmp_path)


# Joints


def test_positions_and_velocities_are_counted_apart(tmp_path: Path) -> None:
    arm = link(
        '<joint name="ball" type="ball"/>', link('<joint name="rail" type="slide"/>', "", "c"), "b"
    )
    robot = load(mjcf(link('<freejoint name="base"/>', arm)), tmp_path)
    assert (robot.nq, robot.nv, robot.nj, robot.nl) == (12, 10, 3, 3)
    assert robot.floating
    assert [JointKind(kind).name for kind in robot.model.joint_kind] == ["FREE", "BALL", "SLIDE"]
    assert robot.position_names[2:9] == (
        "base_z", "base_qw", "base_qx", "base_qy", "base_qz", "ball_qw", "ball_qx",
    )  # fmt: skip
    assert robot.velocity_names[5:] == ("base_wz", "ball_wx", "ball_wy", "ball_wz", "rail")
    assert robot.model.depth.tolist() == list(range(10))


def test_a_urdf_without_a_joint_of_its_trunk_moves_freely(tmp_path: Path) -> None:
    urdf = """<robot name="r"><link name="trunk"><inertial><mass value="1"/>
      <inertia ixx="1" iyy="1" izz="1"/></inertial></link>
      <link name="leg"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
      </link><joint name="hip" type="continuous"><parent link="trunk"/><child link="leg"/>
      <axis xyz="1 0 0"/></joint></robot>"""
    assert load(urdf, tmp_path, "urdf", dimension=3).joint_names == ("root", "hip")
    assert "moves freely" in said(urdf, tmp_path, "urdf")
    held = urdf.replace(
        "</robot>",
        '<link name="world"/><joint name="weld" type="fixed"><parent link="world"/>'
        '<child link="trunk"/></joint></robot>',
    )
    assert load(held, tmp_path, "urdf", dimension=3).joint_names == ("hip",)


def test_floating_frees_the_trunk() -> None:
    with pytest.warns(RobotWarning, match="in the place of root_x, root_z, root_pitch"):
        robot = hs.load_robot("bravo7", dimension=3, floating=True)
    assert robot.joint_names[0] == "root"
    np.testing.assert_allclose(robot.model.reference[:7], [0, 0, 0.9538, 1, 0, 0, 0], atol=1e-15)
    still = hs.load_robot("bravo7", dimension=3)
    assert still.joint_names[:3] == ("root_x", "root_z", "root_pitch")


def test_a_lifted_robot_has_the_equations_of_the_plane() -> None:
    """bravo7 in its planar coordinates, with its own joints and with a free trunk."""
    plane = hs.load_robot("bravo7")
    whole = hs.load_robot("bravo7", dimension=3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        free = hs.load_robot("bravo7", dimension=3, floating=True)
    draw = np.random.default_rng(5)
    for _ in range(20):
        q, v = draw.normal(size=9), draw.normal(size=9)
        mass, bias = dynamics.mass_matrix(plane, q), dynamics.bias_force(plane, q, v)
        assert np.abs(dynamics.mass_matrix(whole, q) - mass).max() <= 1e-12 * mass.max()
        assert np.abs(dynamics.bias_force(whole, q, v) - bias).max() <= 1e-12 * np.abs(bias).max()
        x, z, pitch = q[:3]
        place = [x, 0.0, z, np.cos(pitch / 2), 0.0, np.sin(pitch / 2), 0.0, *q[3:]]
        # Planar velocities among those of the free joint: x, z, about y; then the hinges.
        ours = [0, 2, 4, *range(6, 12)]
        moves = np.zeros(12)
        moves[ours] = v
        block = dynamics.mass_matrix(free, place)[np.ix_(ours, ours)]
        assert np.abs(block - mass).max() <= 1e-12 * mass.max()
        found = dynamics.bias_force(free, place, moves)
        assert np.abs(found[ours] - bias).max() <= 1e-12 * np.abs(bias).max()


# Inertia


def test_fixed_bodies_are_merged(tmp_path: Path) -> None:
    part = (
        '<body pos="0.3 0 0"><inertial pos="0 0 0" mass="3" diaginertia="1e-9 1e-9 1e-9"/></body>'
    )
    robot = load(mjcf(link("<freejoint/>", part)), tmp_path)
    assert robot.nl == 1
    assert robot.total_mass == pytest.approx(4.0)
    np.testing.assert_allclose(robot.model.center_of_mass, [[0.225, 0.0, 0.0]], atol=1e-15)
    # 1 kg at 0.225 m and 3 kg at 0.075 m from their centre.
    aside = 1.0 * 0.225**2 + 3.0 * 0.075**2
    np.testing.assert_allclose(
        robot.model.inertia[0], [0.1, 0.2 + aside, 0.25 + aside, 0.0, 0.0, 0.0], atol=2e-9
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_inertia_that_no_body_has_is_taken_as_it_is(tmp_path: Path, dimension: int) -> None:
    text = PLANAR.replace('diaginertia="0.1 0.2 0.25"', 'fullinertia="0.1 0.7 0.3 0.01 0 0.02"')
    robot = load(text, tmp_path, dimension=dimension)
    found = robot.model.inertia.ravel()
    expected = [0.7] if dimension == 2 else [0.1, 0.7, 0.3, 0.01, 0.0, 0.02]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
def test_next_to_no_inertia_stays_so(tmp_path: Path, dimension: int) -> None:
    """A product of 1e-35 kg m² that a program has rounded, and nothing else, is a point mass."""
    urdf = """<robot name="r"><link name="world"/><link name="a"><inertial><origin xyz="0 0 1"/>
      <mass value="2"/><inertia ixx="0" iyy="0" izz="0" ixz="2.4e-35"/></inertial></link>
      <joint name="j" type="continuous"><parent link="world"/><child link="a"/><axis xyz="0 1 0"/>
      </joint></robot>"""
    robot = load(urdf, tmp_path, "urdf", dimension=dimension)
    assert dynamics.mass_matrix(robot, [0.3])[0, 0] == pytest.approx(2.0, rel=1e-12)


def test_joints_of_a_urdf_that_move_no_mass_are_fixed(tmp_path: Path) -> None:
    """A rod without inertia about its own axis, and fingers without mass, as URDF files have."""
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="{}"/></inertial>'

    def joint(name: str, parent: str, child: str) -> str:
        return (
            f'<joint name="{name}" type="continuous"><parent link="{parent}"/>'
            f'<child link="{child}"/><axis xyz="0 0 1"/></joint>'
        )

    urdf = (
        f'<robot name="r"><link name="a">{inertial.format(1)}</link>'
        f'<link name="rod">{inertial.format(0)}</link><link name="leg">{inertial.format(2)}</link>'
        '<link name="finger"/>'
        + joint("spin", "a", "rod") + joint("hip", "a", "leg") + joint("tip", "leg", "finger")
        + "</robot>"
    )  # fmt: skip
    robot = load(urdf, tmp_path, "urdf", dimension=3)
    assert robot.joint_names == ("root", "hip")
    assert robot.total_mass == pytest.approx(3.0)
    words = said(urdf, tmp_path, "urdf")
    assert "2 joints move no mass" in words
    assert "spin, tip" in words
    assert words.count("moves freely") == 1


def test_a_negative_moment_is_refused(tmp_path: Path) -> None:
    text = FREE.replace('diaginertia="0.1 0.2 0.25"', 'fullinertia="0.1 0.2 0.25 0.5 0 0"')
    with pytest.raises(RobotError, match=r"principal moment of inertia -"):
        load(text, tmp_path)


def test_a_joint_that_moves_nothing_is_refused(tmp_path: Path) -> None:
    nothing = '<inertial pos="0 0 0" mass="1" diaginertia="2e-15 2e-15 2e-15"/>'
    text = mjcf(link("<freejoint/>", f'<body name="b"><joint name="idle"/>{nothing}</body>'))
    with pytest.raises(RobotError, match="'idle' moves no mass"):
        load(text, tmp_path)


# What is told


def test_what_is_left_out_is_named(tmp_path: Path) -> None:
    other = link('<joint name="knee" axis="1 0 0"/>', '<geom size="0.1"/>', "other")
    body = link('<freejoint name="base"/>', '<geom size="0.1"/>' + other)
    tendon = (
        '<tendon><fixed name="cable" stiffness="3"><joint joint="knee" coef="1"/></fixed></tendon>'
    )
    weld = '<equality><joint joint1="knee"/></equality>'
    words = said(mjcf(body, tendon + weld), tmp_path)
    assert "tendons" in words
    assert "equality constraints" in words
    assert "no joint has a motor" in words
    assert "go through each other" not in words  # parent and child never collide
    third = link('<joint name="ankle" axis="1 0 0"/>', '<geom size="0.1"/>', "third")
    both = mjcf(body.replace("</body></body>", f"{third}</body></body>"))
    assert "go through each other" in said(both, tmp_path)


def test_a_free_joint_that_resists_is_told(tmp_path: Path) -> None:
    text = FREE.replace(
        '<freejoint name="base"/>', '<joint name="base" type="free" armature="0.01"/>'
    )
    assert "free joint 'base' has armature 0.01" in said(text, tmp_path)
    robot = load(text, tmp_path)
    np.testing.assert_array_equal(robot.model.armature, np.full(6, 0.01))
    assert "armature" not in said(FREE, tmp_path)


def test_motors_drive_velocities(tmp_path: Path) -> None:
    arm = link('<joint name="knee" axis="1 0 0" range="-1 1"/>', "", "arm")
    drives = (
        '<actuator><motor name="drive" joint="knee" gear="3" ctrllimited="true" ctrlrange="-2 4"/>'
        '<motor name="thruster" joint="base" gear="0 0 1 0 0 0"/></actuator>'
    )
    text = mjcf(link('<freejoint name="base"/>', arm), drives)
    robot = load(text, tmp_path)
    assert robot.actuator_names == ("drive",)
    assert robot.model.actuator_velocity.tolist() == [6]
    assert (robot.model.torque_lower[0], robot.model.torque_upper[0]) == (-6.0, 12.0)
    assert (robot.model.lower[1], robot.model.upper[1]) == (-1.0, 1.0)
    assert np.isinf(robot.model.upper[0])
    assert "left out: thruster" in said(text, tmp_path)
    torque = dynamics.applied_force(robot, robot.model.reference, np.zeros(7), [2.0])
    np.testing.assert_array_equal(torque, [0, 0, 0, 0, 0, 0, 2.0])


def test_states_by_name(tmp_path: Path) -> None:
    arm = link('<joint name="knee" axis="1 0 0"/>', "", "arm")
    robot = load(mjcf(link('<freejoint name="base"/>', arm)), tmp_path)
    state = robot.state({"knee": 0.4, "base_z": 2.0, "base_qx": 1.0}, {"base_wy": 3.0})
    assert robot.positions(state)["knee"] == 0.4
    assert robot.velocities(state)["base_wy"] == 3.0
    np.testing.assert_allclose(state.q[3:7], [0.5**0.5, 0.5**0.5, 0.0, 0.0], rtol=1e-15)
    with pytest.raises(RobotError, match=r"no position 'kneee'\. Did you mean 'knee'"):
        robot.state({"kneee": 0.0})
    with pytest.raises(RobotError, match=r"quaternion of joint 'base' .* has length 2"):
        dynamics.mass_matrix(robot, [0, 0, 0, 2, 0, 0, 0, 0])
