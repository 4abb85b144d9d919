"""The directory of a walk."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import heelstrike as hs
from heelstrike.experiments.results import Results
from heelstrike.experiments.walk import walk


@pytest.fixture(scope="module")
def run(bravo7: hs.Robot, gait: hs.Gait) -> hs.Run:
    return walk(bravo7, gait, steps=1)


def test_directory_is_made_at_once(tmp_path: Path) -> None:
    Results(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        Results(tmp_path / "file" / "below")


def test_a_new_gait_removes_the_results_of_the_old_one(tmp_path: Path, gait: hs.Gait) -> None:
    for name in ("run.nc", "summary.json", "walk.gif", "zmp.png", "mine.png"):
        (tmp_path / name).touch()
    Results(tmp_path).save_gait(gait)
    assert {path.name for path in tmp_path.iterdir()} == {"gait.json", "mine.png"}


def test_every_file_on_its_own(
    tmp_path: Path, run: hs.Run, gait: hs.Gait, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise MemoryError("too large")

    monkeypatch.setattr(hs.Run, "summary", broken)
    monkeypatch.setattr(hs.Run, "plot", broken)
    fractions: list[float] = []
    saved = Results(tmp_path).save_run(run, gait, animation=None, progress=fractions.append)
    failed = {each.path.name for each in saved if each.error is not None}
    assert {path.name for path in tmp_path.iterdir()} == {"run.nc"}
    assert failed == {each.path.name for each in saved} - {"run.nc"}
    assert all(isinstance(each.error, MemoryError) for each in saved if each.error)
    assert fractions[-1] == 1.0


def test_summary_is_the_run_s(
    tmp_path: Path, run: hs.Run, gait: hs.Gait, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hs.Run, "plot", lambda *_, **__: None)  # figures take most of the time
    Results(tmp_path).save_run(run, gait, animation=None)
    saved = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert saved == run.summary(gait=gait).to_dict()
