"""URDF as it is written in research: each idiom in a small file, and the robot it must become.

The judge is MuJoCo on a twin of the file that says the same of the plane in words MuJoCo takes.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import (
    FindingKind,
    Robot,
    RobotWarning,
    builtin_robots,
    inspect_robot,
    load_robot,
    read_mjcf,
)
from heelstrike.robot.library import NO_CONTACTS, NO_MOTORS

TOLERANCE = 1e-10  # of a few hundred products, relative to the largest entry

ROOT = (
    '<link name="world"/><link name="carriage"/><link name="lift"/>'
    '<joint name="root_x" type="prismatic"><parent link="world"/><child link="carriage"/>'
    '<axis xyz="1 0 0"/></joint>'
    '<joint name="root_z" type="prismatic"><parent link="carriage"/><child link="lift"/>'
    '<axis xyz="0 0 1"/></joint>'
    '<joint name="root_pitch" type="continuous"><parent link="lift"/><child link="trunk"/>'
    '<axis xyz="0 1 0"/></joint>'
)


def inertial(mass: float, moment: float, place: str = "0.01 0 -0.2") -> str:
    return (
        f'<inertial><origin xyz="{place}" rpy="0 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )


FOOT = '<collision><origin xyz="0 0 -0.4"/><geometry><sphere radius="0.02"/></geometry></collision>'


def walker(root: str = ROOT) -> str:
    """A trunk on two legs of thigh and shank; a line for every link and joint."""
    lines = ['<?xml version="1.0"?>', '<robot name="walker">', root]
    lines.append(f'<link name="trunk">{inertial(12, 1.33, "0.02 0 0.24")}</link>')
    for side in ("left", "right"):
        lines.append(f'<link name="{side}_thigh">{inertial(6.8, 0.47)}</link>')
        lines.append(
            f'<joint name="{side}_hip" type="revolute"><parent link="trunk"/>'
            f'<child link="{side}_thigh"/><origin xyz="0.01 0 -0.05" rpy="0 0.1 0"/>'
            '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="4"/></joint>'
        )
        lines.append(f'<link name="{side}_shank">{inertial(3.2, 0.2)}{FOOT}</link>')
        lines.append(
            f'<joint name="{side}_knee" type="revolute"><parent link="{side}_thigh"/>'
            f'<child link="{side}_shank"/><origin xyz="0 0 -0.4" rpy="0 0 0"/>'
            '<axis xyz="0 1 0"/><limit lower="0" upper="2" effort="9" velocity="4"/></joint>'
        )
    return "\n".join([*lines, "</robot>"])


def assert_judged(robot: Robot, text: str, *, tolerance: float = TOLERANCE) -> None:
    """Mass matrix and bias force are what MuJoCo has from a text, coordinate by coordinate."""
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.boundmass = spec.compiler.boundinertia = 2e-15  # of carriages without mass
    model = spec.compile()
    data = mujoco.MjData(model)
    place = [model.joint(name).id for name in robot.joint_names]
    assert sorted(place) == list(range(model.njnt))
    draw = np.random.default_rng(5)
    for _ in range(5):
        data.qpos[:], data.qvel[:] = draw.normal(size=(2, model.nv))
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        q, v = data.qpos[place], data.qvel[place]
        mass, bias = dynamics.mass_matrix(robot, q), dynamics.bias_force(robot, q, v)
        scale = np.abs(full).max()
        np.testing.assert_allclose(mass, full[np.ix_(place, place)], atol=tolerance * scale)
        expected = data.qfrc_bias[place]
        scale = np.abs(expected).max()
        np.testing.assert_allclose(bias, expected, atol=tolerance * scale)


@pytest.fixture(autouse=True)
def _loud() -> None:
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", message=f".*({NO_MOTORS}|{NO_CONTACTS})")


def changed(text: str, *changes: tuple[str, str], times: int = -1) -> str:
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, times)
    return text


def test_the_plain_walker_is_judged() -> None:
    assert_judged(read_mjcf(walker()), walker())


# Inertia


MOMENTS = 'ixx="0.47" iyy="0.47" izz="0.47" ixy="0" ixz="0" iyz="0"'


@pytest.mark.parametrize(
    "moments",
    [
        'ixx="0" iyy="0.47" izz="0" ixy="0" ixz="0" iyz="0"',
        'iyy="0.47"',
        'ixx="" iyy="0.47" ixy=""',
        'ixx="0.2349999" iyy="0.47" izz="0.235" ixy="0" ixz="0" iyz="0"',
    ],
    ids=["zero", "missing", "empty", "rounded"],
)
def test_moments_about_other_axes_do_not_count(moments: str) -> None:
    said = warnings.catch_warnings()
    with said:
        if "0.2349999" in moments:
            warnings.simplefilter("ignore", RobotWarning)
        robot = read_mjcf(changed(walker(), (MOMENTS, moments)))
    assert_judged(robot, walker())
    np.testing.assert_allclose(robot.model.inertia[3], 0.47, rtol=1e-14)


@pytest.mark.parametrize(
    "moments",
    [
        'ixx="0.01" iyy="0.47" izz="0.02" ixy="0" ixz="0" iyz="0"',
        'ixx="-1" iyy="0.47" izz="3" ixy="5" ixz="2" iyz="9"',
    ],
)
def test_impossible_moments_about_other_axes_are_said(moments: str) -> None:
    with pytest.warns(RobotWarning, match="no body has the inertia .* left_thigh, right_thigh"):
        robot = read_mjcf(changed(walker(), (MOMENTS, moments)))
    assert_judged(robot, walker())


def test_balanceinertia_does_not_replace_a_moment() -> None:
    """MuJoCo's advice for such files makes 0.157 of 0.47."""
    flat = 'ixx="0" iyy="0.47" izz="0" ixy="0" ixz="0" iyz="0"'
    extension = '<mujoco><compiler balanceinertia="true"/></mujoco></robot>'
    robot = read_mjcf(changed(walker(), (MOMENTS, flat), ("</robot>", extension)))
    assert_judged(robot, walker())


