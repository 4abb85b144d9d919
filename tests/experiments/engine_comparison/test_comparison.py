"""compare_engines(): rows of engines that are there, missing, kept, and what they say."""

from __future__ import annotations

import ast
import io
import json
import math
from dataclasses import fields, replace
from pathlib import Path

import pytest
from rich.console import Console

import heelstrike as hs
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison import (
    EngineComparison,
    EngineRow,
    WalkFigures,
    compass_table,
    scene_table,
)
from heelstrike.experiments.engine_comparison import comparison as module
from heelstrike.experiments.engine_comparison import kept as kept_rows
from heelstrike.experiments.engine_comparison.entries import (
    ABSENT,
    ENTRIES,
    Entry,
    entries_called,
)
from heelstrike.experiments.engine_comparison.kept import KeptRows, asked_of_engine
from heelstrike.experiments.engine_comparison.settings import (
    best_settings,
    found_for_others,
    settings_of,
)
from heelstrike.experiments.engine_comparison.tables import short
from heelstrike.experiments.engines.packages import PACKAGES
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.kept_files import program_digest

WALK = WalkFigures(
    walks=True, steps=3, ending="completed", tracking_rad=1e-3, position=2e-3, touchdown_s=1e-3,
    impulse_Ns=0.5, zmp_m=5e-3, slip_m=1e-4, penetration_m=1e-5, energy_J=math.nan, noise=1e-4,
    peak=20.0, step_us=30.0, computing_s=0.1,
)  # fmt: skip
ROW = EngineRow("mujoco", "MuJoCo", "defaults", 1e-3, None, "", "heelstrike compare")


def test_rows_are_kept_and_not_walked_again(tmp_path: Path) -> None:
    walked = []

    def make() -> WalkFigures:
        walked.append(1)
        return WALK

    for _ in range(2):
        found = KeptRows(tmp_path, {"gait": 1}).row(ROW, {"given": {}}, make)
        assert found.figures is not None
        assert math.isnan(found.figures.energy_J)
        assert replace(found.figures, energy_J=0.0) == replace(WALK, energy_J=0.0)
    assert len(walked) == 1
    KeptRows(tmp_path, {"gait": 2}).row(ROW, {"given": {}}, make)  # of another gait
    KeptRows(tmp_path, {"gait": 1}).row(ROW, {"given": {"stiff": 2.0}}, make)  # set otherwise
    KeptRows(tmp_path, {"gait": 1}).row(replace(ROW, step_s=2e-3), {"given": {}}, make)
    assert len(walked) == 4


def test_a_row_that_failed_says_why_and_is_asked_again(tmp_path: Path) -> None:
    def fail() -> WalkFigures:
        raise InvalidRunError("its process was ended by SIGABRT")

    kept = KeptRows(tmp_path, {})
    found = kept.row(ROW, {}, fail)
    assert found.figures is None
    assert found.reason == "its process was ended by SIGABRT"
    assert kept.row(ROW, {}, lambda: WALK).figures == WALK


def test_a_row_of_another_version_or_adapter_is_walked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walked = []

    def make() -> WalkFigures:
        walked.append(1)
        return WALK

    def walk(version: str) -> None:
        told = asked_of_engine("mujoco", {}, {"mujoco": version})
        KeptRows(tmp_path, {}).row(ROW, told, make)

    walk("4.0.0")
    walk("4.0.0")
    assert len(walked) == 1
    walk("4.1.0")
    assert len(walked) == 2

    def changed(rooms: tuple[str, ...], package: str) -> bytes:
        """Another text of an adapter alone."""
        digest = program_digest(rooms, package)
        return b"another" if "experiments/engines/mujoco_peer" in rooms else digest

    monkeypatch.setattr(kept_rows, "program_digest", changed)
    walk("4.0.0")
    assert len(walked) == 3


def test_settings_found_with_another_version_are_told() -> None:
    found = best_settings()["mujoco"]["version"]
    assert found_for_others({"mujoco": "MuJoCo"}, {"mujoco": found}) == []
    (said,) = found_for_others({"mujoco": "MuJoCo"}, {"mujoco": "99.0"})
    assert said == f"MuJoCo: the best settings were found with {found}, this is 99.0"


