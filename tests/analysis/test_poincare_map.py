"""When a step is over: what the map from touchdown to touchdown makes of a run's events."""

from __future__ import annotations

from typing import Any

import pytest
import walking
from synthetic_runs import liftoff, make_run, touchdown

import heelstrike as hs
from heelstrike.analysis import poincare_map
from heelstrike.analysis.poincare_map import PoincareMap, Section
from heelstrike.sim import Event


def landing(
    monkeypatch: pytest.MonkeyPatch, events: list[Event], *, feet: list[int] | None = None
) -> tuple[float, int]:
    """Time and contact point at which a step of bravo7 with such events is over."""
    robot = walking.bravo7()
    run = make_run(robot, [0.0, 1.0], events=events)
    asked: list[dict[str, Any]] = []

    def simulate(*_: Any, **options: Any) -> hs.Run:
        asked.append(options)
        return run

    monkeypatch.setattr(poincare_map, "simulate", simulate)
    same = None if feet is None else lambda state: state
    step = PoincareMap(Section(robot, hs.Ground()), None, hs.EventDriven(), feet, same, 2.0)
    _, time, contact = step._walk(robot.reference_state())
    assert asked[0]["duration"] == 2.0
    return time, contact


def test_all_points_of_a_foot_must_be_down_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Heel and toe of the left foot; the right foot stands since the beginning."""
    events = [
        touchdown(0.0, 0),
        touchdown(0.0, 1),
        touchdown(0.3, 2),
        liftoff(0.31, 2),
        touchdown(0.4, 3),
        touchdown(0.45, 2),
        touchdown(0.6, 0),
    ]
    assert landing(monkeypatch, events) == (0.45, 2)


def test_points_of_two_feet_are_no_foot(monkeypatch: pytest.MonkeyPatch) -> None:
    events = [touchdown(0.2, 1), touchdown(0.3, 3), touchdown(0.4, 0)]
    assert landing(monkeypatch, events) == (0.4, 0)


def test_the_points_that_were_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    events = [touchdown(0.2, 0), touchdown(0.3, 1), touchdown(0.4, 3)]
    assert landing(monkeypatch, events, feet=[3]) == (0.4, 3)


def test_nothing_lands(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(hs.LimitCycleError, match="did not complete a step in 1 s"):
        landing(monkeypatch, [touchdown(0.3, 2)])


@pytest.mark.parametrize("feet", [[], [4], [-1]])
def test_points_that_are_not_there(monkeypatch: pytest.MonkeyPatch, feet: list[int]) -> None:
    with pytest.raises(hs.SimulationError, match="from 0 to 3"):
        landing(monkeypatch, [], feet=feet)
