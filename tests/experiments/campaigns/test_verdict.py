"""What campaigns say: intervals that cover, indices that are known, the right trials named."""

from __future__ import annotations

import math
from inspect import signature
from pathlib import Path
from typing import Any

import campaign_cases as cases
import numpy as np
import pytest
from scipy import stats

import heelstrike as hs
from heelstrike.analysis.stability.largest import largest
from heelstrike.experiments.campaigns import Bounds, Draw, Outcome, proportion, verdict
from heelstrike.experiments.campaigns.figure import draw_campaign
from heelstrike.experiments.campaigns.page import save_campaign_page
from heelstrike.experiments.campaigns.parameters import planned
from heelstrike.experiments.campaigns.verdict import influences, sobol_orders


def results_of(
    parameters: Any,
    good: Any,
    *,
    trials: int | None = None,
    draw: Draw = Draw.RANDOM,
    seed: int = 1,
) -> hs.CampaignResults:
    """Return the results of a campaign whose outcomes are known: `good` takes the values."""
    plan = planned(parameters, draw, trials, seed)
    outcomes = tuple(
        Outcome("completed" if well else "fell", "", bool(well), "" if well else "slipped",
                time=float(number))
        for number, well in enumerate(good(plan.values))
    )  # fmt: skip
    return hs.CampaignResults(plan, tuple(range(len(outcomes))), outcomes)


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    """2000 campaigns of 400 trials; of so many the share itself has a deviation of 0.5 %.

    Clopper and Pearson's cover it more often than they say, by what is known of them.
    """
    rng = np.random.default_rng(0)
    truth = rng.uniform(0.05, 0.98, 2000)
    counts = rng.binomial(400, truth).tolist()
    covered = {}
    for bounds in Bounds:
        found = [proportion(count, 400, bounds=bounds) for count in counts]
        covered[bounds] = np.mean(
            [each.low <= p <= each.high for each, p in zip(found, truth, strict=True)]
        )
    assert covered[Bounds.WILSON] == pytest.approx(0.95, abs=0.015)
    assert covered[Bounds.CLOPPER_PEARSON] > covered[Bounds.WILSON]


def test_published_intervals() -> None:
    """Newcombe 1998, table I: 81 of 263 by methods 3 and 5."""
    wilson = proportion(81, 263)
    assert (round(wilson.low, 4), round(wilson.high, 4)) == (0.2553, 0.3662)
    exact = proportion(81, 263, bounds=Bounds.CLOPPER_PEARSON)
    assert (round(exact.low, 4), round(exact.high, 4)) == (0.2527, 0.3676)
    nothing = proportion(0, 0)
    assert (nothing.low, nothing.high) == (0.0, 1.0)
    assert math.isnan(nothing.share)
    with pytest.raises(hs.SimulationError, match="cannot be"):
        proportion(3, 2)


def test_indices_of_a_function_whose_indices_are_known() -> None:
    """Ishigami's function, a = 7 and b = 0.1: 0.3139, 0.4424, 0; 0.5576, 0.4424, 0.2437."""
    each = stats.uniform(-math.pi, 2.0 * math.pi)
    plan = planned({"x": each, "y": each, "z": each}, Draw.SENSITIVITY, 5 * 4096, 3)
    x, y, z = plan.values.T
    found = sobol_orders(plan, np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x))
    for name, first, total in (("x", 0.3139, 0.5576), ("y", 0.4424, 0.4424), ("z", 0.0, 0.2437)):
        assert found[name] == pytest.approx((first, total), abs=0.02)
    assert sobol_orders(plan, np.ones(len(x)))["x"] == (0.0, 0.0)


