"""Bridges: where events pile up the run goes on, says so, and loses nothing that it should not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes.methods import Setting
from scenes.scene import random_scene

import heelstrike as hs
from heelstrike.sim import EventKind, RunStatus

# Random scenes on flat ground that ended without time moving on, or without a certified solution.
PILED_UP = (55, 66, 68, 118)


@pytest.mark.parametrize("seed", PILED_UP)
def test_a_robot_on_which_events_pile_up_arrives(seed: int) -> None:
    run = Setting.of(random_scene(seed)).run("event_driven")
    assert run.status is RunStatus.COMPLETED, run.message
    bridges = [event for event in run.events if event.kind is EventKind.BRIDGE]
    lengths = [event.impulse[0] for event in bridges]
    assert bridges
    assert 0.0 < sum(lengths) <= 1e-3 * run.time[-1]
    assert np.all(np.diff(run.time) >= 0.0)
    for event in bridges:
        # Velocities jump at its beginning and position does not; there is a row at its end.
        first, last = np.flatnonzero(np.abs(run.time - event.time) <= 1e-14)[[0, -1]]
        assert first < last
        np.testing.assert_allclose(run.position[last], run.position[first], rtol=0.0, atol=1e-7)
        end = event.time + event.impulse[0]
        assert np.min(np.abs(run.time - end)) <= 1e-14


def test_bridges_are_kept_in_files(tmp_path: Path) -> None:
    run = Setting.of(random_scene(118)).run("event_driven")
    run.save(tmp_path / "run.nc")
    assert hs.load_run(tmp_path / "run.nc").events == run.events


def test_a_run_that_needs_no_bridge_has_none() -> None:
    run = Setting.of(random_scene(2)).run("event_driven")
    assert run.status is RunStatus.COMPLETED
    assert not [event for event in run.events if event.kind is EventKind.BRIDGE]
