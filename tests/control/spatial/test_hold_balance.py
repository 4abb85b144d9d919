"""HoldBalance: its torques by other code, what ground and motors can do, pushes, refusals."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.control.quadratic.program import INFEASIBLE
from heelstrike.control.spatial.gains import bearable_gains
from heelstrike.control.spatial.hold_balance import PRESSURE_LEVEL, WITHIN
from heelstrike.control.spatial.soles import soles_in_space
from heelstrike.dynamics import spatial

FRICTION, STRONGEST = 0.6, 200.0


def leg(side: str, y: float) -> str:
    """A leg of six hinges, its foot a box of 22 cm by 10 cm."""
    shell = 'contype="0" conaffinity="0"'
    return f"""
<body name="{side}_hip" pos="0 {y} -0.05"><joint name="{side}_yaw" axis="0 0 1" range="-1 1"/>
 <geom type="sphere" size="0.04" mass="1" {shell}/>
 <body name="{side}_side"><joint name="{side}_roll" axis="1 0 0" range="-0.8 0.8"/>
  <geom type="sphere" size="0.04" mass="1" {shell}/>
  <body name="{side}_thigh"><joint name="{side}_hip" axis="0 1 0" range="-2 2"/>
   <geom type="capsule" fromto="0 0 0 0 0 -0.38" size="0.05" mass="5" {shell}/>
   <body name="{side}_shank" pos="0 0 -0.38">
    <joint name="{side}_knee" axis="0 1 0" range="-0.1 2.2"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.38" size="0.04" mass="3" {shell}/>
    <body name="{side}_heel" pos="0 0 -0.38">
     <joint name="{side}_ankle" axis="0 1 0" range="-1 1"/>
     <geom type="sphere" size="0.03" mass="0.3" {shell}/>
     <body name="{side}_foot"><joint name="{side}_ankle_roll" axis="1 0 0" range="-0.6 0.6"/>
      <geom type="box" pos="0.03 0 -0.05" size="0.11 0.05 0.02" mass="1"/>
     </body></body></body></body></body></body>"""


def biped() -> str:
    """A trunk on two such legs."""
    joints = ("yaw", "roll", "hip", "knee", "ankle", "ankle_roll")
    ends = f'ctrllimited="true" ctrlrange="-{STRONGEST} {STRONGEST}"'
    motors = "".join(
        f'<motor joint="{side}_{joint}" {ends}/>' for side in ("left", "right") for joint in joints
    )
    return f"""<mujoco model="biped"><compiler angle="radian"/><worldbody>
<body name="trunk" pos="0 0 0.88"><freejoint/>
 <geom type="box" pos="0 0 0.25" size="0.1 0.15 0.25" mass="30" contype="0" conaffinity="0"/>
 {leg("left", 0.1)}{leg("right", -0.1)}</body></worldbody>
<actuator>{motors}</actuator></mujoco>"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> hs.SpatialRobot:
    path = tmp_path_factory.mktemp("robot") / "biped.xml"
    path.write_text(biped())
    with pytest.warns(hs.RobotWarning, match="contact is with the ground alone"):
        return hs.load_robot(path, dimension=3)


@pytest.fixture(scope="module")
def crouched(robot: hs.SpatialRobot) -> np.ndarray:
    """The robot on its soles with bent knees."""
    q = robot.reference_state().q.copy()
    for name, angle in (("hip", -0.3), ("knee", 0.6), ("ankle", -0.3)):
        for side in ("left", "right"):
            q[robot.model.first_position[robot.joint_index(f"{side}_{name}")]] = angle
    lowest = spatial.lowest_positions(robot, q)[:, 2].min()
    q[2] -= lowest
    return q


def pushed(force: tuple[float, float], law: Any, q: np.ndarray, robot: hs.SpatialRobot) -> Any:
    """Push the trunk for 0.1 s, when it has come to rest."""
    push = hs.Push("trunk", force=(*force, 0.0), start=1.0, duration=0.1)
    period = 2e-3 if isinstance(law, hs.HoldBalance) else None
    with warnings.catch_warnings():
        warnings.simplefilter("error", hs.SimulationWarning)
        return hs.simulate(
            robot, law, state=hs.State(q, np.zeros(robot.nv)), duration=4.0, pushes=push,
            control_period=period,
        )  # fmt: skip


