"""Robots of three dimensions in the plane: which plane, what is locked, where, and why.

The judge is MuJoCo on the file as it is, in space. The planar robot moves in it by v = P w, P being
constant, so that its mass matrix is PᵀMP and its bias force Pᵀh: what holds the locked joints and
the plane does no work. No line of this knows how the planar robot was made.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import (
    LockedJoint,
    Robot,
    RobotWarning,
    inspect_robot,
    load_robot,
    read_mjcf,
)
from heelstrike.robot.files.options import LoadOptions
from heelstrike.robot.inspection import facts

Floats = NDArray[np.float64]

TOLERANCE = 1e-10

# Sense of the planar pitch about the axis of the file, and the file's horizontal axis of walking.
FORWARD = {"x": (0, +1, 1), "y": (1, -1, 0), "-x": (0, -1, 1), "-y": (1, +1, 0)}


def judged(
    robot: Robot,
    text: str,
    *,
    forward: str = "x",
    locked: Mapping[str, float] | None = None,
) -> None:
    """Hold mass matrix and bias force against MuJoCo's of the unprojected file."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    along, sense, across = FORWARD[forward]
    ahead = 1.0 if forward in ("x", "y") else -1.0
    draw = np.random.default_rng(7)
    for _ in range(5):
        q = robot.model.reference + 0.5 * draw.normal(size=robot.nq)
        v = draw.normal(size=robot.nv)
        data.qpos[:] = model.qpos0
        for name, value in (locked or {}).items():
            data.qpos[model.joint(name).qposadr[0]] = value
        columns = np.zeros((model.nv, robot.nv))
        for k, name in enumerate(robot.joint_names):
            if name in ("root_x", "root_z", "root_pitch"):
                continue
            joint = model.joint(name)
            place, dof = joint.qposadr[0], joint.dofadr[0]
            if joint.type[0] == mujoco.mjtJoint.mjJNT_BALL:
                data.qpos[place : place + 4] = [np.cos(q[k] / 2), 0, np.sin(q[k] / 2), 0]
                columns[dof + 1, k] = 1.0
            else:
                data.qpos[place] = q[k]
                columns[dof, k] = 1.0
        if robot.floating:
            assert model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
            data.qpos[along], data.qpos[2] = ahead * q[0], q[1]
            data.qpos[3:7] = 0.0
            data.qpos[3] = np.cos(q[2] / 2)
            data.qpos[4 + across] = sense * np.sin(q[2] / 2)
            columns[along, 0], columns[2, 1] = ahead, 1.0
            columns[3 + across, 2] = sense
        data.qvel[:] = columns @ v
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        mass, bias = columns.T @ full @ columns, columns.T @ data.qfrc_bias
        scale = np.abs(mass).max()
        np.testing.assert_allclose(
            dynamics.mass_matrix(robot, q), mass, atol=TOLERANCE * scale, err_msg="mass matrix"
        )
        scale = np.abs(bias).max()
        np.testing.assert_allclose(
            dynamics.bias_force(robot, q, v), bias, atol=TOLERANCE * scale, err_msg="bias force"
        )


def humanoid(*, hip: str = "", swap: bool = False, more: str = "", end: str = "") -> str:
    """A free trunk, legs with roll, yaw, pitch and knee, their masses off the plane.

    With `swap` it looks along y: x and y of every vector change places, one of them its sign.
    """

    def vector(x: float, y: float, z: float) -> str:
        return f"{-y} {x} {z}" if swap else f"{x} {y} {z}"

    legs = "".join(
        f"""<body name="{side}_hip" pos="{vector(0.01, y, -0.1)}">
          <joint name="{side}_roll" axis="{vector(1, 0, 0)}"/>
          <joint name="{side}_yaw" axis="0 0 1"/>
          {hip.format(side) or f'<joint name="{side}_pitch" axis="{vector(0, 1, 0)}"/>'}
          <inertial pos="{vector(0.02, y / 3, -0.2)}" mass="3" diaginertia="0.05 0.05 0.02"/>
          <body name="{side}_shank" pos="{vector(0, 0, -0.4)}">
            <joint name="{side}_knee" axis="{vector(0, 1, 0)}" damping="0.3"/>
            <inertial pos="{vector(0.01, y / 5, -0.2)}" mass="2" diaginertia="0.03 0.03 0.01"/>
            <geom type="box" size="{"0.02 0.1" if swap else "0.1 0.02"} 0.01" mass="0"
              pos="{vector(0.03, 0, -0.4)}"/></body></body>"""
        for side, y in (("right", -0.1), ("left", 0.1))
    )
    return f"""<mujoco model="humanoid"><compiler angle="radian"/><worldbody>
      <body name="trunk" pos="0 0 0.94"><freejoint name="root"/>
      <inertial pos="{vector(0.02, 0, 0.3)}" mass="20"
        diaginertia="{"1.1 1" if swap else "1 1.1"} 0.4"/>{legs}{more}
      </body></worldbody><actuator><motor joint="left_roll"/><motor joint="left_knee"/>
      <motor joint="right_roll"/><motor joint="right_knee"/></actuator>{end}</mujoco>"""


