"""``heelstrike walk``: what it writes, what it says, and that nothing is lost when it fails."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
from synthetic_runs import SUMMARY_KEYS
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.experiments.results import OF_MOTORS
from heelstrike.view.figures import FIGURES

STEPS = 3  # of the walk in conftest.py


def test_walks_and_writes_everything(walked: tuple[Path, Any]) -> None:
    out, result = walked
    assert result.exit_code == 0, result.stderr
    written = {path.name for path in out.iterdir()}
    assert written == {
        "gait.json",
        "run.nc",
        "summary.json",
        "walk.mp4",
        *(f"{figure}.png" for figure in FIGURES),
    }
    assert all((out / name).stat().st_size > 0 for name in written)
    assert (out / "walk.mp4").read_bytes()[4:8] == b"ftyp"
    for name in written:
        assert name in " ".join(result.stderr.split())


def test_summary_has_its_keys_and_a_physical_walk(walked: tuple[Path, Any]) -> None:
    summary = json.loads((walked[0] / "summary.json").read_text(encoding="utf-8"))
    assert summary.keys() >= SUMMARY_KEYS
    assert summary["gait"].keys() >= {"step_length_m", "step_duration_s", "cost_N2m2s"}
    assert summary["solver"].keys() >= {"name", "solves", "fallbacks", "failures"}
    assert summary["status"] == "completed"
    assert summary["steps"] == STEPS
    assert summary["gait"]["step_length_m"] == pytest.approx(0.30)
    assert summary["gait"]["step_duration_s"] == pytest.approx(0.70)
    # The body moves by a step's length a step, and a little on in the time after the last one.
    assert summary["distance_m"] == pytest.approx(STEPS * 0.30, abs=0.1)
    low, high = summary["zmp_limits_m"]
    assert low <= summary["zmp_min_m"] < summary["zmp_max_m"] <= high
    assert summary["solver"]["failures"] == 0
    assert all(math.isfinite(v) for v in summary.values() if isinstance(v, float))


def test_the_run_and_gait_can_be_loaded(walked: tuple[Path, Any]) -> None:
    run = hs.load_run(walked[0] / "run.nc")
    assert run.completed
    gait = hs.load_gait(walked[0] / "gait.json", run.robot)
    summary = json.loads((walked[0] / "summary.json").read_text(encoding="utf-8"))
    assert run.summary(gait=gait).tracking_rms_rad == pytest.approx(summary["tracking_rms_rad"])


def test_table_for_a_person(walked: tuple[Path, Any]) -> None:
    table = walked[1].stdout
    for label in ("steps", "zero moment point", "friction use", "cost of transport"):
        assert label in table
    assert "\x1b" not in table


def test_json_is_all_of_standard_output(walk: Callable[..., Any], tmp_path: Path) -> None:
    result = walk("--steps", "1", "--json")
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    printed = json.loads(result.stdout)
    assert printed == json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))


def test_gif_replaces_the_film_of_an_earlier_walk(walk: Callable[..., Any], tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for name in ("walk.mp4", "run.nc", "notes.txt"):
        (out / name).write_text("of yesterday", encoding="utf-8")
    result = walk("--steps", "1", "--animation", "gif")
    assert result.exit_code == 0, result.stderr
    assert (out / "walk.gif").read_bytes().startswith(b"GIF8")
    assert not (out / "walk.mp4").exists()
    assert (out / "run.nc").read_bytes() != b"of yesterday"
    assert (out / "notes.txt").read_text(encoding="utf-8") == "of yesterday"


def test_a_gait_walks_from_its_own_directory(
    walked: tuple[Path, Any], walk: Callable[..., Any], tmp_path: Path
) -> None:
    gait = tmp_path / "gait.json"
    text = (walked[0] / "gait.json").read_text(encoding="utf-8")
    gait.write_text(text, encoding="utf-8")
    options = ["--gait", str(gait), "--out", str(tmp_path), "--steps", "1", "--animation", "none"]
    assert CliRunner().invoke(app, ["walk", *options]).exit_code == 0
    assert gait.read_text(encoding="utf-8") == text


def test_a_fall_is_kept_and_told(walk: Callable[..., Any], tmp_path: Path) -> None:
    # Without friction the feet slide away at once.
    result = walk("--friction", "0")
    assert result.exit_code == 1
    assert "error: the robot fell" in result.stderr
    assert "status" in result.stdout
    out = tmp_path / "out"
    assert json.loads((out / "summary.json").read_text(encoding="utf-8"))["status"] == "fell"
    assert hs.load_run(out / "run.nc").time[-1] > 0.0
    assert (out / "tracking.png").exists()


@pytest.mark.parametrize("command", ["compare", "walk"])
def test_a_robot_that_goes_down_has_not_walked(
    command: str, tmp_path: Path, walk: Callable[..., Any]
) -> None:
    """Moreau-Jean at 1 ms sinks: its run ends when its time is up, after two steps upright again.

    It looks for contact half a step ahead, where a foot that has turned by rounding touches no
    more; the law, for which the foot stands, then asks for more than the motors have.
    """
    options = ["--method", "moreau-jean", "--step", "1e-3"]
    if command == "walk":
        result = walk("bravo7", "--steps", "2", *options)
    else:
        walking.gait().save(tmp_path / "gait.json")
        options += ["--gait", str(tmp_path / "gait.json"), "--out", str(tmp_path / "out")]
        result = CliRunner().invoke(app, ["compare", "bravo7", "--steps", "1", *options])
    assert result.exit_code == 1
    assert "the robot goes down: torque limit" in " ".join(result.stderr.split())


def test_a_fall_on_point_feet_is_explained(
    walk: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = {"step_length": 0.21, "step_duration": 0.58, "clearance": 0.02}
    gait = hs.optimize_gait(hs.load_robot("rabbit"), **size, friction=0.6, starts=1)
    gait.save(tmp_path / "rabbit.json")
    options = [
        "--animation",
        "none",
        "--out",
        str(tmp_path),
        "--gait",
        str(tmp_path / "rabbit.json"),
    ]
    result = CliRunner().invoke(app, ["walk", "rabbit", *options])
    assert result.exit_code == 1
    said = " ".join(result.stderr.split())
    assert "error: the robot fell" in said
    assert "stands on point feet" in said
    assert "the first step" in said
    assert "--controller VirtualConstraints" in said
    # The first step succeeds.
    result = CliRunner().invoke(app, ["walk", "rabbit", *options, "--steps", "1"])
    assert result.exit_code == 0, result.stderr
    assert "point feet" not in result.stderr


@pytest.mark.parametrize("lost", ["zmp", "tracking"])
def test_a_figure_that_fails_takes_nothing_with_it(
    walk: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lost: str
) -> None:
    def plot(run: hs.Run, what: str, *, path: Path, **_: Any) -> None:
        if what == lost:
            raise RuntimeError("out of ink")
        path.touch()

    monkeypatch.setattr(hs.Run, "plot", plot)
    result = walk("--steps", "1", "--animation", "gif")
    assert result.exit_code == 1
    assert f"{lost}.png could not be made: RuntimeError: out of ink" in result.stderr
    written = {path.stem for path in (tmp_path / "out").iterdir()}
    assert written == {"gait", "run", "summary", "walk", *FIGURES} - {lost}


def test_a_film_that_fails_takes_nothing_with_it(
    walk: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def animate(run: hs.Run, path: Path) -> None:
        raise OSError("no codec")

    monkeypatch.setattr(hs.Run, "animate", animate)
    result = walk("--steps", "1", "--animation", "mp4", "--json")
    assert result.exit_code == 1
    assert "walk.mp4 could not be made: OSError: no codec" in result.stderr
    assert json.loads(result.stdout)["steps"] == 1
    assert (tmp_path / "out" / "run.nc").exists()


def test_the_gait_is_saved_before_it_is_simulated(
    walk: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulate(*_: Any, **__: Any) -> None:
        raise RuntimeError("power cut")

    monkeypatch.setattr("heelstrike.experiments.walk.simulate", simulate)
    assert isinstance(walk().exception, RuntimeError)
    assert hs.load_gait(tmp_path / "out" / "gait.json").step_length == pytest.approx(0.30)


def test_interrupted_by_ctrl_c(
    walk: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reached(stage: Any, fraction: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("heelstrike.cli.terminal.Stage.reached", reached)
    monkeypatch.setattr("heelstrike.experiments.results.Results.save_run", lambda *_, **__: ())
    result = walk("--json")
    assert result.exit_code == 130
    assert "interrupted while walking, at t = " in result.stderr
    assert json.loads(result.stdout)["status"] == "interrupted"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["bravo"], "Did you mean 'bravo7'?"),
        (["no/such/robot.xml"], "no/such/robot.xml"),
        (["--friction", "-0.1"], "friction"),
        (["--friction", "nan"], "friction"),
        (["--step", "0"], "time step must be a positive number"),
        (["--step", "-0.001"], "time step must be a positive number"),
        (["--step", "nan"], "time step must be a positive number"),
        (["--step-length", "5"], "cannot take a step of 5 m"),
        (["--step-length", "-0.3"], "step_length"),
        (["--step-duration", "0"], "step_duration"),
        (["--step-duration", "nan"], "step_duration"),
        (["--steps", "0"], "--steps"),
        (["--steps", "many"], "--steps"),
        (["--method", "runge-kutta"], "gap-linearised"),
        (["--csv", "walk.nc"], "the name of a run ends in .csv"),
        (["--csv", "nowhere/walk.csv"], "there is no folder"),
        (["--stpe", "0.001"], "--step"),
        (["--gait", "no/such/gait.json"], "error: no/such/gait.json: there is no such file"),
        (["--gait", "."], "directory"),
        (["--ground", "slop:3"], "Did you mean slope:DEGREES"),
        (["--push", "head:60:1:0.1"], "link 'head', which robot 'bravo7' does not have"),
        (["--pose", "left_kne=1"], "Did you mean 'left_knee'?"),
        (["--forward", "up"], "is not one of 'x', 'y'"),
        (["--controller", "Footsteps"], "no controller 'Footsteps'. Did you mean"),
        (["--controller", "nosuch.py:make"], "there is no file nosuch.py"),
        (["rabbit", "--controller", "WholeBody"], "(needs flat feet). It can have ComputedTorque,"),
        (["--controller", "StandingLQR", "--step-length", "0.2"], "by no gait"),
        (["compass_gait", "--controller", "JointPD"], "(no motors). No law by name can"),
        (["compass_gait"], "walks down a slope only"),
        (["compass_gait", "--ground", "slope:-3", "--step-length", "0.2"], "has no motors"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_wrong_input(options: list[str], said: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["walk", "--out", str(tmp_path / "out"), *options])
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.replace("│", " ").split())
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert "still in memory" not in result.stderr  # there is no run yet
    assert not (tmp_path / "out" / "run.nc").exists()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x80\x04\x95\x1c\x00\x00\x00\x8c\x02os\x8c\x06system\x93\x94",  # a pickle
        b"not json at all",
        b"[" * 100_000,
        b'{"format": "heelstrike gait"}',
        b'{"format": "heelstrike gait", "version": 1, "robot": "__import__(\'os\')", "cost": NaN}',
        b'{"__class__": "os.system", "args": ["true"]}',
        b'{"a": ' + b"9" * 6000 + b"}",
    ],
    ids=["empty", "pickle", "text", "deep", "hollow", "nan", "class", "digits"],
)
def test_hostile_gait_file(content: bytes, tmp_path: Path) -> None:
    gait = tmp_path / "hostile.json"
    gait.write_bytes(content)
    arguments = ["walk", "--gait", str(gait), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")
    assert str(gait) in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "out" / "gait.json").exists()


SPATIAL = """<mujoco model="spatial"><worldbody><body name="trunk"><freejoint/>
<geom size="0.1"/></body></worldbody></mujoco>"""

FOOTLESS = """<mujoco model="footless"><worldbody><body name="trunk">
<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
<joint name="pitch" axis="0 1 0"/><geom size="0.1" contype="0" conaffinity="0"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("robot", "said"), [(SPATIAL, "plane"), (FOOTLESS, "contact points")], ids=["3D", "footless"]
)
def test_unsuitable_robot(robot: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(robot, encoding="utf-8")
    result = CliRunner().invoke(app, ["walk", str(path), "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert said in result.stderr
    assert "Traceback" not in result.stderr


def test_saved_gait_has_its_own_step(walk: Callable[..., Any]) -> None:
    result = walk("--step-length", "0.4")
    assert result.exit_code == 2
    assert "a saved gait has its own step length" in " ".join(result.stderr.split())


def test_gait_of_another_robot(walked: tuple[Path, Any], tmp_path: Path) -> None:
    gait = str(walked[0] / "gait.json")
    arguments = ["walk", "spring_flamingo", "--gait", gait, "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "'bravo7'" in result.stderr


def test_out_is_a_file(tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    for out in (taken, taken / "below"):
        result = CliRunner().invoke(app, ["walk", "--out", str(out)])
        assert result.exit_code == 2
        assert "taken" in result.stderr
        assert "Traceback" not in result.stderr
    assert taken.read_text(encoding="utf-8") == "mine"


def test_a_push_and_a_slope_reach_the_walk(walk: Callable[..., Any], tmp_path: Path) -> None:
    options = ["--push", "trunk:20:0.2:0.1", "--ground", "slope:-0.2"]
    result = walk("--steps", "1", *options)
    assert result.exit_code == 0, result.stderr
    run = hs.load_run(tmp_path / "out" / "run.nc")
    (push,) = run.pushes
    assert (push.force, push.start, push.duration) == ((20.0, 0.0), 0.2, 0.1)
    assert run.ground.slope == math.radians(-0.2)
    assert abs(run.gap[0, run.robot.feet[0].contacts[0]]) < 1e-12


@pytest.mark.slow
def test_the_law_that_keeps_its_balance_is_named_and_does(
    walk: Callable[..., Any], tmp_path: Path
) -> None:
    """Where computed torque falls of a push the advice is followed, and the robot walks on."""
    push = ["--push", "trunk:400:0.3:0.1", "--steps", "3"]
    result = walk(*push)
    assert result.exit_code == 1
    (advice,) = re.findall(r"--controller \w+", result.stderr)
    result = walk(*push, *advice.split())
    assert result.exit_code == 0, result.stderr
    assert "--controller" not in result.stderr
    assert "alarm" in hs.load_run(tmp_path / "out" / "run.nc").log
    assert "--controller" not in walk("--steps", "1").stderr


def test_a_law_of_ones_own_walks_and_its_code_is_named(
    walk: Callable[..., Any], tmp_path: Path
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        "import heelstrike as hs\n"
        "def make(robot, gait):\n    return hs.ComputedTorque(robot, gait)\n"
    )
    result = walk("--steps", "1", "--controller", f"{file}:make")
    assert result.exit_code == 0, result.stderr
    assert f"the code of {file} has been run" in result.stderr.replace("\n", "")


@pytest.mark.usefixtures("undrawn")
def test_a_law_that_stands_takes_no_steps_and_is_well(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    options = ["--steps", "1", "--controller", "StandingLQR", "--animation", "none", "--out", out]
    result = CliRunner().invoke(app, ["walk", *options])
    assert result.exit_code == 0, result.stderr
    assert not (tmp_path / "out" / "gait.json").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_passive_walker_starts_on_its_cycle(tmp_path: Path) -> None:
    (tmp_path / "gait.json").write_text("of yesterday", encoding="utf-8")
    options = ["--ground", "slope:-3", "--steps", "4", "--animation", "none"]
    arguments = ["walk", "compass_gait", "--out", str(tmp_path), *options]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.stderr
    left = {path.name for path in tmp_path.iterdir()}
    figures = {f"{name}.png" for name in FIGURES if name not in OF_MOTORS}
    assert left == {"run.nc", "summary.json", *figures}
    run = hs.load_run(tmp_path / "run.nc")
    touchdowns = [e.time for e in run.events if e.kind.name == "TOUCHDOWN" and e.time > 0.0]
    assert np.diff(touchdowns) == pytest.approx(0.734346391, abs=1e-7)
    # Its legs are of one length, which time stepping does not let pass.
    result = CliRunner().invoke(app, [*arguments, "--method", "time-stepping"])
    assert result.exit_code == 1
    assert "of 4 steps" in result.stderr
    assert "--method event-driven lets them swing through" in result.stderr


def test_page_of_a_walk(walk: Callable[..., Any], tmp_path: Path) -> None:
    page = tmp_path / "walk.html"
    result = walk("--steps", "1", "--html", str(page))
    assert result.exit_code == 0, result.stderr
    assert "walk.html" in result.stderr
    text = page.read_text(encoding="utf-8")
    assert "bravo7 walks: 1 step," in text
    assert '<th scope="row">command</th>' in text


def test_a_page_that_cannot_be_written_is_refused_first(
    walk: Callable[..., Any], tmp_path: Path
) -> None:
    result = walk("--html", str(tmp_path / "walk.png"))
    assert result.exit_code == 2
    assert "ends in .html" in result.stderr
    assert not (tmp_path / "out" / "run.nc").exists()
