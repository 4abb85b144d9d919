"""Polynomials through given ends (paper eq. 41-43), pieces of them, and quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyval

from heelstrike.compiler.compilation import uncompiled
from heelstrike.gait.polynomials import (
    Instants,
    coefficients,
    cubic,
    evaluated,
    gauss,
    lobatto,
    motion_in_piece,
    place_in_step,
    shape_functions,
)

DRAW = np.random.default_rng(3)
POSITIONS, VELOCITIES = DRAW.normal(size=(2, 2, 6))  # at either end
DURATION = 0.7


def test_ends_of_a_cubic_are_met() -> None:
    pieces, ends = cubic(POSITIONS, VELOCITIES, DURATION)[None], np.array([0.0, DURATION])
    for order, expected in enumerate((POSITIONS, VELOCITIES)):
        found = evaluated(pieces, ends, ends, order)
        np.testing.assert_allclose(found, expected, atol=1e-14)


def test_coefficients_of_a_cubic_are_those_of_the_papers_matrix() -> None:
    T = DURATION
    printed = np.array(
        [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [-3.0 / T**2, 3.0 / T**2, -2.0 / T, -1.0 / T],
            [2.0 / T**3, -2.0 / T**3, 1.0 / T**2, 1.0 / T**2],
        ]
    )
    found = cubic(POSITIONS, VELOCITIES, T)
    expected = printed @ np.vstack([POSITIONS, VELOCITIES])
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


def test_a_piece_begins_where_it_should_and_accelerates_by_legendre_polynomials() -> None:
    values = DRAW.normal(size=(6, 4))  # degree 5
    pieces, breakpoints = coefficients(values, DURATION)[None], np.array([0.0, DURATION])
    times = DURATION * np.array([0.0, 0.2, 1.0])
    for order in (0, 1):
        found = evaluated(pieces, breakpoints, times, order)[0]
        np.testing.assert_allclose(found, values[order], atol=1e-14)
    expected = np.polynomial.legendre.legval(2.0 * times / DURATION - 1.0, values[2:]).T
    np.testing.assert_allclose(evaluated(pieces, breakpoints, times, 2), expected, atol=1e-12)


def test_shape_functions_make_up_every_polynomial_of_their_degree() -> None:
    for degree in (3, 5, 7):
        assert np.linalg.matrix_rank(shape_functions(degree)) == degree + 1


def test_derivatives_are_those_of_the_polynomials() -> None:
    breakpoints = np.array([0.0, 0.2, 0.7])
    pieces = np.random.default_rng(5).normal(size=(2, 6, 3))
    # A complex step has no difference to lose digits in; in the first piece, the second, beyond.
    for t, piece in ((0.123, 0), (0.4, 1), (1.9, 1), (-0.1, 0)):
        c, local = pieces[piece], t - breakpoints[piece]
        first = polyval(local + 1e-30j, c).imag / 1e-30
        np.testing.assert_allclose(
            evaluated(pieces, breakpoints, np.asarray(t), 0), polyval(local, c), rtol=1e-12
        )
        np.testing.assert_allclose(
            evaluated(pieces, breakpoints, np.asarray(t), 1), first, rtol=1e-12
        )
        ahead, behind = (
            evaluated(pieces, breakpoints, np.asarray(t + side * 1e-6), 1) for side in (1, -1)
        )
        np.testing.assert_allclose(
            evaluated(pieces, breakpoints, np.asarray(t), 2), (ahead - behind) / 2e-6, rtol=1e-6
        )
    assert evaluated(pieces, breakpoints, np.zeros((4, 5)), 7).shape == (4, 5, 3)


def test_straight_motion_has_no_acceleration() -> None:
    slope = np.array([0.3, -2.0])
    line = cubic([0.0 * slope, slope * DURATION], [slope, slope], DURATION)[None]
    ends, t = np.array([0.0, DURATION]), np.asarray(0.31)
    np.testing.assert_allclose(evaluated(line, ends, t, 2), 0.0, atol=1e-14)
    np.testing.assert_allclose(evaluated(line, ends, t, 0), slope * 0.31, atol=1e-15)


@pytest.mark.parametrize(("degree", "order"), [(3, 0), (5, 0), (5, 1), (5, 2)])
def test_the_matrix_of_instants_evaluates_the_pieces(degree: int, order: int) -> None:
    """Where the program sees a motion, and the gait that comes of it, are the same."""
    draw = np.random.default_rng(6)
    piece, share = np.array([0, 2, 1, 0]), np.array([0.3, 0.9, 0.0, 1.0])
    instants = Instants(3, piece, share, np.zeros(4))
    values = draw.normal(size=(degree + 1, 3, 2))  # shape functions, pieces, coordinates
    found = instants.matrix(degree, order).T @ values.reshape(-1, 2)
    for k in range(4):
        c = coefficients(values[:, piece[k]], 1.0)[None]
        expected = evaluated(c, np.array([0.0, 1.0]), share[k], order)
        np.testing.assert_allclose(found[k], expected, atol=1e-12)
    np.testing.assert_allclose(instants.phases, (piece + share) / 3.0)


def test_what_was_joined_to_instants() -> None:
    nodes, weights = lobatto(3)
    first = Instants(1, np.zeros(4, int), nodes, weights)
    others = Instants(1, np.zeros(2, int), np.array([0.4, 0.1]), np.zeros(2))
    more = first.joined(others).after(first)
    assert more is not None
    assert more.share.tolist() == [0.4, 0.1]
    assert more.weight.tolist() == [0.0, 0.0]
    assert first.after(first) is not None
    assert first.after(others) is None
    assert first.after(first.joined(others)) is None


def test_quadrature_is_exact_for_polynomials_of_its_degree() -> None:
    # Gauss-Lobatto with n + 1 nodes integrates degree 2n - 1 exactly, Gauss with n of them too.
    for (nodes, weights), exact in ((lobatto(6), 12), (gauss(4), 8)):
        for degree in range(exact):
            assert weights @ nodes**degree == pytest.approx(1.0 / (degree + 1), rel=1e-13)
        assert abs(weights @ nodes**exact - 1.0 / (exact + 1)) > 1e-9
    assert lobatto(6)[0][0] == 0.0
    assert lobatto(6)[0][-1] == 1.0


@pytest.mark.parametrize("time", [-0.1, 0.0, 0.2, 0.3, 0.65, 0.7, 0.75, 0.9])
def test_what_laws_follow_is_the_gait_until_it_stops(time: float) -> None:
    """Pieces that do not fit together, so that it shows which one is taken; still beyond 0.77 s."""
    breakpoints, latest = np.array([0.0, 0.2, 0.3, 0.7]), 0.77
    pieces = DRAW.normal(size=(3, 5, 2))
    piece, inside, moves = uncompiled(place_in_step)(time, latest, breakpoints)
    for joint in range(2):
        found = uncompiled(motion_in_piece)(pieces[piece], joint, inside, moves)
        for order in range(3):
            expected = evaluated(pieces, breakpoints, np.array(min(time, latest)), order)[joint]
            assert found[order] == pytest.approx(expected if order == 0 or time < latest else 0.0)
