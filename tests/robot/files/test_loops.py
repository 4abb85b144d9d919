"""Loops and couplings in robot files, as MuJoCo understands them."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mechanisms import four_bar, geared, parallel_ankles

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.robot import RobotWarning, read_mjcf
from heelstrike.robot.model import NUMBERS

BARS = """<body name="crank" pos="0 0.1 0"><joint name="crank" axis="0 1 0"/>
    <inertial pos="0 0 0.1" mass="1" diaginertia="0.02 0.02 0.02"/>
    <body name="coupler" pos="0 0 0.2"><joint name="coupler" axis="0 {sense} 0"/>
      <inertial pos="0.3 0 0.15" mass="1.5" diaginertia="0.08 0.08 0.08"/>
      <site name="end" pos="0.5 0 0.3"/></body></body>
  <body name="rocker" pos="0.5 0.1 0"><joint name="rocker" axis="0 1 0"/>
    <inertial pos="0 0 0.2" mass="1.2" diaginertia="0.05 0.05 0.05"/>
    <site name="top" pos="0 0 0.5"/></body>"""
CONNECTED = '<connect body1="coupler" body2="rocker" anchor="0.5 0 0.3"/>'


def bars(equality: str, sense: int = 1) -> str:
    body = BARS.format(sense=sense)
    return (
        f"<mujoco><worldbody>{body}</worldbody><equality>{equality}</equality>"
        '<option jacobian="dense"/></mujoco>'
    )


def read(text: str) -> hs.Robot:
    """Read a robot of which nothing is left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RobotWarning)
        warnings.filterwarnings("ignore", message=".*no (joint has a motor|contact points)")
        return read_mjcf(text)


def test_a_connection_is_a_loop() -> None:
    built = four_bar()
    for equality in (
        CONNECTED,
        '<connect site1="end" site2="top"/>',
        CONNECTED + CONNECTED.replace("0.5 0 0.3", "0.5 0.2 0.3"),  # an axis takes two points
    ):
        model = read(bars(equality)).model
        for name in NUMBERS:
            expected, found = getattr(built.model, name), getattr(model, name)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15, err_msg=name)
    world = read(bars('<connect body1="coupler" anchor="0.5 0 0.3"/>')).model
    assert world.loop_link.tolist() == [[1, -1]]
    np.testing.assert_allclose(world.loop_position[0], [[0.5, 0.3], [0.5, 0.5]], atol=1e-15)


def test_what_does_not_act_is_no_loop() -> None:
    assert read(bars(CONNECTED.replace("/>", ' active="false"/>'))).model.loops == 0
    off = bars(CONNECTED).replace("<option", '<option><flag equality="disable"/></option><option')
    assert read(off).model.loops == 0
    welded = bars('<connect body1="lamp" body2="rocker" anchor="0 0 0"/>').replace(
        '<site name="top"', '<body name="lamp"><geom size="0.01" mass="0"/></body><site name="top"'
    )
    assert read(welded).model.loops == 0


def test_the_same_file_in_mujoco() -> None:
    """MuJoCo's mass matrix, bias force and constraint Jacobian give the acceleration of ours."""
    text = bars(CONNECTED)
    robot = read(text)
    state = robot.closed(robot.state({"crank": 0.3}, {"crank": 4.0}), keep=["crank"])
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = state.q, state.v
    mujoco.mj_forward(model, data)
    matrix = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, matrix)
    np.testing.assert_allclose(dynamics.mass_matrix(robot, state.q), matrix, rtol=1e-12)
    jacobian = data.efc_J.reshape(-1, 3)[[0, 2]]  # of x and z
    np.testing.assert_allclose(data.efc_pos, 0.0, atol=1e-12)
    ours = dynamics.loop_jacobian(robot, state.q)
    np.testing.assert_allclose(ours, jacobian, rtol=0, atol=1e-12)
    bias = dynamics.loop_bias_acceleration(robot, state.q, state.v)
    system = np.block([[matrix, -jacobian.T], [jacobian, np.zeros((2, 2))]])
    solution = np.linalg.solve(system, np.concatenate([-data.qfrc_bias, -bias]))
    run = hs.simulate(robot, state=state, duration=1e-3, method=hs.EventDriven())
    np.testing.assert_allclose(run.loop_force[0].ravel(), solution[3:], rtol=1e-10)
    found = dynamics.forward_dynamics(robot, state.q, state.v, np.zeros(3))
    np.testing.assert_allclose(found, solution[:3], rtol=1e-10)


def test_joints_are_coupled_as_in_mujoco() -> None:
    """Polynomials are about qpos0; here the reference is elsewhere, and an axis reversed."""
    factors = [0.0, 0.5, 0.3, -0.2, 0.1]
    equality = f'<joint joint1="rocker" joint2="coupler" polycoef="{" ".join(map(str, factors))}"/>'
    text = bars(equality, sense=-1)
    robot = read_mjcf(text, pose={"coupler": 0.4})
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = [0.1, 0.7, -0.3]
    mujoco.mj_forward(model, data)
    found = dynamics.loop_displacement(robot, data.qpos)
    np.testing.assert_allclose(found, data.efc_pos, rtol=1e-12)
    np.testing.assert_allclose(
        dynamics.loop_jacobian(robot, data.qpos), data.efc_J.reshape(1, 3), rtol=1e-12, atol=1e-12
    )
    with pytest.warns(RobotWarning, match="rocker cannot move"):
        held = read_mjcf(bars('<joint joint1="rocker" polycoef="0.2 0 0 0 0"/>'))
    assert "rocker" not in held.joint_names  # it cannot move at all


@pytest.mark.parametrize("make", [four_bar, parallel_ankles, geared])
def test_mjcf_holds_them(make: object, tmp_path: Path) -> None:
    robot = make()  # type: ignore[operator]
    back = hs.load_robot(robot.save(tmp_path / "robot.xml"))
    for name in NUMBERS:
        expected, found = getattr(robot.model, name), getattr(back.model, name)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14, err_msg=name)


def test_urdf_holds_straight_couplings_and_tells_of_what_it_cannot(tmp_path: Path) -> None:
    robot = geared((0.0, -1.5))
    back = hs.load_robot(robot.save(tmp_path / "geared.urdf"))
    np.testing.assert_allclose(back.model.coupling_polynomial, robot.model.coupling_polynomial)
    np.testing.assert_array_equal(back.model.coupling_joint, robot.model.coupling_joint)
    for other, words in (
        (four_bar(), r"closed loops \(coupler-rocker\)"),
        (geared((0.0, 1.0, 0.5)), "couplings that are not straight of rear"),
    ):
        with pytest.warns(RobotWarning, match=words):
            other.save(tmp_path / "other.urdf")
    with pytest.warns(RobotWarning, match="couplings of rear"):
        robot.save(tmp_path / "geared.sdf")


def test_a_mimic_joint_of_urdf_follows_in_the_plane() -> None:
    link = (
        '<link name="{0}"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    joint = (
        '<joint name="{0}" type="continuous"><parent link="world"/><child link="{0}_link"/>'
        '<axis xyz="0 1 0"/>{1}</joint>'
    )
    text = (
        '<robot name="two"><link name="world"/>'
        + link.format("front_link") + link.format("rear_link")
        + joint.format("front", "")
        + joint.format("rear", '<mimic joint="front" multiplier="-2" offset="0.25"/>')
        + "</robot>"
    )  # fmt: skip
    robot = read_mjcf(text)
    state = robot.closed(robot.state({"front": 0.1}), keep=["front"])
    assert robot.positions(state)["rear"] == pytest.approx(0.25 - 0.2)
