"""Planned walks: what the whole robot's zero moment point is, and what is refused.

That they satisfy the equations of motion and are walked as planned, tests of motions say.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.robot.sole import sole

STEP: dict[str, Any] = {"step_length": 0.3, "step_duration": 0.7}


@pytest.fixture(scope="module")
def planned(bravo7: hs.Robot) -> hs.Motion:
    return hs.plan_motion(bravo7, **STEP)


def centers_of_pressure(robot: hs.Robot, phase: Any, times: np.ndarray) -> np.ndarray:
    """Where the ground pushes on the whole robot, from the forces of a motion."""
    found = []
    for t in times:
        force = phase.forces(t)[:, 0]
        x = dynamics.contact_positions(robot, phase.coordinates(t))[:, 0]
        found.append(force @ x / force.sum())
    return np.array(found)


def test_the_zero_moment_point_stays_in_the_middle_of_the_sole(
    bravo7: hs.Robot, planned: hs.Motion
) -> None:
    """Of the whole robot, after corrections; without, the moving legs push it out of the foot."""
    single = planned.phases[1]
    times = np.linspace(0.02, single.duration - 0.02, 41)
    link, ends = bravo7.feet[0].link, sole(bravo7, bravo7.feet[0]).ends
    middle = dynamics.point_position(bravo7, single.coordinates(0.0), link, ends.mean(axis=0))[0]
    assert np.abs(centers_of_pressure(bravo7, single, times) - middle).max() < 0.004
    with pytest.raises(hs.InfeasibleGaitError, match="more corrections"):
        hs.plan_motion(bravo7, **STEP, corrections=0)


@pytest.mark.slow
def test_the_trunk_is_upright_and_the_centre_of_mass_level(
    bravo7: hs.Robot, planned: hs.Motion
) -> None:
    t = np.linspace(0.0, 0.7, 57)
    q = planned.position(t)
    heights = [dynamics.center_of_mass(bravo7, row)[1] for row in q]
    assert np.ptp(heights) < 1e-5
    assert np.abs([dynamics.link_poses(bravo7, row).angle[2] for row in q]).max() < 1e-5


@pytest.mark.slow
def test_both_planners_at_a_given_height(bravo7: hs.Robot) -> None:
    low = [hs.plan_motion(bravo7, **STEP, planner=each, height=0.85) for each in hs.Planner]
    for motion in low:
        assert dynamics.center_of_mass(bravo7, motion.initial_state.q)[1] == pytest.approx(
            0.85, abs=1e-5
        )
    assert low[0].cost == pytest.approx(low[1].cost, rel=0.01)
    assert low[0].cost > hs.plan_motion(bravo7, **STEP).cost  # knees are bent more


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"planner": "prewiev"}, "planner must be one of 'preview', 'capture_point'"),
        ({"step_length": -0.3}, "step_length must be a positive number"),
        ({"step_duration": np.inf}, "step_duration must be a positive number"),
        ({"step_duration": 0.002}, "step_duration must be from 0.1 to 10 s"),
        ({"double_support": 1.0}, "between 0.0286 and 0.971"),
        ({"clearance": 0.0}, "clearance must be a positive number"),
        ({"corrections": -1}, "whole number from 0 to 10"),
        ({"step_length": 1.9}, r"too short for steps of 1.9 m.* They reach with step_length = "),
        ({"height": 1.2}, "do not reach with the centre of mass at 1.2 m"),
        ({"friction": 0.02}, "friction would have to exceed its limit. Ask for more friction"),
        ({"double_support": 1e-9}, "between 0.0286 and 0.971 of one of 0.7 s"),
        (
            {"height": 0.01},
            r"do not reach with the centre of mass at 0\.01 m.* height = \d[.\d]* m",
        ),
        ({"height": np.array([0.8])}, "height must be a positive number"),
        pytest.param(
            {"clearance": 1.0},
            r"clearance of 1 m.* They reach with clearance = 0\.\d+ m",
            marks=pytest.mark.slow,
        ),
        ({"height": 0.5}, "beyond its range from|do not reach with"),
    ],
)
def test_what_cannot_be_is_said(bravo7: hs.Robot, change: dict[str, Any], words: str) -> None:
    with pytest.raises(hs.GaitError, match=words):
        hs.plan_motion(bravo7, **(STEP | change))


def test_other_robots_are_refused() -> None:
    for name in ("rabbit", "compass_gait"):
        with pytest.raises(hs.GaitError, match=f"robot '{name}' differs"):
            hs.plan_motion(hs.load_robot(name), **STEP)
