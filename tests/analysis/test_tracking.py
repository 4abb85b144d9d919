"""The reference that a run followed is found from the run."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import walking
from synthetic_runs import make_run, pendulum

import heelstrike as hs
from heelstrike.analysis import reference_motion, tracking_error
from heelstrike.analysis.tracking import EARLIEST, LATEST


class Watched:
    """Computed torque that notes which foot it stands on and when its step began."""

    def __init__(self) -> None:
        self.inner = hs.ComputedTorque(walking.bravo7(), walking.gait())
        self.stance: list[int] = []
        self.start: list[float] = []

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        torque = self.inner.torque(t, state, contacts)  # type: ignore[arg-type]
        self.stance.append(self.inner.remembered.stance)
        self.start.append(self.inner.remembered.start)
        return torque


@pytest.mark.parametrize("push", [0.0, 0.04, -0.01], ids=["undisturbed", "early", "late"])
def test_reference_is_the_one_the_controller_followed(push: float) -> None:
    """Also when a push makes the robot land early or late."""
    gait = walking.gait()
    controller = Watched()
    state = hs.State(gait.initial_state.q, gait.initial_state.v)
    state.v[0] += push
    run = hs.simulate(walking.bravo7(), controller, state=state, duration=2.5)
    reference = reference_motion(run, gait)
    rows = len(run.time)
    assert rows > 1000
    np.testing.assert_array_equal(reference.stance, controller.stance[:rows])
    np.testing.assert_allclose(run.time - reference.phase, controller.start[:rows], atol=1e-9)


def test_reference_of_a_punctual_walk_is_the_gait() -> None:
    gait, run = walking.gait(), walking.walk(steps=4)
    reference = reference_motion(run, gait)
    early = run.time < 0.69
    np.testing.assert_allclose(
        reference.position[early], gait.position(run.time[early]), atol=1e-12
    )
    np.testing.assert_allclose(
        reference.velocity[early], gait.velocity(run.time[early]), atol=1e-12
    )
    second = (run.time > 0.71) & (run.time < 1.39)
    late_by = reference.starts[1] - gait.step_duration
    np.testing.assert_allclose(
        reference.position[second], gait.position(run.time[second] - late_by), atol=1e-12
    )


def test_reference_of_a_late_step_goes_on_and_then_rests() -> None:
    """Standing in the air for two steps: nothing ever lands."""
    gait = walking.gait()
    duration = gait.step_duration
    run = make_run(walking.bravo7(), np.linspace(0.0, 2.0 * duration, 201))
    reference = reference_motion(run, gait)
    assert reference.starts == (0.0,)
    a0, a1, a2, a3 = gait.coefficients
    t = 1.05 * duration
    row = int(np.searchsorted(run.time, t - 1e-9))
    np.testing.assert_allclose(reference.position[row], a0 + a1 * t + a2 * t**2 + a3 * t**3)
    np.testing.assert_allclose(reference.velocity[row], a1 + 2.0 * a2 * t + 3.0 * a3 * t**2)
    resting = run.time > LATEST * duration
    t = LATEST * duration
    held = a0 + a1 * t + a2 * t**2 + a3 * t**3
    np.testing.assert_allclose(reference.position[resting], np.tile(held, (resting.sum(), 1)))
    np.testing.assert_array_equal(reference.velocity[resting], 0.0)


def test_constants_are_those_of_the_controller() -> None:
    gait = walking.gait()
    parameters = hs.ComputedTorque(walking.bravo7(), gait).parameters
    assert parameters.earliest == EARLIEST * gait.step_duration
    assert parameters.latest == pytest.approx(LATEST * gait.step_duration)


def test_error_is_measured_minus_reference() -> None:
    gait, run = walking.gait(), walking.walk(steps=1)
    error = tracking_error(run, gait)
    shifted = run.position.copy()
    joint = run.robot.model.actuator_joint[2]
    shifted[:, joint] += 0.01
    moved = tracking_error(dataclasses.replace(run, position=shifted), gait)
    np.testing.assert_allclose(moved.position[:, 2] - error.position[:, 2], 0.01, atol=1e-12)
    np.testing.assert_array_equal(moved.position[:, 0], error.position[:, 0])
    assert moved.max == pytest.approx(np.abs(moved.position).max())
    assert moved.rms == pytest.approx(np.sqrt(np.mean(moved.position**2)))
    assert np.abs(moved.position[:, 2]).max() >= 0.01


def test_thinned_record_gives_the_same_reference() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    thin = hs.simulate(
        robot,
        hs.ComputedTorque(robot, gait),
        state=gait.initial_state,
        duration=2.1,
        record_every=10,
    )
    full = reference_motion(walking.walk(steps=3), gait)
    np.testing.assert_allclose(
        reference_motion(thin, gait).position, full.position[::10][: len(thin.time)], atol=1e-12
    )


def test_gait_of_another_robot() -> None:
    run = hs.simulate(pendulum(), state=hs.State([0.3], [0.0]), duration=0.01)
    with pytest.raises(hs.GaitError, match="pendulum"):
        reference_motion(run, walking.gait())
