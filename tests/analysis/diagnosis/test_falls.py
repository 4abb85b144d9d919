"""The first cause of falls that are built to have it; walks that go well have none."""

from __future__ import annotations

import dataclasses

import built_falls as falls
import numpy as np
import pytest
import walking
from published_walkers import five_link_gait
from synthetic_runs import box, make_run, pendulum

import heelstrike as hs
from heelstrike.analysis import first_cause
from heelstrike.analysis.diagnosis.symptoms import Cause, Walk, find_symptoms
from heelstrike.experiments.laws import law_called
from heelstrike.sim import RunStatus


@pytest.mark.parametrize("name", falls.KNOWN)
def test_the_first_cause_is_the_one_that_was_built(name: str) -> None:
    known, run = falls.KNOWN[name], falls.run_of(name)
    assert not run.completed
    fall = first_cause(run, walking.gait())
    assert fall is not None
    assert (fall.cause, fall.where) == (known.cause, known.where)
    assert known.time[0] <= fall.time <= known.time[1]
    assert fall.chain[0].cause is fall.cause
    assert len({each.cause for each in fall.chain}) == len(fall.chain)
    assert bool(fall.pushes) == name.startswith("pushed")
    assert run.summary(gait=walking.gait()).first_cause.startswith(known.cause.value)


def test_numbers_that_show_it() -> None:
    slip = first_cause(falls.run_of("ice"), walking.gait())
    assert slip is not None
    assert slip.evidence["friction"] == 0.06
    assert slip.evidence["distance_m"] > 0.01
    bar = first_cause(falls.run_of("bar"), walking.gait())
    assert bar is not None
    assert bar.evidence["rise_m"] == pytest.approx(0.045)
    weak = first_cause(falls.run_of("weak motors"), walking.gait())
    assert weak is not None
    assert abs(weak.evidence["limit_Nm"]) == 9.0


@pytest.mark.parametrize("name", ["pushed forwards", "step down", "ice"])
def test_without_its_gait_a_fall_still_has_its_cause(name: str) -> None:
    """But a late step, which only a gait or several steps before it can tell."""
    fall = first_cause(falls.run_of(name))
    assert fall is not None
    expected = Cause.TIPPED_FORWARD if name == "step down" else falls.KNOWN[name].cause
    assert fall.cause is expected


@pytest.mark.parametrize(
    ("landings", "end", "late"),
    [
        ((0.0, 0.7, 1.03, 1.36, 1.69), 1.8, []),  # three short steps of a fall
        ((0.0, 0.7, 1.4, 2.1), 3.2, [2.8]),
        ((0.0, 0.7, 1.4), 2.5, []),  # too few to tell
    ],
)
def test_steps_are_late_beside_those_before_them(
    landings: tuple[float, ...], end: float, late: list[float]
) -> None:
    robot = walking.bravo7()
    raised = robot.reference_state().q + 0.1 * np.eye(robot.nv)[1]  # no foot is down
    walk = Walk(make_run(robot, np.linspace(0.0, end, 50), position=raised))
    walk.__dict__["landings"] = landings
    found = [each.time for each in find_symptoms(walk) if each.cause is Cause.LATE_TOUCHDOWN]
    assert found == pytest.approx(late)


def test_walks_that_go_well_have_none() -> None:
    gait = walking.gait()
    assert first_cause(walking.walk(steps=10), gait) is None
    assert find_symptoms(Walk(walking.walk(steps=10), gait)) == ()
    climbing = falls.walk(
        ground=falls.profile((101.0, 10.0)), law=law_called("FootstepFeedback")
    ).run()
    assert climbing.completed
    assert first_cause(climbing, gait) is None
    assert climbing.summary(gait=gait).first_cause == ""
    phased = five_link_gait()
    zero = hs.zero_dynamics(phased)
    on_points = hs.simulate(
        phased.robot, hs.VirtualConstraints(phased), state=zero.initial_state,
        duration=6.5 * zero.period,
    )  # fmt: skip
    assert on_points.completed
    assert first_cause(on_points) is None


def test_what_a_robot_recovers_from_is_no_cause() -> None:
    """It stumbles over a bar, walks on, and is stopped by its controller four steps later."""
    caught = dataclasses.replace(
        falls.KNOWN["bar"].case(), law=law_called("FootstepFeedback")
    ).run()
    assert caught.completed
    symptoms = find_symptoms(Walk(caught, walking.gait()))
    assert Cause.SCUFFED in {each.cause for each in symptoms}
    assert max(each.end for each in symptoms) < caught.time[-1] - 1.1 * walking.STEP_DURATION
    later = dataclasses.replace(caught, status=RunStatus.CONTROLLER_FAILED, message="made up")
    fall = first_cause(later, walking.gait())
    assert fall is not None
    assert fall.cause is Cause.CONTROLLER
    assert fall.time == caught.time[-1]


def test_what_the_simulation_says_of_its_end() -> None:
    for status, cause in (
        (RunStatus.DIVERGED, Cause.NUMERICAL),
        (RunStatus.SOLVER_FAILED, Cause.NUMERICAL),
        (RunStatus.CONTROLLER_FAILED, Cause.CONTROLLER),
        (RunStatus.FELL, Cause.UNKNOWN),
    ):
        fall = first_cause(make_run(pendulum(), [0.0, 0.1], status=status))
        assert fall is not None
        assert (fall.cause, fall.time) == (cause, 0.1)
    assert first_cause(make_run(box(), [0.0, 0.1])) is None
    assert first_cause(make_run(box(), [])) is None
    assert first_cause(make_run(box(), [0.0], status=RunStatus.INTERRUPTED)) is None


