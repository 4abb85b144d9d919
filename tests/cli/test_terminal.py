"""What holds for every command: how errors, warnings and help reach a person."""

from __future__ import annotations

import re
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import heelstrike
from heelstrike.cli import run as heelstrike_command
from heelstrike.cli.main import app
from heelstrike.cli.terminal import spoken, stage
from heelstrike.errors import GaitError

CONTROL_CHARACTERS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own, its output in pipes."""
    return subprocess.run(
        [sys.executable, "-m", "heelstrike.cli.main", *arguments],
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )


def test_version() -> None:
    result = CliRunner().invoke(app, ["--version"])
    assert result.exit_code == 0
    assert result.stdout == f"heelstrike {heelstrike.__version__}\n"


@pytest.mark.parametrize("command", ["walk", "paper", "robots"])
def test_help_of_every_command(command: str) -> None:
    result = CliRunner().invoke(app, [command, "--help"])
    assert result.exit_code == 0
    assert re.search(rf"Usage: \S+ {command}", result.stdout)


def test_help_loads_neither_compiler_nor_plots_nor_optimiser() -> None:
    script = (
        "import sys\n"
        "from heelstrike.cli.main import app\n"
        "app(['walk', '--help'], standalone_mode=False)\n"
        "print(*sorted({name.split('.')[0] for name in sys.modules}), file=sys.stderr)\n"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    ).stderr.split()
    assert "typer" in loaded
    assert {"numba", "casadi", "matplotlib", "mujoco", "scipy", "xarray"}.isdisjoint(loaded)


def test_help_is_quick() -> None:
    # Processor time, so that a busy machine does not matter: 0.1 s at the time of writing.
    script = (
        "import sys, time\n"
        "from heelstrike.cli.main import app\n"
        "app(['--help'], standalone_mode=False)\n"
        "print(time.process_time(), file=sys.stderr)\n"
    )
    used = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert float(used.stderr) < 0.5


def test_no_control_characters_in_a_pipe() -> None:
    listed = run("robots")
    assert listed.returncode == 0
    assert "bravo7" in listed.stdout
    assert listed.stderr == ""
    assert not CONTROL_CHARACTERS.search(listed.stdout)
    refused = run("walk", "bravo")
    assert refused.returncode == 2
    assert refused.stdout == ""
    assert refused.stderr.startswith("error: ")
    assert not CONTROL_CHARACTERS.search(refused.stderr)


def _app_that_raises(error: Exception) -> typer.Typer:
    other = typer.Typer()

    @other.command()
    @spoken
    def fail() -> None:
        raise error

    return other


def test_error_in_words_unless_debugging() -> None:
    failing = _app_that_raises(GaitError("no such gait"))
    result = CliRunner().invoke(failing, [])
    assert result.exit_code == 2
    assert result.stderr == "error: no such gait\n"
    assert isinstance(CliRunner().invoke(failing, ["--debug"]).exception, GaitError)


def test_file_trouble_names_the_file() -> None:
    failing = _app_that_raises(OSError(28, "No space left on device", "walk/run.nc"))
    result = CliRunner().invoke(failing, [])
    assert result.exit_code == 2
    assert result.stderr == "error: walk/run.nc: No space left on device\n"


def test_a_mistake_in_the_program_is_not_dressed_up() -> None:
    result = CliRunner().invoke(_app_that_raises(ZeroDivisionError("bug")), [])
    assert isinstance(result.exception, ZeroDivisionError)


def test_markup_in_a_message_is_text() -> None:
    result = CliRunner().invoke(_app_that_raises(GaitError("joint [red]x[/red] [0]")), [])
    assert result.stderr == "error: joint [red]x[/red] [0]\n"


def test_warnings_in_words() -> None:
    other = typer.Typer()

    @other.command()
    @spoken
    def risky() -> None:
        warnings.warn("left and right differ", stacklevel=1)

    result = CliRunner().invoke(other, [])
    assert result.exit_code == 0
    assert result.stderr == "warning: left and right differ\n"


def test_stages_are_silent_away_from_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with stage("working") as working:
        working.reached(0.5)
        working.doing("more", 0.7)
        working.outcome = "done"
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == ""


def test_stages_speak_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich's own way to be told that this is a terminal
    with stage("walking", when_slow="(compiling)") as walking:
        walking.reached(0.5)
        walking.outcome = "walked 20 steps"
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "walking" in captured.err
    assert "walked 20 steps" in captured.err


def test_installed_command_is_the_app(monkeypatch: pytest.MonkeyPatch) -> None:
    text = (Path(__file__).resolve().parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    assert 'heelstrike = "heelstrike.cli:run"' in text
    called = []
    monkeypatch.setattr("heelstrike.cli.main.app", lambda: called.append(True))
    heelstrike_command()
    assert called


def test_ctrl_c_before_the_command_begins(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    statuses: list[int] = []
    monkeypatch.setattr("heelstrike.cli.main.app", interrupted)
    monkeypatch.setattr("heelstrike.cli.os._exit", statuses.append)
    heelstrike_command()
    assert statuses == [130]
    assert capsys.readouterr().err == "interrupted\n"
