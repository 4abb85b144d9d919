"""URDF as people write it: roots, meshes, massless links, limits."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import RobotWarning, load_robot, read_mjcf
from heelstrike.robot.files.options import LoadOptions
from heelstrike.robot.library import NO_CONTACTS, NO_MOTORS

INERTIA = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
SPHERE = (
    '<collision><origin xyz="0 0 -0.4"/><geometry><sphere radius="0.02"/></geometry></collision>'
)


def link(name: str, mass: float, more: str = SPHERE) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 -0.2"/><mass value="{mass}"/>{INERTIA}'
        f"</inertial>{more}</link>"
    )


def biped(root: str = "", more: str = SPHERE, axis: str = "0 1 0") -> str:
    """A trunk on two legs; `root` holds what comes before the trunk."""
    text = f'<robot name="biped">{root}{link("trunk", 5, "")}'
    for side in ("left", "right"):
        text += link(f"{side}_leg", 2, more)
        text += (
            f'<joint name="{side}_hip" type="revolute"><parent link="trunk"/>'
            f'<child link="{side}_leg"/><origin xyz="0 {0.1 if side == "left" else -0.1} 0"/>'
            f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="9" velocity="4"/></joint>'
        )
    return text + "</robot>"


def joint(kind: str, axis: str = "0 1 0", *, height: float = 1.0) -> str:
    return (
        f'<link name="world"/><joint name="root" type="{kind}"><parent link="world"/>'
        f'<child link="trunk"/><origin xyz="0 0 {height}"/><axis xyz="{axis}"/></joint>'
    )


CHAIN = (
    '<link name="world"/><link name="carriage"/><link name="lift"/>'
    '<joint name="root_x" type="prismatic"><parent link="world"/><child link="carriage"/>'
    '<axis xyz="1 0 0"/></joint>'
    '<joint name="root_z" type="prismatic"><parent link="carriage"/><child link="lift"/>'
    '<axis xyz="0 0 1"/></joint>'
    '<joint name="root_pitch" type="continuous"><parent link="lift"/><child link="trunk"/>'
    '<axis xyz="0 1 0"/></joint>'
)


def test_the_ways_to_a_floating_base_are_one_robot() -> None:
    """A planar joint, a chain of massless links, and floating=True over a fixed or free root."""
    texts = {
        "planar": (biped(joint("planar")), False),
        "turned planar": (biped(joint("planar", "0 -1 0")), False),
        "chain": (biped(CHAIN), False),
        "fixed": (biped(), True),
        "free": (biped(joint("floating")), True),
    }
    draw = np.random.default_rng(0)
    q, v = draw.normal(size=5), draw.normal(size=5)
    expected = None
    for way, (text, floating) in texts.items():
        robot = read_mjcf(text, floating=floating)
        assert robot.floating, way
        assert robot.joint_names[:3] == ("root_x", "root_z", "root_pitch")
        assert robot.mirror is not None
        np.testing.assert_array_equal(robot.model.mass, [0, 0, 5, 2, 2])
        found = (dynamics.mass_matrix(robot, q), dynamics.bias_force(robot, q, v))
        expected = expected or found
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-12 * np.abs(other).max(), err_msg=way)
        height = dynamics.center_of_mass(robot, robot.model.reference)[1]
        assert height == pytest.approx((1.0 if "world" in text and way != "chain" else 0.0) - 0.2)


def test_a_fixed_trunk_offers_to_float() -> None:
    with pytest.warns(RobotWarning, match="'trunk' is fixed to the world.*floating=True"):
        assert not read_mjcf(biped()).floating


def test_a_free_trunk_offers_to_float() -> None:
    with pytest.raises(RobotError, match=r"'root' of body 'trunk' is a free joint.*floating=True"):
        read_mjcf(biped(joint("floating")))


def test_a_root_in_another_plane_is_refused() -> None:
    with pytest.raises(RobotError, match="'root_TY' of body 'trunk' slides along"):
        read_mjcf(biped(joint("planar", "0 0 1")))


def test_what_cannot_float() -> None:
    with pytest.raises(RobotError, match=r"floating=True .* here are 0 such bodies"):
        load_robot("bravo7", floating=True)
    body = '<body><geom size="1"/></body>'
    with pytest.raises(RobotError, match="here are 2 such bodies"):
        read_mjcf(f"<mujoco><worldbody>{body}{body}</worldbody></mujoco>", floating=True)


def test_floating_takes_nothing_from_the_defaults_of_the_file() -> None:
    robot = read_mjcf(
        '<mujoco><default><joint damping="3" armature="2" range="-1 1" frictionloss="4"/></default>'
        '<worldbody><body name="trunk" pos="0.5 0 2" euler="0 0 180"><freejoint/>'
        '<geom size="0.1"/></body></worldbody></mujoco>',
        floating=True,
    )
    assert robot.floating  # the axes are the world's, though the trunk looks backward
    model = robot.model
    np.testing.assert_allclose(model.reference, [0.5, 2.0, 0.0])
    for values in (model.damping, model.armature, model.dry_friction):
        np.testing.assert_array_equal(values, 0.0)
    assert np.all(np.isinf(model.upper))


def test_limits_of_a_urdf() -> None:
    model = read_mjcf(biped(joint("planar"))).model
    np.testing.assert_array_equal(model.speed_limit, [np.inf] * 3 + [4.0] * 2)
    np.testing.assert_array_equal(model.torque_upper, [9.0, 9.0])
    free = read_mjcf(biped(joint("planar")).replace('velocity="4"', 'velocity="0"')).model
    assert np.all(np.isinf(free.speed_limit))  # what exporters write for nothing
    with pytest.raises(RobotError, match="'velocity' of <limit> of joint 'left_hip'"):
        read_mjcf(biped(joint("planar")).replace('velocity="4"', 'velocity="-4"'))


OBJ = """v -0.1 -0.05 0
v 0.2 -0.05 0
v 0.2 0.05 0
v -0.1 0.05 0
v 0 0 0.1
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
f 1 3 2
f 1 4 3
"""
MESH = '<collision><origin xyz="0 0 -0.4"/><geometry><mesh filename="{}"/></geometry></collision>'
PACKAGE = "package://biped_description/meshes/foot.obj"


def test_a_missing_collision_mesh_is_explained() -> None:
    text = biped(joint("planar"), MESH.format(PACKAGE).replace("obj", "stl"))
    with pytest.warns(RobotWarning, match=r"meshes of left_leg, right_leg are not where.*a box"):
        robot = read_mjcf(text)
    assert robot.nc == 0


def test_a_collision_mesh_stands_on_its_lowest_corners(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "foot.obj").write_text(OBJ)
    (tmp_path / "biped.urdf").write_text(biped(joint("planar"), MESH.format(PACKAGE)))
    robot = load_robot(tmp_path / "biped.urdf")
    np.testing.assert_allclose(
        robot.model.contact_position, [[-0.1, -0.4], [0.2, -0.4]] * 2, atol=1e-7
    )
    assert robot.contact_names[0] == "left_leg_heel"


def test_visual_meshes_need_not_be_there() -> None:
    visual = '<visual><geometry><mesh filename="package://x/nowhere.dae"/></geometry></visual>'
    assert read_mjcf(biped(joint("planar"), SPHERE + visual)).nc == 2


def without_inertial(text: str, link: str) -> str:
    """Return a URDF whose link has lost its ``<inertial>``."""
    start = text.index("<inertial>", text.index(f'"{link}"'))
    return text[:start] + text[text.index("</inertial>", start) + len("</inertial>") :]


def fixed(link: str, parent: str) -> str:
    """Return a link that is fixed to another, with a box and no ``<inertial>``."""
    box = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    return (
        f'<link name="{link}">{box}</link><joint name="{link}_weld" type="fixed">'
        f'<parent link="{parent}"/><child link="{link}"/></joint></robot>'
    )


def padded(text: str) -> str:
    """Return the biped with a pad fixed to either leg."""
    for side in ("left", "right"):
        text = text.replace("</robot>", fixed(f"{side}_pad", f"{side}_leg"))
    return text


@pytest.mark.parametrize(
    "how", [{}, {"projected": True}, {"forward": "x"}, {"floating": True}], ids=str
)
def test_shapes_without_inertial_weigh_nothing(how: LoadOptions) -> None:
    whole = biped(joint("planar"))
    plain = read_mjcf(whole, **how)
    with pytest.warns(RobotWarning, match="left_pad, right_pad have a <collision> and no") as told:
        robot = read_mjcf(padded(whole), **how)
    assert len(told) == 1
    np.testing.assert_array_equal(robot.model.mass, plain.model.mass)
    np.testing.assert_array_equal(robot.model.inertia, plain.model.inertia)
    assert robot.nc > plain.nc  # they touch the ground all the same


def test_a_file_that_asks_for_the_mass_of_shapes_gets_it() -> None:
    asked = '<mujoco><compiler inertiafromgeom="true"/></mujoco></robot>'
    whole = biped(joint("planar")).replace("</robot>", asked)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RobotWarning)
        heavier = read_mjcf(padded(whole))
    boxes = 2 * 1000.0 * 0.1**3
    assert heavier.total_mass == pytest.approx(read_mjcf(whole).total_mass + boxes)


def test_a_leg_that_has_lost_its_mass_is_refused() -> None:
    with (
        pytest.warns(RobotWarning, match="left_leg has a <collision>"),
        pytest.raises(RobotError, match=r"moves no mass.*or make it a fixed joint"),
    ):
        read_mjcf(without_inertial(biped(joint("planar")), "left_leg"))


def test_two_hinges_at_one_place_with_no_mass_between_them_are_refused() -> None:
    leg = (
        '<link name="between"/><joint name="one" type="continuous"><parent link="left_leg"/>'
        '<child link="between"/><axis xyz="0 1 0"/></joint>'
        f'{link("tip", 1, "")}<joint name="two" type="continuous">'
        '<parent link="between"/><child link="tip"/><origin xyz="AT"/><axis xyz="0 1 0"/></joint>'
    )
    text = biped(joint("planar"))
    with pytest.raises(RobotError, match="joints 'one' and 'two' can move together without"):
        read_mjcf(text.replace("</robot>", leg.replace("AT", "0 0 0") + "</robot>"))
    apart = read_mjcf(text.replace("</robot>", leg.replace("AT", "0 0 -0.1") + "</robot>"))
    assert apart.nv == 7


def test_a_link_without_mass_that_ends_a_leg_is_refused() -> None:
    text = biped(joint("planar")).replace(
        "</robot>",
        '<link name="tip"/><joint name="toe" type="continuous"><parent link="left_leg"/>'
        '<child link="tip"/><axis xyz="0 1 0"/></joint></robot>',
    )
    with pytest.raises(RobotError, match="joint 'toe' moves no mass"):
        read_mjcf(text)


# Projection


def humanoid(offset: float = 0.0, foot: str = "") -> str:
    """A free trunk; legs with hip roll, hip yaw and knee, the left one shifted by `offset`."""
    legs = "".join(
        f"""<body name="{side}_hip" pos="0 {y} 0">
          <joint name="{side}_roll" axis="1 0 0"/><joint name="{side}_yaw" axis="0 0 1"/>
          <joint name="{side}_pitch" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.05" contype="0" conaffinity="0"/>
          <body name="{side}_shank" pos="0 0 -0.4"><joint name="{side}_knee" axis="0 1 0"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.04"/></body></body>"""
        for side, y in (("right", -0.1), ("left", 0.1 + offset))
    )
    return f"""<mujoco model="humanoid"><worldbody><body name="trunk" pos="0 0 0.84">
      <freejoint name="root"/><geom type="box" size="0.1 0.15 0.3" pos="0 0 0.3"/>{legs}
      </body></worldbody><actuator><motor joint="left_roll"/><motor joint="left_knee"/>
      <motor joint="right_roll"/><motor joint="right_knee"/></actuator>
      <sensor><jointpos joint="left_roll"/></sensor>
      <keyframe><key qpos="0 0 1 1 0 0 0 0 0 0 0 0 0 0 0"/></keyframe></mujoco>"""


