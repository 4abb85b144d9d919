"""A campaign survives what its scenes do, and goes on where it stopped."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from scene_workers import ASLEEP, ENDLESS, GONE, nothing, pretend
from scenes.campaign import Task, campaign, results_in

TASK = Task(run=pretend, prepare=nothing, limit=1.0)
METHOD = ("event_driven",)


def test_results_are_kept_and_not_asked_for_again(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    first = list(campaign(path, METHOD, (10, 11, 12), task=TASK))
    assert [one["seed"] for one in first] == [10, 11, 12]
    assert results_in(path) == first
    assert not list(campaign(path, METHOD, (10, 11, 12), task=TASK))
    path.write_bytes(path.read_bytes()[:-20])  # a kill in the middle of a line
    (again,) = campaign(path, METHOD, (10, 11, 12), task=TASK)
    assert again == first[2]
    assert results_in(path) == first


def test_a_process_that_ends_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    results = list(campaign(path, METHOD, (GONE, 12), task=TASK, workers=2))
    ends = {one["seed"]: one["status"] for one in results}
    assert ends == {GONE: "crashed", 12: "completed"}
    assert any("ended with 7" in one.get("message", "") for one in results)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot limit processor time")
def test_a_scene_that_works_for_ever_hangs(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    results = list(campaign(path, METHOD, (ENDLESS, 12), task=TASK))
    assert [one["status"] for one in results] == ["hang", "completed"]
    assert results_in(path) == results


def test_a_scene_that_waits_for_ever_hangs(tmp_path: Path) -> None:
    task = Task(run=pretend, prepare=nothing, clock=0.5)
    (one,) = campaign(tmp_path / "results.jsonl", METHOD, (ASLEEP,), task=task)
    assert one["status"] == "hang"
    assert "on the clock" in one["message"]