def test_the_moment_that_acts_is_that_about_the_normal() -> None:
    """The inertial frame is turned about x by a right angle, so that izz is the moment about y."""
    turned = changed(
        walker(),
        ('<origin xyz="0.01 0 -0.2" rpy="0 0 0"/><mass value="6.8"/>', "ORIGIN"),
        ("ORIGIN", '<origin xyz="0.01 0 -0.2" rpy="1.5707963267948966 0 0"/><mass value="6.8"/>'),
        (MOMENTS, 'izz="0.47"'),
    )
    assert_judged(read_mjcf(turned), walker())
    with pytest.raises(RobotError, match="'left_thigh' lacks 'izz', which acts in the plane"):
        read_mjcf(changed(turned, ('izz="0.47"', 'ixx="1" iyy="1"')))


@pytest.mark.parametrize(
    ("moments", "words"),
    [
        ('ixx="1" izz="1"', "'left_thigh' lacks 'iyy', which acts in the plane"),
        ('ixx="1" iyy="-0.47" izz="1"', "'left_thigh' has the moment of inertia -0.47 kg m²"),
    ],
)
def test_the_moment_that_acts_must_be_one(moments: str, words: str) -> None:
    with pytest.raises(RobotError, match=words):
        read_mjcf(changed(walker(), (MOMENTS, moments)))


def test_planar_moments_are_no_finding(tmp_path: Path) -> None:
    flat = 'ixx="0" iyy="0.47" izz="0" ixy="0" ixz="0" iyz="0"'
    path = tmp_path / "walker.urdf"
    path.write_text(changed(walker(), (MOMENTS, flat)))
    assert inspect_robot(path).loadable
    assert all(one.kind is not FindingKind.INERTIA for one in inspect_robot(path).findings)


