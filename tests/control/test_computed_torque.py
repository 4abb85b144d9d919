"""Computed torque: the law is eq. 37, the phase restarts, and encoders are as good as exact."""

from __future__ import annotations

import copy
import pickle
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import walking
from gait_motion import foot_jacobian, middle, selection, standing
from robot_cases import builtin_xml

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control import Encoder
from heelstrike.control import computed_torque as law
from heelstrike.robot import read_mjcf
from heelstrike.sim import Contacts
from heelstrike.sim.controller.robot import extents_of


def nothing_touches() -> Contacts:
    return Contacts.allocate(
        nc=4, axes=2, components=2, normal=np.tile([0.0, 1.0], (4, 1)), gap=np.ones(4)
    )


def as_the_paper_writes_it(
    robot: hs.Robot, link: int, q: np.ndarray, v: np.ndarray, wanted: np.ndarray
) -> np.ndarray:
    """Γ = MᵀA M q̈ᵈ + MᵀA N + MᵀH (eq. 34-39), with dense matrices."""
    jacobian = dynamics.point_jacobian(robot, q, link, np.zeros(2))
    bias = dynamics.point_bias_acceleration(robot, q, v, link, np.zeros(2))
    driven = robot.model.actuator_joint
    free = np.setdiff1d(np.arange(robot.nv), driven)
    projection = np.zeros((robot.nv, robot.nu))
    projection[driven] = np.eye(robot.nu)
    projection[free] = -np.linalg.solve(jacobian[:, free], jacobian[:, driven])
    remainder = np.zeros(robot.nv)
    remainder[free] = -np.linalg.solve(jacobian[:, free], bias)
    mass = dynamics.mass_matrix(robot, q)
    force = dynamics.bias_force(robot, q, v) - dynamics.passive_force(robot, q, v)
    return projection.T @ (mass @ (projection @ wanted + remainder) + force)


@pytest.mark.parametrize("seed", range(5))
def test_the_law_is_the_papers(seed: int) -> None:
    robot, gait = walking.bravo7(), walking.gait()
    draw = np.random.default_rng(seed)
    controller = hs.ComputedTorque(robot, gait, kp=300.0, kd=30.0)
    t = float(draw.uniform(0.0, 0.3))
    q = gait.initial_state.q + 0.3 * draw.normal(size=robot.nq)
    v = gait.initial_state.v + draw.normal(size=robot.nv)
    driven = robot.model.actuator_joint
    wanted = (
        gait.acceleration(t)
        + 30.0 * (gait.velocity(t) - v[driven])
        + 300.0 * (gait.position(t) - q[driven])
    )
    link = robot.feet[gait.stance_foot].link
    expected = as_the_paper_writes_it(robot, link, q, v, wanted)
    torque = controller.torque(t, hs.State(q, v), nothing_touches())
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


SPRINGY = re.sub(
    r'axis="0 1 0" range="(\S+ \S+)"/>',
    r'axis="0 1 0" range="\1" stiffness="80" springref="20" damping="3" armature="0.05"/>',
    builtin_xml("bravo7"),
)
"""The built-in robot with springs, dampers and rotors in its joints."""