def test_a_motor_at_the_end_of_its_speed_torque_line() -> None:
    """At 8 rad/s of 10 it gives a fifth of its stall torque, far below its limit."""
    model = pendulum().model.replaced(stall_torque=np.array([50.0]), no_load_speed=np.array([10.0]))
    robot = dataclasses.replace(pendulum(), model=model)
    time = np.arange(0.0, 0.1, 0.001)
    run = make_run(robot, time, velocity=[[8.0]], torque=[[10.0]], status=RunStatus.FELL)
    fall = first_cause(run)
    assert fall is not None
    assert (fall.cause, fall.where) == (Cause.SPEED_LIMIT, "motor")
    assert fall.evidence["limit_Nm"] == pytest.approx(10.0)
    below = make_run(robot, time, velocity=[[8.0]], torque=[[9.9]], status=RunStatus.FELL)
    assert first_cause(below).cause is Cause.UNKNOWN  # type: ignore[union-attr]


def test_a_robot_that_is_falling_when_its_time_is_up() -> None:
    run = dataclasses.replace(falls.run_of("pushed forwards"), status=RunStatus.COMPLETED)
    fall = first_cause(run, walking.gait())
    assert fall is not None
    assert fall.cause is Cause.TIPPED_FORWARD


def with_stop(angle: float) -> hs.Robot:
    """Return bravo7 whose left knee bends up to an angle (rad); its gait bends it to 0.56."""
    robot = walking.bravo7()
    upper = np.array(robot.model.upper)
    upper[robot.joint_index("left_knee")] = angle
    return dataclasses.replace(robot, model=robot.model.replaced(upper=upper))


def test_what_a_robot_walks_on_with_is_no_cause_of_what_comes_later() -> None:
    """A knee that meets its stop in each swing, and a fault at 1 s; with either alone it is told.

    It is back on its gait for 0.1 s before the fault.
    """
    law = falls.faulty_law("right_ankle", lambda torque: -torque)
    stopped = falls.walk(robot=with_stop(0.5)).run()
    assert stopped.completed
    assert {each.cause for each in find_symptoms(Walk(stopped, walking.gait()))} >= {
        Cause.JOINT_STOP
    }
    fall = first_cause(falls.walk(robot=with_stop(0.5), law=law).run(), walking.gait())
    assert fall is not None
    assert fall.cause is Cause.CONTROLLER
    assert Cause.JOINT_STOP not in {each.cause for each in fall.chain if each.time < 1.0}


def test_what_comes_again_no_longer_than_before_is_no_cause() -> None:
    """The knee is at its stop when the push comes; it was so for as long a stride before."""
    push = hs.Push("trunk", force=(-315.0, 0.0), start=1.75, duration=0.1)
    fall = first_cause(falls.walk(robot=with_stop(0.45), pushes=[push]).run(), walking.gait())
    assert fall is not None
    assert (fall.cause, fall.where) == (Cause.TIPPED_BACK, "right_foot")
    assert fall.time >= 1.75


def test_a_push_that_no_motor_withstands_tips_however_weak_motors_are() -> None:
    """300 N at 1 m move the zero moment point by 0.5 m; with all the torque there is it falls."""
    limit = np.full(6, 25.0)
    weak = walking.bravo7().model.replaced(torque_lower=-limit, torque_upper=limit)
    robot = dataclasses.replace(walking.bravo7(), model=weak)
    assert falls.walk(robot=robot).run().completed
    fall = first_cause(falls.pushed(300.0, robot=robot).run(), walking.gait())
    assert fall is not None
    assert (fall.cause, fall.where) == (Cause.TIPPED_FORWARD, "left_foot")
    assert fall.evidence["beyond_m"] > 0.1
    assert Cause.TORQUE_LIMIT in {each.cause for each in fall.chain}
    for start in (0.0, 1e-3):  # as the run begins, and just after
        push = hs.Push("trunk", force=(300.0, 0.0), start=start, duration=0.1)
        fall = first_cause(falls.walk(robot=robot, pushes=[push]).run(), walking.gait())
        assert fall is not None
        assert (fall.cause, fall.where, fall.time) == (Cause.TIPPED_FORWARD, "right_foot", start)


def test_a_motor_at_its_limit_that_drives_its_joint_away_is_the_controllers() -> None:
    limit = np.full(6, 35.0)
    weak = walking.bravo7().model.replaced(torque_lower=-limit, torque_upper=limit)
    robot = dataclasses.replace(walking.bravo7(), model=weak)
    law = falls.faulty_law("right_hip", lambda _: -100.0)
    fall = first_cause(falls.walk(robot=robot, law=law).run(), walking.gait())
    assert fall is not None
    assert fall.cause is Cause.CONTROLLER


def test_a_foot_that_lands_on_a_step_is_early_though_hardly() -> None:
    """Half of it beyond the edge of a step of 16 mm, at 0.88 of the step's time."""
    ground = hs.Ground(
        friction=walking.FRICTION,
        profile=np.array([(-9.0, 0.0), (1.0223, 0.0), (1.0223, 0.0163), (99.0, 0.0163)]),
    )
    symptoms = find_symptoms(Walk(falls.walk(ground=ground).run(on_error="stop"), walking.gait()))
    scuffed = next(each for each in symptoms if each.cause is Cause.SCUFFED)
    assert 0.85 < scuffed.evidence["step_phase"] < 0.97
    assert scuffed.evidence["rise_m"] == pytest.approx(0.0163)
