"""Energy is accounted for, and the time method's error with it."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from synthetic_runs import box, pendulum

import heelstrike as hs
from heelstrike.analysis import energy_balance
from heelstrike.robot import RobotBuilder
from heelstrike.sim import EventKind

G = 9.81


def test_free_fall_loses_exactly_what_the_scheme_loses() -> None:
    """After k steps of semi-implicit Euler a body has fallen g h² k (k + 1) / 2 at g h k.

    Its energy differs from that of the true fall by −m g² h t / 2: the residual.
    """
    robot, h = box(height=3.0), 1e-3
    run = hs.simulate(
        robot, state=robot.reference_state(), duration=0.4, method=hs.TimeStepping(step=h)
    )
    balance = energy_balance(run)
    np.testing.assert_allclose(balance.kinetic, 0.5 * 2.0 * (G * run.time) ** 2, rtol=1e-10)
    np.testing.assert_allclose(balance.residual, -0.5 * 2.0 * G**2 * h * run.time, atol=1e-9)
    np.testing.assert_array_equal(balance.actuators, 0.0)
    np.testing.assert_array_equal(balance.contacts, 0.0)


def test_plastic_landing_takes_the_kinetic_energy() -> None:
    """What a block has on landing is lost to the ground, all of it, whatever the step."""
    robot, h = box(height=0.05 + 0.2), 1e-3
    run = hs.simulate(
        robot,
        state=robot.reference_state(),
        duration=0.4,
        method=hs.TimeStepping(step=h),
        stop_when_fallen=False,
    )
    balance = energy_balance(run)
    # The scheme resolves the height of the fall to v h, and that is the error of m g 0.2 m.
    assert balance.contacts[-1] == pytest.approx(-2.0 * G * 0.2, abs=2.0 * G * 2.0 * h)
    assert np.all(np.diff(balance.contacts) <= 1e-12)
    assert balance.total[-1] == pytest.approx(balance.potential[-1], abs=1e-12)


def test_sliding_friction_takes_the_kinetic_energy() -> None:
    """Friction does −μ m g s, and the mean velocity of each step makes that exact."""
    robot = box()
    run = hs.simulate(
        robot,
        state=hs.State(robot.model.reference, np.array([2.0, 0.0, 0.0])),
        duration=0.5,
        ground=hs.Ground(friction=0.5),
    )
    balance = energy_balance(run)
    assert balance.contacts[-1] == pytest.approx(-0.5 * 2.0 * 2.0**2, rel=1e-9)
    np.testing.assert_allclose(balance.residual, 0.0, atol=1e-9)


class Push:
    """Turn a joint with a constant torque."""

    def __init__(self, torque: float) -> None:
        self.value = torque

    def torque(self, t: float, state: object, contacts: object) -> np.ndarray:
        return np.array([self.value])


def test_driven_damped_pendulum() -> None:
    """Work of motor and damper explain the energy, with an error that falls with the step."""
    robot = pendulum(damping=0.8)
    residuals = []
    for h in (2e-3, 1e-3, 5e-4):
        run = hs.simulate(
            robot,
            Push(6.0),
            state=robot.reference_state(),
            duration=2.0,
            method=hs.TimeStepping(step=h),
        )
        balance = energy_balance(run)
        turned = run.position[-1, 0] - run.position[0, 0]
        assert balance.actuators[-1] == pytest.approx(6.0 * turned, rel=5.0 * h)
        # Only where the joint turns back can the mean and the old velocity differ in sign.
        assert np.all(np.diff(balance.dampers) < 1e-6)
        residuals.append(np.abs(balance.residual).max())
    orders = np.log2(np.array(residuals[:-1]) / residuals[1:])
    assert np.all(np.abs(orders - 1.0) < 0.1), orders


def test_joint_stop_takes_what_the_pendulum_brings() -> None:
    """From −60° at rest it arrives at +60° with the motor's work; the plastic stop takes it."""
    robot, h = pendulum(limited=True), 1e-3
    start = np.deg2rad(-60.0)
    run = hs.simulate(
        robot,
        Push(3.0),
        state=hs.State([start], [0.0]),
        duration=2.0,
        method=hs.TimeStepping(step=h),
    )
    balance = energy_balance(run)
    after = int(np.argmax(balance.stops < -1.0)) + 2
    assert run.position[after, 0] == pytest.approx(np.deg2rad(60.0), abs=1e-4)
    work = 3.0 * np.deg2rad(120.0)
    assert balance.actuators[after] == pytest.approx(work, rel=5e-3)
    assert balance.stops[after] == pytest.approx(-work, rel=2e-2)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["upper", "lower"])
