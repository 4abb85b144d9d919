"""A gait and a walk that the tests of the command line share."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app

STEPS = 3


@pytest.fixture(scope="session")
def walked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """Directory and outcome of a short walk with everything switched on."""
    out = tmp_path_factory.mktemp("walk") / "new" / "directory"
    result = CliRunner().invoke(app, ["walk", "--steps", str(STEPS), "--out", str(out)])
    return out, result


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures, which `walked` has drawn in earnest, are empty files: they take most of the time."""

    def plot(run: hs.Run, what: str, *, path: Path, **_: Any) -> None:
        path.touch()

    monkeypatch.setattr(hs.Run, "plot", plot)


@pytest.fixture
def walk(walked: tuple[Path, Any], tmp_path: Path, undrawn: None) -> Callable[..., Any]:
    """Walk the gait of `walked` again, with other options, into ``tmp_path / "out"``, undrawn."""

    def run(*options: str) -> Any:
        gait = str(walked[0] / "gait.json")
        arguments = ["--animation", "none", "--out", str(tmp_path / "out"), *options]
        return CliRunner().invoke(app, ["walk", "--gait", gait, *arguments])

    return run


@pytest.fixture(autouse=True)
def same_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Laws of files that a test writes are found by no later one."""
    monkeypatch.setattr(sys, "path", sys.path.copy())