def test_what_is_kept_does_not_follow_from_tables_and_pages() -> None:
    """Hours of walking are not lost when a table is written otherwise, nor by another adapter."""
    for room in kept_rows.ROOMS:
        place = Path(hs.__file__).parent / room
        assert place.is_dir() or place.with_suffix(".py").is_file(), room
        assert "engine_comparison" not in room
        assert not room.endswith("_peer")


def imports_of(module: str) -> set[str]:
    """Rooms and modules of this package that a module imports."""
    home = Path(hs.__file__).parent
    found = set()
    for node in ast.walk(ast.parse((home / module).with_suffix(".py").read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("heelstrike."):
            place = str(node.module).removeprefix("heelstrike.").replace(".", "/")
            inside = [f"{place}/{each.name}" for each in node.names]
            modules = [each for each in inside if (home / each).with_suffix(".py").is_file()]
            found |= set(modules or [place])
    return found


ROOM, ENGINES = "experiments/engine_comparison", "experiments/engines"
NO_NUMBERS = {
    "arguments", "errors", "field_texts", "reader_process", "whole_file", "wording",
    f"{ROOM}/entries",  # settings, which each row tells
    f"{ENGINES}/packages",  # where engines are, of which each row tells the version
}  # fmt: skip


def not_covered(module: str, own: set[str]) -> set[str]:
    """Imports of a module that are in no digest."""
    covered = own | set(kept_rows.ROOMS) | NO_NUMBERS
    return {
        each
        for each in imports_of(module)
        if not any(each == room or each.startswith(f"{room}/") for room in covered)
    }


@pytest.mark.parametrize("modules", [kept_rows.MODULES, compass_table.MODULES, scene_table.MODULES])
def test_what_is_kept_follows_from_all_that_makes_its_numbers(modules: tuple[str, ...]) -> None:
    own = {f"{ROOM}/{name}" for name in modules}
    assert {name: found for name in own if (found := not_covered(name, own))} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_adapters_are_told_with_the_adapters_that_they_import(
    package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[set[str]] = []

    def digest(rooms: tuple[str, ...], _: str) -> bytes:
        asked.append(set(rooms))
        return b""

    monkeypatch.setattr(kept_rows, "program_digest", digest)
    asked_of_engine(package, {}, {package: "1.0"})
    (own,) = asked
    adapter = f"{ENGINES}/{PACKAGES[package].adapter}"
    assert adapter in own
    assert not_covered(adapter, own) == set()


@pytest.fixture(scope="module")
def comparison(bravo7: hs.Robot, gait: hs.Gait) -> EngineComparison:
    """One step in MuJoCo, which is always there, and in an engine that is not."""
    with pytest.MonkeyPatch.context() as patch:
        versions = dict.fromkeys(PACKAGES, "not installed") | {"mujoco": "4.0.0"}
        patch.setattr(module, "peers", lambda load: versions)
        patch.setattr(module, "TRUTH", hs.TimeStepping(step=1e-4))  # which compiles sooner
        return hs.compare_engines(
            bravo7,
            hs.FootstepFeedback(bravo7, gait),
            gait,
            engines=["mujoco", "ode"],
            steps=1,
            step_sizes=[1e-3],
            settings=["defaults"],
        )


def test_an_engine_that_is_there_walks(comparison: EngineComparison) -> None:
    ours, mujoco, _ = comparison.rows
    assert ours.engine == "heelstrike"
    for row in (ours, mujoco):
        assert row.figures is not None
        assert row.figures.walks
    assert mujoco.figures is not None
    assert 0.0 < mujoco.figures.position < 0.05
    assert 1e-4 < mujoco.figures.penetration_m < 0.01  # its ground is soft
    assert "--engines mujoco" in mujoco.command


def test_an_engine_that_is_missing_has_a_row_that_says_so(comparison: EngineComparison) -> None:
    *_, ode = comparison.rows
    assert ode.figures is None
    assert ode.reason == "ODE is not installed"
    assert comparison.versions["ode"] == "not installed"


def test_the_comparison_is_told_in_a_table_in_json_and_in_a_figure(
    comparison: EngineComparison,
) -> None:
    console = Console(file=io.StringIO(), width=80)
    console.print(comparison)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "…" not in text
    for words in ("MuJoCo", "ODE is not installed", "impulse", "noise"):
        assert words in text
    told = json.loads(json.dumps(comparison.to_dict(), allow_nan=False))
    assert [row["engine"] for row in told["rows"]] == ["heelstrike", "mujoco", "ode"]
    axes = comparison.plot().axes[0]
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert "MuJoCo" in [each.get_text() for each in axes.get_legend().get_texts()]


def test_an_interruption_ends_it_and_keeps_what_was_walked(
    bravo7: hs.Robot, gait: hs.Gait, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while an engine walks: the rows before it are in the folder."""

    def interrupt(*_: object) -> WalkFigures:
        raise KeyboardInterrupt

    monkeypatch.setattr(module.Walk, "in_engine", interrupt)
    monkeypatch.setattr(module, "TRUTH", hs.TimeStepping(step=1e-3))
    with pytest.raises(KeyboardInterrupt):
        hs.compare_engines(
            bravo7,
            hs.ComputedTorque(bravo7, gait),
            gait,
            engines=["mujoco"],
            steps=1,
            step_sizes=[1e-3],
            settings=["defaults"],
            folder=tmp_path,
        )
    (kept,) = tmp_path.iterdir()
    assert kept.name.startswith("heelstrike-defaults-0.001-")


def test_an_engine_that_dies_ends_its_rows_alone_and_falls_are_filmed(
    bravo7: hs.Robot, gait: hs.Gait, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    filmed = []

    def in_engine(
        self: object, entry: Entry, step: float, given: object, truth: object, versions: object,
        film: Path | None = None,
    ) -> WalkFigures:  # fmt: skip
        if entry.title == "Bullet":
            raise InvalidRunError("its process was ended by SIGKILL")
        if film is not None:
            film.write_bytes(b"")
            filmed.append(film.name)
        return replace(WALK, walks=False)

    versions = dict.fromkeys(PACKAGES, "1.0")
    monkeypatch.setattr(module, "peers", lambda load: versions)
    monkeypatch.setattr(module, "TRUTH", hs.TimeStepping(step=1e-3))
    monkeypatch.setattr(module.Walk, "in_engine", in_engine)
    for films in (False, True, True):  # rows are kept by then; a film is made once
        found = hs.compare_engines(
            bravo7, hs.ComputedTorque(bravo7, gait), gait, engines=["bullet", "mujoco"], steps=1,
            step_sizes=[1e-3], settings=["defaults"], folder=tmp_path, films=films,
        )  # fmt: skip
    _, bullet, mujoco = found.rows
    assert bullet.figures is None
    assert bullet.reason == "its process was ended by SIGKILL"
    assert mujoco.figures is not None
    assert filmed == ["mujoco-defaults-0.001.mp4"]


def test_an_engine_that_dies_while_a_kept_fall_is_filmed_keeps_its_row(
    bravo7: hs.Robot, gait: hs.Gait, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def in_engine(*given: object) -> WalkFigures:
        if given[-1] is not None:  # a film
            raise InvalidRunError("its process was ended by SIGKILL")
        return replace(WALK, walks=False)

    monkeypatch.setattr(module, "peers", lambda load: dict.fromkeys(PACKAGES, "1.0"))
    monkeypatch.setattr(module, "TRUTH", hs.TimeStepping(step=1e-3))
    monkeypatch.setattr(module.Walk, "in_engine", in_engine)
    said: list[str] = []
    for films in (False, True):
        found = hs.compare_engines(
            bravo7, hs.ComputedTorque(bravo7, gait), gait, engines=["mujoco", "bullet"], steps=1,
            step_sizes=[1e-3], settings=["defaults"], folder=tmp_path, films=films,
            progress=lambda text, _: said.append(text),
        )  # fmt: skip
    for row in found.rows[1:]:
        assert row.figures is not None
        assert not row.figures.walks
    assert "no film of MuJoCo, defaults: its process was ended by SIGKILL" in said


def test_walks_that_would_take_too_long_say_so_and_kept_ones_are_told(
    bravo7: hs.Robot, gait: hs.Gait, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step of 30 µs: 770 steps of 1 ms in one walking step take 23 ms, of 0.1 ms 0.23 s."""
    walked: list[float] = []

    def in_engine(self: object, entry: Entry, step: float, *_: object) -> WalkFigures:
        walked.append(step)
        return WALK

    monkeypatch.setattr(module, "peers", lambda load: dict.fromkeys(PACKAGES, "1.0"))
    monkeypatch.setattr(module, "TRUTH", hs.TimeStepping(step=1e-3))
    monkeypatch.setattr(module.Walk, "in_engine", in_engine)

    def compare(sizes: list[float], longest: float | None) -> EngineComparison:
        return hs.compare_engines(
            bravo7, hs.ComputedTorque(bravo7, gait), gait, engines=["mujoco"], steps=1,
            step_sizes=sizes, settings=["defaults"], folder=tmp_path, longest=longest,
        )  # fmt: skip

    *_, finest = compare([1e-3, 1e-4], 0.1).rows
    assert walked == [1e-3]
    assert finest.figures is None
    assert finest.reason.startswith("not walked: its 1 steps at 0.1 ms would take about")
    *_, finest = compare([1e-3, 1e-4], None).rows
    assert walked == [1e-3, 1e-4]
    *_, finest = compare([1e-3, 1e-4], 0.1).rows
    assert finest.figures is not None
    assert walked == [1e-3, 1e-4]


def test_names_of_engines_are_checked(bravo7: hs.Robot, gait: hs.Gait) -> None:
    with pytest.raises(SimulationError, match=r"no engine 'mujocco'\. Did you mean 'mujoco'"):
        hs.compare_engines(bravo7, hs.ComputedTorque(bravo7, gait), gait, engines=["mujocco"])
    with pytest.raises(SimulationError, match="at least one step"):
        hs.compare_engines(bravo7, hs.ComputedTorque(bravo7, gait), gait, steps=0)
    with pytest.raises(SimulationError, match="'defaults' or 'best', got 'quick'"):
        settings_of("mujoco", ENTRIES["mujoco"], "quick")
    assert entries_called("all") == ENTRIES


def test_every_row_has_an_adapter_and_table_1_is_whole() -> None:
    for entry in ENTRIES.values():
        assert PACKAGES[entry.package].adapter
    table = " ".join([*ABSENT, *(entry.title for entry in ENTRIES.values())])
    for name in ("Gazebo", "V-REP", "Webots", "OpenHRP", "ODE", "Bullet", "Simbody", "DART",
                 "Vortex", "PhysX", "MuJoCo"):  # fmt: skip
        assert name in table


def test_best_settings_are_among_the_choices_and_say_what_found_them() -> None:
    for name, found in best_settings().items():
        entry = ENTRIES[name]
        for setting, value in found["settings"].items():
            choices = [list(v) if isinstance(v, tuple) else v for v in entry.choices[setting]]
            assert value in choices
        assert found["error"] <= found["default_error"]
        assert f"--engines {name} --search" in found["command"]
        assert settings_of(name, entry, "best") == dict(entry.given) | found["settings"]


def test_numbers_are_short() -> None:
    assert [short(x) for x in (0.0, 12.34, 1.234, 0.0123, 1.2e-7, 3e6)] == [
        "0", "12", "1.2", "0.012", "1e-7", "3e6",
    ]  # fmt: skip


def test_every_figure_of_a_walk_is_told() -> None:
    from heelstrike.experiments.engine_comparison.tables import BY_ITSELF, WALKING

    known = {each.name for each in fields(WalkFigures)}
    assert set(WALKING) | set(BY_ITSELF) <= known
