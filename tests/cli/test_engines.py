"""heelstrike compare --engines: what is asked for is compared, told and written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import walking
from experiments.engine_comparison.synthetic import made_up
from typer.testing import CliRunner

from heelstrike.cli.main import app
from heelstrike.experiments import engine_comparison
from heelstrike.experiments.engine_comparison import (
    CompassTable,
    Guards,
    PushTable,
    SceneTable,
    search,
    two_processes,
)
from heelstrike.experiments.engines import InvalidRunError


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What the comparison is asked for, of which a made up one comes."""
    calls: list[dict[str, Any]] = []

    def compare_engines(robot: Any, controller: Any, gait: Any, **options: Any) -> Any:
        calls.append({"robot": robot.name, "law": type(controller).__name__, **options})
        return made_up()

    monkeypatch.setattr(engine_comparison, "compare_engines", compare_engines)
    monkeypatch.setattr(two_processes, "compare_engines", compare_engines)
    return calls


def invoke(tmp_path: Path, *options: str) -> Any:
    gait = tmp_path / "gait.json"
    walking.gait().save(gait)
    arguments = ["compare", "bravo7", "--gait", str(gait), "--out", str(tmp_path / "out"), *options]
    return CliRunner().invoke(app, arguments)


def test_engines_are_compared_as_asked(tmp_path: Path, asked: list[dict[str, Any]]) -> None:
    result = invoke(
        tmp_path, "--engines", "mujoco,ode", "--sizes", "1e-3,5e-4", "--settings", "best",
        "--steps", "5", "--controller", "JointPD", "--friction", "0.8",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    (call,) = asked
    assert call["law"] == "JointPD"
    assert call["engines"] == ["mujoco", "ode"]
    assert call["step_sizes"] == (1e-3, 5e-4)
    assert call["settings"] == ["best"]
    assert call["control_period"] == 2e-3
    assert (call["steps"], call["friction"]) == (5, 0.8)
    written = sorted(file.name for file in (tmp_path / "out").iterdir())
    assert written == ["engines-JointPD-at-1-0.5-ms.json", "engines.png"]
    told = json.loads((tmp_path / "out" / written[0]).read_text())
    assert [row["engine"] for row in told["rows"]][:2] == ["heelstrike", "mujoco"]
    assert "ODE is not installed" in " ".join(result.stdout.split())


def test_a_quick_comparison_takes_few_steps(tmp_path: Path, asked: list[dict[str, Any]]) -> None:
    result = invoke(tmp_path, "--engines", "all", "--quick", "--json")
    assert result.exit_code == 0, result.stderr
    assert asked[0]["engines"] == "all"
    assert (asked[0]["steps"], asked[0]["step_sizes"]) == (4, (1e-3,))
    assert json.loads(result.stdout)["robot"] == "bravo7"


def test_files_of_other_comparisons_are_not_written_over(
    tmp_path: Path, asked: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A quick one, or one at other steps, has other numbers under the same law."""
    nothing = PushTable("bravo7", ())
    monkeypatch.setattr(engine_comparison, "compare_pushes", lambda *_, **__: nothing)
    for options in ([], ["--quick"], ["--sizes", "5e-5"], ["--period", "1e-3", "--quick"]):
        result = invoke(tmp_path, "--engines", "mujoco", "--largest-push", *options)
        assert result.exit_code == 0, result.stderr
    written = {file.name for file in (tmp_path / "out").glob("*.json")}
    assert written == {
        "engines-ComputedTorque.json", "pushes-ComputedTorque.json",
        "engines-ComputedTorque-quick.json", "pushes-ComputedTorque-quick.json",
        "engines-ComputedTorque-at-0.05-ms.json",
        "engines-ComputedTorque-every-1-ms-quick.json",
        "pushes-ComputedTorque-every-1-ms-quick.json",
    }  # fmt: skip


def test_a_quick_comparison_leaves_scenes_and_figures_of_full_ones(
    tmp_path: Path, asked: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    scenes = [SceneTable((), "defaults", step, ()) for step in (1e-3, 2e-3)]
    passive = CompassTable(3, "defaults", ())
    monkeypatch.setattr(engine_comparison, "compare_scenes", lambda **_: scenes.pop())
    monkeypatch.setattr(engine_comparison, "compare_compass", lambda **_: passive)
    out = tmp_path / "out"
    assert invoke(tmp_path, "--engines", "ode", "--scenes").exit_code == 0
    full = {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()}
    assert {"scenes.json", "engines.png"} <= set(full)
    quick = invoke(tmp_path, "--engines", "ode", "--scenes", "--quick")
    assert quick.exit_code == 0, quick.stderr
    assert "scenes-quick.json" in quick.stderr
    written = {file.name for file in out.iterdir() if file.is_file()}
    assert written - set(full) == {
        "engines-ComputedTorque-quick.json", "engines-quick.png", "scenes-quick.json"
    }  # fmt: skip
    assert all((out / name).read_bytes() == data for name, data in full.items())
    refused = invoke(tmp_path, "--engines", "ode", "--quick", "--page", str(tmp_path / "page.md"))
    assert refused.exit_code == 2
    assert "quick comparisons are left out of pages" in " ".join(refused.output.split())


def test_a_search_walks_the_steps_that_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walked = []

    def search_settings(name: str, entry: Any, walk: Any, *_: Any) -> search.Found:
        walked.append(walk.steps)
        return search.Found({"stiff": 2.0}, 1e-3, 2e-3, 3, "4.0.0", "2026-11-27", "heelstrike")

    monkeypatch.setattr(search, "search_settings", search_settings)
    result = invoke(tmp_path, "--engines", "mujoco", "--search", "--steps", "2", "--json")
    assert result.exit_code == 0, result.stderr
    assert walked == [2]
    assert json.loads(result.stdout)["mujoco"]["settings"] == {"stiff": 2.0}


def test_a_search_tells_one_document_of_all_engines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def search_settings(name: str, *_: Any) -> search.Found:
        if name == "bullet":
            raise InvalidRunError("it walks at no setting")
        return search.Found({"stiff": 2.0}, 1e-3, 2e-3, 3, "4.0.0", "2026-11-27", "heelstrike")

    monkeypatch.setattr(search, "search_settings", search_settings)
    result = invoke(tmp_path, "--engines", "mujoco,bullet,ode", "--search", "--json")
    assert result.exit_code == 0, result.stderr
    told = json.loads(result.stdout)
    assert list(told) == ["mujoco", "bullet", "ode"]
    assert told["ode"]["settings"] == {"stiff": 2.0}
    assert told["bullet"] == {"reason": "it walks at no setting"}
    kept = json.loads((tmp_path / "out" / "best_settings.json").read_text())
    assert set(kept) == {"mujoco", "ode"}


def test_a_search_refuses_what_it_has_no_use_for(tmp_path: Path) -> None:
    for options, named in (
        (["--sizes", "1e-3", "--settings", "best"], "--settings, --sizes"),
        (["--period", "1e-3", "--quick"], "--period, --quick"),
        (["--scenes", "--largest-push", "--films"], "--scenes, --largest-push, --films"),
        (["--page", "page.md"], "--page"),
    ):
        result = invoke(tmp_path, "--engines", "mujoco", "--search", *options)
        assert result.exit_code == 2
        said = " ".join(result.output.split())
        assert f"{named}: the search for the best settings walks" in said


def test_what_engines_are_not_asked_for_is_refused(
    tmp_path: Path, asked: list[dict[str, Any]]
) -> None:
    for options in (
        ["--ground", "slope:-3"],
        ["--push", "trunk:50:1:0.1"],
        ["--restitution", "0.5"],
    ):
        result = invoke(tmp_path, "--engines", "mujoco", *options)
        assert result.exit_code == 2
        assert "on level ground without restitution or pushes" in " ".join(result.stderr.split())
    assert not asked


def test_options_that_would_do_nothing_are_refused(tmp_path: Path) -> None:
    without = invoke(tmp_path, "--page", "page.md", "--films")
    assert without.exit_code == 2
    assert "--page, --films: for other engines only" in " ".join(without.output.split())
    within = invoke(tmp_path, "--engines", "mujoco", "--method", "compliant")
    assert within.exit_code == 2
    assert "engines have methods of their own" in " ".join(within.output.split())
    sizes = invoke(tmp_path, "--engines", "mujoco", "--sizes", "abc")
    assert sizes.exit_code == 2
    assert "--sizes" in sizes.output


@pytest.fixture
def whole(monkeypatch: pytest.MonkeyPatch, asked: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What a whole comparison asks for, one made up call after the other."""

    def told(name: str, answer: Any) -> Any:
        def call(*_: Any, **options: Any) -> Any:
            asked.append({"asks": name, **options})
            return answer

        return call

    tables = {
        "compare_pushes": PushTable("bravo7", ()),
        "compare_scenes": SceneTable((), "defaults", 1e-3, ()),
        "compare_compass": CompassTable(3, "defaults", ()),
        "guard": Guards(0.0, 1.0, 0.0, 1.0, 0.0, float32=False),
    }
    for name, answer in tables.items():
        monkeypatch.setattr(engine_comparison, name, told(name, answer))
    return asked


def test_one_command_makes_all_of_the_page(tmp_path: Path, whole: list[dict[str, Any]]) -> None:
    page = tmp_path / "engines.md"
    result = invoke(
        tmp_path, "--engines", "mujoco,ode", "--whole", "--processes", "1", "--page", str(page)
    )
    assert result.exit_code == 0, result.stderr
    walks = [call for call in whole if "law" in call]
    assert [(call["law"], call["steps"], call["control_period"]) for call in walks] == [
        ("FootstepFeedback", 20, 2e-3), ("ComputedTorque", 20, 2e-3), ("ComputedTorque", 4, 2e-4),
    ]  # fmt: skip
    assert min(min(call["step_sizes"]) for call in walks) == 2e-4
    assert [call["asks"] for call in whole if "asks" in call] == [
        "compare_pushes", "compare_scenes", "compare_compass", "guard", "guard",
    ]  # fmt: skip
    processes = {id(call["processes"]) for call in whole if "processes" in call}
    assert len(processes) == 1  # engines are started once
    written = {file.name for file in (tmp_path / "out").iterdir()}
    assert written == {
        "engines-FootstepFeedback.json", "pushes-FootstepFeedback.json",
        "engines-ComputedTorque.json", "engines-ComputedTorque-every-0.2-ms.json", "scenes.json",
        "engines.png", "whole.json",
    }  # fmt: skip
    assert "## 3 steps under ComputedTorque every 0.2 ms" in page.read_text()
    assert "compare bravo7 --engines mujoco,ode --whole --page" in page.read_text()
    assert "of processor time" in " ".join(result.stderr.split())


def test_finer_steps_come_apart(tmp_path: Path, whole: list[dict[str, Any]]) -> None:
    result = invoke(tmp_path, "--engines", "all", "--whole", "--processes", "1", "--fine", "--json")
    assert result.exit_code == 0, result.stderr
    first, *others = [call for call in whole if "law" in call]
    assert first["step_sizes"][-2:] == (1e-4, 5e-5)
    assert first["longest"] == 120.0
    assert min(min(call["step_sizes"]) for call in others) == 2e-4
    assert json.loads(result.stdout)["command"].endswith("--engines all --whole --fine")


def test_a_quick_whole_comparison_is_short(tmp_path: Path, whole: list[dict[str, Any]]) -> None:
    result = invoke(tmp_path, "--engines", "all", "--whole", "--processes", "1", "--quick")
    assert result.exit_code == 0, result.stderr
    walks = [call for call in whole if "law" in call]
    assert all((call["steps"], call["step_sizes"]) == (4, (1e-3,)) for call in walks)
    asks = {call["asks"]: call for call in whole if "asks" in call}
    assert "compare_pushes" not in asks
    assert asks["compare_compass"]["steps"] == asks["compare_scenes"]["steps"] == ()
    assert all("-quick" in file.name for file in (tmp_path / "out").iterdir())


def test_a_whole_comparison_refuses_what_it_decides_itself(
    tmp_path: Path, whole: list[dict[str, Any]]
) -> None:
    for options, named in (
        (["--sizes", "1e-3", "--largest-push"], "--sizes, --largest-push"),
        (["--controller", "JointPD"], "--controller"),
        (["--quick", "--fine"], "--fine"),
        (["--quick", "--page", "page.md"], "--page"),
    ):
        result = invoke(tmp_path, "--engines", "all", "--whole", "--processes", "1", *options)
        assert result.exit_code == 2
        assert f"{named}: " in " ".join(result.output.split())
    apart = invoke(tmp_path, "--engines", "all", "--fine")
    assert apart.exit_code == 2
    assert "--fine: for the whole comparison only" in " ".join(apart.output.split())
    assert not whole
