"""What a controller knows: another robot than the one that moves, its period, and trials."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs

METHODS = [hs.TimeStepping(), hs.EventDriven(rtol=1e-6)]


def heavier(robot: hs.Robot, factor: float) -> hs.Robot:
    """The same robot with all masses and inertias multiplied."""
    from dataclasses import replace

    model = robot.model
    return replace(
        robot,
        model=model.replaced(mass=factor * model.mass, inertia=factor * model.inertia),
    )


@hs.controller
def bears(state, robot, torque):
    """Bear the weight, as the robot that is known has it."""
    robot.gravity_force(state, torque)


@pytest.mark.parametrize("compiles", [True, False])
@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_law_keeps_to_the_robot_it_knows(method: Any, compiles: bool) -> None:
    robot = walking.bravo7()
    nominal = heavier(robot, 2.0)
    function = bears if compiles else hs.controller(compile=False)(bears.python)
    first = {}
    for name, law in (("true", function()), ("wrong", function(robot=nominal))):
        options = {"control_period": 1e-3, "method": method, "duration": 0.002}
        run = hs.simulate(robot, law, state=walking.gait().initial_state, **options)
        assert run.completed, run.message
        first[name] = run.torque[0]
    assert np.abs(first["true"]).max() > 1.0
    np.testing.assert_allclose(first["wrong"], 2.0 * first["true"], rtol=1e-9, atol=1e-12)


def test_a_stock_law_keeps_to_the_robot_it_was_made_for() -> None:
    robot, gait = walking.bravo7(), walking.gait()
    light = heavier(robot, 0.8)
    state = gait.initial_state
    known, wrong = (hs.ComputedTorque(each, gait) for each in (robot, light))
    same = hs.ComputedTorque(heavier(robot, 1.0), gait)  # equal numbers: nothing is wrong
    runs = [hs.simulate(robot, law, state=state, duration=0.002) for law in (known, wrong, same)]
    np.testing.assert_array_equal(runs[2].torque, runs[0].torque)
    # Within a step the law's torques are linear in the masses of the robot it believes in.
    np.testing.assert_allclose(runs[1].torque[0], 0.8 * runs[0].torque[0], rtol=1e-9)


def test_a_robot_built_otherwise_is_refused() -> None:
    robot = walking.bravo7()
    with pytest.raises(hs.ControllerError, match="structure differs"):
        hs.simulate(
            robot, bears(robot=hs.load_robot("rabbit")), state=robot.reference_state(), duration=0.1
        )


def test_a_law_brings_its_period() -> None:
    robot = walking.bravo7()
    simulation = hs.Simulation(robot, bears(period=5e-3), state=robot.reference_state())
    simulation.advance(0.021)
    torque = simulation.record.torque
    assert len(np.unique(torque[:, 0])) == 5
    asked = hs.Simulation(
        robot, bears(period=5e-3), state=robot.reference_state(), control_period=1e-3
    )
    asked.advance(0.021)
    assert len(np.unique(asked.record.torque[:, 0])) > 15
    with pytest.raises(hs.ControllerError, match="period"):
        bears(period=0.0)
    with pytest.raises(hs.SimulationError, match="whole number of steps"):
        hs.simulate(robot, bears(period=1.5e-3), state=robot.reference_state(), duration=0.1)


class Plan(hs.Bundle):
    """A plan that is made again every 2 ms."""

    made: float = hs.cell(float)
    goal: float = hs.cell(float)
    plans: int = hs.cell(int)


class Whether(hs.Bundle):
    """Whether plans are left alone within steps."""

    patient: int = hs.number(int)


@hs.controller
def plans(t, state, robot, parameters: Whether, memory: Plan, torque):
    """Follow a goal that jumps whenever it is planned again."""
    if (parameters.patient == 0 or robot.trial == 0) and t >= memory.made + 2e-3:
        memory.made = t
        memory.goal = 0.1 - memory.goal
        memory.plans += 1
    for i in range(robot.nu):
        torque[i] = 60.0 * (memory.goal - state.joint_position[i]) - state.joint_velocity[i]


def test_a_plan_that_leaves_trials_alone_does_not_crawl() -> None:
    robot = walking.bravo7()
    steps = []
    for patient in (0, 1):
        simulation = hs.Simulation(
            robot, plans(Whether(patient=patient)), state=robot.reference_state(),
            method=hs.EventDriven(rtol=1e-6, atol=1e-8),
        )  # fmt: skip
        simulation.advance(0.05)
        run = simulation.record
        assert run.completed, run.message
        steps.append(run.steps)
    assert 2 * steps[1] < steps[0]
