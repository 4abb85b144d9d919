"""``heelstrike watch`` from outside; what its page does is in ``tests/view/live``."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
import walking
from live_humanoid import humanoid
from typer.testing import CliRunner

from heelstrike.cli.main import app
from heelstrike.cli.options import METHODS
from heelstrike.experiments.watching import WalkStage
from heelstrike.view.live import viewer as module

pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")


class MadeError(Exception):
    """Raised instead of serving anything."""


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What would be served, by the options of the command."""
    found: dict[str, Any] = {}

    def view(**given: Any) -> None:
        found.update(given)
        raise MadeError

    monkeypatch.setattr(module, "view", view)
    return found


def asked(*options: str) -> Any:
    return CliRunner().invoke(app, ["watch", *options])


def test_what_is_asked_for_is_what_viewers_find_set(made: dict[str, Any]) -> None:
    result = asked(
        "geyer7", "--method", "event-driven", "--step", "0.002", "--friction", "0.6",
        "--speed", "0.25", "--port", "8123", "--ground", "slope:-2",
    )  # fmt: skip
    assert isinstance(result.exception, MadeError)
    assert (made["rate"], made["port"]) == (0.25, 8123)
    stage = made["stage"]
    assert isinstance(stage, WalkStage)
    values = stage.fitted({})
    assert values["robot"] == "geyer7"
    assert values["method"] == "event-driven"
    assert values["step"] == "2 ms"
    assert values["friction"] == 0.6
    assert values["slope"] == pytest.approx(-2.0)


def test_time_stepping_is_called_as_everywhere(made: dict[str, Any]) -> None:
    asked("compass_gait", "--method", "time-stepping")
    assert made["stage"].fitted({})["method"] == "time-stepping"


def test_robots_gaits_and_laws_of_ones_own_are_in_the_lists(
    made: dict[str, Any], tmp_path: Path
) -> None:
    files = [tmp_path / name for name in ("robot.xml", "a.json", "b.json", "mine.py")]
    robot, first, second, law = map(str, files)
    walking.bravo7().save(robot)
    for gait in (first, second):
        walking.gait().save(gait)
    files[3].write_text("def make(robot, gait):\n    raise AssertionError\n")
    laws = ("--controller", f"{law}:make", "--controller", "joint-pd")
    result = asked(robot, "rabbit", "--gait", first, "--gait", second, *laws)
    assert isinstance(result.exception, MadeError), result.output
    assert f"the code of {law} has been run" in result.output.replace("\n", "")
    stage = made["stage"]
    lists = {control.name: control.options for control in stage.controls(stage.fitted({}))}
    assert lists["robot"][:3] == (robot, "rabbit", "bravo7")
    assert lists["gait"][:2] == ("a.json", "b.json")
    assert lists["controller"][:2] == (f"{law}:make", "JointPD")


def test_rough_ground_can_be_set_and_stairs_are_as_they_are(made: dict[str, Any]) -> None:
    asked("--ground", "rough:0.004:9")
    assert made["stage"].fitted({})["roughness"] == 0.004
    asked("--ground", "stairs:0.02x0.3")
    values = made["stage"].fitted({})
    assert not {"slope", "roughness"} & values.keys()
    assert made["stage"].ground(values).height(0.55) == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--method", "euler"], f"'euler' is not one of '{METHODS[0]}', '{METHODS[1]}'"),
        (["bravo8"], "bravo8"),
        (["rabbit", "--controller", "FootstepFeedback"], "needs flat feet"),
        (["--controller", "mine.py"], "say which law of it is meant"),
        (["--gait", "nosuch.json"], "nosuch.json"),
        (["--ground", "slop:3"], "Did you mean slope:DEGREES"),
        (["--port", "70000"], "less than or equal to 65535"),
        (["--speed", "0"], "rate must lie between"),
        (["--step", "0"], "step must be a positive number"),
        (["--friction", "-1"], "friction coefficient"),
        (["compass_gait", "--ground", "rough:0.02:1"], "compass_gait has no motors"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_served(
    options: list[str], words: str
) -> None:
    result = asked(*options, "--no-browser")
    assert result.exit_code == 2, result.output
    assert words in " ".join(result.output.replace("│", " ").split())


def test_a_file_in_space_is_watched_in_space(made: dict[str, Any], tmp_path: Path) -> None:
    """Planar robots are lifted on request; what is of the plane only is refused."""
    humanoid(tmp_path)
    file = str(tmp_path / "small.xml")
    result = asked(file, "--friction", "0.6", "--ground", "slope:2", "--controller", "hold-posture")
    assert isinstance(result.exception, MadeError), result.output
    assert made["stage"].dimension.name == "space"
    values = made["stage"].fitted({})
    assert (values["robot"], values["controller"]) == (file, "HoldPosture")
    assert (values["friction"], values["slope"]) == (0.6, pytest.approx(2.0))
    asked("bravo7", "--dimension", "3", "--floating")
    assert made["stage"].dimension.name == "space"
    asked(file, "--dimension", "2", "--floating", "--forward", "x")
    assert made["stage"].dimension.name == "plane"
    for options, words in (
        (["--gait", file], "gaits are of robots in the plane"),
        (["--method", "event-driven"], "simulates robots in the plane only"),
        (["--ground", "stairs:0.02x0.3"], "SpatialGround has planes and boxes"),
        (["--controller", "WholeBody"], "There is HoldPosture"),
    ):
        result = asked(file, *options, "--no-browser")
        assert result.exit_code == 2, result.output
        assert words in " ".join(result.output.replace("│", " ").split())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signal for one process")
def test_ctrl_c_ends_it() -> None:
    started = subprocess.Popen(
        [sys.executable, "-m", "heelstrike", "watch", "compass_gait", "--no-browser"],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert started.stderr is not None
        address = started.stderr.readline().removeprefix("watch at ").strip()
        with urlopen(address, timeout=60.0) as page:
            assert b"heelstrike" in page.read()
        assert started.stderr.readline() == "Ctrl-C ends it\n"
        # Ctrl-C of a terminal.
        started.send_signal(signal.SIGINT)
        assert started.wait(timeout=60.0) == 130
        assert started.stderr.read() == "closed\n"
    finally:
        started.kill()
