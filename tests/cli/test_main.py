"""The command as a whole: how it is started, its help, what shells complete."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heelstrike.cli.main import app
from heelstrike.cli.options import METHODS, built_in, method_called
from heelstrike.robot import builtin_robots
from heelstrike.robot.inspection import Inspection
from heelstrike.sim import Scheme, TimeStepping


def test_python_m() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "heelstrike", "--version"],
        capture_output=True,
        check=True,
        timeout=120,
    )
    assert done.stdout.startswith(b"heelstrike ")
    assert done.stderr == b""


@pytest.mark.parametrize("command", ["walk", "compare", "inspect"])
def test_options_that_all_of_them_have(command: str) -> None:
    """With the ground's kinds whole, however narrow the terminal is."""
    result = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    for option in (
        "floating",
        "projected",
        "forward",
        "pose",
        "mirror",
        "package-path",
        "xacro",
        "ground",
        "push",
    ):
        assert f"--{option} " in result.stdout
    assert "FILE|flat|slope:-3|stairs:0.02x0.3|rough:0.01:7" in result.stdout


def test_methods_have_the_same_names_in_every_command() -> None:
    for command in ("walk", "watch", "report", "compare", "zoo"):
        given = [command, *(["bravo7"] if command == "report" else []), "--method", "euler"]
        result = CliRunner().invoke(app, given, env={"COLUMNS": "400"})
        assert result.exit_code == 2
        assert f"'euler' is not one of {', '.join(map(repr, METHODS))}" in result.stderr
    made = [method_called(name, 1e-3) for name in METHODS]
    assert len({repr(each) for each in made}) == len(made)  # each is another
    assert {each.scheme for each in made if isinstance(each, TimeStepping)} == set(Scheme)


@pytest.mark.parametrize(
    ("options", "xacro"),
    [
        ([], False),
        (["--xacro"], True),
        (["--xacro-arg", "legs:=2", "--xacro-arg", "name:=a:=b"], {"legs": "2", "name": "a:=b"}),
    ],
    ids=str,
)
def test_macros_are_expanded_where_asked(
    options: list[str], xacro: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: dict[str, object] = {}

    def inspect_robot(_name: str, **how: object) -> Inspection:
        seen.update(how)
        return Inspection("", None, ())

    monkeypatch.setattr("heelstrike.robot.inspection.inspect_robot", inspect_robot)
    assert CliRunner().invoke(app, ["inspect", "robot.xacro", *options]).exit_code == 0
    assert seen["xacro"] == xacro


def test_advice_names_options_and_not_keywords_of_python(tmp_path: Path) -> None:
    """And it is good: what is asked for is done when the option is given."""
    spatial = tmp_path / "r.xml"
    spatial.write_text(
        '<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/></body></worldbody>'
        "</mujoco>",
        encoding="utf-8",
    )
    result = CliRunner().invoke(app, ["walk", str(spatial)])  # in the plane
    assert result.exit_code == 2
    assert "load it with --floating, which does so." in " ".join(result.output.split())
    for option in ("--floating", "--projected"):
        again = CliRunner().invoke(app, ["inspect", str(spatial), option])
        assert "leave the plane" not in again.stderr
        assert "root_pitch" in again.stdout
    macro = tmp_path / "r.urdf.xacro"
    macro.write_text('<robot name="r"><xacro:limb/></robot>', encoding="utf-8")
    assert "Load it with --xacro" in CliRunner().invoke(app, ["inspect", str(macro)]).stdout


def test_names_of_robots_are_completed() -> None:
    assert built_in("rab") == ["rabbit", "rabbit_optimtraj"]
    assert built_in("my_robot.ur") == []  # where the shell completes files
    words = {"COMP_WORDS": "heelstrike inspect bra", "COMP_CWORD": "2"}
    done = subprocess.run(
        [sys.executable, "-c", "from heelstrike.cli.main import app; app(prog_name='heelstrike')"],
        capture_output=True,
        text=True,
        timeout=120,
        env=os.environ | words | {"_HEELSTRIKE_COMPLETE": "complete_bash"},
        check=False,
    )
    assert done.stdout.split() == [name for name in builtin_robots() if name.startswith("bra")]
