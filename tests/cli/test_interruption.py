"""Ctrl-C in the commands: what they were at, what they keep, and exit status 130.

The signal comes from inside the work, at a place that is named, so that no clock decides.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import walking
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.cli.terminal import Stage
from heelstrike.experiments import comparison as comparison_module
from heelstrike.sim import RunStatus

pytestmark = pytest.mark.usefixtures("python_handles_ctrl_c")


@pytest.fixture
def interrupt_at(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], None]:
    """Send Ctrl-C when a stage whose name begins so reports for the n-th time that it got on."""

    def arrange(name: str, times: int = 1) -> None:
        reports: list[float] = []

        def reached(stage: Stage, fraction: float) -> None:
            if stage.what.startswith(name):
                reports.append(fraction)
                if len(reports) == times:
                    signal.raise_signal(signal.SIGINT)

        def doing(stage: Stage, what: str, fraction: float) -> None:
            stage.what = what
            reached(stage, fraction)

        monkeypatch.setattr(Stage, "reached", reached)
        monkeypatch.setattr(Stage, "doing", doing)

    return arrange


@pytest.fixture(scope="module")
def gait_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gait") / "gait.json"
    walking.gait().save(path)
    return path


def invoke(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} if folder.is_dir() else set()


def check(result: Any, *words: str) -> None:
    said = " ".join(result.stderr.split())
    assert result.exit_code == 130, said
    assert said.startswith("interrupted")
    assert "Traceback" not in said
    for word in words:
        assert word in said


def test_a_gait_that_was_not_finished_is_not_there(
    tmp_path: Path, interrupt_at: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEELSTRIKE_KEEP_GAITS", "0")
    interrupt_at("designing", 2)
    result = invoke("walk", "--out", tmp_path / "out")
    check(result, "while designing a gait of 0.3 m in 0.7 s", "nothing was written")
    assert names(tmp_path / "out") == set()


def test_a_walk_keeps_its_data_but_draws_nothing(
    tmp_path: Path, gait_file: Path, interrupt_at: Callable[..., None]
) -> None:
    interrupt_at("walking", 2)
    out = tmp_path / "out"
    result = invoke("walk", "--gait", gait_file, "--steps", 2000, "--out", out)
    check(result, "while walking, at t = ", "gait.json", "run.nc", "summary.json")
    assert names(out) == {"gait.json", "run.nc", "summary.json"}
    run = hs.load_run(out / "run.nc")
    assert run.status is RunStatus.INTERRUPTED
    assert 0.0 < run.time[-1] < 2000 * walking.STEP_DURATION
    assert json.loads((out / "summary.json").read_text())["status"] == "interrupted"


@pytest.mark.parametrize("finished", [1, 2])
def test_results_that_were_finished_are_named(
    tmp_path: Path, gait_file: Path, finished: int, interrupt_at: Callable[..., None]
) -> None:
    interrupt_at("writing results", finished)
    out = tmp_path / "out"
    result = invoke("walk", "--gait", gait_file, "--steps", 1, "--out", out)
    files = ["gait.json", "run.nc", "summary.json"][: finished + 1]
    check(result, "while writing results", *(str(out / name) for name in files))
    assert names(out) == set(files)
    assert hs.load_run(out / "run.nc").completed


def test_a_comparison_keeps_the_methods_it_has(
    tmp_path: Path, gait_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[hs.Run] = []

    def simulate(*arguments: Any, **options: Any) -> hs.Run:
        def interrupt(_: float) -> None:
            if len(runs) == 1:
                signal.raise_signal(signal.SIGINT)

        runs.append(hs.simulate(*arguments, **options, progress=interrupt))
        return runs[-1]

    monkeypatch.setattr(comparison_module, "simulate", simulate)
    ways = ["time-stepping", "moreau-jean", "linearly-implicit"]
    options = [word for way in ways for word in ("--method", way)]
    out = tmp_path / "out"
    result = invoke("compare", "--gait", gait_file, "--steps", 1, *options, "--out", out)
    assert result.exit_code == 130
    assert "interrupted while walking" in " ".join(result.stderr.split())
    assert names(out) == {"compare.json"}
    found = json.loads((out / "compare.json").read_text())
    assert [each["status"] for each in found["methods"]] == ["completed", "interrupted"]
    assert list(found["left_out"]) == ["linearly-implicit"]


def test_the_paper_writes_nothing_before_all_is_computed(
    tmp_path: Path, interrupt_at: Callable[..., None]
) -> None:
    interrupt_at("walking")
    out = tmp_path / "out"
    check(invoke("paper", "--out", out), "while walking", "nothing was written")
    assert names(out) == set()


def test_an_import_that_swallows_it_delays_it_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def swallow(*_: object) -> None:
        with contextlib.suppress(BaseException):  # as modules do that look for others
            signal.raise_signal(signal.SIGINT)
        for _ in range(6000):
            time.sleep(0.01)

    monkeypatch.setattr("heelstrike.experiments.results.Results.__init__", swallow)
    check(invoke("walk", "--out", tmp_path), "while loading", "nothing was written")


INTERRUPTED_AT_ONCE = """
import os, signal
from heelstrike.cli.terminal import Stage
Stage.reached = lambda stage, fraction: os.kill(os.getpid(), signal.SIGINT)
from heelstrike.cli import run
run()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
def test_the_process_ends_with_130_and_without_a_traceback(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED_AT_ONCE, "walk", "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"HEELSTRIKE_KEEP_GAITS": "0"},
    )
    assert done.returncode == 130
    assert done.stdout == ""
    assert done.stderr.startswith("interrupted while designing a gait")
    assert len(done.stderr.splitlines()) == 1


HELPED = """
import sys
from heelstrike.control.computed_torque import computed_torque
computed_torque.begin()
print(computed_torque.separate._helper.pid, flush=True)
raise KeyboardInterrupt
"""


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks for processes in /proc")
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="nobody helps on one processor")
def test_no_helper_outlives_the_process_that_it_helps(tmp_path: Path) -> None:
    """It would go on to write machine code."""
    cache = tmp_path / "cache"
    done = subprocess.run(
        [sys.executable, "-c", HELPED],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    helper = Path("/proc") / done.stdout.strip()
    assert helper != Path("/proc")
    for _ in range(6000):
        if not helper.exists() or "State:\tZ" in (helper / "status").read_text():
            break
        time.sleep(0.01)
    else:
        pytest.fail("the helper is still there")
    assert not list(cache.rglob("*computed_torque.computed_torque*"))