LEVELLED = """<mujoco><compiler angle="radian"/><worldbody><body name="trunk" pos="0 0 1">
  <freejoint/><inertial pos="0 0 0.2" mass="10" diaginertia="1 1 1"/>
  <body name="left_hip" pos="0 0.1 0" euler="0.3 0 0"><joint name="left_roll" axis="1 0 0"/>
    <inertial pos="0 0.01 -0.1" mass="1" diaginertia="0.1 0.2 0.3"/>
    <body name="left_leg"><joint name="left_pitch" axis="0 1 0" range="-1 1"/>
    <inertial pos="0.05 0 -0.3" mass="2" diaginertia="0.1 0.2 0.15"/></body></body>
  <body name="right_hip" pos="0 -0.1 0" euler="-0.3 0 0"><joint name="right_roll" axis="1 0 0"/>
    <inertial pos="0 -0.01 -0.1" mass="1" diaginertia="0.1 0.2 0.3"/>
    <body name="right_leg"><joint name="right_pitch" axis="0 1 0" range="-1 1"/>
    <inertial pos="0.05 0 -0.3" mass="2" diaginertia="0.1 0.2 0.15"/></body></body>
</body></worldbody></mujoco>"""


@pytest.fixture(autouse=True)
def _quiet() -> None:
    warnings.simplefilter("ignore", RobotWarning)


def test_a_projected_robot_is_judged_in_space() -> None:
    robot = read_mjcf(humanoid(), projected=True)
    assert robot.floating
    assert robot.mirror is not None
    judged(robot, humanoid())


def test_what_is_locked_is_a_table(tmp_path: Path) -> None:
    path = tmp_path / "humanoid.xml"
    path.write_text(LEVELLED)
    level = {"left_roll": -0.3, "right_roll": 0.3}
    assert load_robot(path, projected=True, pose=level).locked == tuple(
        LockedJoint(name, link, "hinge", (1.0, 0.0, 0.0), level[name], "leaves the plane")
        for name, link in (("left_roll", "left_hip"), ("right_roll", "right_hip"))
    )
    inspection = inspect_robot(path, projected=True, pose=level)
    shown = "left_roll   left_hip   hinge  1, 0, 0  -0.3  leaves the plane"
    assert shown in inspection.text()
    told = facts(inspection)["locked"]
    assert [(one["name"], one["position"]) for one in told] == list(level.items())


# The plane


@pytest.mark.parametrize("forward", [None, "y"])
def test_a_robot_that_looks_along_y_is_turned(forward: str | None) -> None:
    text = humanoid(swap=True)
    robot = read_mjcf(text, projected=True, forward=forward)
    judged(robot, text, forward="y")
    plain = read_mjcf(humanoid(), projected=True)
    for name, values in plain.model.members().items():
        np.testing.assert_allclose(robot.model.members()[name], values, atol=1e-15, err_msg=name)


def test_that_a_robot_was_turned_is_said() -> None:
    with pytest.warns(RobotWarning, match=r'moves in its y–z plane only.*forward="y"'):
        read_mjcf(humanoid(swap=True), projected=True)


@pytest.mark.parametrize("forward", ["x", "-x"])
def test_a_robot_may_look_backward(forward: str) -> None:
    robot = read_mjcf(humanoid(), projected=True, forward=forward)
    sense = 1.0 if forward == "x" else -1.0
    np.testing.assert_array_equal(robot.model.axis[3:, 0], sense)
    judged(robot, humanoid(), forward=forward)


def test_the_other_plane_of_a_robot_is_refused_by_its_sides() -> None:
    """In its frontal plane a robot has joints that move, too: they are not its gait."""
    with pytest.raises(RobotError, match=r"left and right lie one behind the other.*forward="):
        read_mjcf(humanoid(), projected=True, forward="y")


PENDULUM = """<mujoco><worldbody><body name="a"><joint name="a" axis="{0}"/>
  <geom size="0.1" pos="0.1 0.2 -0.3"/><body name="b" pos="0 0 -1"><joint name="b" axis="{1}"/>
  <geom size="0.2" pos="0.1 0.1 -0.5"/></body></body></worldbody></mujoco>"""


