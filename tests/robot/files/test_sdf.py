"""SDF: frames, defaults and axes as the format means them, held against the same robot in MJCF."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import Robot, RobotWarning, load_robot, read_mjcf

MJCF = """<mujoco model="leg">
  <compiler angle="radian"/>
  <worldbody>
    <body name="thigh" pos="0.1 0 1">
      <joint name="hip" type="hinge" axis="0 1 0" range="-1 0.5" damping="0.2"
        frictionloss="0.3" stiffness="4" springref="0.1" armature="0.05"/>
      <inertial pos="0.02 0 -0.2" mass="3" fullinertia="0.03 0.04 0.02 0 0.001 0"/>
      <body name="shin" pos="0.05 0 -0.4">
        <joint name="knee" type="hinge" axis="0 -1 0" pos="0 0 0.02"/>
        <inertial pos="0 0 -0.2" mass="2" diaginertia="0.02 0.03 0.01"/>
        <geom type="sphere" size="0.03" pos="0 0 -0.4" friction="0.7"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="knee" joint="knee" ctrlrange="-20 20"/></actuator>
</mujoco>"""

TENSOR = "<ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz><ixz>{}</ixz>"


def inertial(pose: str, mass: float, *moments: float) -> str:
    tensor = TENSOR.format(*moments, *[0.0] * (4 - len(moments)))
    return f"<inertial><pose>{pose}</pose><mass>{mass}</mass><inertia>{tensor}</inertia></inertial>"


SHIN = (
    inertial("0 0 -0.2 0 0 0", 2, 0.02, 0.03, 0.01)
    + '<collision name="toe"><pose>0 0 -0.4 0 0 0</pose><geometry><sphere><radius>0.03</radius>'
    "</sphere></geometry><surface><friction><ode><mu>0.7</mu></ode></friction></surface>"
    "</collision>"
)
THIGH = inertial("0.02 0 -0.2 0 0 0", 3, 0.03, 0.04, 0.02, 0.001)
HIP = (
    "<limit><lower>-1</lower><upper>0.5</upper><effort>0</effort></limit><dynamics>"
    "<damping>0.2</damping><friction>0.3</friction><spring_reference>0.1</spring_reference>"
    "<spring_stiffness>4</spring_stiffness></dynamics>"
)


def sdf(
    *,
    version: str = "1.7",
    model: str = "<pose>0 0 0 0 0 0</pose>",
    thigh: str = "<pose>0.1 0 1 0 0 0</pose>",
    shin: str = "<pose>0.15 0 0.6 0 0 0</pose>",
    hip: str = "<xyz>0 1 0</xyz>",
    knee: str = "<pose>0 0 0.02 0 0 0</pose>",
    knee_axis: str = "<xyz>0 -1 0</xyz>",
    more: str = "",
) -> str:
    return f"""<sdf version="{version}"><model name="leg">{model}
      <link name="thigh">{thigh}{THIGH}</link>
      <link name="shin">{shin}{SHIN}</link>
      <joint name="hip" type="revolute"><parent>world</parent><child>thigh</child>
        <axis>{hip}{HIP}</axis>
        <drake:rotor_inertia>0.0005</drake:rotor_inertia><drake:gear_ratio>10</drake:gear_ratio>
      </joint>
      <joint name="knee" type="continuous"><parent>thigh</parent><child>shin</child>{knee}
        <axis>{knee_axis}<limit><effort>20</effort></limit></axis></joint>{more}
    </model></sdf>"""


def quiet(text: str, **how: object) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_mjcf(text, **how)  # type: ignore[arg-type]


def assert_same(one: Robot, other: Robot) -> None:
    assert one.joint_names == other.joint_names
    draw = np.random.default_rng(3)
    for _ in range(3):
        q, v = draw.normal(size=one.nq), draw.normal(size=one.nv)
        for query in (dynamics.bias_force, dynamics.passive_force):
            np.testing.assert_allclose(query(one, q, v), query(other, q, v), rtol=0, atol=1e-12)
        for here in (dynamics.mass_matrix, dynamics.contact_positions):
            np.testing.assert_allclose(here(one, q), here(other, q), rtol=0, atol=1e-12)
    for field in ("lower", "upper", "damping", "stiffness", "rest", "dry_friction", "armature"):
        np.testing.assert_allclose(getattr(one.model, field), getattr(other.model, field), 1e-14)
    np.testing.assert_array_equal(one.model.torque_upper, other.model.torque_upper)
    assert one.contact_friction == other.contact_friction


WAYS = {
    "plain": sdf(),
    "relative poses": sdf(shin='<pose relative_to="thigh">0.05 0 -0.4 0 0 0</pose>'),
    "a frame between": sdf(
        shin='<pose relative_to="kneecap">0 0 -0.4 0 0 0</pose>',
        more='<frame name="kneecap" attached_to="thigh"><pose>0.05 0 0 0 0 0</pose></frame>',
    ),
    "a joint on a frame of the world": sdf(
        more='<frame name="seat" attached_to="world"><pose>9 9 9 0 0 0</pose></frame>',
    ).replace("<parent>world</parent>", "<parent>seat</parent>"),
    "a turned joint": sdf(
        knee=f"<pose>0 0 0.02 {math.pi / 2!r} 0 0</pose>", knee_axis="<xyz>0 0 1</xyz>"
    ),
    "a turned joint, axis in the model": sdf(
        knee='<pose degrees="true">0 0 0.02 0 0 90</pose>',
        knee_axis='<xyz expressed_in="__model__">0 -1 0</xyz>',
    ),
    "a turned joint of 1.6": sdf(
        version="1.6",
        knee=f"<pose>0 0 0.02 0 0 {math.pi / 2!r}</pose>",
        knee_axis="<xyz>0 -1 0</xyz><use_parent_model_frame>true</use_parent_model_frame>",
    ),
    "a turned joint of 1.4": sdf(version="1.4", knee=f"<pose>0 0 0.02 0 0 {math.pi / 2!r}</pose>"),
    "a turned model": sdf(
        model='<pose rotation_format="quat_xyzw">0 0 0 0 0 1 0</pose>',
        thigh="<pose>-0.1 0 1 0 0 3.141592653589793</pose>",
        shin="<pose>-0.15 0 0.6 0 0 3.141592653589793</pose>",
    ),
    "in a world": sdf()
    .replace('<sdf version="1.7">', '<sdf version="1.7"><world name="w">')
    .replace("</sdf>", '<model name="wall"><static>true</static></model></world></sdf>'),
    "joint and link of one name": sdf(version="1.6").replace('name="knee"', 'name="shin"'),
}


@pytest.mark.parametrize("way", WAYS)
def test_one_leg_written_in_many_ways(way: str) -> None:
    expected = quiet(MJCF.replace('"knee"', '"shin"') if way.startswith("joint and") else MJCF)
    assert_same(quiet(WAYS[way]), expected)


def test_what_is_not_said_is_what_the_format_means() -> None:
    """Without <inertial> 1 kg and 1 kg m²; without <effort> a motor without limits: both said."""
    text = sdf().replace(SHIN, "").replace("<limit><effort>20</effort></limit>", "")
    with pytest.warns(RobotWarning) as caught:
        robot = read_mjcf(text)
    said = " ".join(str(one.message) for one in caught)
    assert "1 kg m² about each axis: shin" in said
    assert "driven without limit: knee" in said
    assert (robot.model.mass[1], robot.model.inertia[1]) == (1.0, 1.0)
    assert np.isinf(robot.model.torque_upper).all()


def test_a_moment_that_is_not_said_is_one() -> None:
    with pytest.warns(RobotWarning, match="1 kg m² about each axis: shin"):
        robot = read_mjcf(sdf().replace("<iyy>0.03</iyy>", ""))
    assert robot.model.inertia[1] == 1.0


def test_a_joint_with_a_spring_and_no_effort_is_passive() -> None:
    robot = quiet(sdf().replace("<effort>0</effort>", ""))
    assert robot.actuator_names == ("knee",)


def test_loops_and_gearboxes_are_left_out_by_name() -> None:
    more = (
        '<joint name="rod" type="revolute"><parent>world</parent><child>shin</child><axis>'
        '<xyz>0 1 0</xyz></axis></joint><joint name="box" type="gearbox"><parent>thigh</parent>'
        "<child>shin</child></joint>"
    )
    with pytest.warns(RobotWarning, match=r"close a loop .* left out: rod, box\."):
        robot = read_mjcf(sdf(more=more))
    assert_same(robot, quiet(MJCF))


def test_a_model_that_nothing_holds_floats() -> None:
    text = sdf().replace("<parent>world</parent>", "<parent>hips</parent>")
    text = text.replace(
        '<link name="thigh">', f'<link name="hips">{THIGH}</link><link name="thigh">'
    )
    with pytest.raises(RobotError, match=r"free joint.*floating=True"):
        quiet(text)
    robot = quiet(text, floating=True)
    assert robot.joint_names == ("root_x", "root_z", "root_pitch", "hip", "knee")


def test_drakes_planar_joint_begins_where_its_frames_meet() -> None:
    """The frame stands upright: its x and y are the world's x and z, its turn one about -y."""
    text = """<sdf version="1.7"><model name="hopper">
      <link name="stage"><pose degrees="true">0 0 0 90 0 0</pose></link>
      <joint name="weld" type="fixed"><parent>world</parent><child>stage</child></joint>
      <link name="trunk"><inertial><mass>2</mass></inertial></link>
      <drake:joint name="free" type="planar"><drake:parent>stage</drake:parent>
        <drake:child>trunk</drake:child><drake:damping>1 2 3</drake:damping></drake:joint>
    </model></sdf>"""
    with pytest.warns(RobotWarning):
        robot = read_mjcf(text)
    np.testing.assert_allclose(
        robot.model.axis, [[0, 1, 0], [0, 0, 1], [-1, 0, 0]], rtol=0, atol=1e-15
    )
    assert robot.model.damping.tolist() == [1.0, 2.0, 3.0]
    assert robot.model.mass.tolist() == [0.0, 0.0, 2.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (sdf().replace("0.02 0 -0.2", "0.02 junk -0.2"), r"line 2: <pose> is .*, not 6 numbers"),
        (sdf().replace("<mass>3</mass>", "<mass>-3</mass>"), r"<mass> is -3; .* less than 0"),
        (sdf().replace("<mass>3</mass>", "<mass>nan</mass>"), "not a finite number"),
        (sdf().replace("<mass>3", "<mass>3</mass><mass>3"), "two <mass>. Keep one"),
        (sdf().replace("<child>shin", "<child>foot"), "there is no link 'foot'"),
        (sdf().replace('type="continuous"', 'type="hinge"'), "of the type 'hinge'"),
        (sdf().replace("<lower>-1", "<lower>1"), "the range of joint 'hip' is empty"),
        (sdf().replace("0 -1 0</xyz>", "0 0 0</xyz>"), "no direction"),
        (sdf(shin='<pose relative_to="shin">0 0 0 0 0 0</pose>'), "'shin' is given relative to it"),
        (
            sdf(
                shin='<pose relative_to="a">0 0 0 0 0 0</pose>',
                more='<frame name="a"><pose relative_to="b">0 0 0 0 0 0</pose></frame>'
                '<frame name="b"><pose relative_to="a">0 0 0 0 0 0</pose></frame>',
            ),
            "is given relative to itself, by way of",
        ),
        (sdf(more="<include><uri>model://arm</uri></include>"), "not there"),
        (sdf(version="1.0"), "reads 1.2 to 1.12"),
        (sdf().replace("<model", "<model name='b'></model><model"), "here are 'b', 'leg'"),
        (sdf().replace('name="shin"', 'name="thigh"'), "two elements are called 'thigh'"),
    ],
)
def test_what_cannot_be_meant_is_refused(text: str, words: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        with pytest.raises(RobotError, match=words):
            read_mjcf(text)


def test_a_misspelt_element_is_named() -> None:
    with pytest.warns(RobotWarning, match=r"<dampng> in <dynamics>, line 5 \(did you mean <dam"):
        read_mjcf(sdf().replace("<damping>0.2</damping>", "<dampng>0.2</dampng>"))


def test_links_in_a_circle() -> None:
    text = sdf().replace("<parent>world</parent>", "<parent>shin</parent>")
    with pytest.raises(RobotError, match="is attached to itself, through a circle"):
        read_mjcf(text)


def test_from_a_file_and_a_missing_mesh(tmp_path: Path) -> None:
    mesh = "<mesh><uri>model://leg/toe.stl</uri></mesh>"
    text = sdf().replace("<sphere><radius>0.03</radius></sphere>", mesh)
    path = tmp_path / "leg.sdf"
    path.write_text(text, encoding="utf-8")
    with pytest.warns(RobotWarning, match="cannot touch the ground .*: shin"):
        assert load_robot(path).nc == 0
