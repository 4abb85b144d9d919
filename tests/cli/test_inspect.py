"""``heelstrike inspect``."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from heelstrike.cli.main import app
from heelstrike.robot import builtin_robots, load_robot


@pytest.mark.parametrize("name", builtin_robots())
def test_the_library(name: str) -> None:
    result = CliRunner().invoke(app, ["inspect", name])
    assert result.exit_code == 0
    assert result.stderr == ""
    robot = load_robot(name)
    for word in (*robot.joint_names, *robot.link_names, *robot.contact_names):
        assert word in result.stdout
    assert result.stdout.endswith("findings\n  none\n")
    drawing, _, _ = result.stdout.partition(f"{name}: ")
    assert any("\u2801" <= letter <= "\u28ff" for letter in drawing)
    assert max(map(len, drawing.splitlines())) <= 72


def test_the_sample_in_the_documentation() -> None:
    page = Path(__file__).parents[2] / "docs" / "robots.md"
    _, _, after = page.read_text(encoding="utf-8").partition("```text\n")
    sample, _, _ = after.partition("```")
    assert CliRunner().invoke(app, ["inspect", "bravo7"]).stdout.endswith(sample)


def test_a_picture(tmp_path: Path) -> None:
    picture = tmp_path / "bravo7.png"
    result = CliRunner().invoke(app, ["inspect", "bravo7", "--out", str(picture)])
    assert result.exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_finding_is_said_and_counts(tmp_path: Path) -> None:
    path = load_robot("bravo7").save(tmp_path / "r.xml")
    path.write_text(
        path.read_text("utf-8").replace('friction="0.75"', 'friction="0.5"', 1), "utf-8"
    )
    result = CliRunner().invoke(app, ["inspect", str(path)])
    assert result.exit_code == 1
    assert "feet of different friction: right_foot 0.5 and 0.75, left_foot 0.75" in result.stdout
    assert "left and right differ" not in result.stdout  # the ground's friction acts
    assert result.stderr == ""
    told = json.loads(CliRunner().invoke(app, ["inspect", str(path), "--json"]).stdout)
    assert len(told["findings"]) == 1
    assert told["symmetric"] is True


def test_a_robot_in_space(tmp_path: Path) -> None:
    """Projected on request; else there is nothing to draw, and it says why."""
    path = load_robot("bravo7").save(tmp_path / "r.xml")
    roll = '<joint name="roll" axis="1 0 0" /><joint name="root_x"'
    path.write_text(path.read_text("utf-8").replace('<joint name="root_x"', roll, 1), "utf-8")
    picture = tmp_path / "r.png"
    result = CliRunner().invoke(app, ["inspect", str(path), "--out", str(picture)])
    assert result.exit_code == 1
    assert "'roll' of body 'trunk' turns about (1, 0, 0)" in result.stdout
    assert "no robot to draw" in result.stderr
    assert not picture.exists()
    result = CliRunner().invoke(app, ["inspect", str(path), "--projected"])
    assert "right_ankle" in result.stdout
    assert "1 joint is locked: roll" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bravo"], "Did you mean 'bravo7'?"),
        (["no/such/robot.urdf"], "there is no such file"),
        (["."], "expected an MJCF file"),
        (["bravo7", "--out", "no/such/folder/x.png"], "there is no folder"),
        (["bravo7", "--out", "x.doc"], ".png, .pdf or .svg"),
        (["bravo7", "--ground", "slope:3"], "give its file"),
        (["bravo7", "--push", "trunk:60:1:0.1"], "give its file"),
        (["bravo7", "--push", "head:60:1:0.1", "--out", "x.png"], "its links are trunk"),
        (["bravo7", "--ground", "slop:3", "--out", "x.png"], "Did you mean slope:DEGREES"),
        (["bravo7", "--pose", "left_kne=0.4"], "Did you mean 'left_knee'?"),
        (["bravo7", "--pose", "left_knee"], "write joint=value"),
        (["bravo7", "--forward", "z"], "is not one of 'x', 'y'"),
    ],
)
def test_mistakes(arguments: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["inspect", *arguments])
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.split())
    assert "Traceback" not in result.stderr


def test_a_picture_on_a_ground_with_a_push(tmp_path: Path) -> None:
    pictures = []
    for options in ([], ["--ground", "slope:10"], ["--push", "trunk:60:1:0.1"]):
        path = tmp_path / f"{len(pictures)}.png"
        result = CliRunner().invoke(app, ["inspect", "bravo7", "--out", str(path), *options])
        assert result.exit_code == 0, result.stderr
        pictures.append(path.read_bytes())
    assert len(set(pictures)) == 3


def test_how_a_file_is_read(tmp_path: Path) -> None:
    """A robot that walks along y, in another pose: as it is along x."""
    path = load_robot("bravo7").save(tmp_path / "r.xml")
    text = path.read_text("utf-8")
    turned = text.replace(
        '<body name="trunk"', '<body name="trunk" euler="0 0 1.5707963267948966"', 1
    )
    assert turned != text
    path.write_text(turned, "utf-8")
    options = ["--forward", "y", "--pose", "left_knee=23deg"]
    result = CliRunner().invoke(app, ["inspect", str(path), "--json", *options])
    told = json.loads(result.stdout)
    assert told["coordinates"][:3] == ["root_x", "root_z", "root_pitch"]
    knee = told["coordinates"].index("left_knee")
    assert told["reference"][knee] == pytest.approx(np.deg2rad(23.0))


def test_files_of_packages_and_unequal_legs(tmp_path: Path) -> None:
    """A model that the robot includes from elsewhere; legs that are made alike."""
    (tmp_path / "shelf" / "bravo").mkdir(parents=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its outline
        part = load_robot("bravo7").save(tmp_path / "shelf" / "bravo" / "model.sdf")
    text = part.read_text("utf-8")
    mass = re.search("<mass>([^<]+)</mass>", text[text.index('<link name="left_thigh"') :])
    assert mass is not None
    heavier = text.replace(mass[0], f"<mass>{1.01 * float(mass[1])!r}</mass>", 1)
    part.write_text(heavier, "utf-8")
    path = tmp_path / "robot.sdf"
    path.write_text(
        '<sdf version="1.9"><model name="whole"><include merge="true"><uri>model://bravo</uri>'
        "</include></model></sdf>",
        "utf-8",
    )
    assert "not there" in CliRunner().invoke(app, ["inspect", str(path)]).stderr
    there = ["inspect", str(path), "--json", "--package-path", str(tmp_path / "shelf")]
    assert not json.loads(CliRunner().invoke(app, there).stdout)["symmetric"]
    assert json.loads(CliRunner().invoke(app, [*there, "--mirror"]).stdout)["symmetric"]


def test_a_folder_of_packages_for_a_built_in_robot_is_refused_in_words_of_the_command() -> None:
    told = CliRunner().invoke(app, ["inspect", "bravo7", "--package-path", "."])
    assert told.exit_code != 0
    assert "leave out --package-path" in " ".join(told.stderr.split())
    assert "package_path" not in told.stderr


def _inspect(*arguments: str, encoding: str) -> subprocess.CompletedProcess[bytes]:
    code = "from heelstrike.cli.main import app; app()"
    return subprocess.run(
        [sys.executable, "-c", code, "inspect", *arguments],
        capture_output=True,
        check=True,
        timeout=120,
        env=os.environ | {"PYTHONIOENCODING": encoding},
    )


@pytest.mark.slow
def test_a_pipe_gets_plain_text() -> None:
    """No colours, no warnings; without letters for it, no drawing but the rest."""
    done = _inspect("bravo7", encoding="utf-8")
    text = done.stdout.decode()
    assert (done.stderr, "\x1b" in text) == (b"", False)
    assert "⡇" in text
    done = _inspect("bravo7", encoding="ascii")
    assert done.stdout.decode("ascii").startswith("bravo7: 75 kg")
    assert done.stderr == b""
