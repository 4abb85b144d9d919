"""What holds for every stock controller: one suite for all of them.

Each law is compiled and the same in Python, says what it does in a run when it is asked itself,
starts again with every run, lives through snapshots, pickles and batches, and does the same under
both methods.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.sim.controller.law import Law


@cache
def phased() -> hs.PhasedGait:
    robot = hs.load_robot("rabbit")
    gait = hs.optimize_gait(
        robot, step_length=0.21, step_duration=0.58, clearance=0.02, friction=0.6, starts=1,
        joint_ranges={"right_knee": (0.2, 2.6)},
    )  # fmt: skip
    return hs.PhasedGait.from_gait(robot, gait)


def on_flat_feet(make: Callable[..., Law]) -> tuple[hs.Robot, hs.State, Law]:
    robot, gait = walking.bravo7(), walking.gait()
    return robot, gait.initial_state, make(robot, gait)


def on_points(make: Callable[..., Law]) -> tuple[hs.Robot, hs.State, Law]:
    return phased().robot, hs.zero_dynamics(phased()).initial_state, make(phased())


def in_phases(make: Callable[..., Law]) -> tuple[hs.Robot, hs.State, Law]:
    robot, gait = walking.bravo7(), walking.gait()
    return robot, gait.initial_state, make(robot, gait.motion(robot))


def standing(make: Callable[..., Law]) -> tuple[hs.Robot, hs.State, Law]:
    robot = walking.bravo7()
    return robot, robot.reference_state(), make(robot)


LAWS: dict[str, Callable[[], tuple[hs.Robot, hs.State, Law]]] = {
    "ComputedTorque": lambda: on_flat_feet(hs.ComputedTorque),
    "FootstepFeedback": lambda: on_flat_feet(hs.FootstepFeedback),
    "FootstepFeedback on a motion": lambda: in_phases(hs.FootstepFeedback),
    "FlatGaitLQR": lambda: on_flat_feet(hs.FlatGaitLQR),
    "GaitLQR": lambda: on_points(hs.GaitLQR),
    "JointFeedback": lambda: standing(
        lambda robot: JointFeedback(robot, np.zeros(6), kp=3000.0, kd=30.0)
    ),
    "JointPD": lambda: on_flat_feet(lambda *given: hs.JointPD(*given, kp=1000.0, kd=20.0)),
    "MotionLQR": lambda: in_phases(hs.MotionLQR),
    "MotionTracking": lambda: in_phases(hs.MotionTracking),
    "StandingLQR": lambda: standing(hs.StandingLQR),
    "SteppingConstraints": lambda: on_points(
        lambda gait: hs.SteppingConstraints(hs.StepFamily.around(gait))
    ),
    "VirtualConstraints": lambda: on_points(hs.VirtualConstraints),
    "WholeBody": lambda: on_flat_feet(hs.WholeBody),
    "WholeBody on a motion": lambda: in_phases(hs.WholeBody),
    "ZeroMomentPointRegulation": lambda: on_flat_feet(hs.ZeroMomentPointRegulation),
}

OWN = {
    "FlatGaitLQR", "FootstepFeedback on a motion", "GaitLQR", "MotionLQR", "SteppingConstraints",
    "WholeBody on a motion", "ZeroMomentPointRegulation",
}  # fmt: skip
"""Laws that take long to compile, and have quick tests of their own."""

every = pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in OWN else name for name in sorted(LAWS)],
)

PUSH = hs.Push(2, force=(60.0, 0.0), start=0.02, duration=0.02)


@cache
def case(name: str) -> tuple[hs.Robot, hs.State, Law]:
    return LAWS[name]()


def run_of(name: str, law: Law | None = None, duration: float = 0.06, **options: Any) -> hs.Run:
    robot, state, usual = case(name)
    given: dict[str, Any] = {"pushes": PUSH, "control_period": 1e-3} | options
    run = hs.simulate(robot, usual if law is None else law, state=state, duration=duration, **given)
    assert run.completed, run.message
    return run


@cache
def usual(name: str) -> hs.Run:
    return run_of(name)


@every
@pytest.mark.slow
def test_it_is_compiled_and_the_same_in_python(name: str) -> None:
    law = case(name)[2]
    assert law.function.compiles
    looked_at = run_of(name, checked=True, duration=0.006)
    rows = len(looked_at.time)
    scale = np.abs(usual(name).torque).max()
    np.testing.assert_allclose(looked_at.torque, usual(name).torque[:rows], atol=1e-8 * scale)


@every
def test_asked_itself_it_says_what_it_does_in_a_run(name: str) -> None:
    robot, state, law = case(name)
    asked = hs.Simulation(robot, state=state).contacts
    np.testing.assert_allclose(
        law.torque(0.0, state, asked), usual(name).torque[0], rtol=1e-6, atol=1e-6
    )


@every
def test_every_run_begins_anew(name: str) -> None:
    again = run_of(name)
    np.testing.assert_array_equal(again.torque, usual(name).torque)


@every
def test_copies_are_the_same_law(name: str) -> None:
    copied = pickle.loads(pickle.dumps(case(name)[2]))
    np.testing.assert_array_equal(run_of(name, copied).torque, usual(name).torque)


@every
def test_snapshots_take_its_memory_along(name: str) -> None:
    robot, state, law = case(name)
    simulation = hs.Simulation(robot, law, state=state, pushes=PUSH, control_period=1e-3)
    simulation.advance(0.03)
    before = simulation.snapshot()
    simulation.advance(0.05)
    once = simulation.state
    simulation.restore(before)
    simulation.advance(0.05)
    np.testing.assert_array_equal(simulation.state.q, once.q)
    np.testing.assert_array_equal(simulation.state.v, once.v)


@every
def test_batches_are_runs(name: str) -> None:
    robot, state, law = case(name)
    batch = hs.simulate_batch(
        robot, law, state=[state, state], duration=0.03, pushes=PUSH, control_period=1e-3
    )
    rows = run_of(name, duration=0.03).position
    for k in range(2):
        np.testing.assert_allclose(batch.position[k], rows[-1], rtol=0.0, atol=1e-12)


@every
def test_under_events_it_does_the_same(name: str) -> None:
    """Methods differ by the error of time stepping, of first order in a step of 1 ms."""
    exact = run_of(name, method=hs.EventDriven(rtol=1e-6))
    np.testing.assert_allclose(exact.final_state.q, usual(name).final_state.q, rtol=0.0, atol=1e-3)


@every
def test_what_it_logs_has_names_and_units(name: str) -> None:
    run = usual(name)
    dataset = run.to_dataset()
    for member in run.log:
        values = run.log[member].values
        assert len(values) == len(run.time)
        assert np.all(np.isfinite(values))
        assert f"log_{member}" in dataset
