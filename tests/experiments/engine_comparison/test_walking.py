"""A walk in an engine is recorded as our own simulation records it."""

from __future__ import annotations

import numpy as np
import pytest
from experiments.engine_comparison.our_engine import OurPeer

import heelstrike as hs
from heelstrike.analysis.support import walking_steps
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison import walk_in
from heelstrike.experiments.engine_comparison.figures import walk_figures
from heelstrike.experiments.engines import Scenario
from heelstrike.sim import RunStatus
from heelstrike.sim.run import Run

PERIOD, STEP, STEPS = 2e-3, 1e-3, 2


@pytest.fixture(scope="module")
def scenario(bravo7: hs.Robot, gait: hs.Gait) -> Scenario:
    return Scenario("walk", bravo7, gait.initial_state, 2.1 * gait.step_duration)


@pytest.fixture(scope="module")
def direct(scenario: Scenario, gait: hs.Gait) -> Run:
    return hs.simulate(
        scenario.robot,
        hs.ComputedTorque(scenario.robot, gait),
        state=scenario.state,
        duration=scenario.duration,
        method=hs.TimeStepping(step=STEP),
        ground=scenario.ground,
        control_period=PERIOD,
    )


@pytest.fixture(scope="module")
def walked(scenario: Scenario, gait: hs.Gait) -> Run:
    law = hs.ComputedTorque(scenario.robot, gait)
    return walk_in(OurPeer(scenario, STEP), law, control_period=PERIOD, name="ours")


def test_it_is_the_walk_of_a_simulation(walked: Run, direct: Run) -> None:
    """The same law called every 2 ms, so the same numbers but for the last digits.

    A difference of 1e-16 in a torque grows along two stable steps to 1e-12 at most.
    """
    assert walked.status is RunStatus.COMPLETED
    np.testing.assert_allclose(walked.time, direct.time, rtol=0.0, atol=1e-12)
    for name in ("position", "velocity", "gap", "contact_point"):
        np.testing.assert_allclose(
            getattr(walked, name), getattr(direct, name), rtol=0.0, atol=1e-8, err_msg=name
        )
    # In the last row a simulation decides once more, what an engine is not asked for.
    np.testing.assert_allclose(walked.torque[:-1], direct.torque[:-1], atol=1e-6)
    np.testing.assert_allclose(walked.contact_force[:-1], direct.contact_force[:-1], atol=1e-5)


def test_its_landings_are_those_of_a_simulation(walked: Run, direct: Run) -> None:
    ours, theirs = walking_steps(walked), walking_steps(direct)
    assert len(ours) == len(theirs) == STEPS
    for a, b in zip(ours, theirs, strict=True):
        assert a.foot == b.foot
        assert a.touchdown == pytest.approx(b.touchdown, abs=1e-9)
        assert a.impulse == pytest.approx(b.impulse, abs=1e-6)


def test_its_figures_do_not_differ_from_itself(walked: Run, direct: Run, gait: hs.Gait) -> None:
    found = walk_figures(walked, direct, gait, STEPS)
    assert found.walks
    assert found.steps == STEPS
    assert found.ending == "completed"
    assert found.position <= 1e-8
    assert found.touchdown_s <= 1e-9
    assert found.impulse_Ns <= 1e-6
    assert found.zmp_m <= 1e-5  # of the last row, whose forces are those of the one before
    assert found.penetration_m <= 1e-12
    # Steps keep the velocities of feet at zero where they begin, not where they end: 1e-4 m/s.
    assert 0.0 < found.slip_m <= 1e-3
    assert found.noise <= 1e-3
    # The first order error of semi-implicit Euler, some 0.2 J of 700 J.
    assert 1e-3 < found.energy_J < 1.0


def test_a_walk_that_is_not_far_enough_does_not_walk(
    walked: Run, direct: Run, gait: hs.Gait
) -> None:
    found = walk_figures(walked, direct, gait, STEPS + 1)
    assert not found.walks
    assert found.ending == "completed: 2 of 3 steps"


def test_without_torques_it_falls_and_says_so(scenario: Scenario, gait: hs.Gait) -> None:
    run = walk_in(OurPeer(scenario, STEP), None, control_period=PERIOD)
    assert run.status is RunStatus.FELL
    found = walk_figures(run, run, gait, STEPS)
    assert not found.walks
    assert found.ending.startswith("fell: ")


def test_a_control_period_is_a_whole_number_of_steps(scenario: Scenario) -> None:
    with pytest.raises(SimulationError, match="not a multiple of the step"):
        walk_in(OurPeer(scenario, 0.3e-3), None, control_period=1e-3)


def test_an_engine_that_leaves_all_bounds_is_told_to_diverge(scenario: Scenario) -> None:
    class Wild(OurPeer):
        def coordinates(self):  # type: ignore[no-untyped-def]
            q, v = super().coordinates()
            return (q, v) if self.done < 50 else (np.full_like(q, np.nan), v)

    run = walk_in(Wild(scenario, STEP), None, control_period=PERIOD)
    assert run.status is RunStatus.DIVERGED
    assert len(run.time) == 50  # rows 0 to 49 are finite
    assert np.isfinite(run.position).all()
