"""The command as a whole: how it is started, its help, what shells complete."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from heelstrike.cli.main import app
from heelstrike.cli.options import built_in
from heelstrike.robot import builtin_robots


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
        "ground",
        "push",
    ):
        assert f"--{option} " in result.stdout
    assert "FILE|flat|slope:-3|stairs:0.02x0.3|rough:0.01:7" in result.stdout


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
