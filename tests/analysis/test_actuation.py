"""What the motors spend."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from synthetic_runs import make_run, pendulum

import heelstrike as hs
from heelstrike.analysis import cost_of_transport, torque_cost


def moving(torque: np.ndarray, speed: np.ndarray, distance: float, time: np.ndarray) -> hs.Run:
    """Make a run of bravo7 carried along, its first actuator at work."""
    robot = walking.bravo7()
    q = np.tile(robot.model.reference, (len(time), 1))
    q[:, 0] = distance * time / time[-1]
    v = np.zeros((len(time), robot.nv))
    v[:, robot.model.actuator_joint[0]] = speed
    tau = np.zeros((len(time), robot.nu))
    tau[:, 0] = torque
    return make_run(robot, time, position=q, velocity=v, torque=tau)


def test_constant_power() -> None:
    """2 N m at 3 rad/s for 1 s over 1.5 m: 6 J / (m g 1.5 m)."""
    time = np.linspace(0.0, 1.0, 11)
    run = moving(np.full(11, 2.0), np.full(11, 3.0), 1.5, time)
    cost = cost_of_transport(run)
    expected = 6.0 / (75.0 * 9.81 * 1.5)
    assert cost.absolute == pytest.approx(expected, rel=1e-12)
    assert cost.positive == pytest.approx(expected, rel=1e-12)
    assert cost.distance == pytest.approx(1.5)
    assert torque_cost(run) == pytest.approx(4.0)
    assert torque_cost(run, start=0.2, end=0.5) == pytest.approx(4.0 * 0.3)


def test_braking_costs_only_in_the_absolute_figure() -> None:
    time = np.linspace(0.0, 1.0, 11)
    torque = np.where(time < 0.45, 2.0, -2.0)  # five steps of driving, five of braking
    cost = cost_of_transport(moving(torque, np.full(11, 3.0), -1.5, time))
    weight_times_distance = 75.0 * 9.81 * 1.5
    assert cost.absolute == pytest.approx(6.0 / weight_times_distance, rel=1e-12)
    assert cost.positive == pytest.approx(3.0 / weight_times_distance, rel=1e-12)
    assert cost.distance == pytest.approx(-1.5)


def test_going_nowhere_has_no_cost_of_transport() -> None:
    run = hs.simulate(pendulum(), state=hs.State([0.0], [0.0]), duration=0.01)
    assert np.isnan(cost_of_transport(run).absolute)
    assert np.isnan(cost_of_transport(run).positive)


def test_walk_costs_what_its_gait_promises() -> None:
    """Before the first touchdown the torques are those the optimiser weighed (paper eq. 40)."""
    run = walking.walk(steps=1, step=1e-4)
    assert torque_cost(run, end=0.69) == pytest.approx(walking.gait().cost, rel=0.05)
