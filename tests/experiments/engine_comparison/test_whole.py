"""The whole comparison: what belongs to it, and how long it took."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from heelstrike.experiments.engine_comparison.comparison import STEP_SIZES
from heelstrike.experiments.engine_comparison.whole import FINER, PARTS, QUICK, sitting, taken
from heelstrike.experiments.engines.served import EngineProcesses
from heelstrike.experiments.laws import law_called


def test_its_parts_are_walks_of_known_laws() -> None:
    for part in (*PARTS, *QUICK):
        assert law_called(part.law).name == part.law
        for step in (*part.step_sizes, *part.finer):
            periods = part.control_period / step
            assert periods == pytest.approx(round(periods), abs=1e-9)
    assert min(STEP_SIZES) == 2e-4 > max(FINER)  # finer ones come apart
    assert sum(part.pushes for part in PARTS) == 1


def test_the_time_of_an_interrupted_comparison_is_that_of_all_its_sittings(tmp_path: Path) -> None:
    file = tmp_path / "whole.json"
    assert taken(file) == {}
    with pytest.raises(KeyboardInterrupt), sitting(file, "heelstrike compare"):
        raise KeyboardInterrupt
    with sitting(file, "heelstrike compare"):
        end = time.process_time() + 0.05
        while time.process_time() < end:
            pass
    found = taken(file)
    assert found["command"] == "heelstrike compare"
    first, second = found["sittings"]
    assert first["wall_s"] < 0.05 <= second["wall_s"]
    assert second["processor_s"] >= 0.03  # it is counted in hundredths


def test_engines_keep_their_processes() -> None:
    processes = EngineProcesses()
    one = processes.of("mujoco")
    assert processes.of("mujoco") is one
    assert processes.of("mujoco", 1) is not one
    processes.end()
