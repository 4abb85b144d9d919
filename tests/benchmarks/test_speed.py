"""``benchmarks/speed``: the quick form runs, its runs are valid, and it says what is missing."""

from __future__ import annotations

import importlib.util
import io
import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from figure_text import check_text
from rich.console import Console
from speed import page, precision, scenarios, steps, suite
from speed.figures import draw
from speed.machine import machine
from speed.race import reason
from speed.scaling import crossover
from speed.suite import PARTS
from speed.tables import tables

from heelstrike.experiments.engines import Engine, InvalidRunError, Scenario, simulators

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """Directory and outcome of the whole quick form."""
    out = tmp_path_factory.mktemp("bench")
    command = [sys.executable, str(ROOT / "benchmarks/speed"), "run", "--quick", "--out", str(out)]
    return out, subprocess.run(command, capture_output=True, text=True, check=False)


def written(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "benchmark.json").read_text())
    return found


@pytest.mark.slow
def test_every_engine_that_is_timed_stands_as_it_should(quick: tuple[Path, Any]) -> None:
    out, result = quick
    assert result.returncode == 0, result.stderr
    for word in ("heelstrike", "MuJoCo", "standing", "walking", "falling"):
        assert word in result.stdout
    assert (out / "benchmark_steps.png").stat().st_size > 10_000
    found = written(out)["steps"]
    rows = found["rows"]
    assert len(rows) == 6
    for row in rows:
        assert "invalid" not in row
        assert "mujoco_invalid" not in row
        assert row["heelstrike_check"]["complementarity"] <= 1e-9
        assert row["heelstrike_us"] > 0.0
        times = {name: row[f"{name}_us"] / row["heelstrike_us"] for name in found["engines"]}
        assert row["times_faster"] == times
    assert "mujoco" in found["engines"]
    for row in rows[:3]:
        for engine in ("heelstrike", *found["engines"]):
            active = row[f"{engine}_check"]["active_contacts"]
            assert active == 4.0 if engine == "heelstrike" else active == pytest.approx(4, abs=0.04)
            assert row[f"{engine}_check"]["weight_carried"] == pytest.approx(1.0, abs=1e-2)


@pytest.mark.slow
def test_the_whole_quick_form(quick: tuple[Path, Any]) -> None:
    found = written(quick[0])
    for part in PARTS:
        assert part in found
    assert found["machine"]["versions"]["numba"]
    assert found["precision"]["to_goal"]["heelstrike"]["error_rad"] <= 1e-4
    assert len(found["precision"]["touchdowns_s"]) >= 2
    assert [row["size"] for row in found["scaling"]["joints"]] == [2, 8, 30]
    assert found["threads"]["same_for_all_threads"]
    assert found["endurance"]["failures"] == 0
    assert found["endurance"]["unfinished"] == 0
    assert found["endurance"]["complementarity"] <= 1e-9
    names = [row["scenario"] for row in found["stops"]["rows"]]
    assert "at rest on its stops" in names[1]
    assert all(row["us"] > 0.0 for row in found["stops"]["rows"])
    assert found["laws"]["a user's"] < found["laws"]["a user's, checked=True"]
    assert set(found["footprint"]["allocations_a_step"].values()) == {0.0}
    memory = found["footprint"]["memory"]
    if memory["before_MiB"] is not None:  # a system without /proc does not say
        assert memory["after_MiB"] - memory["before_MiB"] <= 2.0


def test_a_missing_engine_is_named_and_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert suite.run(["scaling"], quick=True, out=tmp_path) == 0
    assert "mujoco not installed" in " ".join(capsys.readouterr().out.split())
    found = written(tmp_path)
    assert found["peers"]["mujoco"] == "not installed"
    assert all("mujoco_us" not in row for row in found["scaling"]["joints"])


@pytest.mark.slow
def test_ctrl_c_keeps_the_parts_that_are_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(**_: Any) -> dict[str, Any]:
        signal.raise_signal(signal.SIGINT)
        raise AssertionError("nobody noticed")

    footprint = {"import_s": 0.2}
    parts = {"footprint": lambda **_: footprint, "threads": interrupt}
    measures = {name: SimpleNamespace(measure=measure) for name, measure in parts.items()}
    monkeypatch.setattr(suite, "PARTS", measures)
    monkeypatch.setattr(suite, "tables", lambda _: iter(()))
    assert suite.run(list(parts), quick=False, out=tmp_path) == 130
    assert "interrupted while measuring threads" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["benchmark.json"]
    assert written(tmp_path)["footprint"] == footprint
    assert written(tmp_path)["interrupted"] == "threads"


