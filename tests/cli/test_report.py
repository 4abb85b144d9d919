"""``heelstrike report``: runs from files or walked for it, and what it refuses."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import walking
from synthetic_runs import box, make_run
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.cli.planning import hint_of_balance
from heelstrike.experiments import what_if
from heelstrike.experiments.zoo.disturbances import Effort
from heelstrike.sim import RunStatus
from heelstrike.view.report.plane import InPlane


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a short walk leaves: its gait and its run."""
    folder = tmp_path_factory.mktemp("walk")
    walking.gait().save(folder / "gait.json")
    walking.walk(steps=2).save(folder / "run.nc")
    return folder


@pytest.fixture(autouse=True)
def one_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw one figure of a report only: drawing takes most of its time."""
    monkeypatch.setattr(InPlane, "captions", {"energy": InPlane.captions["energy"]})


def report(*options: str) -> Any:
    return CliRunner().invoke(app, ["report", *options])


def test_a_run_is_reported_with_the_gait_beside_it(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    result = report(str(folder / "run.nc"), "--out", str(out))
    assert result.exit_code == 0, result.stderr
    assert result.stdout.startswith("bravo7 walks: 2 steps")
    assert "gait.json" in result.stderr
    assert "joint tracking error" in out.read_text(encoding="utf-8")


def test_a_robot_is_walked_by_several_methods(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    gait = str(folder / "gait.json")
    walk = ("bravo7", "--gait", gait, "--steps", "3", "--no-tries")
    ways = ("--method", "time-stepping", "--method", "paper-symplectic")
    result = report(*walk, *ways, "--out", str(out))
    assert result.exit_code == 1, result.stderr  # the paper's ordering rattles at 1 ms, and sinks
    assert re.search(r"paper-symplectic: bravo7 (is falling|falls|fell)", result.stdout)
    assert [line.partition(":")[0] for line in result.stdout.splitlines()] == [
        "time-stepping", "paper-symplectic"
    ]  # fmt: skip
    assert "Differences from time-stepping" in out.read_text(encoding="utf-8")


def test_a_fall_is_explained_and_its_mend_tried(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(what_if, "EFFORT", Effort(strides=1, halvings=0))
    gait, out = str(folder / "gait.json"), tmp_path / "report.html"
    walk = ("bravo7", "--gait", gait, "--steps", "3", "--push", "trunk:300:1:0.1", "--json")
    result = report(*walk, "--out", str(out))
    assert result.exit_code == 1, result.stderr
    (found,) = json.loads(result.stdout).values()
    assert found["fall"]["cause"] == "tipped forward"
    assert found["changes"][0]["lever"] == "controller"
    assert found["changes"][0]["value"] == "FootstepFeedback"
    assert [each["lasted"] for each in found["tried"]] == [True, None, None, None, None]
    text = out.read_text(encoding="utf-8")
    for part in ("What happened, causes before consequences", "a push of 300 N on the trunk",
                 "hs.FootstepFeedback(robot, gait)", "Tried: it walks", "Tried beside this run",
                 "largest push forwards", "steepest climb"):  # fmt: skip
        assert part in text, part


def test_a_run_from_a_file_says_why_nothing_was_tried(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    result = report(str(folder / "run.nc"), "--out", str(out))
    assert "does not hold its controller" in out.read_text(encoding="utf-8")
    assert "not tried" in result.stdout


def test_one_that_fell_has_its_exit_status(tmp_path: Path) -> None:
    fallen = make_run(box(), [0.0, 0.1], status=RunStatus.FELL, message="fell")
    path = fallen.save(tmp_path / "fallen.nc")
    twin = shutil.copy(path, tmp_path / "twin.nc")
    result = report(str(path), str(twin), "--json", "--out", str(tmp_path / "report.html"))
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert list(found) == ["fallen", "twin"]
    assert found["twin"]["good"] is False


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("run.nc", "bravo7"), "not both"),
        (("bravo7", "rabbit"), "give one robot"),
        (("run.nc", "--steps", "3"), "--steps"),
        (("run.nc", "--controller", "JointPD"), "--controller"),
        (("bravo7", "--controller", "JointsPD"), "Did you mean 'JointPD'"),
        (("run.nc", "--no-tries"), "--tries"),
        (("run.nc", "--package-path", "."), "--package-path"),
        (("run.nc",), "there is no file"),
        (("bravo7", "--out", "report.pdf"), "prints it to PDF"),
        (("nosuch",), "nosuch"),
    ],
)
def test_requests_that_make_no_sense(
    options: tuple[str, ...], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = report(*options)
    assert result.exit_code == 2
    assert told in " ".join(result.stderr.replace("│", " ").split())
    assert not list(tmp_path.iterdir())


def test_a_push_under_computed_torque_names_the_law_that_keeps_the_balance(
    capsys: pytest.CaptureFixture[str],
) -> None:
    run = walking.walk(steps=1)
    hint_of_balance(run)
    assert not capsys.readouterr().err
    push = hs.Push("trunk", force=(5.0, 0.0), start=0.1, duration=0.1)
    hint_of_balance(run, replace(run, pushes=(push,)))
    assert "--controller FootstepFeedback does" in capsys.readouterr().err
