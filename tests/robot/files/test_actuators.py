"""Torque limits at the joints from the actuators of a file."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from heelstrike.errors import RobotError
from heelstrike.robot import Robot, RobotWarning, read_mjcf


def text(actuators: str, joint: str = "") -> str:
    return f"""<mujoco><worldbody><body name="trunk">
      <joint name="a" axis="0 1 0" {joint}/><geom size="0.1" pos="0.3 0 0"/>
      <body name="leg" pos="0 0 -1"><joint name="b" axis="0 1 0"/><geom size="0.1"/>
      <site name="tip"/></body></body></worldbody><actuator>{actuators}</actuator></mujoco>"""


def driven(actuators: str, joint: str = "") -> Robot:
    return read_mjcf(text(actuators, joint))


@pytest.mark.parametrize(
    ("actuator", "lower", "upper"),
    [
        ("", -np.inf, np.inf),
        ('ctrlrange="-2 3"', -2.0, 3.0),
        ('ctrlrange="-2 3" gear="10"', -20.0, 30.0),
        ('ctrlrange="-2 3" gear="-10"', -30.0, 20.0),
        ('forcerange="-5 7" gear="2"', -10.0, 14.0),
        ('ctrlrange="-9 3" forcerange="-5 7"', -5.0, 3.0),
    ],
)
def test_limits(actuator: str, lower: float, upper: float) -> None:
    model = driven(f'<motor joint="b" {actuator}/>').model
    np.testing.assert_array_equal(model.actuator_joint, [1])
    np.testing.assert_allclose(model.torque_lower, [lower])
    np.testing.assert_allclose(model.torque_upper, [upper])


def test_gain_and_joint_limits() -> None:
    general = '<general joint="a" gainprm="4" ctrlrange="-1 1" gear="5"/>'
    assert driven(general).model.torque_upper[0] == 20.0
    assert driven(general, 'actuatorfrcrange="-8 9"').model.torque_upper[0] == 9.0
    assert driven(general, 'actuatorfrcrange="-8 9"').model.torque_lower[0] == -8.0


def test_limits_are_those_that_mujoco_applies() -> None:
    """A huge control, then a huge negative one, and the force that arrives at the joint."""
    xml = text(
        '<motor joint="a" ctrlrange="-9 3" forcerange="-5 7" gear="-4"/>'
        '<general joint="b" gainprm="2" ctrlrange="-1 2" gear="3"/>',
        'actuatorfrcrange="-11 18"',
    )
    robot = read_mjcf(xml)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    torques = []
    for control in (-1e6, 1e6):
        data.ctrl[:] = control
        mujoco.mj_forward(model, data)
        torques.append(data.qfrc_actuator.copy())
    np.testing.assert_allclose(np.min(torques, axis=0), robot.model.torque_lower)
    np.testing.assert_allclose(np.max(torques, axis=0), robot.model.torque_upper)


def test_motor_inertia_and_damping_arrive_through_the_gear() -> None:
    """Against MuJoCo's own mass matrix and passive force, where this version has them."""
    xml = text('<motor joint="a" gear="3" armature="0.5" damping="0.2"/>', 'armature="0.1"')
    try:
        model = mujoco.MjModel.from_xml_string(xml)
    except ValueError:
        pytest.skip("this version of MuJoCo has no motor inertia")
    robot = read_mjcf(xml)
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    mujoco.mj_forward(model, data)
    without = mujoco.MjModel.from_xml_string(text('<motor joint="a" gear="3"/>'))
    bare = mujoco.MjData(without)
    mujoco.mj_forward(without, bare)
    full, less = np.zeros((2, 2)), np.zeros((2, 2))
    mujoco.mj_fullM(model, data, full)
    mujoco.mj_fullM(without, bare, less)
    np.testing.assert_allclose(np.diag(full - less), robot.model.armature, atol=1e-12)
    np.testing.assert_allclose(-data.qfrc_passive, robot.model.damping, atol=1e-12)


def test_names() -> None:
    robot = driven('<motor name="drive" joint="b"/><motor joint="a"/>')
    assert robot.actuator_names == ("drive", "a")
    np.testing.assert_array_equal(robot.model.actuator_joint, [1, 0])


@pytest.mark.parametrize(
    ("actuators", "words"),
    [
        ('<motor name="one" joint="a"/><motor name="two" joint="a"/>', "'a'.*'one'.*'two'"),
        ('<motor name="one" joint="a" gear="0"/>', "'one' has gear 0"),
        ('<motor name="push" site="tip" gear="1 0 0 0 0 0"/>', "'push' does not act on a joint"),
        ('<muscle name="calf" joint="a"/>', "'calf' is a muscle"),
        ('<motor name="one" joint="a" ctrlrange="1 2" forcerange="-2 -1"/>', "contradictory"),
    ],
)
def test_what_cannot_drive_a_joint_is_refused(actuators: str, words: str) -> None:
    with pytest.raises(RobotError, match=words):
        driven(actuators, 'range="-30 30"')


def test_a_servo_becomes_a_motor_and_says_so() -> None:
    with pytest.warns(RobotWarning, match=r"motors.*'servo': position servo \(kp 9, kv 0\)"):
        model = driven('<position name="servo" joint="a" kp="9" forcerange="-6 6"/>').model
    np.testing.assert_array_equal(model.torque_upper, [6.0])


def test_no_actuators() -> None:
    robot = driven("")
    assert robot.nu == 0
    assert robot.model.actuator_joint.dtype == np.int64
    assert robot.model.torque_lower.shape == (0,)


URDF = """<robot name="leg">
  <link name="{base}">{inertial}</link>
  <link name="shank"><inertial><origin xyz="0 0 -0.2"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.4"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
  <joint name="knee" type="revolute"><parent link="{base}"/><child link="shank"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="30" velocity="5"/>
    <dynamics damping="0.3" friction="0.4"/></joint>
</robot>"""


def test_urdf_drives_the_joints_that_have_an_effort_limit() -> None:
    robot = read_mjcf(URDF.format(base="world", inertial=""))
    assert (robot.name, robot.joint_names, robot.actuator_names) == ("leg", ("knee",), ("knee",))
    np.testing.assert_array_equal(robot.model.torque_upper, [30.0])
    np.testing.assert_array_equal(robot.model.upper, [2.0])
    np.testing.assert_array_equal(robot.model.damping, [0.3])
    np.testing.assert_array_equal(robot.model.dry_friction, [0.4])
    np.testing.assert_allclose(robot.model.contact_position, [[0.0, -0.4]])


def test_urdf_whose_trunk_cannot_move_is_mentioned() -> None:
    inertial = (
        '<inertial><mass value="9"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )
    with pytest.warns(RobotWarning, match="'pelvis' is fixed to the world"):
        robot = read_mjcf(URDF.format(base="pelvis", inertial=inertial))
    assert robot.total_mass == pytest.approx(2.0)