def test_a_mass_without_inertia_is_a_point() -> None:
    text = changed(walker(), (f"<inertia {MOMENTS}/>", ""))
    with pytest.warns(RobotWarning, match="left_thigh, right_thigh have a <mass> and no <inertia>"):
        robot = read_mjcf(text)
    np.testing.assert_allclose(robot.model.inertia[[3, 5]], 0.0, atol=1e-30)
    np.testing.assert_array_equal(robot.model.mass[[3, 5]], 6.8)
    tiny = MOMENTS.replace("0.47", "1e-13")
    assert_judged(robot, changed(walker(), (MOMENTS, tiny)))


def test_a_mass_that_is_none_needs_no_inertia() -> None:
    bare = '<link name="lift"><inertial><mass value="0.0"/></inertial></link>'
    assert_judged(read_mjcf(changed(walker(), ('<link name="lift"/>', bare))), walker())


TILTED = """<mujoco><compiler {}/><worldbody><body><joint axis="0 1 0"/>
  <inertial pos="0 0 -1" mass="2" diaginertia="0.1 {} 0.1"/><geom size="0.1" mass="3"/>
  </body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("compiler", "moment", "expected"),
    [
        ('settotalmass="6"', 0.9, 2.7),
        ('inertiafromgeom="true"', 0.9, 0.4 * 3 * 0.1**2),
        ('boundinertia="0.3"', 0.0001, 0.3),
        ('balanceinertia="true"', 0.9, 1.1 / 3.0),
    ],
)
def test_what_the_compiler_of_an_mjcf_asks_for_holds(
    compiler: str, moment: float, expected: float
) -> None:
    """MuJoCo's own attributes change moments that are possible, and those that are not alike."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = read_mjcf(TILTED.format(compiler, moment))
    np.testing.assert_allclose(robot.model.inertia, expected, rtol=1e-13)


# Links, joints, shapes


def test_a_sphere_of_radius_zero_is_a_point() -> None:
    robot = read_mjcf(changed(walker(), ('radius="0.02"', 'radius="0"')))
    np.testing.assert_array_equal(robot.model.contact_radius, 0.0)
    np.testing.assert_allclose(np.hypot(*robot.model.contact_position.T), 0.4, rtol=1e-15)
    ball = '<mujoco><worldbody><body><joint axis="0 1 0"/><geom size="0.1"/>{}</body></worldbody>'
    point = '<geom type="sphere" size="0" pos="0.2 0 0"/>'
    found = read_mjcf(ball.format(point) + "</mujoco>").model
    np.testing.assert_array_equal(found.contact_radius, [0.1, 0.0])


@pytest.mark.parametrize(
    "change",
    [
        ('<link name="world"/>', ""),
        ('<link name="world"/>', f'<link name="world">{inertial(0, 0)}</link>'),
        (
            '<link name="world"/>',
            '<link name="base"/><link name="world"/><joint name="up" type="fixed">'
            '<parent link="base"/><child link="world"/><axis xyz="0 0 0"/></joint>',
        ),
        (
            '<link name="world"/>',
            '<link name="world"/><link name="ground"/><joint name="up" type="fixed">'
            '<parent link="world"/><child link="ground"/><axis xyz="0 0 0"/></joint>',
        ),
    ],
    ids=["not written", "with inertia", "below another", "zero axis"],
)
def test_the_world(change: tuple[str, str]) -> None:
    robot = read_mjcf(changed(walker(), change))
    assert robot.floating
    assert_judged(robot, walker())


def test_a_zero_axis_of_a_joint_that_moves_is_refused() -> None:
    text = changed(
        walker(), ('<axis xyz="0 1 0"/><limit lower="0"', '<axis xyz="0 0 0"/><limit lower="0"')
    )
    with pytest.raises(RobotError, match="line 8: 'xyz' of <axis> of joint 'left_knee' is zero"):
        read_mjcf(text)


