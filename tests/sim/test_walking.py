"""bravo7 walks: the figures that the simulator promises for its reference walk."""

from __future__ import annotations

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.sim import EventKind, RunStatus, Scheme


@pytest.mark.parametrize(("step", "tracking"), [(1e-3, 2e-3), (1e-4, 1e-3)])
def test_twenty_steps(step: float, tracking: float) -> None:
    run = walking.walk(step=step)
    summary = run.summary(gait=walking.gait())
    assert run.status is RunStatus.COMPLETED
    assert summary.steps == 20
    assert summary.tracking_rms_rad <= tracking
    assert -0.1 <= summary.zmp_min_m < summary.zmp_max_m <= 0.1
    assert summary.friction_use_max <= 1.0
    assert summary.slip_max_m <= 1e-4
    assert summary.penetration_max_m <= 1e-9
    assert summary.complementarity_max <= 1e-9
    assert run.solver.failures == 0
    # The robot really went somewhere: each step takes it one step length further.
    assert summary.distance_m == pytest.approx(6.0, abs=0.05)


def test_tracking_error_falls_with_the_step() -> None:
    """Touchdown is known to within a step, and so is the phase: first order in h."""
    errors = [
        walking.walk(steps=4, step=step).summary(gait=walking.gait()).tracking_rms_rad
        for step in (2e-3, 1e-3, 5e-4)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 0.8), orders


@pytest.mark.parametrize("scheme", [Scheme.PAPER_EXPLICIT, Scheme.PAPER_SYMPLECTIC])
def test_the_papers_ordering_walks_but_chatters(scheme: Scheme) -> None:
    """Eq. 23-26 as they stand: the robot walks, and its flat feet lose and regain the ground.

    Velocities are constrained where the old position touches, so that a foot at rest drifts by
    O(h²) a step; drifting up it is free until it has fallen back.
    """
    run = walking.walk(step=1e-4, scheme=scheme)
    assert run.status is RunStatus.COMPLETED
    assert run.certificates.complementarity <= 1e-9
    assert run.certificates.penetration <= 1e-4
    touchdowns = sum(event.kind is EventKind.TOUCHDOWN for event in run.events)
    assert touchdowns > 40  # two points a step in twenty steps would be forty


def test_every_step_lands_flat_and_at_the_right_place() -> None:
    run = walking.walk(step=1e-4)
    touchdowns = [event for event in run.events if event.kind is EventKind.TOUCHDOWN]
    assert len(touchdowns) == 40
    times = np.array([event.time for event in touchdowns]).reshape(20, 2)
    np.testing.assert_allclose(times, np.outer(np.arange(1, 21) * 0.7, [1, 1]), atol=2e-3)
    # Left and right alternate, both points of a foot together.
    feet = [event.contact // 2 for event in touchdowns]
    first = 1 - walking.gait().stance_foot
    assert feet == [first, first, 1 - first, 1 - first] * 10


def test_runs_repeat_bit_for_bit() -> None:
    first = walking.walk(steps=2)
    walking.walk.cache_clear()
    second = walking.walk(steps=2)
    for name in ("position", "velocity", "torque", "contact_force", "gap"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_a_python_controller_does_what_the_compiled_one_does() -> None:
    """The same law called from Python every step gives the same run but for rounding.

    The loop computes kinematics in straight-line code, which rounds otherwise than the loops that
    the controller uses by itself; feedback keeps the difference as small as it begins.
    """
    robot, gait = walking.bravo7(), walking.gait()
    compiled = hs.ComputedTorque(robot, gait)

    class Slow:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return compiled.torque(t, state, contacts)  # type: ignore[arg-type]

    slow = hs.simulate(robot, Slow(), state=gait.initial_state, duration=1.4)
    fast = hs.simulate(robot, compiled, state=gait.initial_state, duration=1.4)
    np.testing.assert_allclose(slow.position, fast.position, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(slow.contact_force, fast.contact_force, rtol=0.0, atol=1e-7)
    assert [(event.time, event.kind) for event in slow.events] == [
        (event.time, event.kind) for event in fast.events
    ]


def test_torques_are_held_between_the_controllers_instants() -> None:
    """A controller at 1 kHz on steps of 0.1 ms walks as well, though it sees touchdowns late."""
    robot, gait = walking.bravo7(), walking.gait()
    run = hs.simulate(
        robot,
        hs.ComputedTorque(robot, gait),
        state=gait.initial_state,
        duration=7.0,
        method=hs.TimeStepping(step=1e-4),
        control_period=1e-3,
    )
    assert run.completed
    assert run.summary(gait=gait).tracking_rms_rad <= 1e-3
    changes = np.flatnonzero(np.any(np.diff(run.torque, axis=0) != 0.0, axis=1)) + 1
    assert len(changes) > 6900
    assert np.all(changes % 10 == 0)


def test_the_torque_of_the_walk_is_that_of_the_gait() -> None:
    """No spike at touchdown: the cost of a step is the designed one, to first order in h."""
    designed = walking.gait().cost
    for step, excess in ((1e-3, 0.2), (1e-4, 0.02)):
        summary = walking.walk(step=step).summary(gait=walking.gait())
        assert summary.torque_cost_N2m2s / 20 == pytest.approx(designed, rel=excess)
