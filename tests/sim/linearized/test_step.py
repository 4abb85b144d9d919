"""Motions linearised event by event against differences of what is simulated."""

from __future__ import annotations

import mechanisms
import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.sim import EventKind
from heelstrike.sim.linearized.flow import Variation
from heelstrike.sim.linearized.step import linearized

Floats = NDArray[np.float64]

FINE = hs.EventDriven(rtol=1e-12, atol=1e-13)
GROUND = hs.Ground(friction=2.0)


def dropped(robot: hs.Robot, x: Floats) -> hs.Run:
    """A block that falls on its two corners and comes to rest."""
    state = hs.State(x[: robot.nq], x[robot.nq :])
    return hs.simulate(robot, state=state, duration=0.2, method=FINE, ground=GROUND)


def test_of_corners_that_land_together_the_second_comes_as_the_first_has_left_it() -> None:
    """A wide block, 3 cm above the ground, falls flat on its corners and stays there.

    A small error makes either corner come down first; the block turns about it and comes down with
    the other, sooner than it would have without the impact. At rest only the place has an error,
    which depends on when either landed. Derivatives from either side are those of the two orders,
    and central differences their mean; these have an error of their step at most, as what lies
    between two impacts is of second order, of either sign.
    """
    robot = mechanisms.block(width=0.3, height=0.1)
    x = np.array([0.0, 0.08, 0.0, 0.2, -0.1, 0.0])
    run = dropped(robot, x)
    landings = [event for event in run.events if event.kind is EventKind.TOUCHDOWN]
    assert len({event.time for event in landings}) == 1
    assert len(landings) == 2
    state = hs.State(x[:3], x[3:])
    simulation = hs.Simulation(robot, state=state, method=FINE, ground=GROUND)
    found = linearized(run, landings[0].time, Variation(simulation, None))
    assert found.arrival is None  # there are two
    assert found.saltations[-1].spread > 0.05
    step, columns = 1e-5, []
    for error in step * np.eye(6):
        there, back = (dropped(robot, x + each) for each in (error, -error))
        for each in (there, back):
            assert np.abs(each.velocity[-1]).max() < 1e-9
        columns.append((there.position[-1] - back.position[-1]) / (2.0 * step))
    by_differences = np.transpose(columns)
    np.testing.assert_allclose(found.matrix[:3], by_differences, atol=1e-5)
    assert np.abs(by_differences[0, 2]) > 1e-2  # which corner is first matters
    np.testing.assert_allclose(found.matrix[3:], 0.0, atol=1e-9)
