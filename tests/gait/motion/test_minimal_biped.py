"""The walk of least work of the minimal biped (Srinivasan and Ruina 2006), found again.

Walks under ever larger forces are extrapolated to impulses, for which there is a closed form.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from minimal_biped import ASKED, CAPS, Asked, designs, extrapolated, work

PRINTED = {(0.4, 0.6): 0.0113498240, (0.5, 0.4): 0.0058488806, (0.3, 0.5): 0.0045623790}
REACHED = 1e-6
"""Units of work: mass, leg and gravity are one."""
DIGITS = 1e-10
"""The printed works have ten digits after the point."""
NEAR_FIRST = 0.25
"""Of the observed order to one: the next term of the series is no small one at the largest ε."""


@pytest.mark.parametrize("asked", ASKED)
def test_closed_forms_are_as_printed(asked: Asked) -> None:
    assert asked.closed_form == pytest.approx(PRINTED[asked.speed, asked.distance], abs=DIGITS)


def test_walks_under_large_forces_tend_to_the_closed_form() -> None:
    asked = ASKED[1]
    more = np.array([asked.shot(cap) - asked.closed_form for cap in CAPS])
    orders = np.log2(more[:-1] / more[1:])
    assert np.all(more > 0.0)
    assert np.all(np.abs(orders - 1.0) < NEAR_FIRST)
    assert np.all(np.diff(np.abs(orders - 1.0)) < 0.0)
    shot = extrapolated(CAPS, [asked.shot(cap) for cap in CAPS])
    assert shot == pytest.approx(asked.closed_form, abs=REACHED)


@pytest.mark.slow
def test_the_optimiser_finds_the_walk_of_least_work() -> None:
    asked = ASKED[1]
    motions = designs(asked)
    works = [work(motion) for motion in motions]
    assert all(motion.optimal for motion in motions)
    assert min(works) > asked.closed_form
    for cap, found in zip(CAPS, works, strict=True):
        assert math.isclose(found, asked.shot(cap), abs_tol=REACHED)
    assert extrapolated(CAPS, works) == pytest.approx(asked.closed_form, abs=REACHED)
