"""bravo7 under event-driven contact: the reference that time stepping converges to."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.sim import EventKind


@cache
def event_driven_walk(steps: int = 20) -> hs.Run:
    """Walk the reference gait, event driven."""
    return hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state,
        duration=(steps + 0.1) * walking.STEP_DURATION,
        method=hs.EventDriven(rtol=1e-8),
        ground=hs.Ground(friction=walking.FRICTION),
    )


def test_twenty_steps() -> None:
    """The gait is an exact solution, so that the walk follows it to the tolerance."""
    run = event_driven_walk()
    summary = run.summary(gait=walking.gait())
    assert run.completed, run.message
    assert summary.steps == 20
    assert summary.tracking_rms_rad <= 1e-8
    assert summary.penetration_max_m <= 1e-10
    assert summary.complementarity_max <= 1e-9
    assert run.solver.failures == 0


def test_touchdowns_and_impulses_are_the_designed_ones() -> None:
    run = event_driven_walk()
    gait = walking.gait()
    landings = [e for e in run.events if e.kind is EventKind.TOUCHDOWN and e.time > 0.0]
    times = np.array([event.time for event in landings]).reshape(-1, 2)
    steps = np.arange(1, len(times) + 1) * gait.step_duration
    np.testing.assert_allclose(times, np.outer(steps, [1.0, 1.0]), atol=1e-8)
    impulses = np.array([event.impulse[0] for event in landings]).reshape(-1, 2).sum(axis=1)
    np.testing.assert_allclose(impulses, gait.touchdown_impulse[0], rtol=1e-6)


def test_time_stepping_converges_to_it_at_first_order() -> None:
    exact = event_driven_walk().position
    clock = event_driven_walk().time
    at = 1.0  # after the first touchdown
    row = int(np.flatnonzero(np.abs(clock - at) < 1e-9)[-1])
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        run = walking.walk(steps=2, step=step)
        errors.append(np.abs(run.position[round(at / step)] - exact[row])[3:].max())
    order = np.polyfit(np.log([1e-3, 5e-4, 2.5e-4, 1.25e-4]), np.log(errors), 1)[0]
    assert order >= 0.9, errors


def test_runs_repeat_bit_for_bit() -> None:
    first = event_driven_walk(2)
    event_driven_walk.cache_clear()
    second = event_driven_walk(2)
    np.testing.assert_array_equal(first.position, second.position)
    np.testing.assert_array_equal(first.contact_force, second.contact_force)
    assert first.events == second.events


@pytest.mark.parametrize(
    "options", [{"rtol": 0.0}, {"atol": -1.0}, {"max_step": np.nan}, {"solver": "magic"}]
)
def test_bad_options(options: dict[str, object]) -> None:
    with pytest.raises(hs.SimulationError):
        hs.EventDriven(**options)  # type: ignore[arg-type]
