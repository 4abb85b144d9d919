"""A gait as a motion of all coordinates, judged by dense equations of motion of their own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import gait_motion
import numpy as np
import pytest
import walking

import heelstrike as hs

ON_POINTS = {"step_length": 0.21, "step_duration": 0.58, "clearance": 0.02, "friction": 0.6}


@cache
def rabbit() -> tuple[hs.Robot, hs.Gait]:
    robot = hs.load_robot("rabbit")
    return robot, hs.optimize_gait(robot, starts=1, **ON_POINTS)


@cache
def flat() -> hs.Motion:
    return walking.gait().motion(walking.bravo7())


@pytest.mark.parametrize("share", [0.0, 0.13, 0.5, 0.98])
def test_coordinates_and_forces_are_those_of_the_gait(share: float) -> None:
    robot, gait = walking.bravo7(), walking.gait()
    t = share * gait.step_duration
    expected = gait_motion.instant(robot, gait, t)
    (phase,) = flat().phases
    found = [phase.coordinates(t, order=order) for order in range(3)]
    np.testing.assert_allclose(found[0], expected.q, atol=1e-10)
    np.testing.assert_allclose(found[1], expected.v, atol=1e-8)
    np.testing.assert_allclose(found[2], expected.acceleration, atol=1e-5)
    normal, tangent = phase.forces(t).sum(axis=0)
    np.testing.assert_allclose((tangent, normal), expected.wrench[:2], atol=0.05)
    heel, toe = phase.forces(t)[list(robot.feet[gait.stance_foot].contacts), 0]
    assert 0.1 * (heel - toe) == pytest.approx(expected.wrench[2], abs=0.02)  # soles of ±0.1 m


def test_it_goes_on_as_the_gait_does() -> None:
    gait, motion = walking.gait(), flat()
    np.testing.assert_allclose(motion.initial_state.vector, gait.initial_state.vector)
    begin = np.concatenate([motion.position(0.0), motion.velocity(0.0)])
    np.testing.assert_allclose(begin, gait.initial_state.vector, atol=1e-7)
    times = np.linspace(0.0, 2.9, 40) * gait.step_duration
    driven = walking.bravo7().model.actuator_joint
    np.testing.assert_allclose(motion.position(times)[:, driven], gait.position(times), atol=1e-9)
    assert motion.position(2.0 * gait.step_duration)[0] - motion.position(0.0)[0] == pytest.approx(
        2.0 * gait.step_length, abs=1e-9
    )


def test_impulses_are_those_of_the_touchdown() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    (phase,) = flat().phases
    heel, toe = robot.feet[1 - gait.stance_foot].contacts
    normal, tangent, moment = gait.touchdown_impulse
    assert phase.impulse.sum(axis=0) == pytest.approx([normal, tangent])
    assert 0.1 * (phase.impulse[heel, 0] - phase.impulse[toe, 0]) == pytest.approx(moment)


def test_on_a_point_the_trunk_is_that_of_the_gait() -> None:
    robot, gait = rabbit()
    motion = gait.motion(robot)
    (phase,) = motion.phases
    (contact,) = robot.feet[gait.stance_foot].contacts
    for t in (0.0, 0.2, 0.55):
        q, v, a = (phase.coordinates(t, order=order) for order in range(3))
        assert q[2] == pytest.approx(float(gait.pitch(t)), abs=1e-10)
        held = hs.contact_inverse_dynamics(robot, q, v, a, contacts=[contact])
        np.testing.assert_allclose(phase.forces(t), held.contact_force, atol=1e-2)


def test_computed_torque_of_both_is_the_same() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    start = hs.State(gait.initial_state.q, 1.02 * gait.initial_state.v)
    seen = hs.Simulation(robot, state=start).contacts
    once = hs.ComputedTorque(robot, gait).torque(0.0, start, seen)
    again = hs.ComputedTorque(robot, flat()).torque(0.0, start, seen)
    np.testing.assert_allclose(again, once, atol=1e-3)


def test_virtual_constraints_are_those_of_the_gait() -> None:
    robot, gait = rabbit()
    once = hs.PhasedGait.from_gait(robot, gait)
    again = hs.PhasedGait.from_gait(robot, gait.motion(robot))
    np.testing.assert_allclose(again.phase_range, once.phase_range, atol=1e-9)
    np.testing.assert_allclose(again.coefficients, once.coefficients, atol=1e-7)


def test_stairs_go_on_rising(tmp_path: Path) -> None:
    motion = replace(flat(), rise=0.1)
    rose = motion.position(2.5 * motion.duration) - motion.position(0.5 * motion.duration)
    np.testing.assert_allclose(rose[:2], [2.0 * motion.distance, 0.2], atol=1e-9)
    motion.save(tmp_path / "stairs.json")
    assert hs.load_motion(tmp_path / "stairs.json").rise == 0.1


def test_what_is_no_such_gait_is_refused() -> None:
    robot, gait = rabbit()
    with pytest.raises(hs.GaitError, match="moves the joints"):
        gait.motion(walking.bravo7())
    heavier = replace(robot, model=robot.model.replaced(mass=1.1 * robot.model.mass))
    with pytest.raises(hs.GaitError, match="with other numbers"):
        gait.motion(heavier)
    running = hs.optimize_motion(
        robot,
        [hs.ContactPhase("right_tibia", duration=0.2, pieces=4), hs.ContactPhase(duration=0.15)],
        speed=2.0, starts=1,
    )  # fmt: skip
    with pytest.raises(hs.GaitError, match=r"2 phases on 1, 0 points; hs\.MotionLQR follows it"):
        hs.PhasedGait.from_gait(robot, running)
