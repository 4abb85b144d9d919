"""Rows of a simulation that goes on."""

from __future__ import annotations

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.view.live import history
from heelstrike.view.live.history import History


def walker() -> hs.Simulation:
    return hs.Simulation(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state,
        ground=hs.Ground(friction=walking.FRICTION),
    )


def taken(simulation: hs.Simulation, times: list[float]) -> History:
    """What is kept of a simulation that is looked at at some times."""
    kept = History()
    for time in times:
        simulation.advance(time)
        kept.take(simulation.record)
        simulation.forget()
    return kept


def test_pieces_make_up_the_run() -> None:
    whole = walking.walk(steps=2)  # with two touchdowns
    end = float(whole.time[-1])
    # One piece ends just where a foot lands.
    kept = taken(walker(), [0.0, 0.011, 0.4, 0.4, 0.7, 0.701, 1.2, end])
    part = kept.part(0, len(kept) - 1)
    assert len(kept) == len(whole.time)
    for name in ("time", "position", "torque", "contact_force", "gap"):
        assert np.array_equal(getattr(part, name), getattr(whole, name)), name
    assert part.events == whole.events


def test_what_is_cut_is_simulated_again() -> None:
    kept = taken(walker(), [0.3, 0.8])
    kept.cut(0.5)
    assert kept.time[-1] == pytest.approx(0.5, abs=1e-9)
    assert all(event.time <= 0.5 for event in kept.events)
    assert len(kept) == 501


def test_the_oldest_rows_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "MOST_ROWS", 3000)
    simulation = hs.Simulation(
        hs.load_robot("compass_gait"),
        state=hs.load_robot("compass_gait").reference_state(),
        stop_when_fallen=False,
        ground=hs.Ground(slope=-0.05),
    )
    times = np.arange(1, 31) * 0.3
    kept = taken(simulation, times.tolist())
    assert 3000 <= len(kept) <= 9000
    assert kept.time[-1] == pytest.approx(9.0)
    assert np.allclose(np.diff(kept.time), 1e-3)
    assert kept.row_at(8.9995) == len(kept) - 2
    assert kept.row_at(-1.0) == 0
