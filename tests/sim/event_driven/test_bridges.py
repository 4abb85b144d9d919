"""Bridges: where events pile up the run goes on, says so, and loses nothing that it should not."""

from __future__ import annotations

from pathlib import Path

import mechanisms
import numpy as np
import pytest
import walking
from scenes.event_judge import judge_events
from scenes.methods import Setting
from scenes.scene import random_scene

import heelstrike as hs
from heelstrike.sim import Event, EventKind, RunStatus, Simulation
from heelstrike.sim.event_driven.bridge import MOST_BRIDGES

# Random scenes that ended with events without end, or without a certified solution.
PILED_UP = (37, 48, 55, 66, 118)


def bridges(run: hs.Run) -> list[Event]:
    return [event for event in run.events if event.kind is EventKind.BRIDGE]


@pytest.mark.parametrize("seed", PILED_UP)
def test_a_robot_on_which_events_pile_up_arrives(seed: int) -> None:
    run = Setting.of(random_scene(seed)).run("event_driven")
    assert run.status is RunStatus.COMPLETED, run.message
    assert np.all(np.diff(run.time) >= 0.0)
    assert sum(event.impulse[0] for event in bridges(run)) <= 1e-3 * run.time[-1]


@pytest.mark.parametrize("seed", [3, 9, 10, 21, 26, 44, 59])
def test_points_that_chatter_to_rest_need_no_bridge_and_no_leap(seed: int) -> None:
    """Several of them, within microseconds; every jump of the velocity is that of its impulses."""
    setting = Setting.of(random_scene(seed))
    run = setting.run("event_driven")
    assert run.status is RunStatus.COMPLETED
    assert not bridges(run)
    assert not setting.judge("event_driven", run).objections


def bridged(begin: float, longer: int) -> tuple[hs.Run, hs.Run]:
    """A walk of bravo7 with a bridge that nothing called for, and the same walk without."""
    law, state = hs.ComputedTorque(walking.bravo7(), walking.gait()), walking.gait().initial_state
    runs = []
    for forced in (True, False):
        simulation = Simulation(
            walking.bravo7(), law, state=state, method=hs.EventDriven(rtol=1e-11, atol=1e-13),
            ground=hs.Ground(friction=walking.FRICTION),
        )  # fmt: skip
        simulation.advance(begin)
        if forced:
            simulation._work.bridging, simulation._work.bridges = 1, longer
            simulation._work.series = begin
        simulation.advance(begin + 1e-6 * 4.0**longer)
        runs.append(simulation.record)
    return runs[0], runs[1]


@pytest.mark.parametrize("begin", [0.02, 0.35, 0.6])
def test_how_wrong_a_bridge_may_be(begin: float) -> None:
    """Its estimate covers its error, and half the length is at least half the error."""
    errors = []
    for longer in (1, 2, 3):
        run, exact = bridged(begin, longer)
        (bridge,) = bridges(run)
        assert bridge.impulse[0] == pytest.approx(1e-6 * 4.0**longer, rel=1e-9)
        apart = max(
            np.abs(run.position[-1] - exact.position[-1]).max(),
            np.abs(run.velocity[-1] - exact.velocity[-1]).max(),
        )
        assert apart <= bridge.impulse[1] + 1e-11
        errors.append(apart)
    assert errors[1] <= 0.3 * errors[2]


def test_a_bridge_obeys_the_laws_and_is_kept_in_files(tmp_path: Path) -> None:
    run, _ = bridged(0.35, 2)
    assert len(bridges(run)) == 1
    found = judge_events(run)
    assert found.figures["bridges"] == 1
    assert not [one for one in found.objections if "bridge" in one.law or "impact" in one.law]
    run.save(tmp_path / "run.nc")
    assert hs.load_run(tmp_path / "run.nc").events == run.events


def test_a_robot_that_no_bridge_helps_is_given_up_in_words() -> None:
    """Ten that grew are behind it, and it has not got any further."""
    simulation = Simulation(
        mechanisms.rimless_wheel(inertia=1e-6), state=hs.State([0.0, 1.0, 0.0], [0.0, 0.0, 0.0]),
        method=hs.EventDriven(), stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(0.01)
    phase = simulation._work
    phase.bridging, phase.bridges, phase.series = 1, MOST_BRIDGES, simulation.time
    simulation.advance(0.02)
    run = simulation.record
    assert run.status is RunStatus.SOLVER_FAILED
    assert run.time[-1] == pytest.approx(0.01)
    assert "each four times as long as the one before" in run.message


# Random scenes on ground with corners in which an impulse was told in one frame and shown in
# another: a bridge, or a second impact, followed an impact in the same instant.
TWO_FRAMES = ((6311, 0.7363), (6884, 0.6266))
# Those that ended a bridge beside the ground, with speeds that its rows had no more: what came down
# there was stopped without an impulse, and friction drove what was still to come to rest.
OFF_THE_GROUND = ((6726, 0.7786), (6877, 0.7408))


@pytest.mark.parametrize(("seed", "duration"), TWO_FRAMES + OFF_THE_GROUND)
def test_bridges_and_impacts_of_one_instant_balance(seed: int, duration: float) -> None:
    setting = Setting.of(random_scene(seed))
    run = setting.run("event_driven", duration=duration)
    assert run.status is RunStatus.COMPLETED
    assert not setting.judge("event_driven", run).objections