def test_a_planar_robot_of_the_other_plane_is_turned() -> None:
    text = PENDULUM.format("1 0 0", "-1 0 0")
    with pytest.warns(RobotWarning, match="y–z plane only"):
        robot = read_mjcf(text)
    np.testing.assert_array_equal(robot.model.axis[:, 0], [-1.0, 1.0])
    judged(robot, text, forward="y")
    with pytest.raises(RobotError, match=r"'a' of body 'a' turns about \(1, 0, 0\)"):
        read_mjcf(text, forward="x")


def test_a_robot_of_no_plane_is_told_of_its_own() -> None:
    with pytest.raises(RobotError, match=r"'b' of body 'b' turns about \(1, 0, 0\)"):
        read_mjcf(PENDULUM.format("0 1 0", "1 0 0"))


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"forward": "z"}, "forward is one of x, y, -x, -y, not 'z'"),
        ({"mirror": "left"}, "mirror is 'average' or left out, not 'left'"),
        ({"pose": {"left_rol": 1.0}}, "no such joint. Did you mean 'left_roll'"),
        ({"pose": {"left_roll": float("nan")}}, "pose of joint 'left_roll' is nan"),
        ({"pose": {"root": 1.0}}, "'root', a joint that no one number moves"),
    ],
)
def test_options_that_make_no_sense(option: dict[str, object], words: str) -> None:
    with pytest.raises(RobotError, match=words):
        read_mjcf(humanoid(), projected=True, **option)  # type: ignore[arg-type]


# The pose


def test_a_pose_that_tilts_all_axes_leaves_nothing() -> None:
    with pytest.raises(RobotError, match="no joint of this robot moves in the x–z plane"):
        read_mjcf(LEVELLED, projected=True, pose={"left_roll": 0.2, "right_roll": -0.2})


def test_hips_are_levelled_by_the_pose() -> None:
    """Hips that are drawn rolled outwards: locked level, their pitch is in the plane."""
    with pytest.raises(RobotError, match="no joint of this robot moves in the x–z plane"):
        read_mjcf(LEVELLED, projected=True)
    level = {"left_roll": -0.3, "right_roll": 0.3}
    robot = read_mjcf(LEVELLED, projected=True, pose=level)
    assert robot.joint_names[3:] == ("left_pitch", "right_pitch")
    judged(robot, LEVELLED, locked=level)


def test_the_pose_of_a_joint_that_stays_is_the_reference() -> None:
    knees = {"left_knee": 0.6, "right_knee": 0.6}
    bent = read_mjcf(humanoid(), projected=True, pose=knees)
    plain = read_mjcf(humanoid(), projected=True)
    assert bent.positions(bent.reference_state())["left_knee"] == 0.6
    draw = np.random.default_rng(0)
    q = draw.normal(size=bent.nq)
    for query in (dynamics.mass_matrix, dynamics.gravity_force):
        np.testing.assert_allclose(query(bent, q), query(plain, q), atol=1e-12)
    judged(bent, humanoid())


def test_a_pose_outside_the_range_is_refused() -> None:
    with pytest.raises(RobotError, match=r"'left_pitch' at 30, outside its range -1 … 1 \(rad"):
        read_mjcf(LEVELLED, pose={"left_pitch": 30.0}, projected=True)


# Joints that follow others, balls, fixed roots


ARM = """<body name="arm" pos="0 0 0.4"><joint name="arm_yaw" axis="0 0 1"/>
  <inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/>
  <body name="hand" pos="0 0 0.3"><joint name="hand_pitch" axis="0 1 0"/>
  <inertial pos="0.1 0 0" mass="0.5" diaginertia="0.02 0.02 0.02"/></body></body>"""
FOLLOWS = '<equality><joint joint1="hand_pitch" joint2="{}" polycoef="0.1 2 0 0 0"/></equality>'


def test_a_joint_that_follows_a_locked_one_is_locked_where_that_puts_it() -> None:
    text = humanoid(more=ARM, end=FOLLOWS.format("arm_yaw"))
    robot = read_mjcf(text, projected=True)
    table = {one.name: (one.position, one.reason) for one in robot.locked}
    assert table["arm_yaw"] == (0.0, "leaves the plane")
    assert table["hand_pitch"] == (0.1, "follows arm_yaw")
    judged(robot, text, locked={"hand_pitch": 0.1})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read_mjcf(text, projected=True)
    assert not any("equality" in str(one.message) for one in caught)


