"""The estimator against the best filtered difference under the same noise."""

from __future__ import annotations

import numpy as np
import pytest
import walking

import heelstrike as hs


def errors_of_differences(run: hs.Run, cutoff: float) -> np.ndarray:
    """Errors (rad/s) of a first-order filter of differences of what was measured."""
    seen, true = run.log["measured_position"].values[:, 3:], run.velocity[:, 3:]
    turned = 2.0 * np.pi * cutoff * 1e-3
    velocity, errors = true[0], [0.0 * true[0]]
    for k in range(1, len(seen)):
        rate = (seen[k] - seen[k - 1]) / 1e-3
        velocity = velocity + turned / (1.0 + turned) * (rate - velocity)
        errors.append(velocity - true[k])
    return np.array(errors)


def mean(errors: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_half_the_error_of_the_best_difference(noise: float) -> None:
    """Walking under the estimate, four steps, touchdowns included.

    Noise: encoders of 14 bits with as much noise as told, pitch 1e-4 rad, forces 5 N.
    """
    robot, gait = walking.bravo7(), walking.gait()
    controller = hs.Sensed(
        robot, hs.Estimated(robot, hs.ComputedTorque(robot, gait)), seed=1,
        encoders=hs.Encoders(bits=14, noise=noise),
        inertial=hs.InertialUnit(noise=1e-4), feet=hs.FootSensors(noise=5.0),
    )  # fmt: skip
    run = hs.simulate(robot, controller, state=gait.initial_state, duration=2.8)
    assert run.completed, run.message
    assert run.summary().steps >= 3
    error = (run.log["estimated_velocity"].values - run.velocity)[:, 3:]
    others = [errors_of_differences(run, cutoff) for cutoff in np.geomspace(2.0, 400.0, 30)]
    best = min(others, key=mean)
    assert mean(error) <= 0.5 * mean(best)
    # At a touchdown the velocities jump by some rad/s; the estimate jumps with them.
    landings = [event.time for event in run.events if event.kind.name == "TOUCHDOWN"]
    near = np.min(np.abs(run.time[:, None] - np.array(landings)), axis=1) < 10e-3
    assert np.abs(np.diff(run.velocity[:, 3:], axis=0)).max() > 1.0
    assert mean(error[near]) <= 0.5 * min(mean(other[near]) for other in others)


def test_without_noise_the_estimate_is_the_state() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    controller = hs.Estimated(robot, hs.ComputedTorque(robot, gait))
    run = hs.simulate(robot, controller, state=gait.initial_state, duration=0.65)
    position, velocity = (run.log[f"estimated_{name}"].values for name in ("position", "velocity"))
    assert np.abs(position - run.position).max() < 2e-5
    assert np.abs(velocity - run.velocity).max() < 1e-2
    assert np.abs(run.velocity).max() > 1.0


def test_what_an_estimator_needs() -> None:
    robot = walking.bravo7()
    law = hs.ComputedTorque(robot, walking.gait())
    with pytest.raises(hs.ControllerError, match="bandwidth"):
        hs.Estimated(robot, law, bandwidth=-1.0)
