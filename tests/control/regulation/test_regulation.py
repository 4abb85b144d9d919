"""Regulation of the zero moment point: the law by dense matrices, and feet that stay flat."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.zero_moment_point import zero_moment_point
from heelstrike.control.regulation.interval import narrowed
from heelstrike.errors import ControllerError

PUSH = hs.Push("trunk", force=(150.0, 0.0), start=0.98, duration=0.1)
"""15 N s, where computed torque tips the foot at 5."""


def law(**options: Any) -> hs.Law:
    return hs.ZeroMomentPointRegulation(walking.bravo7(), walking.gait(), **options)


def walk(controller: hs.Law, duration: float = 2.1, **options: Any) -> hs.Run:
    setup: dict[str, Any] = {"pushes": PUSH, "ground": hs.Ground(friction=0.75)} | options
    return hs.simulate(
        walking.bravo7(), controller, state=walking.gait().initial_state, duration=duration, **setup
    )


def in_the_air() -> Any:
    contacts = hs.Simulation(walking.bravo7(), state=walking.gait().initial_state).contacts
    return type(contacts)(
        **{k: np.zeros_like(v) if k == "force" else v for k, v in contacts.members().items()}
    )


def expected_wrench(
    q: np.ndarray, v: np.ndarray, joints: np.ndarray, foot: int
) -> tuple[np.ndarray, np.ndarray]:
    """Torques and the ground's wrench on the ankle's place, by dense matrices."""
    robot = walking.bravo7()
    link, driven = robot.feet[foot].link, robot.model.actuator_joint
    jacobian = dynamics.point_jacobian(robot, q, link, np.zeros(2))
    drift = dynamics.point_bias_acceleration(robot, q, v, link, np.zeros(2))
    acceleration = np.zeros(robot.nv)
    acceleration[driven] = joints
    acceleration[:3] = np.linalg.solve(jacobian[:, :3], -drift - jacobian @ acceleration)
    force = dynamics.inverse_dynamics(robot, q, v, acceleration)
    force -= dynamics.passive_force(robot, q, v)
    wrench = np.linalg.solve(jacobian[:, :3].T, force[:3])
    return (force - jacobian.T @ wrench)[driven], wrench


@pytest.mark.parametrize("seed", range(6))
def test_the_clock_obeys_its_time_law_as_far_as_the_sole_reaches(seed: int) -> None:
    """All that is free is s̈: the zero moment point is on its margin, or s̈ is the gait's own.

    The state is drawn about that of the gait; the law begins at s = 0, ṡ = 1. Its answer is
    compared with inverse dynamics by dense matrices at accelerations q_d′ s̈ + q_d″ + feedback.
    """
    robot, gait = walking.bravo7(), walking.gait()
    draw = np.random.default_rng(seed)
    q = gait.initial_state.q + 0.01 * draw.normal(size=robot.nq)
    v = gait.initial_state.v + 0.1 * draw.normal(size=robot.nv)
    controller = law(hurry=1e6)
    torque = controller.torque(0.0, hs.State(q, v), in_the_air())
    choice = controller.remembered
    driven = robot.model.actuator_joint
    own = gait.acceleration(0.0) + 400.0 * (gait.position(0.0) - q[driven])
    own += 40.0 * (gait.velocity(0.0) - v[driven])
    joints = own + gait.velocity(0.0) * choice.hurry
    foot = gait.stance_foot
    expected, wrench = expected_wrench(q, v, joints, foot)
    np.testing.assert_allclose(torque, expected, atol=1e-9 * np.abs(expected).max())

    # On the sole: the ankle is 7 cm above its middle, in the foot's axes.
    angle = dynamics.link_poses(robot, q).angle[robot.feet[foot].link]
    ends = robot.model.contact_position[list(robot.feet[foot].contacts)]
    middle, half = ends.mean(axis=0), 0.5 * np.ptp(ends[:, 0])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    x, z = turn @ middle
    about = wrench[2] - z * wrench[0] + x * wrench[1]
    normal = turn[:, 1] @ wrench[:2]
    place = -about / normal
    tangent = turn[:, 0] @ wrench[:2]
    assert abs(place) < half - 0.02 + 1e-9
    assert abs(tangent) < gait.friction * normal * (1.0 + 1e-9)
    margins = [half - 0.02 - abs(place), gait.friction - abs(tangent) / normal]
    margins.append(normal / robot.weight - 0.1)
    assert choice.hurry == 0.0 or min(map(abs, margins)) < 1e-9


def test_the_ankle_does_what_the_clock_may_not() -> None:
    """With the clock bound to time the ankle alone brings the zero moment point to its margin."""
    robot, gait = walking.bravo7(), walking.gait()
    v = gait.initial_state.v.copy()
    v[robot.model.actuator_joint[2]] += 2.0
    controller = law(hurry=1e-9)
    torque = controller.torque(0.0, hs.State(gait.initial_state.q, v), in_the_air())
    free = law(kd=40.0, hurry=1e6).torque(0.0, hs.State(gait.initial_state.q, v), in_the_air())
    rows = controller.remembered.choice.conditions
    assert abs(controller.remembered.hurry) <= 1e-9
    assert rows[:2, 0].min() < -1.0  # without help it would tip
    assert not np.allclose(torque, free, atol=0.1)


def test_narrowed_keeps_what_is_left_or_the_nearest_end() -> None:
    assert narrowed(-1.0, 1.0, 0.5, 1.0) == (-0.5, 1.0, True)
    assert narrowed(-1.0, 1.0, 0.5, -1.0) == (-1.0, 0.5, True)
    assert narrowed(-1.0, 1.0, -2.0, 1.0) == (1.0, 1.0, False)
    assert narrowed(-1.0, 1.0, -2.0, -1.0) == (-1.0, -1.0, False)
    assert narrowed(-1.0, 1.0, 2.0, 0.0) == (-1.0, 1.0, True)
    assert narrowed(-1.0, 1.0, -2.0, 0.0) == (-1.0, 1.0, False)


@pytest.mark.parametrize("method", [hs.TimeStepping(), hs.EventDriven(rtol=1e-6)])
def test_a_pushed_foot_stays_flat(method: Any) -> None:
    """The zero moment point keeps 1 cm, of 2 that are asked for; computed torque tips the foot."""
    run = walk(law(), method=method)
    zero = zero_moment_point(run)
    settled = zero.single_support.copy()
    for event in run.events:  # an impact takes two steps, or the instants between heel and toe
        settled &= np.abs(run.time - event.time) > 2.5e-3
    margin = np.nanmin(zero.foot_margin[settled], axis=1)
    assert settled.sum() > 0.95 * len(run.time)
    assert margin.min() > 0.01
    rate = run.log["rate"].values
    assert rate.max() > 1.3  # forward pushes are answered by haste
    assert abs(rate[-1] - 1.0) < 0.1
    assert run.log["given_up"].values.max() == 0
    # What the law expects is what it gets, from a little after the push on.
    later = settled & (run.time > 1.2)
    expected = run.log["pressure"].values[later]
    foot = np.nanmax(zero.foot[later], axis=1)
    assert np.abs(expected - foot).max() < 2e-3
    speed = np.abs(run_motion(run).contact_velocity[settled]).max(axis=2)
    stands = run.contact_force[settled, :, 0] > 0.0
    assert speed[stands].max() < 5e-3


def test_computed_torque_tips_the_foot_of_that_push() -> None:
    run = walk(hs.ComputedTorque(walking.bravo7(), walking.gait()), duration=1.4)
    zero = zero_moment_point(run)
    edge = np.nanmin(zero.foot_margin[zero.single_support], axis=1)
    assert np.sum(edge < 1e-6) > 20


def test_unpushed_it_is_computed_torque() -> None:
    """On the gait s̈ = 0 is within the interval, and the clock is time."""
    run = walk(law(), duration=0.6, pushes=[])
    usual = walk(hs.ComputedTorque(walking.bravo7(), walking.gait()), duration=0.6, pushes=[])
    np.testing.assert_allclose(run.position, usual.position, atol=1e-6)
    np.testing.assert_allclose(run.log["clock"].values, run.time, atol=1e-12)


def test_what_pushes_is_felt() -> None:
    """The disturbance is the push: (150, 0) N and its moment about the trunk's frame."""
    robot = walking.bravo7()
    simulation = hs.Simulation(
        robot, law(bandwidth=np.inf), state=walking.gait().initial_state, pushes=PUSH,
        ground=hs.Ground(friction=0.75),
    )  # fmt: skip
    simulation.advance(1.05)
    felt = simulation.memory.disturbance.force
    poses = dynamics.link_poses(robot, simulation.state.q)
    height = poses.center_of_mass[2, 1] - poses.origin[2, 1]
    pushed = np.zeros(robot.nv)
    pushed[0], pushed[2] = 150.0, 150.0 * height * robot.model.axis[2, 0]
    np.testing.assert_allclose(felt, pushed, atol=0.1)
    simulation.advance(1.15)
    np.testing.assert_allclose(simulation.memory.disturbance.force, 0.0, atol=0.1)


