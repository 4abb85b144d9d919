"""Computed torque, and gaits, of robots whose joints follow by closed loops and couplings.

A parallelogram makes an ankle turn as its motor does. With a lever and a rod that weigh next to
nothing the robot is one with the motor in the ankle: torques and all that a gait is made of must be
the same, and the rod must bear what the motor gives over its lever.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mechanisms import parallel_ankles

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control.computed_torque import ComputedTorque, pitch_of
from heelstrike.control.standing_lqr import linear_standing
from heelstrike.errors import ControllerError, GaitError
from heelstrike.gait.request import Request
from heelstrike.gait.transcription import Transcription
from heelstrike.robot import Robot, RobotBuilder

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

LIGHT = 1e-9
NAMES = ("own", "lever")
LEVER = 0.05


def biped(ankle: str, *, weight: float = LIGHT, lever: float = LEVER, toe: bool = False) -> Robot:
    """Biped with its ankle motors in the ankles, on the shanks, or in both places."""
    build = RobotBuilder("parallel_ankles")
    trunk = build.floating_base("trunk", (0, 0.85), mass=20, inertia=1, center_of_mass=(0, 0.2))
    for side in ("right", "left"):
        thigh = build.hinge(
            f"{side}_hip", trunk, mass=5, inertia=0.07, center_of_mass=(0, -0.2), torque=200
        )
        shank = build.hinge(
            f"{side}_knee", thigh, at=(0, -0.4), mass=3, inertia=0.04, center_of_mass=(0, -0.2),
            torque=200, limits=(0.0, 2.0),
        )  # fmt: skip
        own: Any = {"torque": 80} if ankle in ("own", "both") else {}
        foot = build.hinge(
            f"{side}_ankle", shank, at=(0, -0.4), mass=1, inertia=5e-3,
            center_of_mass=(0.02, -0.03), **own,
        )  # fmt: skip
        if ankle != "own":
            arm = build.hinge(
                f"{side}_motor", shank, at=(0, -0.15), mass=weight, inertia=weight, torque=80
            )
            rod = build.hinge(
                f"{side}_rod", arm, at=(-lever, 0), mass=weight, inertia=weight,
                center_of_mass=(0, -0.12),
            )  # fmt: skip
            build.loop(rod, foot, at=(0, -0.25))
        build.sole(foot, heel=(-0.07, -0.05), toe=(0.15, -0.05))
    return build.build()


@pytest.fixture(scope="module")
def gait() -> hs.Gait:
    """A gait of a robot whose levers and rods have weights of their own."""
    robot = parallel_ankles()
    return hs.optimize_gait(
        robot, step_length=0.3, step_duration=0.6, friction=0.6, starts=1
    )  # fmt: skip


def asked_of(robot: Robot) -> Transcription:
    return Transcription(
        Request(
            robot=robot, step_length=0.3, step_duration=0.6, speed=None, friction=0.6,
            clearance=0.03, clearance_profile=None, zmp_margin=None, force_margin=None,
            joint_speed_limit=np.inf, joint_ranges=None, impact=True, intervals=None, starts=1,
        )
    )  # fmt: skip


def test_effort_and_constraints_are_those_of_motors_in_the_ankles() -> None:
    """At any motion: torques, wrench, clearance, impact, and the start that follows."""
    own, lever = asked_of(biped("own")), asked_of(biped("lever"))
    assert lever.size == own.size == 6
    q, v, a, after = 0.4 * np.random.default_rng(3).normal(size=(4, 6))
    level = np.zeros(2)
    along, landing = (q, v, a, 0.3, level), (q, v, after, level)
    for function, arguments in (("motion", along), ("landing", landing)):
        found, expected = (getattr(each, function)(*arguments) for each in (lever, own))
        for k in range(3):
            np.testing.assert_allclose(
                np.array(found[k]), np.array(expected[k]), rtol=1e-6, atol=1e-6
            )
    effort = [float(each.path(*along)[0]) for each in (lever, own)]
    assert effort[0] == pytest.approx(effort[1], rel=1e-6)
    names = [row.subject for row in own.path_rows]
    assert {row.subject for row in lever.path_rows} >= {n for n in names if "ankle" not in n}
    touchdown = [np.array(each.touchdown(q, v, after, 0.6, 0.3, level)) for each in (lever, own)]
    np.testing.assert_allclose(touchdown[0], touchdown[1], rtol=1e-6, atol=1e-6)
    robot = biped("lever")
    position, velocity = (np.array(part).ravel() for part in lever.start(q, after, level))
    assert np.abs(dynamics.loop_displacement(robot, position)).max() < 1e-13
    assert np.abs(dynamics.loop_jacobian(robot, position) @ velocity).max() < 1e-13


def test_a_gait_of_a_robot_with_loops_goes_through_a_file(gait: hs.Gait, tmp_path: Path) -> None:
    gait.save(tmp_path / "gait.json")
    back = hs.load_gait(tmp_path / "gait.json", parallel_ankles())
    np.testing.assert_array_equal(back.initial_state.q, gait.initial_state.q)
    np.testing.assert_array_equal(back.initial_state.v, gait.initial_state.v)


@pytest.mark.parametrize(
    ("method", "near"),
    [(hs.TimeStepping(step=1e-3), 5e-3), (hs.EventDriven(rtol=1e-7, atol=1e-9), 1e-6)],
    ids=["steps", "events"],
)
def test_a_gait_through_parallel_ankles_is_walked(gait: hs.Gait, method: Any, near: float) -> None:
    robot = parallel_ankles()
    run = hs.simulate(
        robot, ComputedTorque(robot, gait), state=gait.initial_state, duration=1.2, method=method,
        ground=hs.Ground(friction=0.6),
    )  # fmt: skip
    assert run.completed
    assert run.position[-1, 0] - run.position[0, 0] == pytest.approx(0.6, abs=near)
    open_by = [np.abs(dynamics.loop_displacement(robot, q)).max() for q in run.position[::50]]
    assert max(open_by) < 1e-13
    if isinstance(method, hs.EventDriven):
        assert np.abs(run.torque).max() == pytest.approx(gait.margins.peak_torque, rel=1e-3)


def test_a_light_rod_bears_what_the_motor_gives(gait: hs.Gait) -> None:
    """Force and torque on a lever that weighs nothing are in balance about its pivot."""
    robot = biped("lever")
    run = hs.simulate(
        robot, ComputedTorque(robot, gait), state=gait.initial_state, duration=0.3,
        method=hs.EventDriven(), ground=hs.Ground(friction=0.6),
    )  # fmt: skip
    for loop, side in enumerate(("right", "left")):
        chain = [robot.joint_index(f"{side}_{name}") for name in ("hip", "knee", "motor")]
        angle = run.position[:, [2, *chain]].sum(axis=1)  # of the lever, which points backward
        x, z = run.loop_force[:, loop].T  # on the rod, and by the rod on the lever
        motor = run.torque[:, robot.actuator_index(f"{side}_motor")]
        assert np.abs(motor).max() > 0.01
        moment = LEVER * (np.sin(angle) * x + np.cos(angle) * z)
        np.testing.assert_allclose(motor, -moment, rtol=0, atol=1e-6 * np.abs(motor).max())


def single_support(robot: Robot, foot: int = 0) -> hs.State:
    """A posture on one flat foot, the other in the air, joints moving."""
    chosen = {"right_hip": -0.3, "right_knee": 0.5, "left_hip": -0.6, "left_knee": 0.9}
    turned = {"right_hip": 0.4, "right_knee": -0.7, "left_hip": 0.5, "left_knee": -0.3}
    for name, value, rate in (("right", -0.2, 0.3), ("left", 0.1, -0.6)):
        for joint in ("ankle", "motor"):
            if f"{name}_{joint}" in robot.joint_names:
                chosen[f"{name}_{joint}"], turned[f"{name}_{joint}"] = value, rate
    keep = [*robot.joint_names[:3], *chosen]
    state = robot.closed(robot.state(chosen, turned), keep=keep)
    return robot.placed(state, hs.Ground())


def wanted_torque(robot: Robot, state: hs.State, acceleration: np.ndarray) -> np.ndarray:
    from heelstrike.sim.controller.robot import controlled_robot

    view = controlled_robot(robot)
    view.estimate.q[:], view.estimate.v[:] = state.q, state.v
    view.update(view.estimate)
    torque = acceleration.copy()
    view.flat_foot_torque(view.estimate, 0, torque, torque)
    return torque


def test_torques_are_those_of_motors_in_the_ankles() -> None:
    acceleration = np.random.default_rng(5).normal(size=6)
    found = [
        wanted_torque(robot, single_support(robot), acceleration)
        for robot in (biped("own"), biped("lever"))
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


@pytest.mark.parametrize("make", [parallel_ankles, lambda: biped("lever", weight=0.4, lever=0.08)])
def test_torques_do_what_they_are_asked_for(make: Any) -> None:
    """Held by foot and loops, forward dynamics answers with the accelerations asked for."""
    robot = make()
    state = single_support(robot)
    asked = np.random.default_rng(6).normal(size=robot.nu)
    torque = wanted_torque(robot, state, asked)
    link = robot.feet[0].link
    held = dynamics.point_jacobian(robot, state.q, link, [0.0, 0.0])
    drift = dynamics.point_bias_acceleration(robot, state.q, state.v, link, [0.0, 0.0])
    rows = np.concatenate([held, dynamics.loop_jacobian(robot, state.q)])
    bias = np.concatenate([drift, dynamics.loop_bias_acceleration(robot, state.q, state.v)])
    matrix = dynamics.mass_matrix(robot, state.q)
    force = -dynamics.bias_force(robot, state.q, state.v)
    force[robot.model.actuator_joint] += torque
    size = len(rows)
    system = np.block([[matrix, -rows.T], [rows, np.zeros((size, size))]])
    found = np.linalg.solve(system, np.concatenate([force, -bias]))[: robot.nv]
    np.testing.assert_allclose(found[robot.model.actuator_joint], asked, rtol=1e-8, atol=1e-9)


def test_two_motors_of_one_ankle_share_its_torque() -> None:
    """At a ratio of one, least norm is half each."""
    one, two = biped("own"), biped("both")
    asked = np.random.default_rng(7).normal(size=6)
    alone = wanted_torque(one, single_support(one), asked)
    by_name = dict(zip(one.actuator_names, asked, strict=True))
    of = {name: by_name[name.replace("motor", "ankle")] for name in two.actuator_names}
    shared = wanted_torque(two, single_support(two), np.array(list(of.values())))
    got = dict(zip(two.actuator_names, shared, strict=True))
    for name, torque in zip(one.actuator_names, alone, strict=True):
        if "ankle" in name:
            half = [got[name], got[name.replace("ankle", "motor")]]
            np.testing.assert_allclose(half, 0.5 * torque, rtol=1e-6)
        else:
            assert got[name] == pytest.approx(torque, rel=1e-6)


def geared_legs() -> Robot:
    """Biped on point feet whose shanks follow the thighs by a belt."""
    build = RobotBuilder("geared_legs")
    trunk = build.floating_base("trunk", (0, 0.9), mass=10, inertia=0.5, center_of_mass=(0, 0.2))
    for side in ("right", "left"):
        thigh = build.hinge(
            f"{side}_hip", trunk, mass=3, inertia=0.05, center_of_mass=(0, -0.2), torque=100
        )
        shank = build.hinge(
            f"{side}_knee", thigh, at=(0, -0.45), mass=2, inertia=0.04, center_of_mass=(0, -0.2)
        )
        build.contact(shank, (0, -0.45))
        build.couple(f"{side}_knee", f"{side}_hip", [0.0, -1.5, 0.3])
    return build.build()


def test_on_a_point_foot_what_no_motor_reaches_follows() -> None:
    from heelstrike.sim.controller.interface import Contacts
    from heelstrike.sim.controller.robot import controlled_robot

    robot, ground = geared_legs(), hs.Ground()
    state = robot.closed(
        robot.state({"right_hip": -0.2, "left_hip": -0.5}, {"right_hip": 0.6, "left_hip": -0.8}),
        keep=["right_hip", "left_hip"],
    )
    state = robot.placed(state, ground)
    at = hs.contact_kinematics(robot, state.q, state.v, ground)
    foot = int(np.argmin(at.gap))
    view = controlled_robot(robot)
    view.estimate.q[:], view.estimate.v[:] = state.q, state.v
    view.update(view.estimate)
    contacts = Contacts(position=at.position, normal=at.normal, gap=at.gap, force=np.zeros((2, 2)))
    asked = np.array([0.7, -1.1])
    torque = asked.copy()
    owner = next(i for i, each in enumerate(robot.feet) if foot in each.contacts)
    view.point_foot_torque(view.estimate, contacts, owner, torque, torque)
    rows = np.concatenate([at.jacobian[foot], dynamics.loop_jacobian(robot, state.q)])
    bias = np.concatenate(
        [at.bias_acceleration[foot], dynamics.loop_bias_acceleration(robot, state.q, state.v)]
    )
    force = -dynamics.bias_force(robot, state.q, state.v)
    force[robot.model.actuator_joint] += torque
    zero = np.zeros((len(rows), len(rows)))
    system = np.block([[dynamics.mass_matrix(robot, state.q), -rows.T], [rows, zero]])
    found = np.linalg.solve(system, np.concatenate([force, -bias]))[: robot.nv]
    np.testing.assert_allclose(found[robot.model.actuator_joint], asked, rtol=1e-8)


@pytest.mark.parametrize("law", ["springs", "encoder", "sensors", "estimate"])
def test_laws_that_read_motors_walk_on_parallel_ankles(gait: hs.Gait, law: str) -> None:
    """What they are shown has closed loops: joints without a motor follow from the readings."""
    robot = parallel_ankles()
    read, torque = hs.Encoders(bits=16, noise=1e-5), ComputedTorque(robot, gait)
    laws = {
        "springs": lambda: hs.JointPD(robot, gait, kp=1000.0, kd=[20.0, 20.0, 2.0] * 2),
        "encoder": lambda: ComputedTorque(robot, gait, encoder=hs.Encoder()),
        "sensors": lambda: hs.Sensed(torque, encoders=hs.Encoders(noise=1e-5, cutoff=100.0)),
        "estimate": lambda: hs.Sensed(hs.Estimated(torque), encoders=read),
    }
    run = hs.simulate(
        robot, laws[law](), state=gait.initial_state, duration=1.2, ground=hs.Ground(friction=0.6)
    )
    assert run.completed
    assert run.position[-1, 0] - run.position[0, 0] == pytest.approx(0.6, abs=1e-2)
    assert abs(run.position[-1, 2] - run.position[0, 2]) < 0.02
    for seen in ("measured", "estimated"):
        if f"{seen}_position" not in run.log:
            continue
        ankle = robot.joint_index("right_ankle")
        q, v = (run.log[f"{seen}_{what}"].values[::50] for what in ("position", "velocity"))
        assert 0.0 < np.abs(q - run.position[::50])[:, ankle].max() < 1e-3
        for position, velocity in zip(q, v, strict=True):
            assert np.abs(dynamics.loop_displacement(robot, position)).max() < 1e-13
            assert np.abs(dynamics.loop_jacobian(robot, position) @ velocity).max() < 1e-9


def test_a_regulator_of_standing_finds_the_motions_of_motors_in_the_ankles() -> None:
    """Light levers and rods change nothing: motions about the posture are the same."""
    own, lever = (linear_standing(robot, robot.reference_state().q) for robot in map(biped, NAMES))
    assert lever.A.shape == own.A.shape == (8, 8)
    found = [np.sort_complex(np.linalg.eigvals(each.A)) for each in (lever, own)]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)
    np.testing.assert_allclose(lever.torque, own.torque, rtol=1e-6, atol=1e-6)
    robot = parallel_ankles()
    law = hs.StandingLQR(robot)
    assert law.poles.real.max() < -1.0
    push = hs.Push("trunk", force=(100.0, 0.0), start=0.1, duration=0.1)
    run = hs.simulate(robot, law, state=robot.reference_state(), duration=2.5, pushes=push)
    assert np.ptp(run.position[:, 2]) > 0.01
    np.testing.assert_allclose(run.position[-1], run.position[0], rtol=0, atol=1e-3)
    torn = robot.state({"right_motor": 0.1}).q
    with pytest.raises(ControllerError, match=r"is open by 0.0\d+: take robot.closed\(state\).q"):
        hs.StandingLQR(robot, torn)


def test_what_motors_do_not_reach_is_refused(gait: hs.Gait) -> None:
    with pytest.raises(ControllerError, match="has loop right_rod-right_ankle"):
        hs.ZeroMomentPointRegulation(parallel_ankles(), gait)
    with pytest.raises(GaitError, match="has none at right_ankle, right_rod"):
        hs.PhasedGait.from_gait(parallel_ankles(), gait)
    build = RobotBuilder("loose")
    trunk = build.floating_base("trunk", (0, 0.9), mass=10, inertia=0.5)
    for side in ("right", "left"):
        leg = build.hinge(f"{side}_hip", trunk, mass=3, inertia=0.05, torque=9)
        foot = build.hinge(f"{side}_ankle", leg, at=(0, -0.8), mass=1, inertia=0.01)
        arm = build.hinge(f"{side}_arm", trunk, mass=1, inertia=0.01)
        build.couple(f"{side}_arm", f"{side}_hip")
        build.sole(foot, heel=(-0.1, -0.05), toe=(0.1, -0.05))
        assert arm
    loose = build.build()
    with pytest.raises(ControllerError, match="nothing drives right_ankle, left_ankle"):
        pitch_of(loose)
    with pytest.raises(GaitError, match="leave 2 of them free"):
        hs.optimize_gait(loose, step_length=0.2)
    with pytest.raises(GaitError, match="connect driven joints with each other"):
        hs.optimize_gait(biped("both"), step_length=0.2)
