"""Walking a number of steps, and how large steps suit a robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.analysis import walking_steps
from heelstrike.experiments.walk import BRAVO7, StepSize, beginning, design, typical_step, walk


def test_step_of_a_robot_twice_as_large(bravo7: hs.Robot) -> None:
    # Dynamic similarity: lengths scale by 2, times by the square root of 2 (Froude).
    model = bravo7.model
    large = replace(
        bravo7,
        name="large",
        model=model.replaced(
            offset=2.0 * model.offset,
            center_of_mass=2.0 * model.center_of_mass,
            contact_position=2.0 * model.contact_position,
            reference=np.where(np.arange(bravo7.nq) < 2, 2.0, 1.0) * model.reference,
        ),
    )
    step = typical_step(large)
    assert step.length == pytest.approx(2.0 * BRAVO7.length, abs=0.006)
    assert step.duration == pytest.approx(np.sqrt(2.0) * BRAVO7.duration, abs=0.006)
    assert step.clearance == pytest.approx(2.0 * BRAVO7.clearance, abs=0.0006)


def test_the_rule_gives_bravo7_its_own_step(bravo7: hs.Robot) -> None:
    assert typical_step(bravo7) == BRAVO7


def test_no_step_suits_a_robot_without_feet(bravo7: hs.Robot) -> None:
    model = bravo7.model
    footless = replace(
        bravo7,
        name="footless",
        model=model.replaced(
            contact_link=model.contact_link[:0],
            contact_position=model.contact_position[:0],
            contact_radius=model.contact_radius[:0],
            friction_scale=model.friction_scale[:0],
            restitution_scale=model.restitution_scale[:0],
        ),
    )
    with pytest.raises(hs.GaitError, match="'footless' has no contact points"):
        typical_step(footless)


def test_bravo7_walks_its_typical_step(bravo7: hs.Robot) -> None:
    """The others of the library do so in test_library_gaits."""
    run = walk(bravo7, design(bravo7), steps=20)
    assert run.completed, run.message
    assert len(walking_steps(run)) == 20


def test_design_keeps_friction_in_reserve(bravo7: hs.Robot) -> None:
    gait = design(bravo7, StepSize(0.20, 0.80, 0.02), friction=0.5)
    assert (gait.step_length, gait.step_duration) == (0.20, 0.80)
    assert gait.friction == pytest.approx(0.4)


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_as_many_steps_as_asked_for(bravo7: hs.Robot, gait: hs.Gait, steps: int) -> None:
    reported: list[float] = []
    run = walk(bravo7, gait, steps=steps, progress=reported.append)
    assert len(walking_steps(run)) == steps
    assert reported == sorted(reported)
    assert reported[-1] == pytest.approx(1.0)


def test_no_steps_are_no_walk(bravo7: hs.Robot, gait: hs.Gait) -> None:
    with pytest.raises(hs.SimulationError, match="at least one step, got 0"):
        walk(bravo7, gait, steps=0)


def test_options_reach_the_simulation(bravo7: hs.Robot, gait: hs.Gait) -> None:
    ground = hs.Ground(friction=0.6)
    run = walk(bravo7, gait, steps=1, method=hs.TimeStepping(step=5e-4), ground=ground)
    assert run.ground is ground
    assert run.time[1] == pytest.approx(5e-4)


@pytest.mark.parametrize("degrees", [-4.0, 0.0, 6.0])
def test_a_start_on_a_slope_is_a_start_on_a_slope(
    bravo7: hs.Robot, gait: hs.Gait, degrees: float
) -> None:
    """The soles lie on it as they lie on the level, and move alike along its tangent."""
    level = hs.Ground()
    ground = hs.Ground(slope=np.deg2rad(degrees))
    state = beginning(bravo7, gait, ground).state
    here = hs.contact_kinematics(bravo7, state.q, state.v, ground)
    there = hs.contact_kinematics(bravo7, gait.initial_state.q, gait.initial_state.v, level)
    np.testing.assert_allclose(here.gap, there.gap, atol=1e-12)
    np.testing.assert_allclose(here.velocity, there.velocity, atol=1e-12)
    np.testing.assert_array_equal(state.q[3:], gait.initial_state.q[3:])
    if degrees == 0.0:
        assert state is gait.initial_state


def test_a_gait_of_a_slope_begins_on_it_as_it_was_designed(bravo7: hs.Robot, gait: hs.Gait) -> None:
    """And is turned by the difference on a steeper one."""
    gentle, steep = (hs.Ground(slope=np.deg2rad(degrees)) for degrees in (3.0, 5.0))
    designed = beginning(bravo7, gait, gentle).state
    sloped = replace(gait, slope=gentle.slope, initial_state=designed)
    there = beginning(bravo7, sloped, gentle).state
    np.testing.assert_allclose(there.vector, designed.vector, atol=1e-12)
    further = beginning(bravo7, sloped, steep).state
    np.testing.assert_allclose(
        further.vector, beginning(bravo7, gait, steep).state.vector, atol=1e-12
    )


def test_a_start_on_high_ground_is_on_the_ground(bravo7: hs.Robot, gait: hs.Gait) -> None:
    ground = hs.Ground(profile=[(-5.0, 0.3), (0.6, 0.3), (0.6, 0.5), (9.0, 0.5)])
    state = beginning(bravo7, gait, ground).state
    gap = hs.contact_kinematics(bravo7, state.q, state.v, ground).gap
    assert gap.min() == pytest.approx(0.0, abs=1e-12)


def test_pushes_reach_the_simulation(bravo7: hs.Robot, gait: hs.Gait) -> None:
    push = hs.Push("trunk", force=(30.0, 0.0), start=0.1, duration=0.1)
    run = walk(bravo7, gait, steps=1, pushes=[push])
    assert run.pushes == (push,)