def test_what_the_outcome_hangs_on() -> None:
    parameters = {"a": stats.uniform(), "b": stats.uniform(), "which": ["one", "two"]}
    results = results_of(parameters, lambda values: values[:, 1] < 0.8, trials=300)
    found = {each.name: each for each in influences(results)}
    assert next(iter(found)) == "b"
    assert found["b"].rank < -0.5
    assert found["b"].chance < 1e-6 < found["a"].chance
    assert math.isnan(found["which"].rank)
    told = verdict(results)
    assert "better with less b" in str(told)
    assert "better with more a:" not in str(told)  # which may be by chance
    assert "better with less a:" not in str(told)
    assert told.causes[0][0] == "slipped"
    failed = np.flatnonzero(~results.success)
    assert told.worst == tuple(failed[:10].tolist())
    assert str(told).startswith(f"walked on: {300 - len(failed)} of 300")


def test_trials_that_were_chosen_have_no_interval() -> None:
    grid = results_of({"b": [0.1, 0.5, 0.9]}, lambda values: values[:, 0] < 0.8, draw=Draw.GRID)
    told = str(verdict(grid))
    assert "walked on: 2 of 3, 66.7 %\n  slipped: 1 of 3, 33.3 %" in told
    drawn = results_of({"b": stats.uniform()}, lambda values: values[:, 0] < 0.8, trials=20)
    assert "% (" in str(verdict(drawn))


def test_a_page_holds_everything_and_asks_for_nothing(tmp_path: Path) -> None:
    results = results_of(
        {"<a>": stats.uniform(), "b": [1.0, 2.0], "which": ["one", "two & three"]},
        lambda values: values[:, 0] < 0.7, trials=60,
    )  # fmt: skip
    page = save_campaign_page(results, tmp_path / "page.html", command="heelstrike campaign x")
    text = page.read_text(encoding="utf-8")
    good = int(results.success.sum())
    assert f"{100.0 * good / 60:.1f} % of 60 trials walked on" in text
    assert "&lt;a&gt;" in text
    assert "<a>" not in text
    assert "http" not in text.replace("http-equiv", "")
    assert "heelstrike campaign x" in text
    with pytest.raises(hs.ViewError, match=r"ends in \.html"):
        save_campaign_page(results, tmp_path / "page.pdf")


def test_the_figure_has_parts_of_equally_many_trials() -> None:
    """Eight of what is drawn from a distribution; of a list each of its numbers, or texts."""
    results = results_of(
        {"x": stats.uniform(), "few": [1.0, 2.5], "which": ["one", "two"]},
        lambda values: values[:, 0] < 0.7, trials=160,
    )  # fmt: skip
    panels = {axes.get_title(loc="left"): axes for axes in draw_campaign(results).axes}
    for name, column in (("x", 0), ("few", 1), ("which", 2)):
        axes = panels[f"walked on (%) by {name}"]
        found = sorted(
            (float(line.get_xdata()[0]), float(line.get_ydata()[0]))
            for line in axes.lines if line.get_marker() == "o"
        )  # fmt: skip
        values = results.values[:, column]
        parts = np.split(np.sort(values), 8) if name == "x" else np.unique(values)
        assert [x for x, _ in found] == pytest.approx([np.median(part) for part in parts])
        if name == "x":
            assert [y for _, y in found[:5]] == [100.0] * 5
            assert [y for _, y in found[6:]] == [0.0] * 2
    labels = panels["walked on (%) by which"].get_xticklabels()
    assert [label.get_text() for label in labels] == ["one", "two"]


def test_margins_are_looked_for_as_finely_as_others() -> None:
    margin, own = signature(hs.Campaign.margin).parameters, signature(largest).parameters
    assert {name: margin[name].default for name in ("strides", "halvings")} == {
        name: own[name].default for name in ("strides", "halvings")
    }


def test_a_margin_lies_between_what_was_stood_and_what_was_not() -> None:
    campaign = hs.Campaign(cases.walks(), {"push.impulse": 0.0}, 1, duration=3.0)
    found = campaign.margin("push.impulse", 12.0, strides=4, halvings=1, unit="N s")
    assert 0.0 < found.recovered < found.failed <= 12.0
    assert found.failed - found.recovered <= 1.5 + 1e-9
    for size, well in ((found.recovered, True), (found.failed, False)):
        again = hs.Campaign(cases.walks(), {"push.impulse": size}, 1, duration=3.0).run()
        assert again.success.tolist() == [well]
