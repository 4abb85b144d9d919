"""``heelstrike robots``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heelstrike.cli.main import app
from heelstrike.robot import builtin_robots, load_robot


def test_lists_what_is_built_in() -> None:
    result = CliRunner().invoke(app, ["robots"])
    assert result.exit_code == 0
    for name in builtin_robots():
        line = next(line for line in result.stdout.splitlines() if name in line)
        robot = load_robot(name)
        numbers = [cell.strip() for cell in line.strip("│").split("│")][1:]
        assert numbers == [f"{robot.total_mass:.4g}", *map(str, (robot.nq, robot.nu, robot.nc))]


def test_json_of_all() -> None:
    listed = json.loads(CliRunner().invoke(app, ["robots", "--json"]).stdout)
    assert [robot["name"] for robot in listed] == list(builtin_robots())
    bravo7 = listed[0]
    assert bravo7["mass_kg"] == pytest.approx(75.0)
    assert len(bravo7["coordinates"]) == 9
    assert len(bravo7["actuators"]) == 6
    assert bravo7["feet"] == ["right_foot", "left_foot"]
    assert bravo7["symmetric"] is True


def test_one_robot_in_detail() -> None:
    result = CliRunner().invoke(app, ["robots", "bravo7"])
    assert result.exit_code == 0
    robot = load_robot("bravo7")
    for name in (*robot.joint_names, *robot.contact_names):
        assert name in result.stdout


def test_picture(tmp_path: Path) -> None:
    picture = tmp_path / "bravo7.png"
    result = CliRunner().invoke(app, ["robots", "bravo7", "--picture", str(picture)])
    assert result.exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bravo"], "Did you mean 'bravo7'?"),
        (["bravo7", "--picture", "no/such/folder/x.png"], "there is no folder"),
        (["bravo7", "--picture", "x.doc"], ".png, .pdf or .svg"),
        (["--picture", "x.png"], "heelstrike robots NAME"),
    ],
)
def test_mistakes(arguments: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["robots", *arguments])
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.split())
    assert "Traceback" not in result.stderr