def test_of_two_dynamics_the_first_counts() -> None:
    two = '<dynamics damping="1"/><dynamics damping="50" friction="2"/><limit lower="0"'
    with pytest.warns(RobotWarning, match="left_knee, right_knee have two <dynamics>; the first"):
        model = read_mjcf(changed(walker(), ('<limit lower="0"', two))).model
    np.testing.assert_array_equal(model.damping[[4, 6]], 1.0)
    np.testing.assert_array_equal(model.dry_friction, 0.0)


def test_a_robot_without_joints_floats() -> None:
    text = f'<robot name="wheel"><link name="hub">{inertial(3, 0.2)}</link></robot>'
    robot = read_mjcf(text)
    assert robot.floating
    np.testing.assert_array_equal(robot.model.mass, [0, 0, 3])


# Text


@pytest.mark.parametrize(
    "text",
    [
        walker() + "\0",
        walker() + "\n\0\0\n",
        "\ufeff" + walker(),
        walker() + "\n\ufeff",
        "\ufeff\ufeff\n" + walker(),
        "\n\n" + walker(),
        walker().replace("version", "vertsion"),
        walker().replace("<robot", "<!-- two -- hyphens -- in it -->\n<robot", 1),
    ],
    ids=["null", "nulls", "mark", "mark behind", "marks", "blank", "declaration", "comment"],
)
def test_what_editors_leave_around_a_file(text: str, tmp_path: Path) -> None:
    path = tmp_path / "walker.urdf"
    path.write_text(text, encoding="utf-8")
    assert_judged(load_robot(path), walker())
    # Line numbers are those of this very file, whatever was mended.
    spoilt = text.replace('mass value="12"', 'mass value="-12"')
    line = spoilt[: spoilt.index('"-12"')].count("\n") + 1
    path.write_text(spoilt, encoding="utf-8")
    with pytest.raises(RobotError, match=rf"line {line}: 'value' of <mass> of link 'trunk'"):
        load_robot(path)


def test_lines_of_the_parsers_own_errors_are_those_of_the_file(tmp_path: Path) -> None:
    text = walker().replace("revolute", "revolving")
    line = text[: text.index("revolving")].count("\n") + 1
    path = tmp_path / "walker.urdf"
    path.write_text(text)
    with pytest.raises(RobotError, match=rf"line {line}\b"):
        load_robot(path)


def test_what_is_left_of_a_file_of_nulls_is_no_robot(tmp_path: Path) -> None:
    path = tmp_path / "walker.urdf"
    path.write_bytes(b"\0" * 100)
    with pytest.raises(RobotError, match="not a text file"):
        load_robot(path)


# The root


def root(order: str, senses: tuple[int, int, int] = (1, 1, 1)) -> str:
    """A floating base by joints in some order."""
    kinds = {
        "x": ("prismatic", (1, 0, 0)),
        "z": ("prismatic", (0, 0, 1)),
        "pitch": ("continuous", (0, 1, 0)),
    }
    links = ["world", "first", "second", "trunk"]
    text = '<link name="world"/><link name="first"/><link name="second"/>'
    for k, name in enumerate(order.split()):
        kind, axis = kinds[name]
        sense = senses[list(kinds).index(name)]
        vector = " ".join(str(sense * value) for value in axis)
        text += (
            f'<joint name="root_{name}" type="{kind}"><parent link="{links[k]}"/>'
            f'<child link="{links[k + 1]}"/><axis xyz="{vector}"/></joint>'
        )
    return text


def test_a_root_in_another_order_is_put_in_order() -> None:
    text = walker(root("z x pitch"))
    with pytest.warns(RobotWarning, match="another order or sense .* root_x, root_z, root_pitch"):
        robot = read_mjcf(text)
    assert robot.floating
    assert robot.joint_names[:3] == ("root_x", "root_z", "root_pitch")
    assert_judged(robot, text)


