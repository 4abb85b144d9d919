"""Errors across a walk, on matrices whose eigenvalues are known."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.analysis.stability.across import Across
from heelstrike.analysis.stability.returns import Disturbed

RATE = np.array([2.0, 1.0, 0.0])


def returned(late: float) -> Disturbed:
    """A return with factors `late` of being late, whose direction is RATE, and 0.5 and 0.1."""
    vectors = np.column_stack((RATE, (0.0, 1.0, 1.0), (1.0, 0.0, 1.0)))
    matrix = vectors @ np.diag((late, 0.5, 0.1)) @ np.linalg.inv(vectors)
    nobody: frozenset[str] = frozenset()
    return Disturbed(
        matrix=matrix, seen=np.zeros((0, 3)), residual=0.0, residual_but_late=0.0, begins=RATE,
        ends=RATE, one_sided=nobody, switched=nobody,
    )  # fmt: skip


def test_being_late_is_left_out_where_it_stays() -> None:
    found = Across.of([returned(1.0)], 1.0, 3, smooth=True)
    assert np.abs(found.multipliers) == pytest.approx([0.5, 0.1])


def test_what_a_sample_takes_away_of_being_late_is_an_error_like_others() -> None:
    """Whole samples stay, parts of one do not: to leave out their direction would be wrong."""
    found = Across.of([returned(0.2)], 1.0, 3, smooth=True)
    assert found.along == 1.0
    assert np.abs(found.multipliers) == pytest.approx([0.5, 0.2, 0.1])


def test_larger_errors_of_a_walk_that_keeps_step_with_its_samples() -> None:
    """That what a sample takes away does not stay is known, whatever the size."""
    found = Across.of([returned(0.2)], 1.0, 3, smooth=False, in_step=True)
    assert np.abs(found.multipliers) == pytest.approx([0.5, 0.2, 0.1])
    found = Across.of([returned(0.2)], 1.0, 3, smooth=False)
    assert np.abs(found.multipliers) == pytest.approx([0.5, 0.1])
