"""Numbers told apart by their bits."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.compiler.words import bits_of, stay_below

LIMIT = 20.0


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize(
    ("number", "stays"),
    [
        (0.0, True), (-0.0, True), (5e-324, True), (LIMIT, True), (-LIMIT, True),
        (np.nextafter(LIMIT, 30.0), False), (-np.nextafter(LIMIT, 30.0), False),
        (1e300, False), (np.inf, False), (-np.inf, False), (np.nan, False), (-np.nan, False),
    ],
)  # fmt: skip
def test_numbers_beyond_a_limit_are_told_by_their_bits(
    number: float, stays: bool, place: int
) -> None:
    numbers = np.linspace(-1.0, 1.0, 5)
    numbers[place] = number
    assert stay_below(bits_of(LIMIT), numbers) == stays
