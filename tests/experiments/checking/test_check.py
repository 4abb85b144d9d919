"""Trajectories before they reach hardware: each is judged rightly, its cause named first."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import walking
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.analysis import zero_moment_point
from heelstrike.cli.main import app
from heelstrike.errors import GaitError
from heelstrike.experiments.checking import Check, check_motion
from heelstrike.experiments.checking import check as check_module
from heelstrike.experiments.checking.stance import placed
from heelstrike.gait.recordings.motion import RecordedMotion

STEPS = 3


def motion(
    rate: float = 200.0, change: Callable[[np.ndarray], np.ndarray] = lambda q: q
) -> RecordedMotion:
    """Return the reference gait as an engineer has it."""
    time = np.arange(0.0, STEPS * walking.STEP_DURATION, 1.0 / rate)
    return RecordedMotion(time, change(np.array(walking.gait().position(time))), ())


def bravo7(**numbers: np.ndarray) -> hs.Robot:
    robot = walking.bravo7()
    return dataclasses.replace(robot, model=robot.model.replaced(**numbers))


@cache
def own() -> Check:
    return check_motion(walking.bravo7(), motion())


def own_time() -> float:
    return float(own().motion.time[-1])


def test_trunk_and_phases_follow_from_the_joints() -> None:
    """As they are in a walk of the same gait by computed torque, to its tracking."""
    run = walking.walk(steps=7)
    found = placed(walking.bravo7(), motion())
    assert [foot for foot, _, _ in found.phases] == [0, 1, 0]
    np.testing.assert_allclose(
        [found.time[first] for _, first, _ in found.phases[1:]],
        [walking.STEP_DURATION, 2 * walking.STEP_DURATION], atol=0.011,
    )  # fmt: skip
    walked = np.array([np.interp(found.time, run.time, x) for x in run.position.T]).T
    walked[:, 0] += found.q[0, 0] - walked[0, 0]
    assert np.abs((found.q - walked)[:, :3]).max() < 3e-3


def test_our_own_gait_has_nothing_against_it() -> None:
    assert own().good, str(own())
    assert own().run is not None
    assert own().run.completed
    assert {each.cause for each in own().findings} >= {
        "range", "scuff", "zero moment point", "friction", "torque", "impact"
    }  # fmt: skip
    # Forces are those of the walk under computed torque, off the exchanges of feet.
    run = walking.walk(steps=7)
    phase = run.time % walking.STEP_DURATION
    inside = (phase > 0.03) & (phase < walking.STEP_DURATION - 0.03) & (run.time < own_time())
    torque = next(each for each in own().findings if each.cause == "torque")
    assert 300.0 * torque.used == pytest.approx(np.abs(run.torque[inside]).max(), rel=0.1)
    zmp = next(each for each in own().findings if each.cause == "zero moment point")
    margin = zero_moment_point(run).foot_margin[inside]
    assert 0.1 * (1.0 - zmp.used) == pytest.approx(np.nanmin(margin), abs=0.02)
    assert own().headline == "nothing is wrong with it: the robot walks it"


def dragged(q: np.ndarray) -> np.ndarray:
    """Bend the knees less: the foot goes through the ground."""
    q = q.copy()
    q[:, [1, 4]] *= 0.6
    return q


LIMIT = np.full(6, 9.0)
FORWARDS = np.array(walking.bravo7().model.center_of_mass) + np.array(
    [[0.2, 0.0] if link == 2 else [0.0, 0.0] for link in range(9)]
)


@pytest.mark.parametrize(
    ("robot", "moves", "cause"),
    [
        (bravo7(torque_lower=-LIMIT, torque_upper=LIMIT), motion(), "torque"),
        (bravo7(center_of_mass=FORWARDS), motion(), "zero moment point"),
        (walking.bravo7(), motion(change=dragged), "scuff"),
        (walking.bravo7(), motion(change=np.rad2deg), "degrees"),
        (bravo7(upper=np.array([np.inf] * 3 + [1.57, 0.4, 1.05] * 2)), motion(), "range"),
        (bravo7(speed_limit=np.array([np.inf] * 3 + [3.0] * 6)), motion(), "speed"),
    ],
)
def test_what_is_wrong_is_named_first(robot: hs.Robot, moves: RecordedMotion, cause: str) -> None:
    found = check_motion(robot, moves)
    assert not found.good
    assert found.findings[0].cause == cause, str(found)
    assert found.headline.startswith(f"no: {cause} at ")
    assert f"change: {found.findings[0].advice}" in str(found)


def test_fifty_rows_a_second_are_enough() -> None:
    found = check_motion(walking.bravo7(), motion(50.0))
    assert found.good, str(found)
    for cause in ("torque", "zero moment point"):
        one, other = (
            next(each.used for each in check.findings if each.cause == cause)
            for check in (found, own())
        )
        assert one == pytest.approx(other, abs=0.15)


def test_walks_with_tolerances_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the motion itself walks and too few of them do, the verdict is no."""
    wide = {"robot.mass.trunk *": [1.0, 4.0]}
    monkeypatch.setattr(check_module, "TOLERANCES", wide)
    found = check_motion(walking.bravo7(), motion(), trials=8)
    assert found.fall is None
    assert [each.cause for each in found.findings if each.broken] == ["tolerances"]
    assert found.headline.startswith("no: tolerances at 0 s: ")
    monkeypatch.setattr(check_module, "TOLERANCES", {"robot.mass.trunk *": 1.0})
    found = check_motion(walking.bravo7(), motion(), trials=8)
    assert found.good
    assert "8 of 8 walks with tolerances succeed" in str(found)


def test_robots_whose_trunk_does_not_follow_are_refused() -> None:
    rabbit = hs.load_robot("rabbit")
    still = RecordedMotion(np.arange(10) / 100.0, np.zeros((10, rabbit.nu)), ())
    with pytest.raises(GaitError, match="flat feet"):
        check_motion(rabbit, still)


def test_the_command(tmp_path: Path) -> None:
    """With tolerances; the exit status tells whether something stands against it."""
    file = tmp_path / "gait.csv"
    names = ",".join(["time", *walking.bravo7().actuator_names])
    moves = motion()
    np.savetxt(
        file, np.column_stack((moves.time, moves.position)), delimiter=",", header=names,
        comments="",
    )  # fmt: skip
    good = CliRunner().invoke(app, ["check", str(file), "--trials", "4", "--json"])
    assert good.exit_code == 0, good.output
    told = json.loads(good.stdout)
    assert told["good"]
    assert told["tolerances"]["trials"] == 4
    icy = CliRunner().invoke(app, ["check", str(file), "--trials", "0", "--friction", "0.05"])
    assert icy.exit_code == 1
    assert icy.stdout.startswith("no: friction at ")
    wrong = CliRunner().invoke(app, ["check", str(tmp_path / "none.csv")])
    assert wrong.exit_code == 2
