"""Between the gaits of a family: which count, by how much, and what if no optimum is near."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.gait import design
from heelstrike.gait.program import Program

SPEEDS = np.array([0.40, 0.45, 0.55])
SLOPES = np.array([-0.1, 0.1])


def mixed(monkeypatch: pytest.MonkeyPatch, **values: float) -> Any:
    """What a family hands on to be mixed: the names of its gaits, with their weights."""
    monkeypatch.setattr(design, "between", lambda _, corners: dict(corners))
    gaits: Any = {(i, j): f"{i}{j}" for i in range(3) for j in range(2)}
    axes = {"speed": SPEEDS, "slope": SLOPES}
    family = hs.GaitFamily(hs.load_robot("bravo7"), axes, {"step_duration": 0.7}, gaits, {})
    return family.at(**values)


def test_corners_count_as_near_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    weights = mixed(monkeypatch, speed=0.475, slope=0.05)
    assert weights == pytest.approx(
        {"10": 0.75 * 0.25, "11": 0.75 * 0.75, "20": 0.25 * 0.25, "21": 0.25 * 0.75}
    )


def test_on_a_line_of_the_grid_two_count(monkeypatch: pytest.MonkeyPatch) -> None:
    assert mixed(monkeypatch, speed=0.45, slope=0.0) == pytest.approx({"10": 0.5, "11": 0.5})
    assert mixed(monkeypatch, speed=0.42, slope=0.1) == pytest.approx({"01": 0.6, "11": 0.4})


@pytest.mark.parametrize("at", [(i, j) for i in range(3) for j in range(2)])
def test_a_gait_of_the_grid_is_returned(
    monkeypatch: pytest.MonkeyPatch, at: tuple[int, int]
) -> None:
    found = mixed(monkeypatch, speed=float(SPEEDS[at[0]]), slope=float(SLOPES[at[1]]))
    assert found == f"{at[0]}{at[1]}"


@pytest.mark.slow
def test_without_an_optimum_the_equations_hold(
    bravo7: hs.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Near the middle of two speeds, where the optimiser is said to have stopped on its way."""
    family = hs.gait_family(bravo7, speed=[0.40, 0.45], step_duration=0.70, starts=1)
    best = family.at(speed=0.42)
    assert best.optimal
    solve = Program.solve

    def stopped(*arguments: Any) -> Any:
        return replace(solve(*arguments), converged=False)

    monkeypatch.setattr(Program, "solve", stopped)
    mean = family.at(speed=0.42)
    assert not mean.optimal
    assert mean.margins.touchdown_error < 1e-10
    assert mean.margins.impact_error < 1e-10
    corners = [family[0], family[1]]
    assert all(corner is not None for corner in corners)
    linear = 0.6 * corners[0].pieces + 0.4 * corners[1].pieces  # type: ignore[union-attr]
    # The equations take it no farther than its own distance from the optimum.
    assert np.abs(mean.pieces - linear).max() < np.abs(best.pieces - linear).max()
