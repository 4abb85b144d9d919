"""bravo7's gait for flat ground on stairs, slopes and rough ground, event driven.

Whether the walk survives is the gait's affair. Here it must end with a status, every event must be
one, and time stepping must see the same first touchdown.
"""

from __future__ import annotations

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.dynamics import contact_positions, energy
from heelstrike.sim import EventKind, RunStatus

RISE = float(np.tan(np.deg2rad(5.0)))
GROUNDS = {
    "stairs down": hs.Ground.stairs(rise=-0.01, tread=0.3, count=20, start=0.15),
    "5 degrees up": hs.Ground(profile=[[-1.0, 0.0], [0.15, 0.0], [10.15, 10.0 * RISE]]),
    "5 degrees down": hs.Ground(profile=[[-1.0, 0.0], [0.15, 0.0], [10.15, -10.0 * RISE]]),
    "rough": hs.Ground.rough(amplitude=5e-3, spacing=0.1, length=10.0, seed=1, start=0.15),
    "rougher": hs.Ground.rough(amplitude=5e-3, spacing=0.03, length=10.0, seed=2, start=0.15),
}


def walk(ground: hs.Ground, method: object, duration: float) -> hs.Run:
    gait = walking.gait()
    return hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), gait),
        state=gait.initial_state,
        duration=duration,
        method=method,  # type: ignore[arg-type]
        ground=ground,
    )


@pytest.mark.parametrize("name", GROUNDS)
def test_walk(name: str) -> None:
    run = walk(GROUNDS[name], hs.EventDriven(), 4.0)
    assert run.status in (RunStatus.COMPLETED, RunStatus.FELL), run.message
    assert run.solver.failures == 0
    assert run.certificates.complementarity <= 1e-9
    assert run.certificates.penetration <= 1e-10
    landings = [e for e in run.events if e.kind is EventKind.TOUCHDOWN]
    assert len(landings) >= 4
    for landing in landings:
        # On the ground when it lands, and not a microsecond before.
        rows = np.flatnonzero(np.abs(run.time - landing.time) <= 1e-11)
        assert abs(run.gap[rows[0], landing.contact]) <= 1e-10
        assert run.gap[rows[0] - 1, landing.contact] >= -1e-12
    made = {e.time for e in run.events if e.kind is EventKind.ENERGY_GAIN}
    struck = {e.time for e in run.events if e.impulse != (0.0, 0.0)} - made
    for time in struck:
        rows = np.flatnonzero(np.abs(run.time - time) <= 1e-11)
        before, after = (
            sum(energy(run.robot, run.position[row], run.velocity[row]))
            for row in (rows[0], rows[-1])
        )
        assert after <= before + 1e-9


@pytest.mark.parametrize("name", GROUNDS)
def test_time_stepping_sees_the_same_first_touchdown(name: str) -> None:
    """It knows times to within a step or two, of 0.1 ms."""
    step = 1e-4
    exact, stepped = (
        next(
            e
            for e in walk(GROUNDS[name], method, 0.8).events
            if e.kind is EventKind.TOUCHDOWN and e.impulse[0] > 0.0
        )
        for method in (hs.EventDriven(), hs.TimeStepping(step=step))
    )
    assert exact.contact == stepped.contact
    assert stepped.time == pytest.approx(exact.time, abs=2.0 * step)


def test_a_robot_that_begins_in_the_ground_is_refused() -> None:
    """A state for level ground on a slope that rises through the foot in front: which, how deep.

    The slope rises by tan 5° from the world's origin. Raised by what the message says, it begins.
    """
    gait = walking.gait()
    ground = hs.Ground(slope=np.deg2rad(5.0))
    robot, state = walking.bravo7(), gait.initial_state
    with pytest.raises(
        hs.SimulationError, match=r"contact point '\w+'.* deep in the ground"
    ) as told:
        hs.simulate(robot, state=state, duration=0.1, method=hs.EventDriven(), ground=ground)
    points = contact_positions(robot, state.q)
    needed = float(np.max(points[:, 0] * np.tan(np.deg2rad(5.0)) - points[:, 1]))
    assert f"raise the robot by {needed:.3g} m" in str(told.value)
    raised = hs.State(state.q + np.array([0.0, needed, *np.zeros(7)]), state.v)
    run = hs.simulate(robot, state=raised, duration=0.1, method=hs.EventDriven(), ground=ground)
    assert run.completed, run.message
    # Time stepping pushes the feet out of it, and fast.
    pushed = hs.simulate(robot, state=state, duration=0.02, method=hs.TimeStepping(), ground=ground)
    assert pushed.gap[-1].min() >= -1e-3
