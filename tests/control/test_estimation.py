"""The estimator against the best filtered difference under the same noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control.estimation import carry_trunk
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.held import HeldRobot
from heelstrike.sim.controller.interface import Contacts


def errors_of_differences(measured: np.ndarray, true: np.ndarray, cutoff: float) -> np.ndarray:
    """Errors (rad/s) of a first-order filter of differences of what was measured."""
    turned = 2.0 * np.pi * cutoff * 1e-3
    velocity, errors = true[0], [0.0 * true[0]]
    for k in range(1, len(measured)):
        rate = (measured[k] - measured[k - 1]) / 1e-3
        velocity = velocity + turned / (1.0 + turned) * (rate - velocity)
        errors.append(velocity - true[k])
    return np.array(errors)


def mean(errors: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))


class Again:
    """Gives the torques of a run once more, one row a call."""

    def __init__(self, run: hs.Run) -> None:
        self.rows = iter(run.torque)

    def torque(self, t: float, state: Any, contacts: Any) -> Any:
        return next(self.rows)


def seen_again(run: hs.Run, steps: int, **sensors: Any) -> tuple[np.ndarray, np.ndarray]:
    """What sensors and estimator would have made of a run: joint positions, joint velocities."""
    wrapper = hs.Sensed(hs.Estimated(Again(run)), **sensors)
    wrapper.robot = run.robot
    measured, estimated = [], []
    for k in range(steps):
        force = run.contact_force[k - 1] if k else np.zeros_like(run.contact_force[0])
        contacts = Contacts(
            position=run.contact_point[k], normal=run.contact_normal[k], gap=run.gap[k], force=force
        )
        state = hs.State(run.position[k], run.velocity[k])
        wrapper.torque(float(run.time[k]), state, contacts)
        log = wrapper._asked.numbers.log  # type: ignore[union-attr]
        told = {name: values.copy() for name, _, values in log.views()}
        measured.append(told["measured_position"][3:])
        estimated.append(told["estimated_velocity"][3:])
    return np.array(measured), np.array(estimated)


@pytest.mark.parametrize(("bits", "noise"), [(14, 1e-4), (12, 0.0), (14, 1e-3)])
@pytest.mark.slow
def test_half_the_error_of_the_best_difference(bits: int, noise: float) -> None:
    """A walk of four steps, seen with the noise of encoders, 1e-4 rad of pitch and 5 N."""
    run, steps = walking.walk(), 2800
    measured, estimated = seen_again(
        run, steps, encoders=hs.Encoders(bits=bits, noise=noise), seed=1,
        imu=hs.InertialUnit(noise=1e-4), feet=hs.FootSensors(noise=5.0),
    )  # fmt: skip
    true = run.velocity[:steps, 3:]
    error = estimated - true
    others = [errors_of_differences(measured, true, f) for f in np.geomspace(2.0, 400.0, 30)]
    best = min(others, key=mean)
    assert mean(error) <= 0.5 * mean(best)
    # At a touchdown the velocities jump by some rad/s; the estimate jumps with them.
    landings = [event.time for event in run.events if event.kind.name == "TOUCHDOWN"]
    near = np.min(np.abs(run.time[:steps, None] - np.array(landings)), axis=1) < 10e-3
    assert near.sum() > 50
    assert np.abs(np.diff(true, axis=0)).max() > 1.0
    assert mean(error[near]) <= 0.5 * min(mean(other[near]) for other in others)


@pytest.mark.slow
def test_a_robot_walks_on_its_estimate() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    controller = hs.Sensed(
        hs.Estimated(hs.ComputedTorque(robot, gait)), seed=1,
        encoders=hs.Encoders(bits=14, noise=1e-4),
        imu=hs.InertialUnit(noise=1e-4), feet=hs.FootSensors(noise=5.0),
    )  # fmt: skip
    run = hs.simulate(robot, controller, state=gait.initial_state, duration=2.8)
    assert run.completed, run.message
    error = run.log["estimated_velocity"].values - run.velocity
    assert mean(error) < 0.01


@pytest.mark.slow
def test_a_push_that_the_model_does_not_know_is_followed() -> None:
    """After the push the estimate comes back within the filter's time."""
    robot = walking.bravo7()
    start = walking.gait().initial_state
    push = hs.Push("trunk", force=(100.0, 0.0), start=0.02, duration=0.02)
    wrapper = hs.Estimated(hs.ComputedTorque(robot, walking.gait()))
    run = hs.simulate(robot, wrapper, state=start, duration=0.25, pushes=push)
    assert run.completed, run.message
    error = np.abs(run.log["estimated_velocity"].values - run.velocity).max(axis=1)
    assert error[40] > 0.01
    assert error[200] < 0.2 * error[40]


@pytest.mark.slow
def test_without_noise_the_estimate_is_the_state() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    controller = hs.Estimated(hs.ComputedTorque(robot, gait))
    run = hs.simulate(robot, controller, state=gait.initial_state, duration=0.65)
    position, velocity = (run.log[f"estimated_{name}"].values for name in ("position", "velocity"))
    assert np.abs(position - run.position).max() < 2e-5
    assert np.abs(velocity - run.velocity).max() < 1e-2
    assert np.abs(run.velocity).max() > 1.0


def test_what_an_estimator_needs() -> None:
    robot = walking.bravo7()
    law = hs.ComputedTorque(robot, walking.gait())
    with pytest.raises(hs.ControllerError, match="bandwidth"):
        hs.Estimated(law, bandwidth=-1.0)


def test_the_trunk_goes_with_corrected_joints_in_x_and_in_z() -> None:
    """Corrections of a leg's joints move the trunk so that its foot, on average, stays."""
    robot = walking.bravo7()
    q = walking.gait().initial_state.q
    for points in ([0], [0, 1], [0, 1, 2]):
        held = HeldRobot.on(Evaluation(robot, q), points).rows
        change = np.random.default_rng(3).normal(size=robot.nv)
        corrected = change.copy()
        carry_trunk(len(points), held, corrected)
        rates = dynamics.contact_jacobian(robot, q, points) @ corrected
        np.testing.assert_allclose(rates.mean(axis=0), 0.0, atol=1e-13)
        np.testing.assert_array_equal(corrected[2:], change[2:])
        assert np.abs(corrected[:2] - change[:2]).min() > 0.01
