"""``heelstrike inspect`` of a humanoid file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heelstrike.cli.main import app

ROBOT = """
<mujoco model="one"><worldbody><body name="trunk" pos="0 0 1"><freejoint name="base"/>
<geom type="box" size="0.1 0.2 0.3" mass="3"/></body></worldbody></mujoco>"""


def test_words_data_and_a_picture(tmp_path: Path) -> None:
    path = tmp_path / "one.xml"
    path.write_text(ROBOT, encoding="utf-8")
    said = CliRunner().invoke(app, ["inspect", str(path)])
    assert "one: 3 kg, in space, 7 positions, 6 velocities" in said.output
    found = json.loads(CliRunner().invoke(app, ["inspect", str(path), "--json"]).stdout)
    assert found["dimension"] == 3
    picture = tmp_path / "one.png"
    drawn = CliRunner().invoke(app, ["inspect", str(path), "--out", str(picture)])
    assert drawn.exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    picture.unlink()
    pushed = ["inspect", str(path), "--out", str(picture), "--ground", "slope:3"]
    refused = CliRunner().invoke(app, pushed)
    assert refused.exit_code != 0
    assert not picture.exists()


@pytest.mark.parametrize(
    ("option", "value"), [("--ground", "slope:3"), ("--push", "trunk:50:1:0.1")]
)
def test_a_refusal_names_the_option(tmp_path: Path, option: str, value: str) -> None:
    path = tmp_path / "one.xml"
    path.write_text(ROBOT, encoding="utf-8")
    refused = CliRunner().invoke(app, ["inspect", str(path), option, value])
    assert refused.exit_code == 2
    said = " ".join(refused.output.split())
    assert option in said
    assert "--out" not in said
