"""The page says what the files say, and has every simulator of Table 1."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from experiments.engine_comparison.synthetic import made_up

from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.compass_table import STEPS
from heelstrike.experiments.engine_comparison.entries import ABSENT, ENTRIES
from heelstrike.experiments.engine_comparison.facts import FACTS
from heelstrike.experiments.engine_comparison.page import (
    FELL,
    _compass,
    _pushes,
    _taken,
    engines_page,
)

BELOW, BALL = "cube below the angle of friction", "ball bouncing, e = 0.9"
DULL, OURS = "takes no coefficient of restitution", "heelstrike, event-driven"
SCENES = {
    "scenes": [[BELOW, 0.0, "m", "it stays"],
               [BALL, 0.2, "m", "parabolas"]],
    "settings": "defaults",
    "step_s": 1e-3,
    "rows": [
        {"scene": scene, "engine": engine, "title": title, "error": error, "reason": reason}
        for scene, engine, title, error, reason in (
            (BELOW, "event-driven", OURS, 0.0, ""),
            (BALL, "event-driven", OURS, 1e-16, ""),
            (BELOW, "mujoco", "MuJoCo", 0.0123, ""),
            (BALL, "mujoco", "MuJoCo", None, DULL),
        )
    ],
    "compass": {
        "strides": 25,
        "settings": "defaults",
        "rows": [
            {"engine": "mujoco", "title": "MuJoCo", "step_s": 2e-4, "reason": "",
             "walk": {"strides": 25, "ending": "", "period_s": 0.7343, "step_m": 0.5355,
                      "middle": [0.56, -0.33, -1.31], "spread": 0.012,
                      "multipliers": [[-0.2, 0.54], [-0.2, -0.54], [0.13, 0.0]], "error": 0.02}},
            {"engine": "bullet", "title": "Bullet", "step_s": 1e-3, "reason": "",
             "walk": {"strides": 3, "ending": "it falls", "multipliers": None}},
            {"engine": "ode", "title": "ODE", "step_s": 1e-3, "walk": None,
             "reason": "ODE is not installed"},
        ],
    },
    "guards": {
        "mujoco": {"flight": 1e-4, "order": 1.0, "extrapolated": 3e-11, "weight": 0.9999,
                   "sunk_m": 1e-3, "float32": False, "holds": True},
        "ode": {"reason": "ODE is not installed"},
    },
}  # fmt: skip


PUSHES = {
    "robot": "bravo7",
    "rows": [
        {"engine": "mujoco", "title": "MuJoCo", "settings": "defaults", "direction": direction,
         "largest": largest, "reason": reason}
        for direction, largest, reason in (
            ("forward", {"recovered": 90.0, "failed": 93.75, "trials": 8, "unit": "N s"}, ""),
            ("backward", {"recovered": 240.0, "failed": None, "trials": 9, "unit": "N s"}, ""),
        )
    ] + [
        {"engine": "ode", "title": "ODE", "settings": "defaults", "direction": "forward",
         "largest": None, "reason": "ODE is not installed"},
    ],
}  # fmt: skip


@pytest.fixture
def page(tmp_path: Path) -> str:
    told = json.dumps(made_up().to_dict())
    for law in ("ComputedTorque", "FootstepFeedback"):
        (tmp_path / f"engines-{law}.json").write_text(told)
    (tmp_path / "scenes.json").write_text(json.dumps(SCENES))
    (tmp_path / "pushes-FootstepFeedback.json").write_text(json.dumps(PUSHES))
    return engines_page(tmp_path, "images/engines.png")


def row(page: str, section: str, name: str) -> list[str]:
    """Cells of the first row of a section that begins with a name."""
    text = page[page.index(section) :]
    line = next(line for line in text.splitlines() if line.startswith(f"| {name} |"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_every_simulator_of_the_paper_has_its_row(page: str) -> None:
    assert set(FACTS) == {"heelstrike", *ENTRIES}
    for name in [entry.title for entry in ENTRIES.values()] + list(ABSENT):
        assert row(page, "## Table 1, renewed", name)
    assert row(page, "## Table 1, renewed", "MuJoCo")[1] == "1.2.3"
    assert row(page, "## Table 1, renewed", "Vortex")[1] == ABSENT["Vortex"]


def test_it_says_at_which_steps_a_robot_walks_and_how_it_creeps(page: str) -> None:
    cells = row(page, "heelstrike's columns", "MuJoCo")
    assert cells[5] == "12"  # mm/s: 12.3 mm in a second
    assert cells[6] == "1"  # ms, at defaults under the first law; at 2 ms it falls
    assert row(page, "heelstrike's columns", "Bullet")[6] == "none"
    assert row(page, "heelstrike's columns", "heelstrike")[6] == "2, 1"


def test_it_begins_with_who_walks(page: str) -> None:
    short = page[page.index("## In short") : page.index("## Table 1")]
    assert "- ComputedTorque, steps of 1 ms: heelstrike, MuJoCo take all 3 steps." in short
    assert "Bullet" not in short


def test_it_shows_figures_of_walks_and_why_others_fell(page: str) -> None:
    section = "## 3 steps under ComputedTorque"
    cells = row(page, section, "MuJoCo")
    assert cells[:3] == ["MuJoCo", "defaults", "yes"]
    assert cells[3:8] == ["1", "2", "1", "0.5", "5"]  # mrad, mm, ms, N s, mm
    fallen = row(page, section, "Bullet")
    assert fallen[2] == "no, 1"  # after a step
    assert fallen[3:8] == ["–"] * 5  # differences of a fall mean nothing
    assert "- Bullet, defaults: fell: slipped at 0.100 s." in page
    assert "- ODE, defaults: ODE is not installed." in page


def test_peaks_of_walks_that_ended_early_are_marked(page: str) -> None:
    section = "## Foot force over step size"
    assert row(page, section, "heelstrike")[2:4] == ["20", "20"]  # at 2 and 1 ms
    assert row(page, section, "MuJoCo")[2:4] == ["20" + FELL, "20"]
    assert row(page, section, "ODE")[2:4] == ["–", "–"]
    assert f"{FELL} marks walks that ended early" in page


def test_scenes_and_guards_are_in_their_tables(page: str) -> None:
    assert row(page, "## Scenes with closed forms", "MuJoCo") == ["MuJoCo", "0.012", "–"]
    assert row(page, "## Guards", "MuJoCo")[-1] == "yes"
    assert row(page, "## Guards", "ODE")[1] == "ODE is not installed"


def test_the_compass_gait_has_its_cycle_or_why_it_has_none(page: str) -> None:
    section = "## The compass gait"
    assert row(page, section, "MuJoCo")[1:] == [
        "0.2", "yes", "0.7343", "0.5355", "12", "−0.20 ± 0.54i, 0.13", "0.02",
    ]  # fmt: skip
    assert row(page, section, "Bullet")[2] == "no, 3: it falls"
    assert row(page, section, "ODE")[2] == "ODE is not installed"


def test_it_says_which_rows_of_the_compass_gait_were_not_run(page: str) -> None:
    said = page[page.index("Missing rows were not run here: ") : page.index("| engine | h ms |")]
    assert "MuJoCo at 1 ms" in said
    assert "Bullet at 0.2 ms" in said
    assert "Siconos at 1 and 0.2 ms" in said
    absent = {"title": "engine", "walk": None, "reason": "it is not there"}
    rows = [{"engine": name, "step_s": step} | absent for name in ENTRIES for step in STEPS]
    assert "Missing" not in _compass({"strides": 25, "settings": "defaults", "rows": rows})


def test_it_says_what_made_it_and_how_long_that_took(tmp_path: Path) -> None:
    file = tmp_path / "whole.json"
    assert _taken(file) == ""
    day, other = "2026-11-27", "2026-11-28"
    sittings = [{"date": day, "wall_s": 1200.0, "processor_s": 900.0},
                {"date": other, "wall_s": 60.0, "processor_s": 30.0}]  # fmt: skip
    told = {"command": "heelstrike compare", "processors": 2, "sittings": sittings}
    file.write_text(json.dumps(told))
    said = _taken(file)
    assert f"`heelstrike compare --page docs/engines.md` made all of it on {day} and" in said
    assert "took 21 minutes on 2 processors" in said
    assert "16 minutes of processor time" in said  # 15.5 to the even one


def test_it_says_where_licences_were_read(page: str) -> None:
    for name in ("MuJoCo", "PhysX"):
        assert f"- {name}: " in page[page.index("Where licences") : page.index("heelstrike's col")]


def test_without_files_there_is_no_page(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match="heelstrike compare --engines all --scenes"):
        engines_page(tmp_path, "figure.png")


@pytest.mark.parametrize("lacks", ["compass", "guards"])
def test_scenes_from_before_are_refused(tmp_path: Path, lacks: str) -> None:
    (tmp_path / "engines-JointPD.json").write_text(json.dumps(made_up().to_dict()))
    scenes = {part: found for part, found in SCENES.items() if part != lacks}
    (tmp_path / "scenes.json").write_text(json.dumps(scenes))
    words = f"scenes.json is from before: it lacks '{lacks}'. heelstrike compare --engines all --s"
    with pytest.raises(SimulationError, match=words):
        engines_page(tmp_path, "figure.png")


def test_it_says_which_push_each_stands(page: str) -> None:
    section = "## Largest push under FootstepFeedback"
    assert row(page, section, "MuJoCo")[1:] == ["defaults", "90 (94)", "≥ 240"]
    assert row(page, section, "ODE")[1:] == ["defaults", "ODE is not installed", "–"]


def test_its_command_has_the_settings_and_the_period_of_the_pushes(tmp_path: Path) -> None:
    file = tmp_path / "pushes-FootstepFeedback-every-4-ms.json"
    unpushed = {"recovered": 0.0, "failed": 0.0, "trials": 1, "unit": "N s"}
    rows = [PUSHES["rows"][0] | {"largest": unpushed}]
    file.write_text(json.dumps(PUSHES | {"rows": rows}))
    section = _pushes(file)
    assert (
        "--controller FootstepFeedback --engines NAME --settings defaults --period 0.004 "
        "--largest-push" in section
    )
    assert "does not walk unpushed" in section


def test_quick_comparisons_are_left_out(page: str, tmp_path: Path) -> None:
    for file in list(tmp_path.glob("*.json")):
        (tmp_path / f"{file.stem}-quick.json").write_bytes(file.read_bytes())
    assert engines_page(tmp_path, "images/engines.png") == page
    for file in set(tmp_path.glob("*.json")).difference(tmp_path.glob("*-quick.json")):
        file.unlink()
    with pytest.raises(SimulationError, match="heelstrike compare --engines all --scenes"):
        engines_page(tmp_path, "images/engines.png")
