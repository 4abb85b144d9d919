"""The verdict of a run: what was reached first, how close the rest came, what to change."""

from __future__ import annotations

import dataclasses
import math
import re

import built_falls as falls
import numpy as np
import pytest
import walking
from synthetic_runs import make_run, pendulum, pushes

import heelstrike as hs
from heelstrike.analysis import Limit, Tried
from heelstrike.experiments.laws import gait_for, law_called
from heelstrike.experiments.walk import walk
from heelstrike.sim import RunStatus, SolverCount
from heelstrike.view.page import judge
from heelstrike.view.page.verdict import on_points, told


def limits_of(run: hs.Run) -> dict[str, Limit]:
    return {limit.name: limit for limit in judge(run).limits}


def test_a_walk_that_reaches_nothing() -> None:
    verdict = judge(walking.walk(steps=2), walking.gait())
    assert verdict.good
    assert verdict.headline.startswith("bravo7 walks: 2 steps, 0.")
    assert verdict.headline.endswith(
        "Limits, falls and contact certificates were checked: nothing needs to change. "
        "No push and no slope was tried."
    )
    push = Tried("largest push", "5 N s (not 6)")
    tried = judge(walking.walk(steps=2), walking.gait(), tried=[push])
    assert tried.headline.endswith("Tried beside it: largest push: 5 N s (not 6).")
    assert tried.tried == (push,)
    assert verdict.advice == ()
    assert {limit.kind for limit in verdict.limits} == {
        "friction", "zero moment point", "torque", "joint"
    }  # fmt: skip
    used = [limit.used for limit in verdict.limits]
    assert used == sorted(used, reverse=True)
    summary = walking.walk(steps=2).summary()
    friction = max(limit.used for limit in verdict.limits if limit.kind == "friction")
    assert friction == pytest.approx(summary.friction_use_max)


def test_a_run_whose_impacts_made_energy_is_not_good() -> None:
    run = walking.walk(steps=2)
    made = dataclasses.replace(run.certificates, energy_gain=0.5)
    verdict = judge(dataclasses.replace(run, certificates=made), walking.gait())
    assert not verdict.good
    assert "made 0.5 J in impacts" in verdict.advice[0]


@pytest.mark.parametrize(
    ("law", "named"),
    [
        ("ComputedTorque", "walk it by hs.VirtualConstraints, or by hs.SteppingConstraints"),
        ("VirtualConstraints", "walk it by hs.SteppingConstraints"),
        ("SteppingConstraints", "the law that it had steps"),
    ],
)
@pytest.mark.slow
def test_a_law_that_just_fell_is_not_advised(law: str, named: str) -> None:
    robot = hs.load_robot("rabbit")
    run = walk(robot, gait_for(robot), steps=1, law=law_called(law))
    assert on_points(run).startswith(named)


def test_torque_is_measured_against_the_limit_of_its_sign() -> None:
    model = pendulum().model.replaced(torque_lower=np.array([-4.0]), torque_upper=np.array([8.0]))
    robot = dataclasses.replace(pendulum(), model=model)
    run = make_run(robot, [0.0, 0.1, 0.2], torque=[[6.0], [-3.5], [0.0]])
    limit = limits_of(run)["torque of motor"]
    assert limit.used == pytest.approx(3.5 / 4.0)
    assert limit.time == 0.1
    assert limit.reached == math.inf
    assert limit.detail == "−3.5 of −4 N m at 0.1 s"
    run = make_run(robot, [0.0, 0.1, 0.2], torque=[[6.0], [-4.0], [8.0]])
    assert limits_of(run)["torque of motor"].reached == 0.1


def test_range_of_a_joint() -> None:
    run = make_run(pendulum(limited=True), [0.0, 0.1], position=[[0.1], [-math.pi / 6]])
    limit = limits_of(run)["range of swing"]
    assert limit.used == pytest.approx(0.5)
    assert limit.detail.startswith("0.524 rad from its stop")


def test_zero_moment_point_and_friction_of_one_foot() -> None:
    """All of the weight on the toe, a tangential force on the edge of the cone."""
    robot = walking.bravo7()
    force = pushes(robot, [[0], [0]])
    force[1, robot.feet[0].contacts[0]] = 0.0
    force[1, :, 1] = 0.75 * force[1, :, 0]
    found = limits_of(make_run(robot, [0.0, 0.1], force=force))
    name = robot.feet[0].name.replace("_", " ")
    assert found[f"zero moment point of the {name}"].used == pytest.approx(1.0)
    assert found[f"zero moment point of the {name}"].reached == 0.1
    assert found[f"friction of the {name}"].used == pytest.approx(1.0)
    assert f"friction of the {robot.feet[1].name.replace('_', ' ')}" not in found