def test_snapshots_take_the_clock_along() -> None:
    simulation = hs.Simulation(
        walking.bravo7(), law(), state=walking.gait().initial_state, pushes=PUSH
    )
    simulation.advance(1.05)
    before = simulation.snapshot()
    simulation.advance(1.2)
    once = simulation.state.q.copy()
    simulation.restore(before)
    simulation.advance(1.2)
    np.testing.assert_array_equal(simulation.state.q, once)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"margin": 0.1}, "less than half the sole of robot 'bravo7', 0.1 m"),
        ({"margin": -0.01}, "margin must be"),
        ({"slowest": 1.5}, "slowest must be from 0 to 1"),
        ({"slowest": -0.5}, "never goes back"),
        ({"fastest": 0.5}, "slowest must be from 0 to 1"),
        ({"returning": 0.0}, "returning must be a positive number"),
        ({"hurry": np.inf}, "hurry must be a positive number"),
        ({"friction": -1.0}, "friction must be a positive number"),
        ({"least_force": 1.0}, "a part of the weight"),
        ({"bandwidth": 0.0}, "a positive frequency"),
        ({"kp": -1.0}, "kp must not be negative"),
        ({"kd": [1.0, 2.0]}, "one finite number or 6"),
        ({"period": 0.0}, "period of a controller must be a positive number"),
    ],
)
def test_wrong_numbers_are_named(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ControllerError, match=said):
        law(**options)


def test_a_gait_on_point_feet_is_refused() -> None:
    robot, gait = walking.rabbit(), walking.rabbit_gait()
    with pytest.raises(ControllerError, match="one flat foot at a time"):
        hs.ZeroMomentPointRegulation(robot, gait)
