"""Reports of runs in space: the parts of a report of the plane, by the same code."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from synthetic_runs import box, make_run
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.analysis.diagnosis.changes import Tried
from heelstrike.analysis.diagnosis.measures import motor_loads
from heelstrike.cli.main import app
from heelstrike.sim.spatial import SpatialRun
from heelstrike.view import ViewError
from heelstrike.view.report.account import account_of
from heelstrike.view.report.differences import differences
from heelstrike.view.report.space import InSpace

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

POST = """
<mujoco model="post"><compiler angle="radian"/><worldbody><body name="foot" pos="0 0 0.02">
  <freejoint name="root"/><geom type="box" size="0.1 0.08 0.02" mass="2"/>
  <body name="mast" pos="0 0 0.02"><joint name="ankle" axis="1 0 0" range="-1 1"/>
    <geom type="box" pos="0 0 0.4" size="0.03 0.03 0.4" mass="3"/></body></body></worldbody>
  <actuator><motor name="ankle" joint="ankle"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> hs.SpatialRobot:
    path = tmp_path_factory.mktemp("robot") / "post.xml"
    path.write_text(POST)
    return hs.load_robot(path, dimension=3)


def pushed(robot: hs.SpatialRobot, force: float) -> SpatialRun:
    """A post that holds its posture and is pushed to its left at 0.1 s."""
    law = hs.HoldPosture(robot, kp=200.0, kd=10.0)
    push = hs.Push("mast", force=(0.0, force, 0.0), start=0.1, duration=0.1)
    run = hs.simulate(robot, law, state=robot.reference_state(), duration=0.6, pushes=push)
    assert isinstance(run, SpatialRun)
    return run


@pytest.fixture(scope="module")
def runs(robot: hs.SpatialRobot) -> dict[str, SpatialRun]:
    return {"stands": pushed(robot, 1.0), "falls": pushed(robot, 200.0)}


@pytest.fixture(autouse=True)
def one_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw one figure of a report only: drawing takes most of its time."""
    monkeypatch.setattr(InSpace, "captions", {"torque": InSpace.captions["torque"]})


def films(text: str) -> list[dict[str, float]]:
    found = re.search(r'<script type="application/json" id="runs">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    read: list[dict[str, float]] = json.loads(found[1])
    return read


def test_a_report_has_the_parts_of_the_plane(runs: dict[str, SpatialRun], tmp_path: Path) -> None:
    path = runs["stands"].save_report(tmp_path / "report.html", command="make it again")
    text = path.read_text(encoding="utf-8")
    first = re.search(r'<p class="verdict">(.*?)</p>', text)
    assert first is not None
    assert "post stays up for 0.6 s" in first[1]
    for part in ("How close to each limit", "The run in figures", "Motors", "Summary", "Figures",
                 "Joint torques", "residual of the contact problems",
                 "make it again", "slip of a pressed contact point"):  # fmt: skip
        assert part in text, part
    assert "walk" not in re.sub(r"<(script|style).*?</\1>", "", text, flags=re.DOTALL)
    assert not re.search(r"https?://", re.sub(r'(xmlns|src)(:\w+)?="[^"]*"', "", text))


def test_a_fall_is_shown_from_before_its_cause(runs: dict[str, SpatialRun], tmp_path: Path) -> None:
    text = hs.report(runs, tmp_path / "both.html").read_text(encoding="utf-8")
    assert text.count('<p class="verdict">') == text.count("<canvas") == 2
    stands, falls = films(text)
    assert stands["shown"] == pytest.approx(0.3)
    assert falls["shown"] < 0.3
    times = [float(each) for each in re.findall(r'data-time="([^"]+)"', text)]
    assert times[0] == pytest.approx(0.1)  # the push
    assert times == sorted(times)
    table = text[text.index("Differences from stands") :]
    (apart,) = re.findall(r"largest distance \(mm\)</th><td>0</td><td>([^<]+)</td>", table)
    centers = [InSpace(run).center_of_mass() for run in runs.values()]
    common = min(map(len, centers))
    exact = np.linalg.norm(centers[0][:common] - centers[1][:common], axis=1).max()
    assert float(apart) == pytest.approx(1e3 * exact, rel=5e-3)


def test_motors_are_loaded_by_what_they_drive(runs: dict[str, SpatialRun]) -> None:
    run = runs["falls"]
    (load,) = motor_loads(run)
    assert load.name == "ankle"
    assert load.peak_speed == pytest.approx(np.abs(run.velocity[:, 6]).max())
    assert load.peak_torque == pytest.approx(np.abs(run.torque).max())


def test_plane_and_space_are_not_compared(runs: dict[str, SpatialRun], tmp_path: Path) -> None:
    flat = make_run(box(), [0.0, 0.1])
    with pytest.raises(ViewError, match="not both"):
        hs.report({"flat": flat, **runs}, tmp_path / "report.html")
    assert not list(tmp_path.iterdir())


def test_the_command_reports_runs_in_space(runs: dict[str, SpatialRun], tmp_path: Path) -> None:
    files = [str(run.save(tmp_path / f"{name}.nc")) for name, run in runs.items()]
    out = tmp_path / "report.html"
    ended = CliRunner().invoke(app, ["report", *files, "--out", str(out)])
    assert ended.exit_code == 1, ended.stderr  # one fell
    assert ended.stdout.startswith("stands: post stays up")
    assert "Differences from stands" in out.read_text(encoding="utf-8")
    refused = CliRunner().invoke(
        app, ["report", files[0], "--gait", "gait.json", "--out", str(tmp_path / "other.html")]
    )
    assert refused.exit_code == 2
    assert "--gait" in refused.stderr


def test_one_orientation_is_no_difference(robot: hs.SpatialRobot) -> None:
    run = pushed(robot, 1.0)
    position = run.position.copy()
    position[:, 3:7] *= -1.0  # of the quaternion of the free joint
    turned = dataclasses.replace(run, position=position)
    _, rows = differences({"one": account_of("one", run), "other": account_of("other", turned)})
    told = {what: values for what, *values in rows}
    assert told["coordinates, largest difference (rad, m)"][1] == "0"


def test_what_was_tried_is_not_dropped(runs: dict[str, SpatialRun], tmp_path: Path) -> None:
    tried = Tried("another gain", "it stood", True)
    with pytest.raises(ViewError, match="nothing is tried beside runs in space"):
        account_of("stands", runs["stands"], tried=[tried])
