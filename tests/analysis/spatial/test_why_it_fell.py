"""Why a robot in space fell, and how close it came to its limits, where both are known."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_humanoid import humanoid

import heelstrike as hs
from heelstrike.analysis.diagnosis.symptoms import BRIEF, Cause
from heelstrike.analysis.spatial.diagnosis import first_cause_in_space, spatial_limits
from heelstrike.experiments.space import hold
from heelstrike.sim.spatial.run import RECORDED, SpatialRun
from heelstrike.view.page.verdict import happened
from heelstrike.view.spatial.page import page_in_space
from heelstrike.view.spatial.verdict import judge_in_space

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> hs.SpatialRobot:
    return humanoid(tmp_path_factory.mktemp("robot"))


def run_of(
    robot: hs.SpatialRobot, force: tuple[float, float, float], friction: float = 0.75
) -> SpatialRun:
    run = hs.simulate(
        robot, hold(robot, 1e-3, kp=800.0, kd=10.0), state=robot.reference_state(),
        duration=1.5, ground=hs.SpatialGround(friction=friction),
        pushes=hs.Push("trunk", force=force, start=0.3, duration=0.1),
    )  # fmt: skip
    assert isinstance(run, SpatialRun)
    return run


@pytest.mark.parametrize(
    ("force", "cause", "words"),
    [
        ((260.0, 0.0, 0.0), Cause.TIPPED_FORWARD, "tips forwards"),
        ((-260.0, 0.0, 0.0), Cause.TIPPED_BACK, "tips backwards"),
        ((0.0, 400.0, 0.0), Cause.TIPPED_SIDEWAYS, "tips to its left"),
        ((0.0, -400.0, 0.0), Cause.TIPPED_SIDEWAYS, "tips to its right"),
    ],
)
def test_a_robot_that_is_pushed_over_tips_that_way(
    robot: hs.SpatialRobot, force: tuple[float, float, float], cause: Cause, words: str
) -> None:
    run = run_of(robot, force, friction=2.0)
    fall = first_cause_in_space(run)
    assert fall is not None
    assert fall.cause is cause
    assert 0.299 < fall.time < 0.7  # after the push began, long before it lies
    assert fall.pushes == run.pushes
    verdict = judge_in_space(run)
    assert not verdict.good
    assert words in verdict.headline
    assert f"after a push of {np.linalg.norm(force):.3g} N began" in verdict.headline


def test_one_that_stands_has_limits_and_no_cause(robot: hs.SpatialRobot, tmp_path: Path) -> None:
    """Friction used by a push F along the ground: about F over μ times the weight."""
    run = run_of(robot, (0.0, 30.0, 0.0))
    assert first_cause_in_space(run) is None
    found = {limit.name: limit for limit in spatial_limits(run)}
    friction = max(limit.used for limit in found.values() if limit.kind == "friction")
    assert 0.5 * 30.0 / (0.75 * robot.weight) < friction < 4.0 * 30.0 / (0.75 * robot.weight)
    hip = found["torque of left hip joint"]
    largest = float(np.abs(run.torque[:, robot.actuator_index("left_hip_joint")]).max())
    assert hip.used == pytest.approx(largest / 80.0)
    assert 0.0 < found["zero moment point"].used < 1.0
    assert found["range of neck"].used == pytest.approx(0.0, abs=1e-2)
    verdict = judge_in_space(run)
    assert verdict.good
    assert "stays up for 1.5 s" in verdict.headline
    page = run.save_html(tmp_path / "run.html").read_text()
    assert verdict.headline in re.sub(r"&#x27;|&#39;", "'", page)
    assert "How close to each limit" in page


def test_a_fall_late_in_a_long_run_is_seen_as_early_as_in_a_short_one(
    robot: hs.SpatialRobot,
) -> None:
    """The same push after 13 s: the same cause as after 0.3 s, as long after the push."""
    short = run_of(robot, (260.0, 0.0, 0.0), friction=2.0)
    late = 13.0
    stood = np.concatenate((np.arange(0.0, late, 1e-3), late + short.time))
    rows = np.concatenate(
        (np.zeros(len(stood) - len(short.time), dtype=int), range(len(short.time)))
    )
    run = replace(
        short, time=stood, pushes=(replace(short.pushes[0], start=late + 0.3),),
        **{name: getattr(short, name)[rows] for name in RECORDED},
    )  # fmt: skip
    early, found = first_cause_in_space(short), first_cause_in_space(run)
    assert early is not None
    assert found is not None
    assert found.cause is Cause.TIPPED_FORWARD
    assert found.time == pytest.approx(late + early.time, abs=BRIEF)


def test_a_run_at_a_limit_is_not_told_that_nothing_needs_to_change(robot: hs.SpatialRobot) -> None:
    run = run_of(robot, (0.0, 30.0, 0.0))
    headline = judge_in_space(run).headline
    assert "No limit is reached" in headline
    assert "nothing needs to change" in headline
    slack = run.torque.copy()
    slack[40] = robot.model.torque_upper
    headline = judge_in_space(replace(run, torque=slack)).headline
    assert "First limit reached" in headline
    assert "nothing needs to change" not in headline


@pytest.mark.parametrize(
    ("quantity", "cause"),
    [("torque", Cause.TORQUE_LIMIT), ("stop_torque", Cause.JOINT_STOP), ("slip", Cause.SLIPPED)],
)
def test_causes_that_are_no_tips(robot: hs.SpatialRobot, quantity: str, cause: Cause) -> None:
    """A record that shows one of them before it ends in a fall, and nothing else."""
    stands = run_of(robot, (0.0, 0.0, 0.0))
    last = int(np.searchsorted(stands.time, 0.5))
    short = {name: getattr(stands, name)[:last] for name in ("time", *RECORDED)}
    short[quantity] = short[quantity].copy()
    where = {
        "torque": (robot.actuator_index("neck"), 5.0, "neck"),
        "stop_torque": (int(robot.model.first_velocity[robot.joint_index("neck")]), 1.0, "neck"),
        "slip": (list(robot.feet[0].contacts), 1.0, robot.feet[0].name),
    }
    place, value, name = where[quantity]
    short[quantity][300:, place] = value
    fall = first_cause_in_space(replace(stands, **short, status=hs.RunStatus.FELL))
    assert fall is not None
    assert fall.cause is cause
    assert fall.where == name
    assert fall.time == pytest.approx(short["time"][300])


def test_what_happened_at_one_time_is_told_whole(robot: hs.SpatialRobot) -> None:
    """Pushes on links by index, and two things at one time, each in a row of the page."""
    run = run_of(robot, (260.0, 0.0, 0.0), friction=2.0)
    push = replace(run.pushes[0], link=robot.link_names.index("trunk"))
    run = replace(run, pushes=(push, push))
    rows = happened(judge_in_space(run), run)
    assert [what for _, what in rows].count("a push of 260 N on the trunk, for 0.1 s") == 2
    assert page_in_space(run).count("a push of 260 N on the trunk") >= 2
    assert [time for time, _ in rows] == sorted(time for time, _ in rows)