def test_a_locked_leader_leads_to_where_the_pose_has_it() -> None:
    text = humanoid(more=ARM.replace('0 0 1"/>', '1 0 0"/>'), end=FOLLOWS.format("arm_yaw"))
    robot = read_mjcf(text, projected=True, pose={"arm_yaw": 0.01})
    assert {one.name: one.position for one in robot.locked}["hand_pitch"] == pytest.approx(0.12)


def test_a_joint_that_follows_one_in_the_plane_is_coupled_to_it() -> None:
    text = humanoid(more=ARM, end=FOLLOWS.format("left_knee"))
    robot = read_mjcf(text, projected=True)
    names = [robot.joint_names[joint] for joint in robot.model.coupling_joint[0]]
    assert names == ["hand_pitch", "left_knee"]
    state = robot.closed(robot.state({"left_knee": 0.1}), keep=["left_knee"])
    assert robot.positions(state)["hand_pitch"] == pytest.approx(0.1 + 2.0 * 0.1)


def test_mimic_of_a_urdf() -> None:
    """Finger 2 follows finger 1, which turns about x and is locked; the arm stays."""
    one = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>'
    joint = (
        '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{0}_link"/>'
        '<origin xyz="0 0 0.3"/><axis xyz="{2}"/>{3}</joint><link name="{0}_link">'
        + one
        + "</link>"
    )
    mimic = '<mimic joint="finger1" multiplier="-1.5" offset="0.2"/>'
    text = (
        '<robot name="hand"><link name="world"/>'
        + joint.format("arm", "world", "0 1 0", "")
        + joint.format("finger1", "arm_link", "1 0 0", "")
        + joint.format("finger2", "arm_link", "0 1 0", mimic)
        + "</robot>"
    )
    robot = read_mjcf(text, projected=True, pose={"finger1": 0.1})
    assert robot.joint_names == ("arm",)
    assert {one.name: one.position for one in robot.locked} == {
        "finger1": 0.1,
        "finger2": pytest.approx(0.2 - 0.15),
    }


def test_a_ball_joint_keeps_its_pitch() -> None:
    ball = '<joint name="{}_ball" type="ball" damping="0.5" range="0 1" limited="true"/>'
    text = humanoid(hip=ball)
    end = "</actuator>"
    text = text.replace(end, f'<motor joint="left_ball" gear="0 7 0" ctrlrange="-2 2"/>{end}')
    text = text.replace(end, f'<motor joint="right_ball" gear="3 0 0" ctrlrange="-2 2"/>{end}')
    robot = read_mjcf(text, projected=True)
    assert robot.joint_names[3:] == ("right_ball", "right_knee", "left_ball", "left_knee")
    table = {one.name: (one.kind, one.reason) for one in robot.locked}
    assert table["left_ball"] == ("ball", "keeps its pitch only")
    place = robot.joint_index("left_ball")
    assert (robot.model.lower[place], robot.model.upper[place]) == (-1.0, 1.0)
    assert robot.model.damping[place] == 0.5
    assert robot.joint_names.index("right_ball") not in robot.model.actuator_joint
    (motor,) = np.flatnonzero(robot.model.actuator_joint == place)
    assert robot.model.torque_upper[motor] == 14.0
    judged(robot, text)


def test_a_urdf_of_space_floats_unless_the_world_holds_it() -> None:
    leg = """<link name="{0}_leg"><inertial><origin xyz="0 0 -0.3"/><mass value="2"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>
      <joint name="{0}_roll" type="continuous"><parent link="trunk"/><child link="{0}_hip"/>
      <origin xyz="0 {1} 0"/><axis xyz="1 0 0"/></joint><link name="{0}_hip"/>
      <joint name="{0}_pitch" type="continuous"><parent link="{0}_hip"/><child link="{0}_leg"/>
      <axis xyz="0 1 0"/></joint>"""
    trunk = """<link name="trunk"><inertial><mass value="5"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>"""
    legs = leg.format("left", 0.1) + leg.format("right", -0.1)
    assert read_mjcf(f'<robot name="r">{trunk}{legs}</robot>', projected=True).floating
    held = """<link name="world"/><joint name="weld" type="fixed"><parent link="world"/>
      <child link="trunk"/></joint>"""
    robot = read_mjcf(f'<robot name="r">{held}{trunk}{legs}</robot>', projected=True)
    assert robot.joint_names == ("left_pitch", "right_pitch")


# Sides