def test_a_symmetric_robot_is_projected() -> None:
    with pytest.raises(RobotError, match=r"'root' of body 'trunk' is a free joint.*projected=True"):
        read_mjcf(humanoid())
    with pytest.warns(RobotWarning) as caught:
        robot = read_mjcf(humanoid(), projected=True)
    (told,) = [str(one.message) for one in caught if "projected" in str(one.message)]
    assert "4 joints are locked: right_roll, right_yaw, left_roll, left_yaw." in told
    assert [(one.name, one.link, one.kind, one.axis) for one in robot.locked] == [
        (f"{side}_{name}", f"{side}_hip", "hinge", axis)
        for side in ("right", "left")
        for name, axis in (("roll", (1.0, 0.0, 0.0)), ("yaw", (0.0, 0.0, 1.0)))
    ]
    assert robot.joint_names[3:] == ("right_pitch", "right_knee", "left_pitch", "left_knee")
    assert robot.actuator_names == ("left_knee", "right_knee")
    assert robot.floating
    assert robot.mirror is not None
    assert robot.model.reference[1] == 0.84
    # A capsule of radius r with a shaft of length h, across its axis.
    r, h = 0.04, 0.4
    shaft, ball = 1000 * np.pi * r**2 * h, 1000 * 4 / 3 * np.pi * r**3
    inertia = shaft * (h**2 / 12 + r**2 / 4) + ball * (2 / 5 * r**2 + h**2 / 4 + 3 / 8 * h * r)
    assert robot.model.inertia[4] == pytest.approx(inertia, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (humanoid(offset=0.4), "centre of mass is .* m to the side of its middle"),
        (
            humanoid().replace('size="0.1 0.15 0.3"', 'size="0.1 0.15 0.3" euler="0 0 30"'),
            "products of inertia with y",
        ),
        (
            humanoid().replace('axis="0 1 0"', 'axis="0 0 1"'),
            "no joint of this robot moves",
        ),
    ],
)
def test_what_is_not_planar_by_symmetry_is_not_projected(text: str, words: str) -> None:
    with pytest.raises(RobotError, match=words):
        read_mjcf(text, projected=True)


