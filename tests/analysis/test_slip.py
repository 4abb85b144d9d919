"""How far contact points slide, and sink."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from synthetic_runs import box, make_run, pushes

import heelstrike as hs
from heelstrike.analysis import max_slip, penetration, slip_distance

G = 9.81


def test_sliding_stop() -> None:
    """A block of 2 m/s stops after v²/(2 μ g); the end velocity of each step makes it v h / 2 less.

    The last step, in which the block stops, is not a whole one: the sum is known to μ g h².
    """
    speed, friction, h = 2.0, 0.5, 1e-3
    robot = box()
    run = hs.simulate(
        robot,
        state=hs.State(robot.model.reference, np.array([speed, 0.0, 0.0])),
        duration=0.5,
        method=hs.TimeStepping(step=h),
        ground=hs.Ground(friction=friction),
    )
    expected = speed**2 / (2.0 * friction * G) - 0.5 * speed * h
    assert expected == pytest.approx(0.407747 - 1e-3, abs=1e-6)
    slid = slip_distance(run)
    np.testing.assert_allclose(slid[-1], expected, atol=friction * G * h**2)
    assert np.all(np.diff(slid, axis=0) >= 0.0)
    assert max_slip(run) == slid[-1].max()
    # The block itself went as far.
    assert run.position[-1, 0] == pytest.approx(slid[-1, 0], abs=1e-9)


def test_only_pressed_points_slip_and_there_and_back_counts_twice() -> None:
    robot = walking.bravo7()
    speed = np.zeros((5, robot.nc))
    speed[:, 0] = [1.0, -1.0, 1.0, 1.0, 9.0]
    speed[:, 2] = 5.0  # in the air
    run = make_run(
        robot,
        np.arange(5) * 0.1,
        force=pushes(robot, [[0], [0], [], [0], [0]]),
        slip_velocity=speed,
    )
    # The last row's step is not part of the run.
    np.testing.assert_allclose(slip_distance(run)[:, 0], [0.0, 0.1, 0.2, 0.2, 0.3])
    np.testing.assert_array_equal(slip_distance(run)[:, 2], 0.0)
    assert max_slip(run) == pytest.approx(0.3)


def test_penetration_is_the_depth_below_ground() -> None:
    run = make_run(walking.bravo7(), [0.0], gap=np.array([[0.1, -0.02, 0.0, -0.0]]))
    np.testing.assert_array_equal(penetration(run)[0], [0.0, 0.02, 0.0, 0.0])
