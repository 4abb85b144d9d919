"""Motions of the centre of mass: those of a cart on a table, that repeat."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.gait.cart_table.center_of_mass import Planner, followed

HEIGHT, GRAVITY, LENGTH = 0.85, 9.81, 0.3
TIMES = np.linspace(0.0, 0.7, 141)
WANTED = np.interp(TIMES, [0.0, 0.14, 0.7], [-LENGTH, 0.0, 0.0])

every = pytest.mark.parametrize("planner", list(Planner))


@every
def test_it_repeats_a_step_further(planner: Planner) -> None:
    begin, end = followed(planner, TIMES, WANTED, HEIGHT, GRAVITY)(TIMES[[0, -1]]).T
    assert end - begin == pytest.approx([LENGTH, 0.0, 0.0], abs=1e-11)


def test_quick_steps_repeat_as_well() -> None:
    """One of 0.1 s leaves 70 % of its beginning to the next."""
    times = np.linspace(0.0, 0.1, 21)
    wanted = np.interp(times, [0.0, 0.02, 0.1], [-0.1, 0.0, 0.0])
    begin, end = followed(Planner.PREVIEW, times, wanted, HEIGHT, GRAVITY)(times[[0, -1]]).T
    assert end - begin == pytest.approx([0.1, 0.0, 0.0], abs=1e-10)


@every
def test_derivatives(planner: Planner) -> None:
    """Between samples, by central differences."""
    motion = followed(planner, TIMES, WANTED, HEIGHT, GRAVITY)
    inside, h = TIMES[:-1] + 0.4 * TIMES[1], 1e-5
    low, middle, high = (motion(inside + by) for by in (-h, 0.0, h))
    assert (high[0] - low[0]) / (2 * h) == pytest.approx(middle[1], abs=1e-8)
    assert (high[1] - low[1]) / (2 * h) == pytest.approx(middle[2], abs=1e-7)


def test_by_capture_point_the_zero_moment_point_is_where_it_is_wanted() -> None:
    times = np.linspace(0.0, 0.7, 997)
    x, _, a = followed(Planner.CAPTURE_POINT, TIMES, WANTED, HEIGHT, GRAVITY)(times)
    wanted = np.interp(times, TIMES, WANTED)
    assert x - HEIGHT / GRAVITY * a == pytest.approx(wanted, abs=1e-14)


def test_the_walk_of_a_pendulum() -> None:
    """On points, x = A sinh ωt about each, from −D/2 to D/2: a closed form."""
    rate, duration = np.sqrt(GRAVITY / HEIGHT), 0.5
    times = np.linspace(0.0, duration, 101)
    wanted = np.zeros(101)
    wanted[-1] = LENGTH  # it leaps within the last sample
    found = followed(Planner.CAPTURE_POINT, times, wanted, HEIGHT, GRAVITY)(times[[0, 50]])
    leap = times[1]
    phase = 0.5 * duration - 0.5 * leap  # in the middle of the leap the legs are alike
    size = 0.5 * LENGTH / np.sinh(rate * 0.5 * duration)
    assert found[1, 1] == pytest.approx(rate * size * np.cosh(rate * (times[50] - phase)), rel=1e-3)


def test_preview_comes_near() -> None:
    x, _, a = followed(Planner.PREVIEW, TIMES, WANTED, HEIGHT, GRAVITY)(TIMES)
    assert np.abs(x - HEIGHT / GRAVITY * a - WANTED).max() < 0.01
