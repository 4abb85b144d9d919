"""Gaits that are kept on disk: found again digit by digit, and only where nothing has changed."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import kept_files
from heelstrike.gait import design, kept_gait
from heelstrike.robot.model import Model

ASKED: dict[str, Any] = {"step_length": 0.3, "step_duration": 0.7, "intervals": 12, "starts": 1}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    walking.gait()  # not into this folder
    monkeypatch.setenv("HEELSTRIKE_KEEP_GAITS", str(tmp_path / "gaits"))
    return tmp_path / "gaits"


@pytest.fixture
def designs(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """What has been designed since, and not read; each is the same gait, designed once."""
    made: list[object] = []
    gait = walking.gait()

    def designed(request: object, profile: object, report: Any) -> hs.Gait:
        made.append(request)
        return gait

    monkeypatch.setattr(design, "designed", designed)
    return made


def same(one: Any, other: Any) -> bool:
    """Whether all numbers of two results are the same to the last digit."""
    if hasattr(one, "__dataclass_fields__"):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    return bool(one == other)


@pytest.mark.parametrize("name", ["bravo7", "rabbit"])
def test_a_kept_gait_is_the_designed_one(name: str, folder: Path) -> None:
    point_feet = {"step_length": 0.21, "step_duration": 0.58, "clearance": 0.02, "friction": 0.6}
    asked = ASKED if name == "bravo7" else {**point_feet, "starts": 1}
    robot, progress = hs.load_robot(name), list[float]()
    first = hs.optimize_gait(robot, **asked)
    assert len(list(folder.iterdir())) == 1
    again = hs.optimize_gait(hs.load_robot(name), **asked, progress=progress.append)
    assert progress == [1.0]
    assert same(first, again)
    assert not same(first, replace(first, cost=np.nextafter(first.cost, 1e9)))


def test_another_request_or_robot_is_designed(folder: Path, designs: list[object]) -> None:
    robot = walking.bravo7()
    members = robot.model.members()
    heavier = members | {"mass": members["mass"] * (1.0 + 1e-15)}
    requests: list[tuple[hs.Robot, dict[str, Any]]] = [
        (robot, {}),
        (robot, {"friction": np.nextafter(0.75, 1.0)}),
        (robot, {"joint_ranges": {"right_knee": (0.0, 1.5)}}),
        (robot, {"joint_ranges": {"right_knee": (0.1, 1.5)}}),
        (robot, {"impact": False}),
        (replace(robot, model=Model(**heavier)), {}),
    ]
    for machine, options in requests:
        hs.optimize_gait(machine, **ASKED | options)
    assert len(designs) == len(list(folder.iterdir())) == len(requests)
    hs.optimize_gait(robot, **ASKED)
    hs.optimize_gait(robot, **ASKED, joint_ranges={"right_knee": (0, 1.5)})
    assert len(designs) == len(requests)


def test_another_program_designs_anew(
    folder: Path, designs: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    hs.optimize_gait(walking.bravo7(), **ASKED)
    monkeypatch.setattr(kept_gait, "program_digest", lambda *_: b"another")
    hs.optimize_gait(walking.bravo7(), **ASKED)
    assert len(designs) == 2


@pytest.mark.parametrize("changed", ["room/part/one.py", "module.py"])
def test_a_program_is_known_by_the_text_of_its_packages_and_modules(
    changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_files, "__file__", str(tmp_path / "kept_files.py"))
    (tmp_path / "room" / "part").mkdir(parents=True)
    for name in ("room/part/one.py", "module.py", "elsewhere.py"):
        (tmp_path / name).write_text("x = 1\n")

    def digest() -> bytes:
        kept_files.program_digest.cache_clear()
        return kept_files.program_digest(("room", "module"), "numpy")

    before = digest()
    (tmp_path / "elsewhere.py").write_text("x = 2\n")
    assert digest() == before
    (tmp_path / changed).write_text("x = 2\n")
    assert digest() != before


def test_a_damaged_file_is_designed_anew_and_replaced(folder: Path, designs: list[object]) -> None:
    hs.optimize_gait(walking.bravo7(), **ASKED)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole.replace(b"0.7", b"0.8", 1))
    hs.optimize_gait(walking.bravo7(), **ASKED)
    assert len(designs) == 2
    assert file.read_bytes() == whole


def test_what_cannot_be_kept_is_designed_all_the_same(
    tmp_path: Path, designs: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    no_folder = tmp_path / "file"
    no_folder.write_text("a file")
    for switch in ("0", str(no_folder / "below")):
        monkeypatch.setenv("HEELSTRIKE_KEEP_GAITS", switch)
        hs.optimize_gait(walking.bravo7(), **ASKED)
        hs.optimize_gait(walking.bravo7(), **ASKED)
    assert len(designs) == 4


def test_the_older_half_goes(
    folder: Path, designs: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_files, "MOST", 4)
    for friction in (0.5, 0.6, 0.7, 0.8, 0.9):
        hs.optimize_gait(walking.bravo7(), **ASKED, friction=friction)
    assert len(list(folder.iterdir())) == 3
