"""The cart table against the optimal gait: the optimum costs less, and failures say why."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app


@pytest.mark.slow
def test_the_optimum_costs_least(bravo7: hs.Robot) -> None:
    found = hs.compare_planners(bravo7, speeds=[0.43], steps=3)
    preview, capture, optimum = found.walks
    assert [each.planner for each in found.walks] == ["preview", "capture_point", "optimum"]
    assert all(each.walks for each in found.walks)
    assert preview.torque_cost == pytest.approx(capture.torque_cost, rel=0.01)
    assert optimum.torque_cost < 0.05 * preview.torque_cost
    assert optimum.cost_of_transport < 0.5 * preview.cost_of_transport
    assert optimum.peak_torque < preview.peak_torque
    assert 0.09 < preview.zmp_margin <= 0.1  # half a sole is 0.1 m
    assert 0.0 < optimum.zmp_margin < preview.zmp_margin


@pytest.mark.slow
def test_the_command(tmp_path: Path) -> None:
    """One step is too long: it says so, and writes everything nevertheless."""
    asked = ["planners", "--speeds", "0.43,3", "--steps", "2", "--json", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, asked)
    assert result.exit_code == 1, result.output
    told = json.loads(result.stdout)
    assert told == json.loads((tmp_path / "planners.json").read_text())
    assert [each["walks"] for each in told["walks"]] == [True] * 3 + [False] * 3
    assert "too short for steps of 2.1 m" in told["walks"][3]["message"]
    assert told["walks"][3]["torque_cost"] is None
    assert (tmp_path / "planners.png").read_bytes().startswith(b"\x89PNG")
    refused = CliRunner().invoke(app, ["planners", "--speeds", "fast", "--out", str(tmp_path)])
    assert refused.exit_code == 2


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"speeds": "0.4"}, "speeds must be positive numbers"),
        ({"speeds": 4}, "speeds must be positive numbers"),
        ({"speeds": [None]}, "speeds must be positive numbers"),
        ({"speeds": [[0.3]]}, "speeds must be positive numbers"),
        ({"speeds": {"slow": 0.3}}, "speeds must be positive numbers"),
        ({"speeds": []}, "speeds must be positive numbers"),
        ({"steps": 0}, "steps must be 1 or more"),
    ],
)
def test_comparisons_that_make_no_sense(bravo7: hs.Robot, asked: Any, said: str) -> None:
    with pytest.raises(hs.GaitError, match=said):
        hs.compare_planners(bravo7, **asked)
