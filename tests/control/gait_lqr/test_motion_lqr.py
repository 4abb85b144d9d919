"""The regulator about motions of any phases: what it predicts, what it follows, what it refuses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control.gait_lqr.phases import PhasedOrbit
from heelstrike.control.gait_lqr.phases_law import first_level
from heelstrike.sim.controller.interface import Contacts

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

SPEED = 2.0


@cache
def rabbit() -> hs.Robot:
    return hs.load_robot("rabbit")


@cache
def running() -> hs.Motion:
    phases = [
        hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=4),
        hs.ContactPhase(duration=(0.05, 0.3), pieces=3),
    ]
    return hs.optimize_motion(rabbit(), phases, speed=SPEED, starts=1)


@cache
def law() -> hs.MotionLQR:
    return hs.MotionLQR(rabbit(), running())


@cache
def ground() -> hs.Ground:
    return hs.Ground(friction=running().friction)


def run(cycles: float, controller: hs.Controller | None = None, **more: object) -> hs.Run:
    motion = running()
    given = {"method": hs.EventDriven(), "state": motion.initial_state, "ground": ground()} | more
    law_of_run = law() if controller is None else controller
    return hs.simulate(rabbit(), law_of_run, duration=cycles * motion.duration, **given)


def landed(run: hs.Run) -> np.ndarray:
    """State at the last touchdown but for where it is along the ground."""
    down = [event.time for event in run.events if event.kind is hs.sim.EventKind.TOUCHDOWN]
    row = int(np.searchsorted(run.time, down[-1], side="right")) - 1
    return np.concatenate([run.position[row, 1:], run.velocity[row]])


@pytest.mark.slow
def test_a_run_on_points_repeats_as_predicted() -> None:
    """By differences of whole simulated cycles, which share nothing with the linear equations."""
    # Runs are integrated to 1e-10 or so: what is left of a cycle through flight is 2e-10.
    cycle = hs.find_limit_cycle(
        rabbit(), running().initial_state, law(), ground=ground(), tolerance=1e-9
    )
    assert cycle.differences  # not by the linear equations
    predicted = np.abs(law().multipliers)
    assert cycle.period == pytest.approx(running().duration, rel=1e-4)
    np.testing.assert_allclose(np.abs(cycle.multipliers[:4]), predicted[:4], atol=2e-3)


@pytest.mark.slow
def test_it_recovers_from_pushes_that_computed_torque_does_not() -> None:
    """The trunk in flight, and on a point, is steered by the touchdowns to come."""
    push = hs.Push("torso", force=(20.0, 0.0), start=0.1, duration=0.05)  # 1 N s
    pushed = run(12.5, pushes=push)
    assert pushed.completed, pushed.message
    np.testing.assert_allclose(landed(pushed), landed(run(12.5)), atol=1e-4)
    assert not run(16.0, hs.ComputedTorque(rabbit(), running())).completed


@pytest.mark.slow
def test_both_legs_are_treated_alike() -> None:
    """Torques in the mirror image of a state are the mirror image of the torques."""
    motion, mirror = running(), rabbit().mirror
    assert mirror is not None
    found = run(2.2, method=hs.EventDriven(rtol=1e-9))
    begin = motion.duration
    times = begin * np.array([0.2, 0.5, 0.8])
    driven = mirror.among(rabbit().model.actuator_joint)
    for t in times:
        torque = [
            np.array([np.interp(at, found.time, column) for column in found.torque.T])
            for at in (t, t + begin)
        ]
        np.testing.assert_allclose(
            torque[1], driven.sign * torque[0][driven.joint], atol=0.02 * np.abs(torque[0]).max()
        )


def test_where_in_the_world_it_is_does_not_matter() -> None:
    moved = running().initial_state
    q = moved.q.copy()
    q[0] += 1000.0
    here, there = run(0.9), run(0.9, state=hs.State(q, moved.v))
    np.testing.assert_allclose(there.position[-1, 1:], here.position[-1, 1:], atol=1e-5)


def test_nor_does_how_high_it_is_from_the_first_step_on() -> None:
    motion = running()
    high = hs.Ground(friction=motion.friction, profile=[(-1.0, 0.1), (9.0, 0.1)])
    raised = motion.initial_state.q.copy()
    raised[1] += 0.1
    here = run(0.3)
    there = run(0.3, state=hs.State(raised, motion.initial_state.v), ground=high)
    np.testing.assert_allclose(there.torque[0], here.torque[0], atol=1e-8)
    np.testing.assert_allclose(there.velocity[-1], here.velocity[-1], atol=1e-6)


def test_the_first_ground_is_that_below_the_foot_that_stands_and_in_flight_the_lowest() -> None:
    stands, gap = law().parameters.stands[0, ::2], np.array([0.3, 0.0])
    if not stands[1]:
        gap = gap[::-1].copy()
    ground_below = np.where(stands == 1, 0.2, 0.1)
    contacts = Contacts(
        position=np.column_stack([np.zeros(2), ground_below + gap]),
        normal=np.array([[0.0, 1.0], [0.0, 1.0]]), gap=gap, force=np.zeros((2, 2)),
    )  # fmt: skip
    assert first_level(contacts, law().parameters, 0) == pytest.approx(0.2)
    assert first_level(contacts, law().parameters, 1) == pytest.approx(0.1)


def test_after_the_last_phase_of_a_motion_that_never_repeats_nothing_comes_down() -> None:
    once = replace(running(), repeat=hs.Repeat.NEVER)
    assert len(PhasedOrbit(rabbit(), once).jumps) == len(once.phases) - 1
    assert hs.MotionLQR(rabbit(), once).multipliers.size == 0


@pytest.mark.slow
def test_on_flat_feet_it_is_the_regulator_of_the_joints() -> None:
    """With errors of the trunk free of charge both are optima of one problem."""
    robot, gait = walking.bravo7(), walking.gait()
    weights = np.where(np.arange(robot.nv) < 3, 0.0, 1.0)
    whole = hs.MotionLQR(
        robot, gait.motion(robot), position_weight=1e5 * weights, velocity_weight=1e3 * weights
    )
    joints = hs.FlatGaitLQR(robot, gait)
    np.testing.assert_allclose(
        np.abs(whole.multipliers[:4]), np.abs(joints.multipliers[:4]), atol=2e-3
    )


@pytest.mark.slow
def test_it_runs_on_after_a_step_up() -> None:
    """Heights count from where it came down last."""
    step_up = hs.Ground(
        friction=running().friction, profile=[(-2.0, 0.0), (3.0, 0.0), (3.0, 0.004), (50.0, 0.004)]
    )
    found = run(25.5, ground=step_up)
    assert found.completed, found.message
    higher = landed(found) - landed(run(25.5))
    np.testing.assert_allclose(higher[0], 0.004, atol=1e-4)
    np.testing.assert_allclose(higher[1:], 0.0, atol=1e-3)


def crouched(depth: float) -> hs.State:
    """Standing still on both feet, the hip lower by so much (m)."""
    robot = walking.bravo7()
    q = robot.reference_state().q.copy()
    q[1] -= depth
    for foot in robot.feet:
        q = dynamics.inverse_kinematics(robot, q, foot.name, (0.0, 0.0, 0.0)).q
    return hs.State(q, np.zeros(robot.nv))


@pytest.mark.slow
def test_it_stands_up_on_two_feet_though_pushed() -> None:
    """A motion that never repeats has gains until its end, and both feet bear the robot."""
    robot = walking.bravo7()
    both = hs.ContactPhase("right_foot", "left_foot", duration=0.6, pieces=4)
    rising = hs.optimize_motion(
        robot, [both], repeat="never", start=crouched(0.15), end=crouched(0.05), starts=1
    )
    push = hs.Push("trunk", force=(20.0, 0.0), start=0.05, duration=0.1)  # 2 N s

    def ended(weight: float, pushes: tuple[hs.Push, ...] = ()) -> np.ndarray:
        law = hs.MotionLQR(
            robot, rising, position_weight=1e4 * weight, velocity_weight=1e2 * weight
        )
        assert law.multipliers.size == 0
        run = hs.simulate(
            robot, law, state=rising.initial_state, duration=0.6, method=hs.EventDriven(),
            pushes=pushes,
        )  # fmt: skip
        return run.final_state.vector

    np.testing.assert_allclose(ended(1.0), crouched(0.05).vector, atol=1e-3)  # of collocation
    regulated, not_regulated = (
        np.abs(ended(weight, (push,)) - crouched(0.05).vector)[2:].max() for weight in (1.0, 1e-9)
    )
    assert regulated < 0.3 * not_regulated


def test_what_it_refuses() -> None:
    slowly = replace(running(), fingerprint="another")
    with pytest.raises(hs.GaitError, match="designed for robot"):
        hs.MotionLQR(rabbit(), slowly)
    with pytest.raises(hs.ControllerError, match="motion must be a Motion"):
        hs.MotionLQR(rabbit(), walking.gait())
    with pytest.raises(hs.ControllerError, match="torque_weight must be positive"):
        hs.MotionLQR(rabbit(), running(), torque_weight=0.0)


def test_touchdowns_without_speed_are_refused() -> None:
    """Of a foot that rolls flat at rest small errors decide when."""
    robot = walking.bravo7()
    planned = hs.plan_motion(robot, step_length=0.3, step_duration=0.7)
    with pytest.raises(hs.ControllerError, match=r"comes down at .* landing_speed=0\.1"):
        hs.MotionLQR(robot, planned)


@pytest.mark.parametrize("make", [hs.ZeroMomentPointRegulation, hs.FlatGaitLQR])
def test_laws_on_one_foot_name_those_that_follow_any_phases(make: type) -> None:
    with pytest.raises(hs.ControllerError, match=r"hs\.ComputedTorque, hs\.MotionLQR"):
        make(rabbit(), running())
