"""The verdict of a run: what was reached first, how close the rest came, what to change."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import walking
from synthetic_runs import make_run, pendulum, pushes

import heelstrike as hs
from heelstrike.sim import RunStatus, SolverCount
from heelstrike.view.page import Limit, judge


def limits_of(run: hs.Run) -> dict[str, Limit]:
    return {limit.name: limit for limit in judge(run).limits}


def test_a_walk_that_reaches_nothing() -> None:
    verdict = judge(walking.walk(steps=2), walking.gait())
    assert verdict.good
    assert verdict.headline.startswith("bravo7 walks: 2 steps, 0.")
    assert verdict.headline.endswith("Nothing has to change.")
    assert verdict.advice == ()
    assert {limit.kind for limit in verdict.limits} == {
        "friction", "zero moment point", "torque", "joint"
    }  # fmt: skip
    used = [limit.used for limit in verdict.limits]
    assert used == sorted(used, reverse=True)
    summary = walking.walk(steps=2).summary()
    friction = max(limit.used for limit in verdict.limits if limit.kind == "friction")
    assert friction == pytest.approx(summary.friction_use_max)


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
    robot = walking.bravo7()
    force = pushes(robot, [[0], [0]])
    force[1, :, 1] = 0.75 * force[1, :, 0]
    fell = {"status": RunStatus.FELL, "message": "fell"}
    run = make_run(robot, [0.0, 0.1], force=force, **fell)
    verdict = judge(run, walking.gait())
    assert not verdict.good
    assert "falls at 0.1 s" in verdict.headline
    assert "optimize_gait(robot, friction=...)" in verdict.advice[0]
    assert "optimize_gait" not in judge(run).headline  # nothing is known of a gait
    early = hs.Push("trunk", force=(3.0, 4.0), start=0.05, duration=0.1)
    pushed = judge(make_run(robot, [0.0, 0.1], force=force, pushes=(early,), **fell))
    assert pushed.advice[0].startswith("the push of 5 N from 0.05 s on")
    for start in (0.2, -0.6):  # after it, and long before
        other = hs.Push("trunk", force=(3.0, 4.0), start=start, duration=0.1)
        found = judge(make_run(robot, [0.0, 0.1], force=force, pushes=(other,), **fell))
        assert found.advice[0].startswith("friction")


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
    assert "smaller time step" in judge(run).headline
