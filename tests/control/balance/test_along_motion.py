"""The whole body along motions of any phases: near them, within limits, on moved footholds."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.gait.gait import fingerprint

FAST = 2.2
AWAY = 0.02
"""Largest error of joints (rad) in a state that is not on the motion."""
NOTHING = 1e-9
"""Weight of the trunk's rotation with which the joints alone count."""


@cache
def motion() -> hs.Motion:
    return walking.gait().motion(walking.bravo7())


def disturbed(seed: int) -> hs.State:
    """A state near that of the motion after a fifth of the step, the stance foot where it was."""
    robot, time = walking.bravo7(), 0.2 * motion().duration
    state = hs.State(motion().position(time), motion().velocity(time))
    moved = np.random.default_rng(seed).uniform(-AWAY, AWAY, robot.nv)
    leg = [robot.joint_names.index(f"right_{each}") for each in ("hip", "knee", "ankle")]
    moved[[0, 1, 2, *leg]] = 0.0
    return hs.State(state.q + moved, state.v)


def asked(law: hs.Controller, state: hs.State) -> np.ndarray:
    contacts = hs.Simulation(law.robot, state=state).contacts
    return np.asarray(law.torque(0.2 * motion().duration, state, contacts))


@pytest.mark.parametrize("seed", range(3))
def test_without_limits_it_is_motion_tracking(seed: int) -> None:
    """One solves a quadratic programme, the other equations, for the same accelerations."""
    robot, state = walking.bravo7(), disturbed(seed)
    usual = asked(hs.MotionTracking(robot, motion()), state)
    whole = asked(hs.WholeBody(robot, motion(), numbers={"pitch": NOTHING}), state)
    np.testing.assert_allclose(whole, usual, atol=1e-4 * np.abs(usual).max())


def test_motors_are_not_asked_for_more_than_they_have() -> None:
    robot, state = walking.bravo7(), disturbed(0)
    free = asked(hs.WholeBody(robot, motion()), state)
    most = 0.8 * np.abs(free).max()
    limits = {"torque_lower": np.full(robot.nu, -most), "torque_upper": np.full(robot.nu, most)}
    weak = replace(robot, model=robot.model.replaced(**limits))
    own = replace(motion(), fingerprint=fingerprint(weak))
    law = hs.WholeBody(weak, own)
    found = asked(law, state)
    assert np.abs(found).max() <= most * (1.0 + 1e-9)
    assert np.abs(found).max() == pytest.approx(most, rel=1e-6)


def test_what_it_refuses() -> None:
    robot = walking.bravo7()
    with pytest.raises(hs.ControllerError, match="a motion has its own speed"):
        hs.WholeBody(robot, motion(), speed=0.5)
    with pytest.raises(hs.ControllerError, match="there is no number 'crouch'; there are friction"):
        hs.FootstepFeedback(robot, motion(), numbers={"crouch": 0.1})
    with pytest.raises(hs.ControllerError, match="friction must be positive"):
        hs.WholeBody(robot, motion(), friction=0.0)
    with pytest.raises(hs.GaitError, match="designed for robot"):
        hs.WholeBody(walking.rabbit(), motion())


@cache
def running() -> hs.Motion:
    phases = [
        hs.ContactPhase("right_foot_toe", duration=(0.15, 0.3), pieces=4),
        hs.ContactPhase(duration=(0.1, 0.3), pieces=3),
    ]
    return hs.optimize_motion(walking.bravo7(), phases, speed=FAST, starts=1)


def steps(law: hs.Controller, pushes: tuple[hs.Push, ...] = ()) -> float:
    run = hs.simulate(
        walking.bravo7(), law, state=running().initial_state, duration=20.5 * running().duration,
        method=hs.EventDriven(), ground=hs.Ground(friction=running().friction), pushes=pushes,
    )  # fmt: skip
    return float(run.time[-1]) / running().duration


@pytest.mark.slow
def test_moved_footholds_keep_a_run_on_toes_up() -> None:
    """In which no motor moves the trunk: without them it falls, with them it bears a push."""
    robot = walking.bravo7()
    assert steps(hs.WholeBody(robot, running())) < 20.0
    push = hs.Push("trunk", force=(0.02 * robot.weight, 0.0), start=1.0, duration=0.1)
    law = hs.FootstepFeedback(robot, running())
    assert steps(law) == pytest.approx(20.5)
    assert steps(law, (push,)) == pytest.approx(20.5)


def test_spells_in_the_air_are_those_of_the_motion() -> None:
    """By the heights of the feet: in the air from the touchdown of the other foot to its own."""
    law = hs.FootstepFeedback(walking.bravo7(), motion())
    parameters, _ = law.numbers(walking.bravo7())
    np.testing.assert_allclose(parameters.spell, [[0.0, 0.7], [0.7, 0.0]], atol=1e-12)
    np.testing.assert_array_equal(parameters.before, np.zeros((2, 2)))


def test_the_centre_of_mass_is_that_of_the_motion() -> None:
    law = hs.FootstepFeedback(walking.bravo7(), motion())
    parameters, _ = law.numbers(walking.bravo7())
    (phase, *_) = motion().phases
    for k, begin in enumerate(phase.breakpoints[:-1]):
        inside = 0.4 * (phase.breakpoints[k + 1] - begin)
        place = dynamics.center_of_mass(walking.bravo7(), phase.coordinates(begin + inside))
        found = np.polynomial.polynomial.polyval(inside, parameters.mass[k, :, 0])
        assert found == pytest.approx(place[0], abs=1e-9)