def test_a_root_of_other_senses_is_turned() -> None:
    """Positive forward, upward and leaning forward: three signs against MuJoCo's coordinates."""
    text = walker(root("z x pitch", (-1, 1, -1)))
    with pytest.warns(RobotWarning, match="another order or sense"):
        robot = read_mjcf(text)
    assert robot.floating
    plain = read_mjcf(walker())
    for name, values in plain.model.members().items():
        np.testing.assert_allclose(robot.model.members()[name], values, atol=1e-15, err_msg=name)


@pytest.mark.parametrize("order", ["pitch x z", "x pitch z"])
def test_a_root_that_turns_before_it_slides_stays_as_it_is(order: str) -> None:
    with pytest.warns(RobotWarning, match="floats, but not by slide along x, slide along z, hinge"):
        robot = read_mjcf(walker(root(order)))
    assert not robot.floating
    assert_judged(robot, walker(root(order)))


def test_carriages_that_weigh_something_stay_in_their_order() -> None:
    text = walker(root("z x pitch"))
    text = changed(text, ('<link name="first"/>', f'<link name="first">{inertial(1, 0.1)}</link>'))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = read_mjcf(text)
    assert robot.joint_names[0] == "root_z"
    assert not robot.floating
    assert_judged(robot, text)


# Rounded axes


def rounded(angle: str) -> str:
    """The walker with hips and knees about z of frames that are turned about x and back."""
    text = changed(
        walker(),
        ('rpy="0 0.1 0"/><axis xyz="0 1 0"/>', f'rpy="{angle} 0 0"/><axis xyz="0 0 -1"/>'),
        ('rpy="0 0 0"/><axis xyz="0 1 0"/>', 'rpy="0 0 0"/><axis xyz="0 0 -1"/>'),
    )
    # Thighs and shanks are drawn in turned frames.
    text = text.replace('<origin xyz="0.01 0 -0.2" rpy="0 0 0"/>', '<origin xyz="0.01 0.2 0"/>')
    text = text.replace('<origin xyz="0 0 -0.4"', '<origin xyz="0 0.4 0"')
    assert text.count('xyz="0.01 0.2 0"') == 4
    return text


EXACT = "-1.5707963267948966"


@pytest.mark.parametrize(
    ("angle", "off"),
    [("-1.57", 8e-4), ("-1.5708", 3.7e-6), ("-1.571", 2.1e-4), ("-1.570796", 3e-7)],
)
def test_axes_are_snapped_into_the_plane(angle: str, off: float) -> None:
    """What comes of it is the robot of the exact angle, and is said."""
    text = rounded(angle)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = read_mjcf(text)
    said = [str(one.message) for one in caught]
    assert len(said) == (off > 1e-6)
    if said:
        (found,) = re.findall(r"left_hip by ([\d.e-]+)", said[0])
        assert float(found) == pytest.approx(off, rel=0.1)
        assert "left_knee" not in said[0]  # which is turned with the hip
    assert_judged(robot, rounded(EXACT))
    assert robot.locked == ()


def test_what_was_snapped_is_what_is_saved(tmp_path: Path) -> None:
    with pytest.warns(RobotWarning, match="axes that miss the x–z plane"):
        robot = read_mjcf(rounded("-1.57"))
    path = robot.save(tmp_path / "snapped.urdf")
    assert_judged(robot, path.read_text("utf-8"))


