"""Scenes with closed forms: our event-driven runs have them to rounding, so both are right.

The forms are computed without the simulator. Event-driven runs integrate with tolerances of 1e-11
and locate events to rounding; 1e-8 is what is promised.
"""

from __future__ import annotations

import io
import json
import math
from pathlib import Path

import pytest
from experiments.engine_comparison.synthetic import made_up
from rich.console import Console

from heelstrike.experiments.engine_comparison import scene_table
from heelstrike.experiments.engine_comparison.page import _scenes
from heelstrike.experiments.engine_comparison.scene_table import EXACT
from heelstrike.experiments.engine_comparison.scenes import Scene, our_scene_error, scenes
from heelstrike.experiments.engines.peer import InvalidRunError

SCENES = scenes()


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_an_event_driven_run_has_the_closed_form(scene: Scene) -> None:
    error, _ = our_scene_error(scene, EXACT)
    assert abs(error) <= 1e-8


def test_the_scenes_are_not_all_at_rest() -> None:
    moving = [scene.exact for scene in SCENES if scene.exact]
    assert len(moving) >= 7
    assert math.isclose(moving[1], 6.0**2 / (2.0 * 0.75 * 9.81))


@pytest.mark.slow
def test_the_table_says_how_far_off_and_who_does_not_bounce(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stays, bounces = SCENES[0], SCENES[6]
    monkeypatch.setattr(scene_table, "scenes", lambda: (stays, bounces))
    table = scene_table.compare_scenes(engines=["mujoco"])
    found = {(row.scene, row.engine): row for row in table.rows}
    assert len(found) == 6
    creeps = found[stays.name, "mujoco"].error
    assert creeps is not None
    assert 1e-4 < abs(creeps) < 0.1
    refused = found[bounces.name, "mujoco"]
    assert refused.error is None
    assert refused.reason == "takes no coefficient of restitution"
    assert found[stays.name, "event-driven"].error == pytest.approx(0.0, abs=1e-12)


LANDING = next(scene for scene in SCENES if scene.name == scene_table.AT_STEPS["landing"])


def test_an_engine_that_fails_at_another_step_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def error(scene: Scene, entry: object, step: float, *_: object) -> tuple[float, float]:
        if step > 1e-3:
            raise InvalidRunError("its solver failed to converge")
        return 2e-3, 0.1

    monkeypatch.setattr(scene_table, "scenes", lambda: (LANDING,))
    monkeypatch.setattr(scene_table, "scene_error", error)
    table = scene_table.compare_scenes(engines=["mujoco"], steps=(4e-3, 1e-3))
    fails, works = (row for row in table.at_steps if row.title == "MuJoCo")
    assert (fails.step_s, fails.error, fails.reason) == (
        4e-3, None, "its solver failed to converge",
    )  # fmt: skip
    assert (works.error, works.reason) == (2e-3, "")
    why = f"MuJoCo, {LANDING.name}, 4 ms: its solver failed to converge"
    console = Console(file=io.StringIO(), width=160)
    console.print(table)
    assert why in console.file.getvalue()  # type: ignore[attr-defined]
    assert f"- {why}." in _scenes(table.to_dict())
    assert len(made_up().plot(table).axes) == 2  # the walk, and the landing without what failed


def test_computing_times_are_of_the_run_that_tells_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Errors are kept; an engine of another day is not timed beside ours of today."""
    seconds = iter([0.1, 0.2, 0.3])

    def error(*_: object) -> tuple[float, float]:
        return 2e-3, next(seconds)

    monkeypatch.setattr(scene_table, "scenes", lambda: (LANDING,))
    monkeypatch.setattr(scene_table, "scene_error", error)
    for taken in (0.2, 0.3):  # the row is simulated first, and then kept
        table = scene_table.compare_scenes(engines=["mujoco"], steps=(1e-3,), folder=tmp_path)
        (timed,) = (row for row in table.at_steps if row.title == "MuJoCo")
        assert timed.computing_s == taken
        assert [row.error for row in table.rows if row.engine == "mujoco"] == [2e-3]
    (kept,) = tmp_path.iterdir()
    assert json.loads(kept.read_text()) == {"error": 2e-3}


def test_an_end_that_is_not_finite_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_table, "scenes", lambda: (LANDING,))
    monkeypatch.setattr(scene_table, "scene_error", lambda *_: (math.nan, 0.1))
    table = scene_table.compare_scenes(engines=["mujoco"], steps=())
    (row,) = (row for row in table.rows if row.engine == "mujoco")
    assert (row.error, row.reason) == (None, "what it ends with is not finite")
