"""Checks of scenes can fail, and say why."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenes import running
from scenes.checks import bridges, orders, twins
from scenes.checks.commands import CHECKS, check
from scenes.checks.summary import summary
from scenes.findings import Findings
from scenes.methods import Setting
from scenes.scene import random_scene
from scenes.twins import Twin, twins_of

import heelstrike as hs
from heelstrike.sim.closed_sets import RunStatus

SEED = 10
"""Falls onto the ground, and chatters."""
CHATTERS = 20
"""Differs from its twins by more than they may, since rounding grows from impact to impact."""


def test_twins_agree_and_a_wrong_one_does_not() -> None:
    setting = Setting.of(random_scene(SEED))
    run = setting.run("event_driven", duration=0.3)
    row = twins.windows(run)[0]
    state, begin = hs.State(run.position[row], run.velocity[row]), float(run.time[row])
    assert begin <= run.events[0].time - twins.BEFORE or begin == 0.0
    same = twins.compare(setting, twins_of(setting)[:2], state, begin)
    assert same["size"] <= twins.AGREE
    assert not same["cause"]
    heavy = dataclasses.replace(setting.scene.links[0], mass=setting.scene.links[0].mass * 1.001)
    scene = dataclasses.replace(setting.scene, links=(heavy, *setting.scene.links[1:]))
    wrong = Twin("wrong", setting, scene, mirror=False)
    found = twins.compare(setting, (wrong,), state, begin)
    assert found["size"] > twins.AGREE
    assert found["spread"] < 1e-3 * found["size"]  # its own last digits do not do that
    assert found["cause"] != "amplified"


def test_scenes_that_do_not_arrive_do_not_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither where no twin comes to its end, too, nor where the scene breaks off."""
    monkeypatch.setattr(twins, "ends", lambda *_: None)
    setting = Setting.of(random_scene(SEED))
    found = twins.compare(setting, twins_of(setting)[:2], setting.scene.state(setting.robot), 0.0)
    assert found["cause"] == "no end"
    broken = SimpleNamespace(completed=False, status=RunStatus.DIVERGED, message="", events=())
    monkeypatch.setattr(twins, "windows", lambda run: [])
    monkeypatch.setattr(Setting, "run", lambda *_: broken)
    result = twins.twins_of_scene("twins", SEED)
    assert not result["passes"]
    assert result["cause"] == "diverged"


def test_a_second_look_that_breaks_off_excuses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """What happens between rows is looked at again in a run that has to get as far."""

    def run(_: Setting, method: str, **settings: Any) -> Any:
        end = 0.1 if settings else 0.5
        return SimpleNamespace(
            completed=True, status=RunStatus.COMPLETED, message="", time=np.array([0.0, end])
        )

    def judge(_: Setting, method: str, run: Any) -> Findings:
        found = Findings()
        found.look("energy", np.array([float(run.time[-1] > 0.2)]), 0.5, run.time[-1:])
        return found

    monkeypatch.setattr(Setting, "run", run)
    monkeypatch.setattr(Setting, "judge", judge)
    result = running.run_scene("event_driven", SEED, twins=False)
    assert [one["law"] for one in result["objections"]] == ["energy"]


def test_the_last_digits_of_a_nudge() -> None:
    state = hs.State([1.0, -2.0, 0.0], [3.0, 4.0, -5.0])
    other = twins.nudged(state, 8e-16)
    assert 0.0 < np.abs(other.q - state.q).max() <= 2e-15
    assert 0.0 < np.abs(other.v - state.v).max() <= 5e-15


def test_orders_of_drifts() -> None:
    steps = orders.STEPS
    assert orders.order(steps, [3.0 * h for h in steps]) == pytest.approx(1.0)
    assert orders.order(steps, [h**0.5 for h in steps]) == pytest.approx(0.5)
    assert orders.order(steps, [1e-13] * len(steps)) == np.inf
    assert orders.order(steps, [1e-6] * len(steps)) == pytest.approx(0.0, abs=1e-12)


def test_the_energy_of_time_stepping_falls_with_the_step() -> None:
    found = orders.orders_of_scene("orders", 2)
    assert found["passes"]
    assert 0.9 < found["order"] < 1.3


def test_a_bridge_that_is_forced_and_one_that_lies() -> None:
    setting = Setting.of(random_scene(1))
    run = setting.run("event_driven")
    found = bridges.bridge_at(setting, run, 0.1439)
    assert found is not None
    assert found["covered"]
    assert found["halved"]
    assert found["error"] > bridges.NOISE


def test_summary_names_what_does_not_pass() -> None:
    results: list[dict[str, Any]] = [
        {"method": "energy", "seed": 1, "passes": True, "size": 1e-9, "seconds": 1.0},
        {"method": "energy", "seed": 2, "passes": False, "size": 1e-3, "cause": "not explained"},
        {"method": "energy", "seed": 3, "passes": False, "status": "hang"},
    ]
    text = summary("energy", results)
    assert "1 of 3 scenes pass" in text
    assert "- not explained, 1 (at most 1.0e-03): 2" in text
    assert "- hang, 1 (at most 0.0e+00): 3" in text


def test_a_check_goes_on_where_it_ended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is simulated here: all that is asked for, and more, is in the file."""
    assert set(CHECKS) == {"energy", "twins", "orders", "bridges"}
    out = tmp_path / "bridges.jsonl"
    known = [{"method": "bridges", "seed": seed, "passes": seed < 2} for seed in range(3)]
    out.write_text("".join(json.dumps(one) + "\n" for one in known))
    check("bridges", range(1, 3), out, 1)
    (first, *_) = capsys.readouterr().out.splitlines()
    assert first == "bridges: 1 of 2 scenes pass"


def test_scenes_without_a_bridge_are_told_and_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bridges, "bridge_at", lambda *_: None)
    result = bridges.bridges_of_scene("bridges", SEED)
    assert not result["passes"]
    good = result | {"seed": 11, "passes": True, "counts": True}
    words = summary("bridges", [result, good])
    assert words.startswith("bridges: 1 of 1 scenes pass")
    assert "nothing to check in 1, not counted: 10" in words
    assert summary("bridges", [result]) == "bridges: no scenes with anything to check"
