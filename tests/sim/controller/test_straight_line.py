"""The robot on a flat foot: straight-line code says what the search for pivots says."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import walking
from mechanisms import parallel_ankles

import heelstrike as hs
from heelstrike.control.balance.constrained import Constrained, constrain, constrained_programs
from heelstrike.sim.controller.robot import ControlledRobot, robot_view

ROUNDING = 1e-12
"""Of some hundred operations, relative to the largest number of an answer."""


def moved(view: ControlledRobot, seed: int) -> np.ndarray:
    """Put the view's own state anywhere; return accelerations of the joints."""
    draw = np.random.default_rng(seed)
    state = view.estimate
    state.q[:], state.v[:] = draw.normal(size=view.nq), draw.normal(size=view.nv)
    view.update(state)
    return 10.0 * draw.normal(size=view.nu)


@pytest.mark.parametrize("name", ["bravo7", "walker2d"])
def test_torques_on_a_flat_foot(name: str) -> None:
    view = robot_view(hs.load_robot(name))
    assert np.all(view.flat_foot != 0)
    programs, none = view.flat_foot.copy(), np.zeros(2, np.int64)
    for seed in range(4):
        acceleration = moved(view, seed)
        for foot in range(2):
            answers = []
            for addresses in (programs, none):
                view.flat_foot[:] = addresses
                torque = acceleration.copy()
                view.flat_foot_torque(view.estimate, foot, torque, torque)
                answers.append(torque)
            limit = ROUNDING * np.abs(answers[1]).max()
            np.testing.assert_allclose(answers[0], answers[1], rtol=0.0, atol=limit)
        # The other foot asks for something else.
        assert np.abs(answers[1] - acceleration).max() > 1.0


def test_what_depends_on_the_joints_on_a_flat_foot() -> None:
    """What a whole-body controller asks, the sole anywhere."""
    robot = hs.load_robot("bravo7")
    view, programs = robot_view(robot), constrained_programs(robot)
    assert np.all(programs != 0)
    by_program, by_search = (Constrained.allocate(nv=robot.nv, nu=robot.nu) for _ in range(2))
    for seed in range(4):
        sole = moved(view, seed)[:2]
        for foot in range(2):
            constrain(view, view.estimate, foot, sole, programs, by_program)
            constrain(view, view.estimate, foot, sole, np.zeros(2, np.int64), by_search)
            for name in ("motion", "drift", "wrench", "load", "torque", "hold"):
                found, wanted = getattr(by_program, name), getattr(by_search, name)
                limit = ROUNDING * np.abs(wanted).max()
                np.testing.assert_allclose(found, wanted, rtol=0.0, atol=limit)


def test_where_loops_hold_pivots_are_searched() -> None:
    robot = parallel_ankles()
    assert not np.any(robot_view(robot).flat_foot)
    assert not np.any(constrained_programs(robot))


def test_a_law_keeps_no_addresses() -> None:
    """It goes to other processes, and to robots whose code is another: addresses are the run's."""
    robot = dataclasses.replace(walking.bravo7())
    law = hs.FootstepFeedback(robot, walking.gait())
    assert not np.any(law.parameters.constrained)
    parameters, _ = law.numbers(robot)
    assert np.all(parameters.constrained == constrained_programs(robot))
    assert np.all(parameters.constrained != 0)
