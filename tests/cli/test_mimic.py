"""``heelstrike mimic``, and ``heelstrike check`` of a gait that was written as a table."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import walking
from typer.testing import CliRunner

from heelstrike.cli.main import app

ROLLS = """<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1" mass="9"/>
<body name="leg" pos="0 0.1 0"><joint name="roll" axis="1 0 0"/>
<geom name="foot" size="0.05" pos="0 0 -0.5" mass="1"/></body></body></worldbody></mujoco>"""
"""A robot whose leg leaves the plane."""


def test_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["mimic", str(tmp_path / "none.trc")])
    assert result.exit_code == 2
    assert "none.trc cannot be read" in result.stderr
    wrong = CliRunner().invoke(app, ["mimic", "winter", "--marker", "right_hip"])
    assert wrong.exit_code == 2
    assert "LANDMARK=NAME" in wrong.stderr


def test_what_cannot_come_of_it_is_told_before_it_is_computed(tmp_path: Path) -> None:
    """The recording is not even opened: there is none."""
    none = str(tmp_path / "none.trc")
    rate = CliRunner().invoke(app, ["mimic", none, "--csv-rate", "0"])
    assert rate.exit_code == 2
    assert "--csv-rate must be from" in rate.stderr
    robot = tmp_path / "turns.xml"
    robot.write_text(ROLLS)
    leaves = CliRunner().invoke(app, ["mimic", none, "--robot", str(robot)])
    assert leaves.exit_code == 2
    assert "none.trc" not in leaves.stderr
    assert "plane" in leaves.stderr


@pytest.mark.slow
def test_a_person_on_a_robot(tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["winter", "--robot", "bravo7", "--steps", "3", "--out", str(out), "--json"]
    result = CliRunner().invoke(app, ["mimic", *arguments])
    told = json.loads(result.stdout)
    assert result.exit_code == (0 if told["walk"]["steps"] == 3 else 1)
    assert told["robot"] == "bravo7"
    assert told["gait"]["distance_deg"] < 2.0
    assert told == json.loads((out / "summary.json").read_text())
    assert sorted(each.name for each in out.iterdir()) == [
        "angles.png", "motion.csv", "motion.json", "person.csv", "summary.json", "walk.nc",
    ]  # fmt: skip


def test_a_gait_that_was_written_as_a_table_is_checked(tmp_path: Path) -> None:
    path = tmp_path / "gait.csv"
    walking.gait().save(path, rate=200.0, degrees=True)
    result = CliRunner().invoke(app, ["check", str(path), "--trials", "0", "--json"])
    assert json.loads(result.stdout)["good"], result.stdout
    assert result.exit_code == 0