def test_a_fall_names_what_came_first() -> None:
    verdict = judge(falls.run_of("pushed forwards"), walking.gait())
    assert not verdict.good
    first, why, change = re.split(r"\. (?=First|To)", verdict.headline)
    time = re.match(r"bravo7 falls at ([\d.]+) s, after [2-4] steps", first)
    assert time is not None, first
    assert float(time[1]) == pytest.approx(1.8, abs=0.1)
    assert why.startswith("First cause: the left foot tips over its toe at 1.0")
    assert "ms after a push of 300 N began; then torques reach their limits" in why
    assert change.startswith("To change: walk it by hs.FootstepFeedback(robot, gait)")
    assert verdict.fall is not None
    assert verdict.changes[0].value == "FootstepFeedback"
    # Limits are those before: in a fall all are reached.
    assert all(limit.time <= verdict.fall.time for limit in verdict.limits)
    assert "torque of right hip" not in {v.name for v in verdict.limits if v.reached < math.inf}
    without = judge(falls.run_of("pushed forwards"))
    assert "no gait is known here" in without.headline


def test_a_controller_that_ends_its_run_in_order_made_nothing_fall() -> None:
    message = "the controller ended the run at t = 0.1 s: seen enough"
    run = make_run(walking.bravo7(), [0.0, 0.1], status=RunStatus.STOPPED, message=message)
    verdict = judge(run)
    assert verdict.fall is None
    assert verdict.advice == ()
    assert not verdict.good  # it did not last as long as it was asked to
    assert verdict.headline.startswith(f"bravo7 does not go on after 0 steps, 0 m: {message}.")
    assert "First cause" not in verdict.headline
    assert run.summary().first_cause == ""
    fell = dataclasses.replace(falls.run_of("pushed forwards"), status=RunStatus.STOPPED)
    assert judge(fell, walking.gait()).fall is not None


def test_a_walk_without_reserve_is_told_so() -> None:
    """It lasts, and its feet use all of the friction that there is."""
    force = pushes(walking.bravo7(), [[0], [0]])
    force[1, :, 1] = 0.75 * force[1, :, 0]
    verdict = judge(make_run(walking.bravo7(), [0.0, 0.1], force=force))
    assert verdict.good
    assert "friction of the right foot has no reserve at 0.1 s" in verdict.advice[0]
    assert "nothing needs to change" not in verdict.headline


def test_what_was_seen_to_work_comes_first() -> None:
    run, gait = falls.run_of("ice"), walking.gait()
    friction, design = judge(run, gait).changes
    seen = [Tried("friction", "it fell", False, friction), Tried("gait", "7 steps", True, design)]
    advice = judge(run, gait, tried=seen).advice
    assert advice[0].startswith("optimize_gait(robot, friction=0.048)")
    assert advice[0].endswith("Tried: it walks, 7 steps.")
    assert advice[1].endswith("Tried: it does not help, it fell.")


@pytest.mark.parametrize("name", falls.KNOWN)
def test_every_cause_is_told_in_words(name: str) -> None:
    run = falls.run_of(name)
    fall = judge(run, walking.gait()).fall
    assert fall is not None
    for each in fall.chain:
        sentence = told(each, run.robot)
        assert f"{each.time:.3f} s" in sentence
        assert "nan" not in sentence
        assert each.where.replace("_", " ") in sentence
        assert f"{each.time:.3f} s" not in told(each, run.robot, when=False)


def test_a_wheel_has_no_sole() -> None:
    robot = hs.load_robot("rimless_wheel")
    force = np.zeros((2, robot.nc, 2))
    force[:, :2, 0] = 5.0
    run = make_run(robot, [0.0, 0.1], force=force)
    assert {limit.kind for limit in judge(run).limits} == {"friction"}


def test_what_is_not_certified_is_not_good() -> None:
    solver = SolverCount("lemke", 2, 0, 0, 1)
    verdict = judge(make_run(walking.bravo7(), [0.0, 0.1], solver=solver))
    assert not verdict.good
    assert "no certified solution" in verdict.headline


def test_runs_without_rows_or_numbers_are_judged_too() -> None:
    assert "did not begin" in judge(make_run(pendulum(), [])).headline
    run = make_run(pendulum(), [0.0, 0.1], torque=[[np.nan], [np.nan]], status=RunStatus.DIVERGED)
    assert "a time step of 0.01 s" in judge(run).headline


def test_what_no_step_mends_is_told_so() -> None:
    def ended(status: RunStatus) -> hs.Run:
        return make_run(
            walking.bravo7(), [0.0, 1e-3], position=walking.gait().initial_state.q, status=status,
            method=hs.EventDriven(),
        )  # fmt: skip

    failed = ended(RunStatus.SOLVER_FAILED)
    assert judge(failed).advice == judge(failed, walking.gait()).advice
    assert judge(failed).advice[0].startswith("another method, as hs.TimeStepping(step=1e-4)")
    assert judge(ended(RunStatus.FELL), walking.gait()).advice == (
        "nothing is known that would help.",
    )
