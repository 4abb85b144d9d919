"""When a step is over: what the map from touchdown to touchdown makes of a run's events."""

from __future__ import annotations

from typing import Any

import numpy as np
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
    asked: list[float] = []

    class Simulation:
        record = run

        def __init__(self, *_: Any, **__: Any) -> None:
            pass

        def advance(self, until: float) -> None:
            asked.append(until)

    monkeypatch.setattr(poincare_map, "Simulation", Simulation)
    same = None if feet is None else lambda state: state
    step = PoincareMap(Section(robot, hs.Ground()), None, hs.EventDriven(), feet, same, 2.0)
    _, time, contact = step._walk(robot.reference_state())
    assert asked[0] == 2.0
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


def test_a_controller_is_called_as_often_as_it_is_to_be() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    law = hs.ComputedTorque(robot, gait)
    coarse = hs.EventDriven(rtol=1e-6, atol=1e-8)
    ends = [
        PoincareMap(Section(robot, hs.Ground()), law, coarse, None, None, 2.0, period)(
            gait.initial_state
        ).state.v
        for period in (None, 1e-3, 2e-2)
    ]
    near, far = (np.abs(each - ends[0]).max() for each in ends[1:])
    assert 1e-6 < near < 0.1 * far


def test_a_state_of_time_stepping_is_lifted_out_of_the_ground() -> None:
    robot, ground = walking.bravo7(), hs.Ground(slope=0.1)
    section = Section(robot, ground)
    q = robot.reference_state().q

    _, gap, _ = section.contacts(hs.State(q, 0.0 * q))
    normal = ground.model().normal[0]
    along = np.array([normal[1], -normal[0]])

    def at_depth(depth: float) -> hs.State:
        placed = q.copy()
        placed[:2] -= (gap.min() + depth) * normal
        return hs.State(placed, np.zeros(robot.nv))

    for depth in (5e-6, 9e-5):
        state = at_depth(depth)
        lifted = section.lifted(state)
        _, above, _ = section.contacts(lifted)
        assert abs(above.min()) < 1e-12
        assert np.abs((lifted.q - state.q)[:2] @ along) < 1e-15
    deep = at_depth(2e-3)  # that is no penetration of a method: the simulation says so
    assert section.lifted(deep) is deep
