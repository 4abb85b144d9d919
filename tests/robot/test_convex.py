"""Convex outlines: the corners of a hull, fewer of them, and those on which it stands."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.robot.shapes.convex import (
    convex_hull,
    lowest_chain,
    nearest_points,
    touches_first,
    with_fewer_corners,
)
from heelstrike.robot.shapes.outlines import Outline, without_hidden

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def area(polygon: np.ndarray) -> float:
    x, z = polygon.T
    return float(0.5 * np.sum(x * np.roll(z, -1) - z * np.roll(x, -1)))


def arc(radius: float, low: float, high: float, count: int = 200) -> np.ndarray:
    """Points of a rocker that touches z = 0 at x = 0."""
    turn = np.linspace(low, high, count)
    return radius * np.column_stack((np.sin(turn), 1.0 - np.cos(turn)))


def test_the_hull_has_the_corners_and_nothing_else() -> None:
    inside = np.random.default_rng(1).uniform(0.01, 0.99, (500, 2))
    hull = convex_hull(np.concatenate((inside, SQUARE)))
    assert {tuple(corner) for corner in hull.tolist()} == {tuple(c) for c in SQUARE.tolist()}
    assert area(hull) == pytest.approx(1.0)  # positive: from +x towards +z


def test_hulls_without_area() -> None:
    line = np.outer(np.linspace(-1.0, 2.0, 7), [3.0, 4.0])
    assert sorted(convex_hull(line).tolist()) == [[-3.0, -4.0], [6.0, 8.0]]
    np.testing.assert_array_equal(convex_hull(np.ones((5, 2))), np.ones((1, 2)))
    np.testing.assert_array_equal(convex_hull(np.ones((1, 2))), np.ones((1, 2)))


def test_fewer_corners_of_a_circle() -> None:
    circle = convex_hull(arc(1.0, 0.0, 2.0 * np.pi, 1000))
    fewer = with_fewer_corners(circle)
    assert len(fewer) < 30
    assert area(fewer) > 0.95 * np.pi
    np.testing.assert_array_equal(with_fewer_corners(SQUARE), SQUARE)


@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_a_flat_sole_has_two_ends(noise: float) -> None:
    """Whatever rounding makes of the corners in between, and left as right."""
    sole = np.column_stack((np.linspace(-0.1, 0.15, 300), np.zeros(300)))
    for seed in range(5):
        shift = noise * np.random.default_rng(seed).uniform(-1.0, 1.0, 300)
        upper = sole + np.array([0.0, 0.05])
        chain = lowest_chain(np.concatenate((sole + np.outer(shift, [0.0, 1.0]), upper)))
        # An end that noise lifts out of the hull leaves it to its neighbour, 0.8 mm away.
        np.testing.assert_allclose(chain, [(-0.1, 0.0), (0.15, 0.0)], atol=2e-3 * (noise > 0.0))


def test_a_turned_up_toe_is_kept_and_a_steep_heel_is_not() -> None:
    foot = np.array([(-0.11, 0.04), (-0.1, 0.0), (0.1, 0.0), (0.15, 0.02), (0.16, 0.08)])
    np.testing.assert_array_equal(lowest_chain(foot), foot[1:4])


def test_a_rocker_is_as_round_as_it_needs() -> None:
    rocker = arc(0.3, -0.6, 0.6)
    chain = lowest_chain(rocker)
    assert 4 <= len(chain) <= 12
    assert np.all(np.diff(chain[:, 0]) > 0.0)
    np.testing.assert_allclose(chain[[0, -1]], rocker[[0, -1]])
    # No lower than the chain by more than a hundredth of its size, across edges of up to 0.6 rad.
    below = np.interp(rocker[:, 0], *chain.T) - rocker[:, 1]
    assert below.max() < 0.01 * np.ptp(rocker[:, 0]) / np.cos(0.6)


def test_a_vertical_line_stands_on_its_lower_end() -> None:
    np.testing.assert_array_equal(lowest_chain(np.array([(1.0, 2.0), (1.0, 1.0)])), [(1.0, 1.0)])


def test_points_that_others_keep_off_the_ground() -> None:
    points = np.array([(-0.05, -0.05), (0.12, -0.05), (0.0, -0.025), (0.2, 0.0)])
    first = touches_first(points, np.array([0.005, 0.005, 0.0, 0.0]))
    assert first.tolist() == [True, True, False, True]


def test_rims() -> None:
    disc = Outline(0, np.array([[1.0, 2.0]]), 0.5).rim()
    np.testing.assert_allclose(np.hypot(*(disc - [1.0, 2.0]).T), 0.5)
    capsule = Outline(0, np.array([[0.0, 0.0], [0.0, 1.0]]), 0.1).rim()
    np.testing.assert_allclose(
        [capsule.min(axis=0), capsule.max(axis=0)], [(-0.1, -0.1), (0.1, 1.1)]
    )
    assert Outline(0, SQUARE, 0.0).rim() is SQUARE


def test_what_is_hidden_is_left_out() -> None:
    square, small = Outline(0, SQUARE, 0.0), Outline(0, 0.5 * SQUARE + 0.1, 0.0)
    elsewhere = Outline(1, small.corners, 0.0)
    point = Outline(2, np.zeros((1, 2)), 0.0)
    assert without_hidden([small, square, elsewhere, point]) == (square, elsewhere)


@pytest.mark.parametrize("seed", range(20))
def test_nearest_points_of_polygons(seed: int) -> None:
    """Beside all pairs of points along both rims: none is nearer, by more than their spacing."""
    draw = np.random.default_rng(seed)
    a, b = (
        convex_hull(draw.normal(size=(int(count), 2)) + draw.normal(scale=4.0, size=2))
        for count in draw.integers(1, 8, size=2)
    )
    share = np.linspace(0.0, 1.0, 200)[:, None, None]
    rims = [(each + share * (np.roll(each, -1, axis=0) - each)).reshape(-1, 2) for each in (a, b)]
    least = np.hypot(*np.moveaxis(rims[0][:, None] - rims[1], -1, 0)).min()
    start, end = nearest_points(a, b)
    found = np.hypot(*(end - start))
    if found == 0.0:
        assert least < 0.1
    else:
        assert least - 0.05 < found <= least + 1e-12


def test_polygons_that_touch_or_cross_are_not_apart() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    bar = np.array([[-1.0, 0.4], [2.0, 0.4], [2.0, 0.6], [-1.0, 0.6]])  # no corner in the other
    line = np.array([[0.5, -1.0], [0.5, 2.0]])
    beside = square + np.array([1.0, 0.0])
    for other in (bar, line, beside, 0.2 * square + 0.3, np.array([[0.5, 0.5]])):
        for start, end in (nearest_points(square, other), nearest_points(other, square)):
            np.testing.assert_array_equal(start, end)
    start, end = nearest_points(np.array([[0.0, 0.0]]), np.array([[3.0, 4.0]]))
    assert (*start, *end) == (0.0, 0.0, 3.0, 4.0)