def test_torques_are_those_of_accelerations_and_wrenches(
    robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    """By the queries of the dynamics: Γ = M v̇ + H − Jᵀw where motors are, and nothing elsewhere.

    And wrenches are such as the ground has, by the world's axes: its normal is z.
    """
    law = hs.HoldBalance(robot, posture=crouched, friction=FRICTION)
    push = hs.Push("trunk", force=(120.0, 60.0, 0.0), start=0.1, duration=0.1)
    simulation = hs.Simulation(
        robot, law, state=hs.State(crouched, np.zeros(robot.nv)), pushes=push
    )
    memory = simulation._numbers.memory
    soles = soles_in_space(robot, crouched)
    seen = 0
    for until in np.arange(0.02, 0.6, 0.02):
        simulation.advance(float(until))
        state = simulation.state
        simulation.step()
        torque = simulation.record.torque[-2]  # of the row that the step began with
        program = memory.program
        if program.relaxed:
            continue
        seen += 1
        v_dot, wrenches = program.x[: robot.nv], program.x[robot.nv :].reshape(-1, 6)
        force = spatial.inverse_dynamics(robot, state.q, state.v, v_dot)
        force -= spatial.passive_force(robot, state.q, state.v)
        for link, local, half, wrench in zip(
            soles.link, soles.middle, soles.half, wrenches, strict=True
        ):
            force -= spatial.point_jacobian(robot, state.q, link, local).T @ wrench
            (fx, fy, fz), (mx, my, mz) = wrench[:3], wrench[3:]
            assert fz >= -1e-6
            assert np.hypot(fx, fy) <= FRICTION * fz * 1.02 + 1e-6  # soles tilt by a degree
            assert abs(my) <= WITHIN * half[0] * fz * 1.05 + 1e-3
            assert abs(mx) <= WITHIN * half[1] * fz * 1.05 + 1e-3
            assert abs(mz) <= 0.5 * FRICTION * WITHIN * min(half) * fz * 1.05 + 1e-3
        size = robot.weight
        driven = robot.model.actuator_velocity
        assert np.abs(np.delete(force, driven)).max() <= 1e-9 * size
        assert np.abs(force[driven] - torque).max() <= 1e-9 * size
        assert np.abs(torque).max() <= STRONGEST
    assert seen >= 20


@pytest.mark.parametrize("raised", ["both", "left"])
def test_nothing_pushes_a_foot_in_the_air(
    raised: str, robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    """It has no wrench, so that torques are not reckoned with one."""
    law = hs.HoldBalance(robot, posture=crouched)
    q = crouched.copy()
    if raised == "both":
        q[2] += 0.3
        q[3:7] = np.cos(0.1), 0.0, np.sin(0.1), 0.0
    else:
        q[robot.model.first_position[robot.joint_index("left_knee")]] += 0.4
    simulation = hs.Simulation(robot, law, state=hs.State(q, np.zeros(robot.nv)))
    simulation.step()
    program = simulation._numbers.memory.program
    left, right = program.x[robot.nv :].reshape(-1, 6)
    assert np.all(left == 0.0)
    assert np.all(right == 0.0) if raised == "both" else right[2] > 0.1 * robot.weight


def test_motors_follow_their_lines(
    robot: hs.SpatialRobot, crouched: np.ndarray, tmp_path: Path
) -> None:
    """Of 10 N m at rest a knee that turns faster than its motor has 2 to 22 N m, and brakes."""
    path = tmp_path / "line.xml"
    names = "".join(
        f'<numeric name="{what}:left_knee" data="{value}"/>'
        for what, value in (("stall_torque", 10.0), ("no_load_speed", 2.5))
    )
    path.write_text(biped().replace("<actuator>", f"<custom>{names}</custom><actuator>"))
    with pytest.warns(hs.RobotWarning, match="contact is with the ground alone"):
        weak = hs.load_robot(path, dimension=3)
    knee = weak.actuator_names.index("left_knee")
    place = weak.model.actuator_velocity[knee]
    assert weak.model.stall_torque[place] == 10.0
    for speed, least, most in ((3.0, -22.0, -2.0), (-3.0, 2.0, 22.0)):
        v = np.zeros(weak.nv)
        v[place] = speed
        torques = []
        for each in (robot, weak):
            law = hs.HoldBalance(each, posture=crouched)
            simulation = hs.Simulation(each, law, state=hs.State(crouched, v))
            simulation.step()
            torques.append(simulation.record.torque[0, knee])
            program, memory = simulation._numbers.memory.program, simulation._numbers.memory
        planned = memory.mass[place] @ program.x[: weak.nv] + memory.bias[place]
        planned -= memory.passive[place] + memory.jacobian[:, place] @ program.x[weak.nv :]
        assert not least <= torques[0] <= most
        assert least - 1e-6 <= planned <= most + 1e-6
        assert torques[1] == pytest.approx(planned, abs=1e-6)


def test_it_tells_of_programmes_that_are_not_solved(
    robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    """No torque is at least 300 and at most 200 N m: those of the call before go on."""
    law = hs.HoldBalance(robot, posture=crouched)
    state = hs.State(crouched, np.zeros(robot.nv))
    simulation = hs.Simulation(robot, law, state=state)
    simulation.advance(0.01)
    log: Any = simulation.log
    assert log.unsolved == 0
    limits, actuator = simulation._numbers.control.robot.model.torque_lower, 3
    kept = limits[actuator]
    limits[actuator] = 1.5 * STRONGEST
    try:
        simulation.advance(0.02)
        assert simulation._numbers.memory.program.status == INFEASIBLE
        log = simulation.log
        assert log.unsolved == 1
    finally:
        limits[actuator] = kept
    others = np.delete(simulation.record.torque, actuator, axis=1)
    assert np.all(others[10:20] == others[9])
    simulation.advance(0.03)
    log = simulation.log
    assert log.unsolved == 0


def yawed(q: np.ndarray, angle: float) -> np.ndarray:
    """The robot in another place of the compass."""
    q, turn = q.copy(), (np.cos(0.5 * angle), np.sin(0.5 * angle))
    w, x, y, z = q[3:7]
    q[3:7] = np.array([
        turn[0] * w - turn[1] * z, turn[0] * x - turn[1] * y,
        turn[0] * y + turn[1] * x, turn[0] * z + turn[1] * w,
    ])  # fmt: skip
    q[:2] = q[0] * np.cos(angle) - q[1] * np.sin(angle), q[0] * np.sin(angle) + q[1] * np.cos(angle)
    return q


@pytest.mark.parametrize("angle", [0.3, np.pi / 4, 2.0])
def test_it_does_the_same_wherever_it_looks(
    angle: float, robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    """Moving so fast that its soles' sizes count."""
    torques = []
    for turn in (0.0, angle):
        q, v = yawed(crouched, turn), np.zeros(robot.nv)
        v[:2] = 0.4 * np.cos(turn + 0.3), 0.4 * np.sin(turn + 0.3)
        law = hs.HoldBalance(robot, posture=q)
        simulation = hs.Simulation(robot, law, state=hs.State(q, v))
        simulation.step()
        program = simulation._numbers.memory.program
        held = program.multiplier[: program.count] > 1e-6
        assert np.any(held[program.level[: program.count] == PRESSURE_LEVEL])
        torques.append(simulation.record.torque[0])
    np.testing.assert_allclose(torques[1], torques[0], atol=1e-6 * STRONGEST)


@pytest.mark.parametrize("out", [0.0, 0.3, np.pi / 4])
def test_feet_that_are_toed_out_keep_their_soles(
    out: float, robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    """22 cm by 10 cm along the foot, about the middle of its box."""
    q = crouched.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        joint = robot.joint_index(f"{side}_yaw")
        q[robot.model.first_position[joint]] = sign * out
    soles = soles_in_space(robot, q)
    np.testing.assert_allclose(soles.half, [[0.11, 0.05]] * 2, atol=1e-9)
    np.testing.assert_allclose(soles.middle, [[0.03, 0.0, -0.07]] * 2, atol=1e-9)
    np.testing.assert_allclose(np.abs(soles.axes), [np.eye(3)] * 2, atol=1e-9)


def test_it_stands_over_the_middle_of_its_soles(
    robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    law = hs.HoldBalance(robot, posture=crouched)
    run = pushed((0.0, 0.0), law, crouched, robot)
    assert run.completed
    away = run.log["away"].values
    assert away[0] > 5e-3
    assert away[-1] < 0.5 * away[0]
    assert np.abs(run.velocity[-1]).max() < 0.01
    assert run.certificates.uncertified == 0


@pytest.mark.parametrize("force", [(120.0, 0.0), (-135.0, 0.0), (0.0, 210.0), (0.0, -210.0)])
def test_it_withstands_pushes_that_a_posture_does_not(
    force: tuple[float, float], robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    """12, 13.5 and 21 N s; a pendulum of its height falls over its soles at 20, 20 and 27.

    The posture is held with gains that the step bears, and falls at 1.5 N s (2 to the sides) less
    and more, too.
    """
    assert pushed(force, hs.HoldBalance(robot, posture=crouched), crouched, robot).completed
    kp, kd = bearable_gains(robot, 1e-3, kp=600.0, kd=15.0)
    posture = hs.HoldPosture(robot, posture=crouched, kp=kp, kd=kd)
    assert pushed(force, posture, crouched, robot).status is hs.RunStatus.FELL


def test_pushed_to_either_side_it_does_the_same(
    robot: hs.SpatialRobot, crouched: np.ndarray
) -> None:
    law = hs.HoldBalance(robot, posture=crouched)
    left, right = (pushed((0.0, side * 100.0), law, crouched, robot) for side in (1.0, -1.0))
    assert np.abs(left.position[:, 1]).max() > 0.01
    np.testing.assert_allclose(left.position[:, 1], -right.position[:, 1], atol=1e-6)


def test_refusals(robot: hs.SpatialRobot, crouched: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(hs.ControllerError, match="friction must be a positive"):
        hs.HoldBalance(robot, friction=0.0)
    with pytest.raises(hs.ControllerError, match="posture must be 19"):
        hs.HoldBalance(robot, posture=crouched[:-1])
    with pytest.raises(hs.ControllerError, match="must be a SpatialRobot"):
        hs.HoldBalance(hs.load_robot("bravo7"))  # type: ignore[arg-type]
    on_points = biped().replace('type="box" pos="0.03 0 -0.05" size="0.11 0.05 0.02"',
                                'type="sphere" pos="0 0 -0.05" size="0.02"')  # fmt: skip
    path = tmp_path / "points.xml"
    path.write_text(on_points)
    with pytest.warns(hs.RobotWarning, match="contact is with the ground alone"):
        pointed = hs.load_robot(path, dimension=3)
    with pytest.raises(hs.ControllerError, match="along a line or in a point only"):
        hs.HoldBalance(pointed)
