"""Figures that an engineer signs, against the gait and against each other."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import walking
from synthetic_runs import make_run, pendulum

from heelstrike.analysis import cost_of_transport, limits, measures, motor_loads, tracking_error


def test_a_walk_measures_as_its_gait_was_designed() -> None:
    run, gait = walking.walk(steps=10), walking.gait()
    found = {each.name: each for each in measures(run, gait)}
    assert found["walking speed"].value == pytest.approx(0.30 / 0.70, rel=0.01)
    assert found["duration of a step"].value == pytest.approx(0.70, abs=1e-3)
    # Of all touchdowns the largest, by steps of 1 ms; the foot is still above the ground before it.
    impulse, velocity = gait.margins.impulse, -gait.margins.landing_velocity
    assert found["touchdown impulse, largest"].value == pytest.approx(impulse, rel=0.05)
    assert velocity < found["touchdown velocity, largest"].value < 1.3 * velocity
    clearance = found["clearance of the swing foot, least"].value
    assert 0.6 * 1e3 * gait.clearance < clearance < 1e3 * gait.clearance
    assert found["slip of a pressed contact point"].value == 0.0
    assert found["tracking error, largest"].value == tracking_error(run, gait).max
    assert found["change of a state after two steps, last"].value < 1e-6
    assert "tracking error, largest" not in {each.name for each in measures(run)}


def test_powers_add_up_to_the_cost_of_transport() -> None:
    run = walking.walk(steps=10)
    loads = motor_loads(run)
    transport = cost_of_transport(run)
    work = sum(load.mean_power for load in loads) * (run.time[-1] - run.time[0])
    spent = transport.absolute * run.robot.weight * transport.distance
    assert work == pytest.approx(spent, rel=1e-9)
    found = {each.name: each.value for each in measures(run)}
    assert found["cost of transport"] == transport.absolute
    mean = sum(load.mean_power for load in loads)
    assert found["mechanical power, mean of all motors"] == pytest.approx(mean, rel=1e-9)


def test_one_motor_by_hand() -> None:
    """Torques act from each row to the next; the last row's acts on nothing."""
    run = make_run(
        pendulum(), [0.0, 0.1, 0.2], velocity=[[2.0], [2.0], [-4.0]], torque=[[3.0], [-4.0], [9.0]]
    )
    (load,) = motor_loads(run)
    assert load.peak_torque == 9.0
    assert load.rms_torque == pytest.approx(np.sqrt((9.0 + 16.0) / 2.0))
    assert load.peak_speed == 4.0
    assert load.peak_power == pytest.approx(6.0)  # 3 × 2; -4 × (2 - 4)/2 is 4
    assert load.mean_power == pytest.approx(5.0)


def test_speed_of_a_motor_against_its_line() -> None:
    model = pendulum().model.replaced(stall_torque=np.array([50.0]), no_load_speed=np.array([10.0]))
    robot = dataclasses.replace(pendulum(), model=model)
    run = make_run(robot, [0.0, 0.1], velocity=[[4.0], [-8.0]], torque=[[6.0], [-5.0]])
    speed, torque = (
        next(each for each in limits(run) if each.kind == kind) for kind in ("speed", "torque")
    )
    assert (speed.used, speed.time) == (pytest.approx(0.8), 0.1)
    assert torque.used == pytest.approx(0.5)  # 5 of the 10 N m that are left at 8 rad/s
    until = limits(run, until=0.05)
    assert next(each for each in until if each.kind == "speed").used == pytest.approx(0.4)


def test_nothing_is_measured_of_nothing() -> None:
    assert measures(make_run(pendulum(), [])) == ()
