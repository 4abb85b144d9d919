"""What drives a URDF: effort limits, transmissions, ros2_control."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from heelstrike.errors import RobotError
from heelstrike.robot import (
    Robot,
    RobotBuilder,
    RobotWarning,
    inspect_robot,
    load_robot,
    read_mjcf,
)
from heelstrike.sim import EventDriven, simulate


def link(name: str) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 -0.2"/><mass value="2"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name: str, parent: str, child: str, effort: str = 'effort="9"') -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="4" {effort}/></joint>'
    )


def leg(more: str = "", effort: str = 'effort="9"') -> str:
    return (
        f'<robot name="leg"><link name="world"/>{link("thigh")}{link("shin")}'
        f"{joint('hip', 'world', 'thigh')}{joint('knee', 'thigh', 'shin', effort)}{more}</robot>"
    )


def transmission(joint: str, inner: str, outer: str = "") -> str:
    return (
        f'<transmission name="{joint}_gear"><type>transmission_interface/SimpleTransmission</type>'
        f'<joint name="{joint}"/><actuator name="{joint}_motor">{inner}</actuator>{outer}'
        "</transmission>"
    )


def quiet(text: str) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        return read_mjcf(text)


def test_without_transmissions_every_effort_limit_is_a_motor() -> None:
    robot = quiet(leg())
    assert robot.actuator_names == ("hip", "knee")
    assert not robot.model.armature.any()


@pytest.mark.parametrize(
    "gear",
    [
        transmission(
            "hip",
            "<mechanicalReduction>50</mechanicalReduction><motorInertia>0.0003</motorInertia>",
        ),
        transmission(  # as FROST writes it
            "hip",
            "",
            "<mechanicalReduction>50</mechanicalReduction><motorInertia>0.0003</motorInertia>",
        ),
        transmission(  # as Drake does
            "hip", '<drake:rotor_inertia value="0.0003"/><drake:gear_ratio value="-50"/>'
        ),
        '<ros2_control name="c" type="system"><joint name="hip"><command_interface name="effort"/>'
        '</joint><transmission name="t"><plugin>t/SimpleTransmission</plugin><actuator name="m"/>'
        '<joint name="hip"><mechanical_reduction>50</mechanical_reduction></joint>'
        "<rotor_inertia>0.0003</rotor_inertia></transmission></ros2_control>",
    ],
)
def test_a_reduction_reflects_the_inertia_of_the_motor(gear: str) -> None:
    robot = quiet(leg(gear))
    np.testing.assert_allclose(robot.model.armature, [50**2 * 0.0003, 0.0], rtol=1e-15)
    assert robot.actuator_names == ("hip",)
    assert robot.model.torque_upper.tolist() == [9.0]


def test_who_gives_one_joint_a_transmission_means_the_others_passive() -> None:
    with pytest.warns(RobotWarning, match="joints knee have an effort limit and no transmission"):
        read_mjcf(leg(transmission("hip", "")))


def test_limits_and_commands_of_ros2_control() -> None:
    control = (
        '<ros2_control name="c" type="system"><joint name="hip"><command_interface name="effort">'
        '<param name="min">-3</param><param name="max">4</param></command_interface></joint>'
        '<joint name="knee"><command_interface name="position"/></joint></ros2_control>'
    )
    with pytest.warns(RobotWarning, match="joints knee are commanded by position or velocity"):
        robot = read_mjcf(leg(control))
    assert robot.model.torque_lower.tolist() == [-3.0, -9.0]
    assert robot.model.torque_upper.tolist() == [4.0, 9.0]


def test_a_motor_without_an_effort_limit_is_unlimited_and_said() -> None:
    with pytest.warns(RobotWarning, match="joints knee have a motor and no effort limit"):
        robot = read_mjcf(leg(transmission("knee", ""), effort='effort="0"'))
    assert np.isinf(robot.model.torque_upper).all()


def test_two_transmissions_of_one_joint_are_one_motor() -> None:
    inertia = "<mechanicalReduction>10</mechanicalReduction><motorInertia>0.001</motorInertia>"
    with pytest.warns(RobotWarning, match="joints hip are driven by several transmissions"):
        robot = read_mjcf(leg(transmission("hip", inertia) + transmission("hip", inertia)))
    assert robot.model.armature[0] == pytest.approx(0.2, rel=1e-15)


@pytest.mark.parametrize(
    ("gear", "words"),
    [
        (transmission("hip", "<mechanicalReduction>5O</mechanicalReduction>"), "is '5O', where a"),
        (transmission("hip", "<mechanicalReduction>0</mechanicalReduction>"), "the reduction 0"),
        (transmission("hip", "<motorInertia>-1</motorInertia>"), "a negative motor inertia"),
        (transmission("ankle", ""), "drives joint 'ankle', but there is none"),
        (
            transmission(
                "hip",
                "<mechanicalReduction>5</mechanicalReduction>",
                "<mechanicalReduction>6</mechanicalReduction>",
            ),
            "has several reductions",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(gear: str, words: str) -> None:
    with pytest.raises(RobotError, match=words):
        quiet(leg(gear))


def test_what_drives_a_robot_is_said_at_load_and_by_inspect(tmp_path: Path) -> None:
    """A passive leg with a spring at its toe, which touches nothing."""
    toe = """<mujoco><compiler angle="radian"/><worldbody><body name="foot">
      <joint name="ankle" axis="0 1 0"/><geom size="0.1" contype="0" conaffinity="0"/>
      <body name="toe" pos="0.1 0 0"><joint name="toe" axis="0 1 0" stiffness="3"/>
      <geom size="0.05" contype="0" conaffinity="0"/></body></body></worldbody></mujoco>"""
    path = tmp_path / "foot.xml"
    path.write_text(toe, encoding="utf-8")
    with pytest.warns(RobotWarning) as caught:
        load_robot(path)
    said = [str(one.message) for one in caught]
    assert any("no joint has a motor" in words for words in said)
    assert any("it has no contact points" in words for words in said)
    text = inspect_robot(path).text()
    assert "drives: no motors; springs at toe; no contact points" in text


def test_a_toe_on_a_spring_swings_as_its_closed_form() -> None:
    """A wheel about its centre on a spring: q = a cos(√(k/J) t), the energy stays."""
    build = RobotBuilder("wheel")
    build.hinge("toe", None, mass=1, inertia=0.02, stiffness=3.0)
    robot = build.build()
    run = simulate(
        robot,
        state=robot.state({"toe": 0.3}),
        duration=1.0,
        method=EventDriven(rtol=1e-10, atol=1e-12),
    )
    expected = 0.3 * np.cos(np.sqrt(3.0 / 0.02) * run.time)
    np.testing.assert_allclose(run.position[:, 0], expected, rtol=0, atol=1e-7)


def test_the_line_of_a_motor_is_a_number_of_the_robot(tmp_path: Path) -> None:
    """MJCF holds it; URDF and SDF name it as lost."""
    build = RobotBuilder("motor")
    motor = {"stall_torque": 90.0, "no_load_speed": 12.0, "winding_resistance": 0.4}
    build.hinge("hip", None, mass=1, inertia=0.1, torque=60, **motor)  # type: ignore[arg-type]
    robot = build.build()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        back = load_robot(robot.save(tmp_path / "r.xml"))
    for name, value in motor.items():
        assert getattr(back.model, name).tolist() == [value]
    told = inspect_robot(robot).text()
    assert "speed-torque lines at hip (20.8 V)" in told  # √(0.4 Ω · 90 N m · 12 rad/s)
    assert "stall torque 90, no load speed 12, winding resistance 0.4" in told
    for ending in ("urdf", "sdf"):
        with pytest.warns(RobotWarning, match="Left out: stall torque of hip; no load speed of hi"):
            robot.save(tmp_path / f"r.{ending}")


@pytest.mark.parametrize("limit", ["", '<limit lower="-1" upper="1" velocity="4"/>'])
def test_what_is_said_of_a_joint_without_effort_agrees_with_its_transmission(limit: str) -> None:
    """A joint that a transmission drives has a motor, whatever its <limit> leaves out."""
    bare = (
        f'<joint name="ankle" type="revolute"><parent link="shin"/><child link="foot"/>{limit}'
        '<axis xyz="0 1 0"/></joint>'
    )
    text = leg(link("foot") + bare)

    def said(text: str) -> tuple[Robot, str]:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", RobotWarning)
            robot = read_mjcf(text)
        return robot, " ".join(str(each.message) for each in told)

    robot, words = said(text)
    assert "ankle" not in robot.actuator_names
    assert "no motor" in words
    robot, words = said(text.replace("</robot>", transmission("ankle", "") + "</robot>"))
    assert robot.actuator_names == ("ankle",)
    assert "ankle have a motor and no effort limit: its torque is unlimited" in words
    assert "motor" in words.split("may not say what is meant", 1)[1].split(".")[0]
    assert "no motor moves it" not in words
    assert "it has no motor" not in words
