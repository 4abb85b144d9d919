"""Every robot of the library that can walk gets a gait, and walks it as far as that can be held."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.analysis.summary import Summary
from heelstrike.errors import GaitError
from heelstrike.experiments.walk import design, typical_step, walk, why_unstable
from heelstrike.sim.method import Method

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

FLAT = ("human7", "geyer7", "spring_flamingo", "walker2d")
POINTS = ("rabbit", "rabbit_optimtraj")
# What the optimiser finds by itself after the parabola has failed, without the time that takes.
PROFILE = {"spring_flamingo": "smooth"}
STEPS = 20
FEW = 5
GROUND = hs.Ground(friction=0.75)


@dataclass(frozen=True)
class Designed:
    """A robot with its gait."""

    robot: hs.Robot
    gait: hs.Gait


@cache
def designed(name: str) -> Designed:
    robot = hs.load_robot(name)
    size = typical_step(robot)
    gait = hs.optimize_gait(
        robot,
        step_length=size.length,
        step_duration=size.duration,
        clearance=size.clearance,
        friction=0.6,
        clearance_profile=PROFILE.get(name),
        starts=1,  # the other starts of `design` find the same optimum
    )
    return Designed(robot, gait)


@pytest.mark.parametrize("name", [*FLAT, *POINTS])
def test_the_gait_keeps_its_limits(name: str) -> None:
    robot, gait = designed(name).robot, designed(name).gait
    margins = gait.margins
    assert 0.1 * robot.weight <= margins.normal_force * (1.0 + 1e-9)
    assert margins.friction_use <= 1.0 + 1e-6
    assert margins.impulse > 0.0
    assert margins.impulse_friction_use <= 1.0 + 1e-4
    assert min(margins.joint_range, margins.torque, margins.clearance) >= 0.0
    assert margins.landing_velocity <= 0.0
    assert margins.touchdown_error <= 1e-8
    assert (why_unstable(gait) is None) == (name in FLAT)


def test_the_page_tells_the_steps_and_costs() -> None:
    """docs/gaits.md says what the optimiser finds, to the digits that it prints."""
    page = Path(__file__).parents[2] / "docs" / "gaits.md"
    row = re.compile(r"^\| (\w+)[^|]*\| ([\d.]+) m in ([\d.]+) s \| ([\d.]+) \|", re.MULTILINE)
    told = {name: numbers for name, *numbers in row.findall(page.read_text(encoding="utf-8"))}
    assert told.keys() == {"bravo7", *FLAT, *POINTS}
    for name in (*FLAT, *POINTS):
        gait = designed(name).gait
        found = (gait.step_length, gait.step_duration, gait.cost)
        for number, text in zip(found, told[name], strict=True):
            digit = 10.0 ** -len(text.partition(".")[2])
            assert number == pytest.approx(float(text), abs=0.6 * digit), name


def walked(name: str, method: Method, steps: int = STEPS) -> Summary:
    robot, gait = designed(name).robot, designed(name).gait
    run = walk(robot, gait, steps=steps, method=method, ground=GROUND)
    assert run.completed, run.message
    summary = run.summary(gait=gait)
    assert summary.steps == steps
    assert summary.distance_m / gait.step_length == pytest.approx(steps, abs=0.3)
    assert summary.penetration_max_m <= 1e-9
    assert summary.solver.failures == 0
    assert summary.zmp_margin_min_m > 0.0
    return summary


@pytest.mark.parametrize("name", FLAT)
def test_robots_with_soles_walk_event_driven(name: str) -> None:
    """The error is the integrator's, rtol = 1e-8; no foot slips, in contact or in an impact."""
    summary = walked(name, hs.EventDriven())
    assert summary.tracking_rms_rad <= 1e-6
    assert summary.friction_use_max <= 0.8  # a fifth is kept in reserve by the gait
    assert summary.slip_max_m <= 1e-12


@pytest.mark.parametrize("name", FLAT)
def test_robots_with_soles_walk_by_time_stepping(name: str) -> None:
    """Its errors are of first order in h: a foot that lands or leaves slips for a part of a step.

    At 1 ms and landing speeds of up to 1.4 m/s that is 1.4 mm a step at most. The tracking error
    vanishes with h, though not evenly: whether heel and toe land in one time step or in two is
    decided by errors that are as small.
    """
    assert walked(name, hs.TimeStepping(step=1e-3)).tracking_rms_rad <= 2e-3
    coarse, fine = (walked(name, hs.TimeStepping(step=h), FEW) for h in (1e-3, 2e-5))
    assert coarse.tracking_rms_rad <= 2e-3
    assert fine.tracking_rms_rad <= 0.3 * coarse.tracking_rms_rad
    assert coarse.slip_max_m <= FEW * 1.4e-3
    assert fine.slip_max_m <= 0.05 * coarse.slip_max_m + 1e-12


@pytest.mark.parametrize("name", POINTS)
def test_robots_on_points_track_the_first_step_and_say_that_it_does_not_last(name: str) -> None:
    robot, gait = designed(name).robot, designed(name).gait
    run = walk(robot, gait, steps=1, method=hs.TimeStepping(step=1e-3), ground=GROUND)
    assert run.completed, run.message
    summary = run.summary(gait=gait)
    assert summary.steps == 1
    assert summary.tracking_rms_rad <= 5e-3
    reason = why_unstable(gait)
    assert reason is not None
    assert name in reason
    assert "no motor" in reason
    # And indeed it falls, within the twenty steps of a usual walk.
    fallen = walk(robot, gait, steps=20, method=hs.TimeStepping(step=1e-3), ground=GROUND)
    assert not fallen.completed
    assert fallen.summary(gait=gait).steps < 20


@pytest.mark.parametrize("name", ["compass_gait", "kneed_walker", "rimless_wheel"])
def test_passive_walkers_are_refused_in_words(name: str) -> None:
    with pytest.raises(GaitError, match=name):
        design(hs.load_robot(name))


def test_steps_suit_the_size() -> None:
    for name in (*FLAT, *POINTS):
        size = typical_step(hs.load_robot(name))
        assert 0.1 < size.length < 0.4
        froude = (size.length / size.duration) ** 2 / (9.81 * size.length)
        assert np.isclose(froude, 0.0624, rtol=0.1)  # of bravo7's step: dynamically similar
