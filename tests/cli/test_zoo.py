"""``heelstrike zoo``: what it prints, writes, keeps and refuses."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.experiments.zoo import DISTURBANCES, campaign

SPRINGS = ("--controllers", "jointfeedback", "--disturbances", "trunk-mass,push-backwards")
FILES = {"zoo.json", "zoo.csv", "zoo.md", "zoo.svg"}


@pytest.fixture
def handler() -> Iterator[None]:
    """Python's own way with Ctrl-C, whatever runs the tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def invoke(*arguments: object) -> Any:
    return CliRunner().invoke(
        app, ["zoo", *map(str, arguments)], env={"COLUMNS": "80", "TERM": "dumb"}
    )


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} if folder.is_dir() else set()


def test_a_table_and_its_files(tmp_path: Path) -> None:
    """In a pipe nothing but the table is on standard output, and no bar anywhere."""
    out = tmp_path / "new" / "zoo"
    page, figure = tmp_path / "page.md", tmp_path / "figure.png"
    done = invoke(
        "--quick", "--robots", "bravo7,rabbit", *SPRINGS, "--out", out, "--page", page,
        "--figure", figure,
    )  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert done.stdout.startswith("bravo7, 75 kg")
    assert re.search(r"JointFeedback +≥50 +\d+$", done.stdout, re.MULTILINE)
    assert done.stdout.rstrip().endswith("rabbit, 32 kg\nneeds flat feet: JointFeedback")
    assert " ".join(done.stderr.split()).startswith(f"in {out}: zoo.json, zoo.csv; {page}")
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert names(out) == {"zoo.json", "zoo.csv"}
    assert "](figure.png)" in page.read_text(encoding="utf-8")
    assert figure.read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader((out / "zoo.csv").open(encoding="utf-8")))
    assert [(row["robot"], row["disturbance"], row["unit"]) for row in rows] == [
        (robot, *of)
        for robot in ("bravo7", "rabbit")
        for of in (("trunk-mass", "%"), ("push-backwards", "N s"))
    ]  # fmt: skip


def test_a_robot_of_a_file_by_whatever_name(tmp_path: Path) -> None:
    """Square brackets are markup to rich. A URDF file does not say how high its robot stands."""
    robot = hs.load_robot("bravo7")
    with pytest.warns(hs.RobotWarning, match="Left out: outlines"):
        robot.save(tmp_path / "[red]mine.urdf")
    done = invoke("--quick", "--robots", tmp_path / "[red]mine.urdf", *SPRINGS,
                  "--out", tmp_path / "out")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert done.stdout.startswith("[red]mine.urdf, 75 kg")
    assert re.search(r"JointFeedback +≥50 +\d+$", done.stdout, re.MULTILINE)


def test_a_second_call_goes_on_and_other_settings_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = invoke("--quick", "--robots", "bravo7", *SPRINGS, "--out", tmp_path, "--json")
    found = json.loads(first.stdout)
    assert [cell["disturbance"] for cell in found["cells"]] == ["trunk-mass", "push-backwards"]
    assert found["settings"] | {"seed": 0, "trials": 1} == found["settings"]

    def never(*_: object) -> hs.Largest:
        raise AssertionError

    monkeypatch.setattr(
        campaign, "DISTURBANCES", tuple(replace(each, measure=never) for each in DISTURBANCES)
    )
    again = invoke("--quick", "--robots", "bravo7", *SPRINGS, "--out", tmp_path, "--json")
    assert again.stdout == first.stdout
    other = invoke("--robots", "bravo7", *SPRINGS, "--seed", 3, "--out", tmp_path)
    assert other.exit_code == 2
    said = " ".join(other.stderr.split())
    assert "was made with seed 0, not 3; trials 1, not 4; strides 5, not 10" in said
    assert "--afresh" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--robots", "bravo"), "Did you mean 'bravo7'?"),
        (("--controllers", "WholeBodies"), "Did you mean 'WholeBody'?"),
        (("--disturbances", "frictoin"), "Did you mean 'friction'?"),
        (("--robots", ","), "there is nothing to do"),
        (("--robots", "bravo7,bravo7"), "two robots are called 'bravo7'"),
        (("--trials", "0"), "--trials"),
        (("--seed", "-1"), "--seed"),
        (("--method", "magic"), "--method"),
        (("--step", "0"), "step"),
        (("--figure", "zoo.gif"), "the name of a figure ends in .svg, .png or .pdf"),
        (("--page", "nowhere/zoo.md"), "there is no folder"),
        (("--pose", "knee"), "write joint=value"),
    ],
)
def test_mistakes_are_told_before_anything_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = invoke(*arguments)
    assert done.exit_code == 2
    assert words in " ".join(re.sub("[│╭╮╰╯─]", " ", done.stderr).split())
    assert "Traceback" not in done.stderr
    assert not names(tmp_path / "zoo") - {"zoo.json"}


def test_a_folder_that_cannot_be_written_to(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    done = invoke("--quick", "--robots", "bravo7", *SPRINGS, "--out", tmp_path / "file" / "zoo")
    assert done.exit_code == 2
    assert done.stderr.startswith("error: ")
    assert str(tmp_path / "file" / "zoo") in " ".join(done.stderr.split()).replace("\n", "")
    (tmp_path / "out" / "zoo.csv").mkdir(parents=True)
    done = invoke("--quick", "--robots", "bravo7", *SPRINGS, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "it is a folder" in " ".join(done.stderr.split())
    assert names(tmp_path / "out") == {"zoo.csv"}


def test_a_damaged_results_file(tmp_path: Path) -> None:
    (tmp_path / "zoo.json").write_text("{}")
    done = invoke("--quick", "--robots", "bravo7", *SPRINGS, "--out", tmp_path)
    assert done.exit_code == 2
    assert "not a zoo file" in " ".join(done.stderr.split())
    assert (tmp_path / "zoo.json").read_text() == "{}"


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.usefixtures("handler")
def test_ctrl_c_keeps_what_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal comes while the second cell is measured, which would not end by itself."""

    def endless(trial: hs.Trial, *_: object) -> hs.Largest:
        os.kill(os.getpid(), signal.SIGINT)
        while True:
            trial.run(trial.begins)

    slow = tuple(
        replace(each, measure=endless) if each.name == "push-backwards" else each
        for each in DISTURBANCES
    )
    monkeypatch.setattr(campaign, "DISTURBANCES", slow)
    arguments = ("--quick", "--robots", "bravo7", *SPRINGS, "--out", tmp_path)
    done = invoke(*arguments, "--workers", 1)
    said = " ".join(done.stderr.split())
    assert done.exit_code == 130, said
    assert said.startswith("interrupted while measuring, 1 of 2 finished")
    assert said.endswith(f"kept: {tmp_path / 'zoo.json'}")
    assert names(tmp_path) == {"zoo.json"}
    monkeypatch.undo()
    whole = invoke(*arguments)
    assert whole.exit_code == 0
    assert names(tmp_path) == FILES
