"""The example of tuning: what it makes larger depends on what is tuned; a study goes on."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest
import tuning
import walking

import heelstrike as hs

USUAL = {"frequency": 20.0, "damping_ratio": 1.0, "step_duration": 0.7, "clearance": 0.02}


class Suggests:
    """A trial that takes the middle of every range."""

    def suggest_float(self, name: str, low: float, high: float, *, log: bool = False) -> float:
        return (low * high) ** 0.5 if log else 0.5 * (low + high)


def test_what_is_suggested_makes_a_walk() -> None:
    trial = tuning.tuned(walking.bravo7(), tuning.suggested(Suggests()))
    assert trial.step_duration == pytest.approx(0.7)
    assert isinstance(trial.controller, hs.ComputedTorque)


@pytest.mark.slow
def test_gains_matter() -> None:
    robot = walking.bravo7()
    stiff = tuning.share(robot, USUAL, 8)
    assert stiff > tuning.share(robot, USUAL | {"frequency": 1.0}, 8)


def test_without_optuna_it_says_what_to_install() -> None:
    if find_spec("optuna") is not None:
        pytest.skip("Optuna is installed")
    ended = subprocess.run(
        [sys.executable, tuning.__file__], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 1
    assert "pip install optuna" in ended.stderr


@pytest.mark.slow
def test_a_study_goes_on_where_it_was_ended(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    command = [sys.executable, tuning.__file__, "--walks", "2", "--study", str(tmp_path / "s")]
    for trials in ("1", "2"):
        ended = subprocess.run(
            [*command, "--trials", trials], capture_output=True, text=True, check=True
        )
        assert "of the walks go on" in ended.stdout
    assert "Using an existing study" in ended.stderr


FINISHED = """
select t.number, t.state, v.value from trials t left join trial_values v on v.trial_id = t.trial_id
where t.state in ('COMPLETE', 'PRUNED') order by t.number
"""


def finished(study: Path) -> list[tuple[int, str, float | None]]:
    """Trials of a study that are finished: number, state and value, as its file has them."""
    try:
        with sqlite3.connect(f"file:{study}?mode=ro", uri=True) as connection:
            return connection.execute(FINISHED).fetchall()
    except sqlite3.OperationalError:  # it is not there yet, or is being written
        return []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="kill -9 is of POSIX")
def test_a_study_that_is_killed_goes_on(tmp_path: Path) -> None:
    """What was finished at the kill is there unchanged, and the rest is done, no more."""
    pytest.importorskip("optuna")
    study = tmp_path / "study.sqlite"
    command = [sys.executable, tuning.__file__, "--walks", "2", "--study", str(study)]
    killed = subprocess.Popen(
        [*command, "--trials", "50"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        end = time.monotonic() + 240.0
        while len(finished(study)) < 2 and killed.poll() is None and time.monotonic() < end:
            time.sleep(0.02)
        assert killed.poll() is None
    finally:
        killed.kill()
        killed.wait()
    before = finished(study)
    assert 2 <= len(before) < 50
    wanted = len(before) + 2
    ended = subprocess.run(
        [*command, "--trials", str(wanted)], capture_output=True, text=True, check=True
    )
    assert "Using an existing study" in ended.stderr
    after = finished(study)
    assert after[: len(before)] == before
    assert len(after) == wanted
