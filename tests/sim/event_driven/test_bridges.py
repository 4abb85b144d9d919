"""Bridges: where events pile up the run goes on, says so, and loses nothing that it should not."""

from __future__ import annotations

import numpy as np
import pytest
from scenes.methods import Setting
from scenes.scene import random_scene

import heelstrike as hs
from heelstrike.sim import EventKind, RunStatus

# Random scenes that ended with events without end, or without a certified solution; no bridge now.
PILED_UP = (37, 48, 55, 66, 118)


def bridges(run: hs.Run) -> list[hs.sim.Event]:
    return [event for event in run.events if event.kind is EventKind.BRIDGE]


@pytest.mark.parametrize("seed", PILED_UP)
def test_a_robot_on_which_events_pile_up_arrives(seed: int) -> None:
    run = Setting.of(random_scene(seed)).run("event_driven")
    assert run.status is RunStatus.COMPLETED, run.message
    assert np.all(np.diff(run.time) >= 0.0)
    assert sum(event.impulse[0] for event in bridges(run)) <= 1e-3 * run.time[-1]


@pytest.mark.parametrize("seed", [3, 9, 21])
def test_a_run_that_needs_no_bridge_has_none(seed: int) -> None:
    """Points that chatter to rest within microseconds, several of them at once."""
    setting = Setting.of(random_scene(seed))
    run = setting.run("event_driven")
    assert run.status is RunStatus.COMPLETED
    assert not bridges(run)