def test_rounding_does_not_add_up_along_a_chain() -> None:
    """Twelve joints, each turned by 1.57 against the one before: the last would be off by 0.01."""
    text = '<robot name="chain"><link name="world"/>'
    last = "world"
    for k in range(12):
        text += f'<link name="l{k}">{inertial(1, 0.1)}</link><joint name="j{k}" type="continuous">'
        axis = ("0 0 -1", "0 -1 0", "0 0 1", "0 1 0")[k % 4]
        text += (
            f'<parent link="{last}"/><child link="l{k}"/><origin xyz="0.1 0 0" rpy="-1.57 0 0"/>'
        )
        text += f'<axis xyz="{axis}"/></joint>'
        last = f"l{k}"
    text += "</robot>"
    with pytest.warns(RobotWarning, match="j0 by 0.0008.*j11 by 0.0008"):
        robot = read_mjcf(text)
    np.testing.assert_array_equal(np.abs(robot.model.axis[:, 0]), 1.0)
    assert_judged(robot, text.replace("-1.57 ", EXACT + " "))
    with pytest.warns(RobotWarning, match="axes that miss"):
        assert read_mjcf(text, projected=True).locked == ()


def test_an_axis_given_with_few_digits_is_snapped() -> None:
    text = changed(
        walker(), ('<axis xyz="0 1 0"/><limit', '<axis xyz="0.0006 0.9999 -0.0007"/><limit')
    )
    with pytest.warns(RobotWarning, match="left_hip by 0.0009"):
        robot = read_mjcf(text)
    np.testing.assert_array_equal(robot.model.axis[3:, 0], 1.0)


def test_a_joint_that_is_meant_to_leave_the_plane_is_not_snapped() -> None:
    text = changed(walker(), ('<axis xyz="0 1 0"/><limit', '<axis xyz="0.01 1 0"/><limit'))
    with pytest.raises(RobotError, match="'left_hip' of body 'left_thigh' turns about"):
        read_mjcf(text)


# Packages


STL = bytes(80) + (4).to_bytes(4, "little")
CORNERS = np.array([[-0.1, -0.05, 0], [0.2, -0.05, 0], [0, 0.05, 0], [0, 0, 0.1]], dtype="<f4")
for face in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)):
    STL += bytes(12) + CORNERS[list(face)].tobytes() + bytes(2)

