"""Places within a step: the polynomial that they are on, against exact fractions, and its order."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from single_steps import exact, one_step, swinging

from heelstrike.compiler.compilation import uncompiled
from heelstrike.sim.event_driven import continuous_extension as ce
from heelstrike.sim.event_driven import dormand_prince as dp

fit_correction = uncompiled(ce.fit_correction)
move_places = uncompiled(ce.move_places)
interpolate = uncompiled(dp.interpolate)
interpolate_corrected = uncompiled(ce.interpolate_corrected)


def test_each_share_is_the_polynomial_of_one_slope() -> None:
    """Zero with its slope at both ends, its slope 1 at its own place and 0 at the others."""
    places = [Fraction(each).limit_denominator(100) for each in ce.PLACES]
    np.testing.assert_array_equal([float(each) for each in places], ce.PLACES)
    for j, row in enumerate(ce.SHARES):
        shares = [Fraction(0), *map(Fraction, row)]
        for node in (Fraction(0), Fraction(1), *places):
            slope = sum(k * each * node ** (k - 1) for k, each in enumerate(shares) if k)
            assert float(slope) == pytest.approx(float(node == places[j]), abs=1e-11)
        assert float(sum(shares)) == pytest.approx(0.0, abs=1e-11)


def test_slopes_of_the_dense_output() -> None:
    """Against differences of what it interpolates."""
    small = 1e-5
    for row in range(dp.DENSE_ROWS):
        dense = np.zeros((dp.DENSE_ROWS, 1))
        dense[row] = 1.0
        for j, place in enumerate(ce.PLACES):
            at = np.zeros((2, 1))
            for k, part in enumerate((place - small, place + small)):
                interpolate(part, np.zeros(1), dense, at[k])
            difference = (at[1, 0] - at[0, 0]) / (2.0 * small)
            assert ce.DENSE_SLOPES[row, j] == pytest.approx(difference, abs=1e-8)


def errors(h: float, rounds: int) -> tuple[float, float]:
    """Errors within one step of length h from 0, of the dense output and once it is corrected."""
    begin, point = exact(0.0), np.zeros(4)
    _, end, dense = one_step(swinging, begin, h)
    extension = ce.Extension.allocate(nv=2)
    for j in range(ce.BETWEEN):
        interpolate(ce.PLACES[j], begin, dense, extension.state[j])
    moved = []
    for _ in range(rounds):
        for j in range(ce.BETWEEN):
            extension.slope[j] = swinging(ce.PLACES[j] * h, extension.state[j])
        fit_correction(h, dense, extension.slope, extension.correction)
        moved.append(move_places(begin, end, dense, 0.0, 1.0, extension))
    assert moved == sorted(moved, reverse=True)
    worst = [0.0, 0.0]
    for part in (0.1, 0.3, 0.5, 0.7, 0.9):
        interpolate(part, begin, dense, point)
        worst[0] = max(worst[0], float(np.abs(point - exact(part * h)).max()))
        interpolate_corrected(part, begin, dense, extension.correction, point)
        worst[1] = max(worst[1], float(np.abs(point - exact(part * h)).max()))
    return worst[0], worst[1]


@pytest.mark.parametrize("rounds", [1, 2])
def test_it_is_of_one_order_more_than_the_dense_output(rounds: int) -> None:
    """Errors of short steps fall with h⁹, not h⁸, and are a sixth of those before at most."""
    at = {h: errors(h, rounds) for h in (0.4, 0.2, 0.1)}
    for dense, corrected in at.values():
        assert corrected <= dense / 6.0
    dense, corrected = np.log2(np.array(at[0.2]) / np.array(at[0.1]))
    assert dense <= 7.6
    assert corrected >= 8.5


def test_the_ends_stay_where_they_are() -> None:
    begin, point = exact(0.0), np.zeros(4)
    slopes, end, dense = one_step(swinging, begin, 0.5)
    correction = np.zeros((ce.DEGREE, 4))
    fit_correction(0.5, dense, slopes[: ce.BETWEEN], correction)
    for part, there in ((0.0, begin), (1.0, end)):
        interpolate_corrected(part, begin, dense, correction, point)
        np.testing.assert_allclose(point, there, atol=1e-10)
