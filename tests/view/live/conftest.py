"""A walk that is watched, and a browser to watch it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import walking
from browsers import browser


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def gait(tmp_path_factory: pytest.TempPathFactory) -> Path:
    walking.walk(steps=1)  # compiled, before anybody waits for it
    path = tmp_path_factory.mktemp("gait") / "gait.json"
    walking.gait().save(path)
    return path


@pytest.fixture
def viewer(gait: Path) -> Iterator[Any]:
    """A live walk of bravo7 with all controls."""
    pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")
    from heelstrike.cli.options import method_called
    from heelstrike.cli.watch import METHODS
    from heelstrike.experiments.watching import First, WalkStage
    from heelstrike.view.live.viewer import view

    with view(stage=WalkStage("bravo7", method_called, METHODS, First(gait=gait))) as viewer:
        yield viewer