def test_side_offsets_that_symmetry_cancels_are_none() -> None:
    """The frame of the trunk is drawn far to the side; its mass and legs are in the middle."""
    text = humanoid().replace('pos="0.02 0 0.3"', 'pos="0.02 0.5 0.3"')
    for y in ("-0.1", "0.1"):
        text = text.replace(f'pos="0.01 {y} -0.1"', f'pos="0.01 {float(y) + 0.5} -0.1"')
    robot = read_mjcf(text, projected=True)
    judged(robot, text)
    plain = read_mjcf(humanoid(), projected=True)
    np.testing.assert_allclose(robot.model.center_of_mass, plain.model.center_of_mass, atol=1e-15)


def test_a_small_asymmetry_is_said_and_a_large_one_refused() -> None:
    with pytest.warns(RobotWarning, match=r"projection is rough, because its centre of mass is"):
        read_mjcf(humanoid().replace('pos="0.02 0 0.3"', 'pos="0.02 0.009 0.3"'), projected=True)
    with pytest.raises(RobotError, match=r"its centre of mass is .* to the side of its middle"):
        read_mjcf(humanoid().replace('pos="0.02 0 0.3"', 'pos="0.02 0.09 0.3"'), projected=True)


def test_what_the_root_had_is_said_when_it_floats() -> None:
    text = """<robot name="r"><link name="world"/><link name="trunk"><inertial><mass value="5"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link><joint name="root" type="planar">
      <parent link="world"/><child link="trunk"/><axis xyz="0 1 0"/><dynamics damping="3"/></joint>
      </robot>"""
    with pytest.warns(RobotWarning, match=r"trunk floats; the limits, damping and friction"):
        assert read_mjcf(text).floating


# Robots that are planar in no direction


def radial(angles: Sequence[float], *, yaw: bool = False, turned: float = 0.0) -> str:
    """A trunk whose legs look outwards at angles (degrees) about z, on a free joint."""
    legs = "".join(
        f"""<body name="leg{k}" euler="0 0 {angle}">
          {f'<joint name="yaw{k}" axis="0 0 1"/>' if yaw else ""}
          <joint name="hip{k}" axis="0 1 0"/>
          <geom type="capsule" fromto="0.1 0 0 0.1 0 -0.3" size="0.02" mass="1"/></body>"""
        for k, angle in enumerate(angles)
    )
    return f"""<mujoco><worldbody><body name="trunk" pos="0 0 1" euler="0 0 {turned}">
      <freejoint/><geom type="box" size="0.2 0.2 0.1" mass="5"/>{legs}
      </body></worldbody></mujoco>"""


DIAGONAL = (45.0, 135.0, 225.0, 315.0)


@pytest.mark.parametrize("how", [{}, {"floating": True}, {"projected": True}], ids=str)
def test_legs_in_several_planes_are_refused_with_advice_that_is_good(how: LoadOptions) -> None:
    """Whatever is asked for first: no turn helps, and neither option does."""
    with pytest.raises(RobotError, match=r"angles of 45, 135 degrees.*no turn of the whole") as no:
        read_mjcf(radial(DIAGONAL), **how)
    assert "projected=True" not in str(no.value)
    assert "the pose" not in str(no.value)
    with pytest.raises(RobotError, match="Joints about z, as 'yaw0', can turn its legs") as yes:
        read_mjcf(radial(DIAGONAL, yaw=True), **{**how, "projected": True})
    assert "give their angles as the pose" in str(yes.value)
    quarter = np.pi / 4.0
    pose = {f"yaw{k}": quarter * (-1.0 if k % 2 == 0 else 1.0) for k in range(4)}
    robot = read_mjcf(radial(DIAGONAL, yaw=True), projected=True, pose=pose)
    assert robot.joint_names[3:] == ("hip0", "hip1", "hip2", "hip3")


def test_legs_in_one_plane_are_turned_by_what_is_advised() -> None:
    for how in ({"floating": True}, {"projected": True}):
        with pytest.raises(RobotError, match="turn the robot in its file by -30 degrees about z"):
            read_mjcf(radial((30.0, 210.0)), **how)  # type: ignore[arg-type]
    robot = read_mjcf(radial((30.0, 210.0), turned=-30.0), floating=True)
    assert robot.joint_names[3:] == ("hip0", "hip1")


def test_a_free_joint_is_replaced_as_advised() -> None:
    with pytest.raises(RobotError, match="load it with floating=True"):
        read_mjcf(radial((0.0, 180.0)))
    assert read_mjcf(radial((0.0, 180.0)), floating=True).nv == 5
    mixed = radial((0.0, 180.0, 90.0, 270.0))
    with pytest.raises(RobotError, match="load it with projected=True, which does so and locks"):
        read_mjcf(mixed)
    assert read_mjcf(mixed, projected=True).nv == 5
