"""What trials differ in: drawn as they are asked to be, and the same whenever they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import heelstrike as hs
from heelstrike.experiments.campaigns.parameters import Draw, Share, planned

TWO = {"a": stats.norm(3.0, 0.5), "b": stats.uniform(1.0, 2.0)}


def test_more_random_trials_are_the_same_ones_and_others() -> None:
    few, many = (planned(TWO, Draw.RANDOM, count, 5) for count in (7, 20))
    np.testing.assert_array_equal(few.values, many.values[:7])
    np.testing.assert_array_equal(few.seeds, many.seeds[:7])
    assert len(set(many.seeds.tolist())) == 20
    assert not np.array_equal(few.values, planned(TWO, Draw.RANDOM, 7, 6).values)


@pytest.mark.parametrize("draw", [Draw.RANDOM, Draw.SOBOL, Draw.LATIN_HYPERCUBE])
def test_values_have_the_distribution_that_was_asked_for(draw: Draw) -> None:
    """Kolmogorov and Smirnov find nothing at 1e-3; even draws are far nearer than random ones."""
    values = planned(TWO, draw, 512, 11).values
    for column, wanted in enumerate(TWO.values()):
        found = stats.kstest(values[:, column], wanted.cdf)
        assert found.pvalue > 1e-3
        if draw is Draw.LATIN_HYPERCUBE:  # one in each of 512 slices
            assert found.statistic < 1.0 / 512 + 1e-12


def test_a_grid_has_every_combination_once() -> None:
    plan = planned({"a": [1.0, 2.0, 3.0], "trial": ["slow", "fast"], "c": 7}, Draw.GRID, None, 0)
    assert [plan.of(i) for i in range(3)] == [
        {"a": 1.0, "trial": "slow", "c": 7.0}, {"a": 1.0, "trial": "fast", "c": 7.0},
        {"a": 2.0, "trial": "slow", "c": 7.0},
    ]  # fmt: skip
    assert len({tuple(row) for row in plan.values.tolist()}) == len(plan.values) == 6


def test_shares_have_parameters_of_their_own() -> None:
    plan = planned([Share(3.0, {"a": stats.norm()}), Share(1.0, TWO)], Draw.SOBOL, 1024, 2)
    with_b = np.isfinite(plan.values[:, 1])
    assert with_b.mean() == pytest.approx(0.25, abs=2.0 / 1024)
    assert np.isfinite(plan.values[:, 0]).all()
    assert {tuple(plan.of(i)) for i in range(100)} == {("a",), ("a", "b")}


def test_a_sensitivity_design_exchanges_one_column_at_a_time() -> None:
    plan = planned(TWO, Draw.SENSITIVITY, 35, 3)
    assert plan.base == 8
    a, b, first, second = plan.values.reshape(4, 8, 2)
    np.testing.assert_array_equal(first, np.column_stack((b[:, 0], a[:, 1])))
    np.testing.assert_array_equal(second, np.column_stack((a[:, 0], b[:, 1])))


@pytest.mark.parametrize(
    ("parameters", "draw", "trials", "words"),
    [
        ({}, Draw.RANDOM, 3, "at least one parameter"),
        (TWO, Draw.RANDOM, None, "trials must be"),
        (TWO, Draw.GRID, None, "not of distributions"),
        ({"a": [1, 2]}, Draw.GRID, 3, "has 2 combinations"),
        ({"a": [1, "two"]}, Draw.RANDOM, 3, "mixes texts and numbers"),
        ({"a": object()}, Draw.RANDOM, 3, "'a' must be a distribution"),
        ({"a": [[1.0]]}, Draw.RANDOM, 3, "'a' must be a distribution"),
        ({"a": [float("nan")]}, Draw.RANDOM, 3, "'a' must be a distribution"),
        ([TWO], Draw.RANDOM, 3, "sequence of Share"),
        ([Share(0.0, TWO)], Draw.RANDOM, 3, "weight"),
        (TWO, Draw.SENSITIVITY, 7, "at least 2 points"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    parameters: object, draw: Draw, trials: int | None, words: str
) -> None:
    with pytest.raises(hs.SimulationError, match=words):
        planned(parameters, draw, trials, 0)  # type: ignore[arg-type]