WAYS = [
    "beside",
    "upward",
    "named upward",
    "ROS_PACKAGE_PATH",
    "deep",
    "ament",
    "argument",
    "the package",
]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("scheme", ["package://", "model://"])
def test_packages_are_found(
    way: str, scheme: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots = tmp_path / "somewhere" / "robots" / "urdf"
    robots.mkdir(parents=True)
    package = {
        "beside": robots / "walker_description",
        "upward": tmp_path / "somewhere" / "walker_description",
        "named upward": tmp_path / "somewhere",
        "ROS_PACKAGE_PATH": tmp_path / "ros" / "walker_description",
        "deep": tmp_path / "ros" / "stack" / "other_name",
        "ament": tmp_path / "install" / "share" / "walker_description",
        "argument": tmp_path / "mine" / "walker_description",
        "the package": tmp_path / "mine" / "walker_description",
    }[way]
    (package / "meshes").mkdir(parents=True)
    (package / "meshes" / "foot.STL").write_bytes(STL)
    manifest = "<package><name>walker_description</name></package>"
    (package / "package.xml").write_text(manifest, encoding="utf-8")
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    path = robots / "walker.urdf"
    mesh = f'<mesh filename="{scheme}walker_description/meshes/foot.STL"/>'
    path.write_text(changed(walker(), ('<sphere radius="0.02"/>', mesh)))
    how: dict[str, object] = {}
    if way in ("ROS_PACKAGE_PATH", "deep", "ament", "argument", "the package"):
        with pytest.warns(RobotWarning, match="meshes of left_shank, right_shank are not where"):
            assert load_robot(path).nc == 0
    if way in ("ROS_PACKAGE_PATH", "deep"):
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    elif way == "ament":
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    elif way == "argument":
        how = {"package_path": tmp_path / "mine"}
    elif way == "the package":
        how = {"package_path": [tmp_path / "nothing", package]}
    robot = load_robot(path, **how)  # type: ignore[arg-type]
    assert robot.nc == 4


@pytest.mark.parametrize("content", [b"solid ascii\nfacet", b"version https://git-lfs", STL[:100]])
def test_a_mesh_that_no_parser_reads_is_left_out(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "foot.stl").write_bytes(content)
    path = tmp_path / "walker.urdf"
    path.write_text(changed(walker(), ('<sphere radius="0.02"/>', '<mesh filename="foot.stl"/>')))
    with pytest.warns(RobotWarning, match=r"or no meshes that MuJoCo reads .*'foot.stl'"):
        assert load_robot(path).nc == 0


# What comes in goes out


@pytest.mark.parametrize("name", [name for name in builtin_robots() if name != "rimless_wheel"])
def test_planar_moments_of_every_built_in_robot(name: str, tmp_path: Path) -> None:
    """Saved as URDF, their other moments taken away: the same robot."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        path = load_robot(name).save(tmp_path / "robot.urdf")
        saved = load_robot(path)
        flat = re.sub(r'(ixx|izz)="[^"]*"', r'\1="0"', path.read_text("utf-8"))
        robot = read_mjcf(flat)
    np.testing.assert_allclose(robot.model.inertia, saved.model.inertia, rtol=1e-13, atol=1e-17)


# Dialects


def test_a_free_trunk_on_a_base_that_weighs_nothing(tmp_path: Path) -> None:
    free = (
        '<link name="base"/><joint name="free" type="floating"><parent link="base"/>'
        '<child link="trunk"/><origin xyz="0 0 1"/><axis xyz="0 0 0"/></joint>'
    )
    with pytest.raises(RobotError, match="'free' of body 'trunk' is a free joint"):
        read_mjcf(walker(free))
    robot = read_mjcf(walker(free), floating=True)
    assert_judged(robot, walker())
    np.testing.assert_array_equal(robot.model.reference[:3], [0.0, 1.0, 0.0])


def test_joints_of_drake_and_dojo() -> None:
    plain = walker(
        '<link name="world"/><joint name="root" type="planar"><parent link="world"/>'
        '<child link="trunk"/><axis xyz="0 1 0"/></joint>'
    )
    drake = changed(plain, ('<joint name="root"', '<drake:joint name="root"'), times=1)
    drake = changed(drake, ("</joint>", "</drake:joint>"), times=1)
    for text in (drake, changed(plain, ("planar", "planaraxis"))):
        robot = read_mjcf(text)
        assert robot.floating
        assert_judged(robot, walker())


def test_a_ball_of_dojo_keeps_its_pitch_when_projected() -> None:
    old = 'name="left_knee" type="revolute"'
    text = changed(walker(), (old, old.replace("revolute", "ball")))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = read_mjcf(text, projected=True)
    assert [one.name for one in robot.locked] == ["left_knee"]
    assert_judged(robot, walker())


def test_shapes_that_nobody_knows_are_left_out() -> None:
    capsule = '<drake:capsule radius="0.02" length="0.1"/>'
    robot = read_mjcf(changed(walker(), ('<sphere radius="0.02"/>', capsule)))
    assert robot.nc == 4
    for shape in ("", '<drake:ellipsoid a="1" b="1" c="1"/>'):
        with pytest.warns(RobotWarning, match="left_shank, right_shank have collision shapes that"):
            assert read_mjcf(changed(walker(), ('<sphere radius="0.02"/>', shape))).nc == 0


def test_an_ornament_whose_mesh_is_not_there_weighs_nothing() -> None:
    camera = (
        '<link name="camera"><collision><geometry><mesh filename="package://no/camera.obj"/>'
        '</geometry></collision></link><joint name="mount" type="fixed"><parent link="trunk"/>'
        '<child link="camera"/></joint></robot>'
    )
    with pytest.warns(RobotWarning, match="collision meshes of camera are not where"):
        robot = read_mjcf(changed(walker(), ("</robot>", camera)))
    assert_judged(robot, walker())