def test_joint_stop_between_rows(side: float) -> None:
    """The same when the stop is reached in an instant: what no work explains is of sampling."""
    robot, start = pendulum(limited=True), -side * np.deg2rad(60.0)
    run = hs.simulate(
        robot,
        Push(side * 3.0),
        state=hs.State([start], [0.0]),
        duration=2.0,
        method=hs.EventDriven(),
    )
    balance = energy_balance(run)
    after = int(np.argmax(balance.stops < -1.0))
    assert balance.kinetic[after] == pytest.approx(0.0, abs=1e-4)
    assert balance.stops[after] == pytest.approx(-3.0 * np.deg2rad(120.0), rel=1e-5)
    np.testing.assert_allclose(balance.residual, 0.0, atol=1e-5)


@pytest.mark.parametrize("kind", ["brake", "dry friction"])
def test_a_joint_that_comes_to_rest_between_rows(kind: str) -> None:
    """Friction of 2000 N m stops 0.5 kg m² at 2 rad/s in 0.5 ms, and takes ½ I ω², all of it.

    The torque is gone in the row in which the joint rests; the one before it is half a period away.
    """
    build = RobotBuilder("wheel")
    dry = 2000.0 if kind == "dry friction" else 0.0
    build.hinge("turn", None, mass=1.0, inertia=0.5, center_of_mass=(0.0, 0.0), dry_friction=dry)
    build.brake("turn", limit=2000.0)
    simulation = hs.Simulation(
        build.build(), state=hs.State([0.0], [2.0]), method=hs.EventDriven(), stop_when_fallen=False
    )
    simulation.braked = ["turn"] if kind == "brake" else []
    simulation.advance(0.01)
    run = simulation.record
    assert [event.kind for event in run.events][-1] is EventKind.JOINT_STICK
    balance = energy_balance(run)
    taken = balance.brakes if kind == "brake" else balance.dry_friction
    assert taken[-1] == pytest.approx(-0.5 * 0.5 * 2.0**2, rel=1e-9)
    np.testing.assert_allclose(balance.residual, 0.0, atol=1e-9)


def test_walk() -> None:
    """Over a steady walk motors give what impacts take, and hard contact gives nothing.

    The step keeps a foot at rest in the pose of its beginning, so that the foot's velocity in the
    pose of its end is of order h, and so is the work of the ground on a foot at rest. So is what
    positions gain on velocities in the step of an impact, 1.5 % of its energy a millisecond.
    """
    balance = energy_balance(walking.walk(steps=4, step=5e-4))
    given_by_ground = np.maximum(np.diff(balance.contacts), 0.0).sum()
    assert given_by_ground < 1e-2 * -balance.contacts[-1]
    start, end = np.searchsorted(balance.time, (1.4 + 0.35, 2.1 + 0.35))
    given = balance.actuators[end] - balance.actuators[start]
    taken = balance.contacts[end] - balance.contacts[start]
    assert given == pytest.approx(-taken, rel=0.01)
    # What no work explains is the error of a method of first order.
    finer = energy_balance(walking.walk(steps=4, step=2.5e-4))
    ratio = np.abs(balance.residual).max() / np.abs(finer.residual).max()
    assert ratio == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_impacts_between_events_take_their_energy(restitution: float) -> None:
    """A falling box loses (1 − e²) of its energy at the first impact, which is in an event."""
    robot = box(height=0.05 + 0.2)
    fall = np.sqrt(2.0 * 0.2 / G)
    run = hs.simulate(
        robot,
        state=robot.reference_state(),
        duration=1.2 * fall,
        method=hs.EventDriven(),
        ground=hs.Ground(restitution=restitution),
        stop_when_fallen=False,
    )
    balance = energy_balance(run)
    lost = (1.0 - restitution**2) * 2.0 * G * 0.2
    assert balance.contacts[-1] == pytest.approx(-lost, rel=1e-8)
    np.testing.assert_allclose(balance.residual, 0.0, atol=1e-8)


def test_event_driven_walk_balances() -> None:
    """Motors put in what impacts take out; the trapezium over 1 ms is the only error."""
    run = hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state,
        duration=1.5,
        method=hs.EventDriven(),
    )
    balance = energy_balance(run)
    assert balance.contacts[-1] < -1.0
    assert np.all(np.diff(balance.contacts) <= 1e-9)
    np.testing.assert_allclose(balance.residual, 0.0, atol=2e-3)


def test_event_driven_walk() -> None:
    """Impacts go where the velocities jump, however near rows of the output period are to them.

    The work of smooth torques is summed at 1 ms: some 1e-5 J after ten steps.
    """
    run = hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state,
        duration=10.0 * walking.STEP_DURATION,
        method=hs.EventDriven(),
    )
    balance = energy_balance(run)
    assert balance.contacts[-1] < -30.0
    np.testing.assert_allclose(balance.residual, 0.0, atol=1e-4)
