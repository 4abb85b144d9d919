"""``heelstrike bench``: the quick form runs, its runs are valid, and it says what is missing."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from heelstrike.cli.bench import Part
from heelstrike.cli.main import app
from heelstrike.experiments.benchmark import PARTS


def bench(out: Path, *parts: Part, options: tuple[str, ...] = ()) -> Any:
    chosen = [word for part in parts for word in ("--part", part.value)]
    return CliRunner().invoke(app, ["bench", "--quick", "--out", str(out), *chosen, *options])


def test_the_command_knows_all_parts() -> None:
    assert [part.value for part in Part] == list(PARTS)


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """Directory and outcome of the whole quick form."""
    out = tmp_path_factory.mktemp("bench")
    return out, bench(out)


def written(quick: tuple[Path, Any]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((quick[0] / "benchmark.json").read_text())
    return found


@pytest.mark.slow
def test_every_engine_that_is_timed_stands_as_it_should(quick: tuple[Path, Any]) -> None:
    out, result = quick
    assert result.exit_code == 0, result.stderr
    for word in ("heelstrike", "MuJoCo", "standing", "walking", "falling"):
        assert word in result.stdout
    assert (out / "benchmark_steps.png").stat().st_size > 10_000
    steps = written(quick)["steps"]
    rows = steps["rows"]
    assert len(rows) == 5
    for row in rows:
        assert "invalid" not in row
        assert "mujoco_invalid" not in row
        assert row["heelstrike_check"]["complementarity"] <= 1e-9
        assert row["heelstrike_us"] > 0.0
        times = {name: row[f"{name}_us"] / row["heelstrike_us"] for name in steps["engines"]}
        assert row["times_faster"] == times
    assert "mujoco" in steps["engines"]
    for row in rows[:3]:
        for engine in ("heelstrike", *steps["engines"]):
            active = row[f"{engine}_check"]["active_contacts"]
            assert active == 4.0 if engine == "heelstrike" else active == pytest.approx(4, abs=0.04)
            assert row[f"{engine}_check"]["weight_carried"] == pytest.approx(1.0, abs=1e-2)


@pytest.mark.slow
def test_the_whole_quick_form(quick: tuple[Path, Any]) -> None:
    found = written(quick)
    for part in PARTS:
        assert part in found
    precision = found["precision"]
    assert len(precision["touchdowns_s"]) >= 2
    assert precision["to_goal"]["heelstrike"]["error_rad"] <= 1e-4
    assert found["threads"]["same_for_all_threads"]
    assert found["endurance"]["failures"] == 0
    assert found["endurance"]["unfinished"] == 0
    assert found["endurance"]["complementarity"] <= 1e-9
    assert set(found["footprint"]["allocations_a_step"].values()) == {0.0}
    memory = found["footprint"]["memory"]
    if memory["before_MiB"] is not None:  # a system without /proc does not say
        assert memory["after_MiB"] - memory["before_MiB"] <= 2.0


def test_json_alone_on_standard_output(tmp_path: Path) -> None:
    result = bench(tmp_path, Part.SCALING, options=("--json",))
    assert result.exit_code == 0, result.stderr
    printed = json.loads(result.stdout)
    assert printed == json.loads((tmp_path / "benchmark.json").read_text())
    assert printed["machine"]["versions"]["numba"]
    assert [row["size"] for row in printed["scaling"]["joints"]] == [2, 8, 30]


def test_a_missing_engine_is_named_and_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = bench(tmp_path, Part.SCALING)
    assert result.exit_code == 0, result.stderr
    assert "not installed" in result.stderr
    assert "mujoco" in result.stderr
    written = json.loads((tmp_path / "benchmark.json").read_text())
    assert written["peers"]["mujoco"] == "not installed"
    assert all("mujoco_us" not in row for row in written["scaling"]["joints"])