def test_a_planar_robot_is_projected_onto_itself() -> None:
    one, other = load_robot("bravo7"), load_robot("bravo7", projected=True)
    for field, values in one.model.members().items():
        np.testing.assert_array_equal(other.model.members()[field], values, err_msg=field)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<limit lower", "<limits lower", "<limits> in <joint> .*did you mean 'limit'"),
        ("effort=", "efort=", "unknown attribute 'efort' .did you mean 'effort'"),
        ('lower="-1" ', "", "<limit> of joint 'left_hip' has no 'lower'"),
        ('upper="1"', 'upper="-1"', "range of joint 'left_hip' is empty, from -1 to -1"),
        ("<collision>", "<colision>", "<colision> in <link> .*did you mean 'collision'"),
    ],
)
def test_what_a_parser_would_pass_over_is_told(old: str, new: str, said: str) -> None:
    text = biped(joint("planar"))
    assert old in text
    changed = text.replace(old, new, 1)
    if "colision" in new:
        changed = changed.replace("</collision>", "</colision>", 1)
    with pytest.warns(RobotWarning, match=said):
        read_mjcf(changed)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'value="5"',
            'value="-5"',
            "'value' of <mass> of link 'trunk' is '-5'; it must not be neg",
        ),
        ('value="5"', 'value="5,5"', "'5,5', where a number must be"),
        ('iyy="0.1"', "", "<inertia> of link 'trunk' lacks 'iyy', which acts in the plane"),
        ('name="right_hip"', 'name="left_hip"', "two joints are called 'left_hip'"),
        ('xyz="0 1 0"', 'xyz="0 0 0"', "'xyz' of <axis> of joint 'root' is '0 0 0'|no direction"),
        ("<link", "<xacro:link", "Load it with xacro=True, if you trust it"),
    ],
)
def test_what_cannot_be_meant_is_refused(old: str, new: str, words: str) -> None:
    text = biped(joint("planar"))
    if "xacro" in new:
        text = text.replace("<link name", '<xacro:property name="a"/><link name', 1)
    else:
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(RobotError, match=words):
        read_mjcf(text)


def test_what_belongs_to_other_programs_is_left_alone() -> None:
    """Prefixes that nothing declares, materials, transmissions, Gazebo: no word about them."""
    more = (
        '<material name="m"><color rgba="1 0 0 1"/></material><gazebo reference="trunk"/>'
        '<transmission name="t"/><gazebo:plugin filename="x"/><ros2_control name="c"/>'
    )
    text = biped(joint("planar")).replace("</robot>", more + "</robot>")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=f".*({NO_MOTORS}|{NO_CONTACTS})")
        assert read_mjcf(text).nu == 2
