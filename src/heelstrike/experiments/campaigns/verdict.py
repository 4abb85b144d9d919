"""What a campaign says: how often it went well, what that depends on, why it failed."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import takes
from heelstrike.errors import SimulationError
from heelstrike.experiments.campaigns.parameters import Plan
from heelstrike.experiments.campaigns.results import CampaignResults
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

CONFIDENCE = 0.95
"""Share of campaigns whose interval covers the truth."""

FEWEST = 8
"""Trials from which on a correlation is told."""

SHOWN = 10
"""Worst trials that a verdict names."""


class Bounds(enum.Enum):
    """Kinds of intervals of a proportion.

    ``WILSON``
        Covers the truth about as often as it says, whatever the truth.
    ``CLOPPER_PEARSON``
        Covers it at least so often: wider.
    """

    WILSON = "wilson"
    CLOPPER_PEARSON = "exact"


@dataclass(frozen=True)
class Proportion:
    """How often something happened, and what that says of how often it will."""

    count: int
    trials: int
    """count, trials: How often, of how many."""
    low: float
    high: float
    """low, high: Interval of the probability; NaN where trials were chosen, not drawn."""

    @property
    def share(self) -> float:
        """Part of the trials; NaN of none."""
        return self.count / self.trials if self.trials else math.nan

    def __str__(self) -> str:
        told = f"{self.count} of {self.trials}, {100.0 * self.share:.1f} %"
        if math.isnan(self.low):
            return told
        return f"{told} ({100.0 * self.low:.1f} to {100.0 * self.high:.1f} %)"


@dataclass(frozen=True)
class Influence:
    """How the outcome depends on a parameter."""

    name: str
    """The parameter."""
    trials: int
    """Trials in which it differed."""
    rank: float
    """Spearman's rank correlation of its value with the outcome; NaN of texts and of too few."""
    chance: float
    """Probability of one as large where nothing depends on it."""
    first_order: float = math.nan
    total_order: float = math.nan
    """first_order, total_order: Sobol indices: parts of the variance of the outcome that this
    parameter explains alone, and together with others; NaN but of a sensitivity design."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a campaign says."""

    success: Proportion
    """Trials that went well."""
    causes: tuple[tuple[str, Proportion], ...]
    """First causes of the others, the most frequent first."""
    influences: tuple[Influence, ...]
    """What the outcome depends on, the strongest first."""
    worst: tuple[int, ...]
    """Trials that failed soonest."""

    def __str__(self) -> str:
        lines = [f"walked on: {self.success}"]
        lines += [f"  {cause}: {share}" for cause, share in self.causes]
        for each in self.influences:
            if math.isfinite(each.total_order):
                lines.append(
                    f"depends on {each.name}: alone {each.first_order:.2f}, with others "
                    f"{each.total_order:.2f} of the variance"
                )
            elif math.isfinite(each.rank) and each.chance < 1.0 - CONFIDENCE:
                more = "more" if each.rank > 0.0 else "less"
                lines.append(f"better with {more} {each.name}: rank correlation {each.rank:+.2f}")
        if self.worst:
            lines.append(f"worst trials: {', '.join(map(str, self.worst))}")
        return "\n".join(lines)


@takes(SimulationError)
def proportion(
    count: int, trials: int, *, confidence: float = CONFIDENCE, bounds: Bounds = Bounds.WILSON
) -> Proportion:
    """Say what a number of successes tells of their probability.

    Parameters
    ----------
    count, trials : int
        Successes, and trials.
    confidence : float
        Share of such intervals that cover the truth.
    bounds : Bounds
        Which kind.

    Returns
    -------
    Proportion
        With an interval; of no trials from 0 to 1.

    Raises
    ------
    SimulationError
        If there cannot be so many.
    """
    from scipy.stats import binomtest

    if not (0 <= count <= trials and 0.0 < confidence < 1.0):
        raise SimulationError(f"{count} successes of {trials} trials at {confidence} cannot be")
    if not trials:
        return Proportion(0, 0, 0.0, 1.0)
    found = binomtest(count, trials).proportion_ci(confidence, method=bounds.value)
    return Proportion(count, trials, float(found.low), float(found.high))


def verdict(results: CampaignResults, *, bounds: Bounds = Bounds.WILSON) -> Verdict:
    """Judge a campaign.

    Parameters
    ----------
    results : CampaignResults
        What its trials came to.
    bounds : Bounds
        Kind of intervals.

    Returns
    -------
    Verdict
        How often it went well, why not, and what that depends on. Intervals are of trials that were
        drawn; those of a grid or a sensitivity design have none.
    """
    good, count = results.success, len(results)

    def share(some: int) -> Proportion:
        if results.plan.random:
            return proportion(some, count, bounds=bounds)
        return Proportion(some, count, math.nan, math.nan)

    causes = [(cause, share(each)) for cause, each in results.causes.items()]
    time = results.column("time").astype(np.float64)
    soon = np.argsort(np.where(np.isnan(time), -1.0, time), kind="stable")
    worst = [results.numbers[i] for i in soon.tolist() if not good[i]][:SHOWN]
    return Verdict(share(int(good.sum())), tuple(causes), influences(results), tuple(worst))


def influences(
    results: CampaignResults, outcome: Callable[[CampaignResults], ArrayLike] | None = None
) -> tuple[Influence, ...]:
    """Say what the outcome depends on.

    Parameters
    ----------
    results : CampaignResults
        What its trials came to.
    outcome : callable, optional
        Takes the results, returns a number of each trial; by default 1 of those that went well and
        0 of the others.

    Returns
    -------
    tuple of Influence
        The strongest first.
    """
    from scipy.stats import spearmanr

    y = np.asarray(results.success if outcome is None else outcome(results), dtype=np.float64)
    plan = results.plan
    orders = sobol_orders(plan, y) if plan.base and len(results) == len(plan.values) else {}
    found = []
    for column, name in enumerate(plan.names):
        x = results.values[:, column]
        known = np.isfinite(x) & np.isfinite(y)
        rank = chance = math.nan
        varies = known.sum() >= FEWEST and np.ptp(x[known]) > 0.0 and np.ptp(y[known]) > 0.0
        if varies and name not in plan.texts:
            test = spearmanr(x[known], y[known])
            rank, chance = float(test.statistic), float(test.pvalue)
        first, total = orders.get(name, (math.nan, math.nan))
        found.append(Influence(name, int(known.sum()), rank, chance, first, total))
    return tuple(sorted(found, key=_strength, reverse=True))


def _strength(each: Influence) -> float:
    strength = each.total_order if math.isfinite(each.total_order) else abs(each.rank)
    return strength if math.isfinite(strength) else -1.0


def sobol_orders(plan: Plan, outcome: NDArray[np.float64]) -> dict[str, tuple[float, float]]:
    """Sobol indices of first and of total order of each parameter, by `scipy.stats`.

    Parameters
    ----------
    plan : Plan
        Of a sensitivity design.
    outcome : (n,) float
        A number of each of its trials.
    """
    from scipy.stats import sobol_indices

    count = len(plan.names)
    a, b, *mixed = np.asarray(outcome).reshape(count + 2, plan.base)
    if np.ptp(outcome) == 0.0:
        return dict.fromkeys(plan.names, (0.0, 0.0))
    values: dict[str, Floats] = {
        "f_A": a[None, :], "f_B": b[None, :], "f_AB": np.array(mixed)[:, None, :]
    }  # fmt: skip
    found = sobol_indices(func=values, n=plan.base)
    return {
        name: (float(found.first_order.ravel()[i]), float(found.total_order.ravel()[i]))
        for i, name in enumerate(plan.names)
    }
