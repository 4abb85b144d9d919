"""Passive walkers of the library, on the walks that repeat on their slopes."""

from __future__ import annotations

import re
from itertools import product

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.cli.values import ground_called
from heelstrike.experiments.passive import METHOD, passive_walk
from heelstrike.experiments.walk import steps_taken, walk, why_unstable


def slope(degrees: float) -> hs.Ground:
    return hs.Ground(slope=np.deg2rad(degrees))


@pytest.mark.parametrize("degrees", [0.1, 1.0, 3.0, 8.0])
def test_the_compass_gait_walks_down_slopes(degrees: float) -> None:
    """Its speeds follow from a fit to walks that were found before, and are found again.

    At 3 degrees the walk is the published one (Goswami, Thuilot and Espiau 1998), whose digits
    tests/analysis/test_limit_cycle.py has. Energy: what a step descends, m g L sin γ, is lost at
    its impact alone.
    """
    robot, ground = hs.load_robot("compass_gait"), slope(-degrees)
    cycle = passive_walk(robot, ground)
    assert cycle.residual <= 1e-10
    assert cycle.iterations <= 4  # the start is near
    assert cycle.stable == (degrees < 4.0)
    if degrees == 3.0:
        assert cycle.period == pytest.approx(0.734346391, abs=1e-8)
        assert cycle.step_length == pytest.approx(0.535445415, abs=1e-8)
    run = walk(robot, cycle, steps=3, ground=ground, method=METHOD)
    assert run.completed
    assert steps_taken(run, cycle) == 3
    assert run.summary().steps == 3


def test_the_wheel_rolls_as_its_closed_form_says() -> None:
    """omega² = 4 g sin α sin γ cot² 2α just after an impact; α = 22.5°, spokes of 1 m.

    Its moment of inertia, 1e-6 kg m², changes that by some 1e-6 of it.
    """
    robot, ground = hs.load_robot("rimless_wheel"), slope(-8.0)
    cycle = passive_walk(robot, ground)
    rate = np.sqrt(4.0 * 9.81 * np.sin(np.pi / 8.0) * np.sin(np.deg2rad(8.0)))
    assert abs(cycle.state.v[2]) == pytest.approx(rate, rel=2e-6)
    run = walk(robot, cycle, steps=4, ground=ground, method=METHOD)
    assert steps_taken(run, cycle) == 4


@pytest.mark.parametrize(
    ("robot", "ground", "said"),
    [
        ("compass_gait", hs.Ground(), "walks down a slope only"),
        ("compass_gait", slope(3.0), "walks down a slope only"),
        ("compass_gait", hs.Ground.stairs(rise=-0.1, tread=0.3, count=3), "down a slope only"),
        ("rimless_wheel", slope(-2.0), "repeats on a slope of -2 degrees"),
    ],
)
def test_where_there_is_no_walk(robot: str, ground: hs.Ground, said: str) -> None:
    with pytest.raises(hs.LimitCycleError, match=said):
        passive_walk(hs.load_robot(robot), ground)


@pytest.mark.parametrize(
    ("name", "ground"),
    [
        *product(("compass_gait", "kneed_walker", "rimless_wheel"), (hs.Ground(), slope(-1.0))),
        ("compass_gait", hs.Ground(slope=-0.2, friction=0.01)),
    ],
)
def test_advice_for_passive_walkers_is_good(name: str, ground: hs.Ground) -> None:
    """On the ground that a refusal names the walker has a stable walk, in both its spellings."""
    robot = hs.load_robot(name)
    try:
        passive_walk(robot, ground)
    except hs.LimitCycleError as error:
        found = re.search(r"Ground\(slope=(-[\d.]+)\), or --ground (slope:-[\d.]+)", str(error))
        assert found
        for advised in (hs.Ground(slope=float(found[1])), ground_called(found[2])):
            cycle = passive_walk(robot, advised)
            assert cycle.stable
            assert (
                steps_taken(walk(robot, cycle, steps=3, ground=advised, method=METHOD), cycle) == 3
            )
    else:
        assert name == "compass_gait"  # which walks on the mildest slopes


def test_a_robot_whose_walk_is_not_known() -> None:
    builder = hs.RobotBuilder("hopper")
    trunk = builder.floating_base("trunk", (0, 1), mass=1, inertia=1)
    builder.contact(trunk, (0, -1))
    with pytest.raises(
        hs.LimitCycleError, match="'hopper' has no motors, and no start of its walk"
    ):
        passive_walk(builder.build(), slope(-3.0))


def test_an_unstable_walk_is_explained() -> None:
    robot = hs.load_robot("compass_gait")
    assert why_unstable(passive_walk(robot, slope(-3.0))) is None
    assert "by the factor 1.54" in str(why_unstable(passive_walk(robot, slope(-5.0))))
