"""MJCF as it was written in its first years, and files whose meshes or materials are missing."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import Robot, RobotWarning, load_robot, read_mjcf

LOCAL = """<mujoco model="leg"><compiler angle="radian" inertiafromgeom="true"/>
<default><geom contype="1" conaffinity="1"/></default>
<worldbody><geom type="plane" size="9 9 1"/><body name="thigh" pos="0.1 0 1.2">
  <joint name="hip" axis="0 1 0" pos="0 0 0.1"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.04"/>
  <body name="shin" pos="0 0 -0.5"><joint name="knee" axis="0 1 0"/>
    <geom type="box" size="0.1 0.05 0.2" pos="0.02 0 -0.2"/></body></body></worldbody></mujoco>"""
GLOBAL = """<mujoco model="leg">
<compiler angle="radian" inertiafromgeom="true" coordinate="global"/>
<default><geom contype="1" conaffinity="1"/></default>
<worldbody><geom type="plane" size="9 9 1"/><body name="thigh" pos="0.1 0 1.2" euler="0 0 1">
  <joint name="hip" axis="0 1 0" pos="0.1 0 1.3"/>
  <geom type="capsule" fromto="0.1 0 1.2 0.1 0 0.7" size="0.04"/>
  <body name="shin" {pos}><joint name="knee" axis="0 1 0" pos="0.1 0 0.7"/>
    <geom type="box" size="0.1 0.05 0.2" pos="0.12 0 0.5"/></body></body></worldbody></mujoco>"""


def quiet(text: str) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_mjcf(text)


def assert_same(one: Robot, other: Robot) -> None:
    draw = np.random.default_rng(3)
    q, v = draw.normal(size=one.nq), draw.normal(size=one.nv)
    for mine, its in (
        (dynamics.mass_matrix(one, q), dynamics.mass_matrix(other, q)),
        (dynamics.bias_force(one, q, v), dynamics.bias_force(other, q, v)),
        (dynamics.contact_positions(one, q), dynamics.contact_positions(other, q)),
    ):
        np.testing.assert_allclose(mine, its, rtol=0, atol=1e-12)


@pytest.mark.parametrize("pos", ['pos="0.1 0 0.7"', "", 'pos="-3 0 9"'])
def test_global_coordinates(pos: str) -> None:
    """Where the frame of a body is moves nothing: all that hangs in it is placed in the world."""
    assert_same(quiet(GLOBAL.format(pos=pos)), quiet(LOCAL))


def test_a_place_of_a_body_that_nobody_can_read_is_said() -> None:
    with pytest.warns(RobotWarning, match="'pos' of <body> is '0.2/2 0 0.1'.* moves nothing"):
        robot = read_mjcf(GLOBAL.format(pos='pos="0.2/2 0 0.1"'))
    assert_same(robot, quiet(LOCAL))


def test_a_place_of_a_joint_that_nobody_can_read_is_refused() -> None:
    with pytest.raises(RobotError, match=r"'pos' of <joint> is 'a 0 0\.7'"):
        quiet(GLOBAL.format(pos="").replace('pos="0.1 0 0.7"', 'pos="a 0 0.7"'))


def test_what_never_moved_a_robot_is_passed_over() -> None:
    old = LOCAL.replace(
        "<worldbody>",
        '<option collision="predefined"><flag sensornoise="disable"/></option><worldbody>',
    ).replace('type="box"', 'type="box" material="not_there"')
    old = old.replace('<geom type="capsule"', '<inertial mass="10"/><geom type="capsule"')
    assert_same(quiet(old), quiet(LOCAL))


def test_missing_meshes_of_bodies_that_state_their_inertia(tmp_path: Path) -> None:
    """The geoms are left out by name; a body that is weighed by its mesh is refused."""
    mesh = LOCAL.replace("<worldbody>", '<asset><mesh file="shin.stl"/></asset><worldbody>')
    mesh = mesh.replace(
        '<geom type="box" size="0.1 0.05 0.2" pos="0.02 0 -0.2"/>',
        '<geom type="mesh" mesh="shin"/>',
    )
    path = tmp_path / "leg.xml"
    path.write_text(mesh, encoding="utf-8")
    with pytest.raises(RobotError, match=r"line 3: <mesh> names 'shin.stl'.*'shin' has its mass"):
        load_robot(path)
    weighed = mesh.replace(' inertiafromgeom="true"', "").replace(
        '<geom type="mesh"', '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh"'
    )
    path.write_text(weighed, encoding="utf-8")
    with pytest.warns(RobotWarning, match=r"shin.stl.* and shin cannot touch the ground"):
        assert load_robot(path).model.mass[1] == 1.0
