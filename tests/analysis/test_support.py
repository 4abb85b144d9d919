"""Who carries the robot, and how many steps it took."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from synthetic_runs import box, liftoff, make_run, pendulum, pushes, touchdown

import heelstrike as hs
from heelstrike.analysis import (
    double_support_fraction,
    single_support,
    stances,
    support_phases,
    walking_steps,
)

RIGHT, LEFT = (0, 1), (2, 3)
ROWS = np.arange(11) * 0.1


def test_phases() -> None:
    robot = walking.bravo7()
    feet = [[0]] * 4 + [[0, 1]] * 2 + [[1]] * 3 + [[]] * 2
    run = make_run(robot, ROWS, force=pushes(robot, feet))
    phases = support_phases(run)
    assert [phase.feet for phase in phases] == [(0,), (0, 1), (1,), ()]
    np.testing.assert_allclose([phase.start for phase in phases], [0.0, 0.4, 0.6, 0.9])
    np.testing.assert_allclose([phase.duration for phase in phases], [0.4, 0.2, 0.3, 0.1])
    assert double_support_fraction(run) == pytest.approx(0.2)
    np.testing.assert_array_equal(single_support(run), [len(f) == 1 for f in feet])


def test_something_else_on_the_ground_is_not_single_support() -> None:
    """A block's corners are contact points; bravo7's knee would be another."""
    robot = box()
    assert len(robot.feet) == 1
    assert single_support(make_run(robot, [0.0], force=pushes(robot, [[0]]))).all()


def test_steps_alternate() -> None:
    robot = walking.bravo7()
    events = [
        touchdown(0.2, LEFT[0], 3.0),
        touchdown(0.2, LEFT[1], 4.0),  # heel and toe together
        liftoff(0.2, RIGHT[0]),
        liftoff(0.3, RIGHT[1]),
        touchdown(0.5, RIGHT[0], 5.0),
        liftoff(0.6, LEFT[0]),
        touchdown(0.6, RIGHT[1], 1.0),
        liftoff(0.6, LEFT[1]),
        touchdown(0.8, LEFT[1], 2.0),
    ]
    run = make_run(robot, ROWS, force=pushes(robot, [[0]] * 11), events=events)
    found = stances(run)
    assert [(s.foot, s.touchdown, s.liftoff, s.impulse) for s in found] == [
        (0, 0.0, 0.3, 0.0),
        (1, 0.2, 0.6, 7.0),
        (0, 0.5, np.inf, 5.0),
        (1, 0.8, np.inf, 2.0),
    ]
    assert [s.touchdown for s in walking_steps(run)] == [0.2, 0.5, 0.8]


def test_chatter_and_scuffing_are_no_steps() -> None:
    """A foot that leaves the ground and comes back before the other one landed made no step."""
    robot = walking.bravo7()
    events = [
        liftoff(0.1, RIGHT[0]),
        liftoff(0.1, RIGHT[1]),
        touchdown(0.11, RIGHT[0]),
        touchdown(0.3, LEFT[0]),
        liftoff(0.35, LEFT[0]),
        touchdown(0.4, LEFT[0]),
    ]
    run = make_run(robot, ROWS, force=pushes(robot, [[0]] * 11), events=events)
    assert [(s.foot, s.touchdown) for s in walking_steps(run)] == [(1, 0.3)]


def test_a_landing_that_does_not_last_is_no_step() -> None:
    """The left foot taps the ground for 10 ms; later it lands, bounces twice, and stays."""
    robot = walking.bravo7()
    events = [
        liftoff(0.15, RIGHT[0]),
        liftoff(0.15, RIGHT[1]),
        touchdown(0.2, LEFT[0]),
        liftoff(0.21, LEFT[0]),
        touchdown(0.3, RIGHT[0]),
        touchdown(0.4, LEFT[0]),
        liftoff(0.405, LEFT[0]),
        touchdown(0.415, LEFT[0]),
        liftoff(0.418, LEFT[0]),
        touchdown(0.43, LEFT[0]),
        liftoff(0.5, LEFT[0]),
    ]
    run = make_run(robot, ROWS, force=pushes(robot, [[0]] * 11), events=events)
    assert [(s.foot, s.touchdown, s.liftoff) for s in walking_steps(run)] == [(1, 0.4, 0.5)]


def test_feet_that_chatter_in_turn_make_no_steps() -> None:
    """Both feet stand and lose the ground for a few milliseconds, one after the other."""
    robot = walking.bravo7()
    events = []
    for k in range(8):
        contacts = (RIGHT, LEFT)[k % 2]
        events += [liftoff(0.1 + 0.02 * k, contact) for contact in contacts]
        events += [touchdown(0.105 + 0.02 * k, contact) for contact in contacts]
    run = make_run(robot, ROWS, force=pushes(robot, [[0, 1]] * 11), events=events)
    assert len(stances(run)) == 10
    assert walking_steps(run) == ()


@pytest.mark.parametrize(
    ("first", "expected"),
    [([0, 1], [(0, 0.4)]), ([], [(1, 0.5)])],
    ids=["standing on both feet", "dropped"],
)
def test_first_step(first: list[int], expected: list[tuple[int, float]]) -> None:
    """From two feet the first landing is a step; a robot that is dropped only lands."""
    robot = walking.bravo7()
    events = [touchdown(0.4, RIGHT[0]), touchdown(0.5, LEFT[0])]
    if first:
        events = [liftoff(0.1, RIGHT[0]), liftoff(0.1, RIGHT[1]), touchdown(0.4, RIGHT[0])]
    run = make_run(robot, ROWS, force=pushes(robot, [first] + [[0]] * 10), events=events)
    assert [(s.foot, s.touchdown) for s in walking_steps(run)] == expected


def test_walk() -> None:
    run = walking.walk(steps=4)
    assert len(walking_steps(run)) == 4
    assert [s.foot for s in walking_steps(run)] == [1, 0, 1, 0]
    for phase in support_phases(run)[:-1]:
        assert phase.duration == pytest.approx(0.7, abs=2e-3)


def test_run_without_rows() -> None:
    run = make_run(walking.bravo7(), np.zeros(0))
    assert support_phases(run) == ()
    assert stances(run) == ()
    assert walking_steps(run) == ()
    assert np.isnan(double_support_fraction(run))


def test_robot_without_feet() -> None:
    run = hs.simulate(pendulum(), state=hs.State([0.3], [0.0]), duration=0.01)
    assert [phase.feet for phase in support_phases(run)] == [()]
    assert not single_support(run).any()