@pytest.mark.parametrize("seed", range(3))
def test_springs_and_dampers_are_made_up_for(seed: int) -> None:
    """The law against forward dynamics with contact, which knows nothing of it.

    With the stance foot flat and at rest, v̇ of the joints is the reference's plus feedback,
    whatever springs, dampers and rotors there are in the joints.
    """
    robot, gait = read_mjcf(SPRINGY, name="bravo7"), walking.gait()
    assert np.count_nonzero(robot.model.stiffness) == 6
    assert np.count_nonzero(robot.model.rest) == 6
    draw = np.random.default_rng(seed)
    t, kp, kd = float(draw.uniform(0.1, 0.3)), 300.0, 30.0
    foot, joints = gait.stance_foot, robot.model.actuator_joint
    q = standing(robot, gait.position(t) + 0.02 * draw.normal(size=6), foot)
    rows = foot_jacobian(robot, q, foot)
    v = np.zeros(robot.nv)
    v[joints] = gait.velocity(t) + 0.1 * draw.normal(size=6)
    v[:3] = -np.linalg.solve(rows[:, :3], rows @ v)
    wanted = (
        gait.acceleration(t)
        + kd * (gait.velocity(t) - v[joints])
        + kp * (gait.position(t) - q[joints])
    )
    torque = hs.ComputedTorque(robot, gait, kp=kp, kd=kd).torque(
        t, hs.State(q, v), nothing_touches()
    )
    # The ground holds the foot's three coordinates; what it takes to do so follows.
    mass = dynamics.mass_matrix(robot, q)
    drift = dynamics.point_bias_acceleration(
        robot, q, v, robot.feet[foot].link, middle(robot, foot)
    )
    force = selection(robot) @ torque + dynamics.passive_force(robot, q, v)
    force -= dynamics.bias_force(robot, q, v)
    whole = np.block([[mass, -rows.T], [rows, np.zeros((3, 3))]])
    found = np.linalg.solve(whole, np.concatenate([force, -drift]))[: robot.nv]
    np.testing.assert_allclose(found[joints], wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def test_touchdown_exchanges_the_feet_and_restarts_the_phase() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    controller = hs.ComputedTorque(robot, gait)
    state = gait.initial_state
    swing = robot.feet[1 - gait.stance_foot]
    touching = nothing_touches()
    touching.force[swing.contacts[0], 0] = 100.0
    driven = robot.model.actuator_joint

    def wanted(phase: float, mirrored: bool) -> np.ndarray:
        a = gait.mirrored_coefficients(robot) if mirrored else gait.coefficients
        position = a[0] + phase * (a[1] + phase * (a[2] + phase * a[3]))
        velocity = a[1] + phase * (2 * a[2] + 3 * phase * a[3])
        return (
            2 * a[2]
            + 6 * a[3] * phase
            + 40.0 * (velocity - state.v[driven])
            + 400.0 * (position - state.q[driven])
        )

    def expected(foot: int, phase: float, mirrored: bool) -> np.ndarray:
        link = robot.feet[foot].link
        return as_the_paper_writes_it(robot, link, state.q, state.v, wanted(phase, mirrored))

    # In the first half of the step a touch of the swing foot counts for nothing (it has just left).
    torque = controller.torque(0.2, state, touching)
    np.testing.assert_allclose(torque, expected(gait.stance_foot, 0.2, False), atol=1e-8)
    # Later it is a touchdown: left and right change places and the phase starts at zero.
    torque = controller.torque(0.6, state, touching)
    np.testing.assert_allclose(torque, expected(1 - gait.stance_foot, 0.0, True), atol=1e-8)
    torque = controller.torque(0.65, state, nothing_touches())
    np.testing.assert_allclose(torque, expected(1 - gait.stance_foot, 0.05, True), atol=1e-8)


def test_velocities_count_again_once_the_foot_has_stopped() -> None:
    """Between first touch and rest the velocity feedback pauses; a slow foot ends the pause."""
    robot, gait = walking.bravo7(), walking.gait()
    controller = hs.ComputedTorque(robot, gait)
    swing = robot.feet[1 - gait.stance_foot]
    touching = nothing_touches()
    touching.force[swing.contacts[0], 0] = 100.0
    q = gait.initial_state.q
    falling = np.zeros(robot.nv)
    falling[1] = -0.1  # the whole robot comes down, and both feet with it
    driven = robot.model.actuator_joint
    a = gait.mirrored_coefficients(robot)
    expected = as_the_paper_writes_it(
        robot, swing.link, q, falling, 2 * a[2] + 400.0 * (a[0] - q[driven])
    )
    torque = controller.torque(0.6, hs.State(q, falling), touching)
    np.testing.assert_allclose(torque, expected, atol=1e-8)
    rest = 0.0 * falling
    t = 1e-3
    wanted = (
        2 * a[2]
        + 6 * a[3] * t
        + 40.0 * (a[1] + t * (2 * a[2] + 3 * t * a[3]))
        + 400.0 * (a[0] + t * (a[1] + t * (a[2] + t * a[3])) - q[driven])
    )
    torque = controller.torque(0.6 + t, hs.State(q, rest), touching)
    expected = as_the_paper_writes_it(robot, swing.link, q, rest, wanted)
    np.testing.assert_allclose(torque, expected, atol=1e-8)


def test_a_late_step_goes_on_for_a_tenth_and_then_rests() -> None:
    """Eq. 41 says zero after T, which would throw the joints to the straight posture."""
    robot, gait = walking.bravo7(), walking.gait()
    link = robot.feet[gait.stance_foot].link
    driven = robot.model.actuator_joint
    state = hs.State(gait.initial_state.q, 0.0 * gait.initial_state.v)
    a, end = gait.coefficients, 1.1 * gait.step_duration
    position = a[0] + end * (a[1] + end * (a[2] + end * a[3]))
    wanted = 400.0 * (position - state.q[driven])
    torque = hs.ComputedTorque(robot, gait).torque(5.0, state, nothing_touches())
    expected = as_the_paper_writes_it(robot, link, state.q, state.v, wanted)
    np.testing.assert_allclose(torque, expected, atol=1e-8)


@pytest.mark.parametrize(
    ("encoder", "tracking"),
    [(Encoder(period=1e-3, resolution=0.0), 2e-3), (Encoder(), 4e-3)],
    ids=["sampled", "sampled and rounded"],
)
def test_walks_on_encoders(encoder: Encoder, tracking: float) -> None:
    """Ten steps on velocities estimated by cubics through four samples (section 5)."""
    robot, gait = walking.bravo7(), walking.gait()
    run = hs.simulate(
        robot,
        hs.ComputedTorque(robot, gait, encoder=encoder),
        state=gait.initial_state,
        duration=7.0,
    )
    summary = run.summary(gait=gait)
    assert run.completed, run.message
    assert summary.steps == 10
    assert summary.tracking_rms_rad <= tracking
    assert -0.1 < summary.zmp_min_m < summary.zmp_max_m < 0.1


def test_what_encoders_tell_the_law() -> None:
    """Without a velocity to see: the reference's at first, then slopes through 2, 3, 4 samples.

    A touchdown makes it forget the samples before. The foot is flat and at rest, the trunk where
    that puts it, whatever the state says of it.
    """
    robot, gait = walking.bravo7(), walking.gait()
    h, start = 0.01, 0.1
    controller = hs.ComputedTorque(
        robot, gait, kp=300.0, kd=30.0, encoder=Encoder(period=h, resolution=0.0)
    )
    driven, foot = robot.model.actuator_joint, gait.stance_foot
    draw = np.random.default_rng(3)
    joints = gait.position(start) + 0.02 * draw.normal(size=(6, 6)).cumsum(axis=0)
    for k, measured in enumerate(joints):
        t = start + k * h
        newest, *before = joints[k::-1][:4]
        match before:
            case []:
                seen = gait.velocity(t)
            case [a]:
                seen = (newest - a) / h
            case [a, b]:
                seen = (3.0 * newest - 4.0 * a + b) / (2.0 * h)
            case [a, b, c]:
                seen = (11.0 * newest - 18.0 * a + 9.0 * b - 2.0 * c) / (6.0 * h)
        q = standing(robot, measured, foot)
        v = np.zeros(robot.nv)
        v[driven] = seen
        rows = foot_jacobian(robot, q, foot)
        v[:3] = -np.linalg.solve(rows[:, :3], rows @ v)
        wanted = (
            gait.acceleration(t)
            + 30.0 * (gait.velocity(t) - seen)
            + 300.0 * (gait.position(t) - measured)
        )
        expected = as_the_paper_writes_it(robot, robot.feet[foot].link, q, v, wanted)
        told = q.copy()
        told[2] += 0.3  # the trunk's pitch is not measured
        state = hs.State(told, np.full(robot.nv, 7.0))
        torque = controller.torque(t, state, nothing_touches())
        np.testing.assert_allclose(torque, expected, atol=1e-8 * np.abs(expected).max())


def test_readings_are_rounded_and_due_once_a_period() -> None:
    from heelstrike.compiler.compilation import uncompiled

    read = uncompiled(law.read_encoders)
    parameters = hs.ComputedTorque(
        walking.bravo7(), walking.gait(), encoder=Encoder(period=0.01, resolution=0.25)
    ).parameters
    memory = law.Memory.allocate(nu=6)
    state = law.ControlState.allocate(extents_of(walking.bravo7()))
    for k, t in enumerate([0.0, 0.005, 0.01, 0.02, 0.03, 0.04]):
        state.joint_position[:] = 0.3 * k + np.arange(6)
        read(t, state, parameters, memory)
        assert memory.sampled == (0.0 if t == 0.005 else t)
        assert memory.samples == [1, 1, 2, 3, 4, 4][k]
    # 1.5, 1.2, 0.9 and 0.6, to quarters; the joints differ by whole numbers.
    expected = np.array([1.5, 1.25, 1.0, 0.5])[:, None] + np.arange(6)
    np.testing.assert_allclose(memory.readings, expected, atol=1e-12)


def test_a_light_touch_is_a_touchdown() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    controller = hs.ComputedTorque(robot, gait)
    touching = nothing_touches()
    touching.force[robot.feet[1 - gait.stance_foot].contacts[1], 0] = 1e-3
    controller.torque(0.6, gait.initial_state, touching)
    memory = controller.remembered
    assert memory.stance == 1 - gait.stance_foot
    assert memory.start == 0.6


def test_a_joint_without_a_motor_is_named() -> None:
    xml = re.sub(r'\s*<motor name="\w+_ankle".*', "", builtin_xml("bravo7"))
    with pytest.raises(hs.ControllerError, match=r"leaves .*right_ankle.*left_ankle without"):
        hs.ComputedTorque(read_mjcf(xml, name="bravo7"), walking.gait())


def test_the_estimate_is_exact_for_cubics() -> None:
    from heelstrike.compiler.compilation import uncompiled

    period, t = 0.01, 0.3
    instants = t - period * np.arange(4)
    samples = (2.0 - instants + 3.0 * instants**2 - 4.0 * instants**3)[:, None]
    slope = uncompiled(law.estimated_velocity)(samples, 4, period, 0)
    assert slope == pytest.approx(-1.0 + 6.0 * t - 12.0 * t**2, rel=1e-10)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"kp": -1.0}, "kp"),
        ({"kd": np.nan}, "kd"),
        ({"kp": [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]}, "kp"),
        ({"kd": [1.0, 1.0, np.nan, 1.0, 1.0, 1.0]}, "kd"),
        ({"kp": [1.0, 2.0]}, "kp must be one finite number or 6"),
    ],
)
def test_gains_are_checked(options: dict[str, object], words: str) -> None:
    with pytest.raises(hs.ControllerError, match=words):
        hs.ComputedTorque(walking.bravo7(), walking.gait(), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(("period", "resolution"), [(0.0, 0.0), (-1.0, 0.0), (1e-3, -1.0)])
def test_encoders_are_checked(period: float, resolution: float) -> None:
    with pytest.raises(hs.ControllerError, match="encoder"):
        Encoder(period=period, resolution=resolution)


def test_a_robot_that_computed_torque_cannot_hold() -> None:
    from robot_cases import RANDOM

    with pytest.raises(hs.ControllerError, match=r"not one: it(s base is fixed| has \d feet)"):
        hs.ComputedTorque(RANDOM[0].robot(), walking.gait())


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_a_copy_is_the_same_law(clone: Callable[[Any], Any]) -> None:
    """For another process, or to be changed: with the machine code of where it is."""
    robot, gait = walking.bravo7(), walking.gait()
    law = hs.ComputedTorque(robot, gait)
    contacts = Contacts.allocate(nc=robot.nc, axes=2, components=2)
    state = gait.initial_state
    torque = law.torque(0.0, state, contacts)
    np.testing.assert_array_equal(clone(law).torque(0.0, state, contacts), torque)


def test_unknown_keyword_raises() -> None:
    with pytest.raises(TypeError):
        hs.ComputedTorque(walking.bravo7(), walking.gait(), gain=3.0)  # type: ignore[call-arg]