def test_the_page_is_filled_from_results_that_are_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "performance.md"
    copy.write_text(page.PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    before = copy.read_text(encoding="utf-8")
    monkeypatch.setattr(page, "PAGE", copy)
    results = {
        "quick": False,
        "date": "2001-02-03T04:05:06",
        "machine": machine(),
        "peers": {"mujoco": "1.2.3"},
        "threads": {
            "runs": 7, "duration_s": 1.0, "steps": 7000, "same_for_all_threads": True,
            "rows": [{"threads": 1, "steps_per_s": 5e5, "speed_up": 1.0}],
        },
    }  # fmt: skip
    (tmp_path / "benchmark.json").write_text(json.dumps(results))
    page.fill(tmp_path)
    after = copy.read_text(encoding="utf-8")
    assert "Measured 2001-02-03 on" in after
    assert "*7 walks of 1 s, 7000 steps, identical on all threads*" in after
    assert "| 1 | 0.5 | 1 | – | – |" in after
    # All that was not measured, and the counts of instructions, stay as they are.
    for part in ("steps", "scaling", "footprint", "endurance", "instructions"):
        block = re.search(rf"<!-- benchmark: {part} -->.*?<!-- end -->", before, re.DOTALL)
        assert block is not None
        assert block[0] in after
    (tmp_path / "benchmark.json").write_text(json.dumps({**results, "quick": True}))
    with pytest.raises(SystemExit, match="not all results"):
        page.fill(tmp_path)


def _only(monkeypatch: pytest.MonkeyPatch, engines: dict[str, Engine], contest: Scenario) -> None:
    """Measure one scenario in these engines."""
    monkeypatch.setattr(steps, "simulators", lambda names: engines)
    monkeypatch.setattr(steps, "contests", lambda: [(contest, None, {})])


def test_who_ends_elsewhere_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    working = simulators(["mujoco"])["mujoco"]
    falling = scenarios.falling("bravo7")
    law = scenarios.standing("bravo7").feedback

    def held(scenario: Scenario, step: float) -> Any:
        """What flies as it should, and does not fall."""
        ours = scenario is falling
        return working.peer(replace(scenario, feedback=law) if ours else scenario, step)

    _only(monkeypatch, {"mujoco": replace(working, peer=held)}, falling)
    (row,) = steps.measure(quick=True, peers=("mujoco",))["rows"]
    assert "from where it should" in row["mujoco_invalid"]
    assert "mujoco_us" not in row


def test_who_does_not_stand_is_refused_on_our_side_too(monkeypatch: pytest.MonkeyPatch) -> None:
    standing = scenarios.standing("bravo7", duration=0.05)
    _only(monkeypatch, {}, replace(standing, contacts=3))
    (row,) = steps.measure(quick=True, peers=())["rows"]
    assert row["invalid"].startswith("4 to 4 contacts carry")
    assert "heelstrike_us" not in row


def test_an_engine_that_breaks_does_not_lose_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(scenario: Any, step: float) -> Any:
        raise OSError("no such world")

    working = simulators(["mujoco"])["mujoco"]
    both = {"drake": replace(working, peer=breaks), "mujoco": working}
    _only(monkeypatch, both, scenarios.falling("bravo7", duration=0.05))
    part = steps.measure(quick=True, peers=("drake", "mujoco"))
    (row,) = part["rows"]
    assert row["drake_invalid"] == "OSError: no such world"
    assert "drake_us" not in row
    assert row["times_faster"].keys() == {"mujoco"}
    console = Console(file=io.StringIO(), width=200)
    console.print(*tables({"steps": part}))
    assert "does not count: OSError: no such world" in console.file.getvalue()  # type: ignore[attr-defined]
    (figure,) = draw({"steps": part}).values()
    assert "–" in check_text(figure)


def test_a_setting_that_breaks_is_told_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(scenario: Any, step: float, **how: Any) -> Any:
        raise OSError("no such world")

    working = simulators(["mujoco"])["mujoco"]
    bad = replace(working, peer=breaks)
    monkeypatch.setattr(precision, "simulators", lambda names: {"mujoco": bad})
    monkeypatch.setattr(scenarios, "walking", lambda: scenarios.falling("bravo7", duration=0.02))
    part = precision.measure(quick=True, peers=("mujoco",))
    assert len(part["failures"]) == 6
    assert {each["reason"] for each in part["failures"]} == {"OSError: no such world"}
    assert {point["side"] for point in part["points"]} == {"heelstrike"}
    assert part["to_goal"]["times_less"] == {}


def test_a_reason_that_is_ours_needs_no_name() -> None:
    assert reason(InvalidRunError("it sinks")) == "it sinks"
    assert reason(OSError("no such world")) == "OSError: no such world"


def test_what_engines_print_stays_out_of_the_results() -> None:
    """From Python, too, where standard output is a file and has a buffer."""
    told = subprocess.run(
        [
            sys.executable,
            "-c",
            "from speed.suite import output_diverted as diverted\n"
            "with diverted():\n"
            "    print('noise')\n"
            "print('result')",
        ],
        cwd=ROOT / "benchmarks",
        env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout == "result\n"
    assert "noise" in told.stderr


@pytest.mark.parametrize(
    ("ours", "theirs", "size"),
    [
        ([1.0, 2.0, 9.0], [3.0, 3.0, 3.0], 3),
        ([1.0, 2.0, 2.5], [3.0, 3.0, 3.0], None),
        ([4.0, 4.0, 4.0], [3.0, 3.0, 3.0], 1),
        ([1.0, 4.0, 2.0, 9.0], [3.0, 3.0, 3.0, 3.0], 4),  # quicker again after a jump
        ([1.0, 4.0, 2.0], [3.0, 3.0, 3.0], None),
        ([1.0, 4.0, 9.0], [3.0, None, 3.0], 3),  # left out where it was not valid
    ],
)
def test_from_which_size_on_a_peer_is_faster(
    ours: list[float], theirs: list[float | None], size: int | None
) -> None:
    rows = [
        {"size": number, "heelstrike_us": mine} | ({} if its is None else {"peer_us": its})
        for number, (mine, its) in enumerate(zip(ours, theirs, strict=True), start=1)
    ]
    assert crossover(rows, "peer") == size
