"""What differs from trial to trial: distributions and lists, and how values are drawn of them.

Every value comes from a number between 0 and 1 through the inverse of its distribution, so that
random draws, Sobol sequences and Latin hypercubes differ in those numbers alone.
"""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers

SMALLEST = 2.0**-54
"""How far drawn numbers keep off 0 and 1, where distributions without bounds are infinite."""

MOST_TRIALS = 10_000_000
"""Trials of the largest campaign: their values are in memory at once."""


class Draw(enum.Enum):
    """How the values of trials are drawn.

    ``RANDOM``
        Each trial by its own seed: more trials are the same ones and others.
    ``SOBOL``, ``LATIN_HYPERCUBE``
        Scrambled, spread evenly over all trials together (:mod:`scipy.stats.qmc`).
    ``GRID``
        Every combination of lists of values.
    ``SENSITIVITY``
        The design of Saltelli, which Sobol indices are computed from: of d parameters, d + 2 trials
        for each of n, a power of two.
    """

    RANDOM = "random"
    SOBOL = "sobol"
    LATIN_HYPERCUBE = "latin-hypercube"
    GRID = "grid"
    SENSITIVITY = "sensitivity"


@dataclass(frozen=True, eq=False)
class Share:
    """A part of the trials of a campaign, in which some parameters differ and others do not."""

    weight: float
    """How large it is, in proportion to the others."""
    parameters: Mapping[str, Any]
    """What differs in it, as in :class:`~heelstrike.Campaign`."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The values of all trials."""

    names: tuple[str, ...]
    """Names of the parameters."""
    values: Floats
    """(n, parameters) Values; NaN where a trial leaves a parameter as it is. Texts are numbered."""
    texts: Mapping[str, tuple[str, ...]]
    """Texts that a parameter chooses among, by its name."""
    seeds: Integers
    """(n,) The seed of what is random within each trial."""
    base: int = 0
    """Of a sensitivity design, the n of its matrices; else 0."""
    random: bool = True
    """Whether its trials are drawn from distributions, each by itself: shares of them estimate
    probabilities then. Those of a grid and of a sensitivity design are chosen."""

    def of(self, number: int) -> dict[str, Any]:
        """Return what is other in a trial, by the names of its parameters."""
        row = self.values[number].tolist()
        return {
            name: self.texts[name][int(value)] if name in self.texts else value
            for name, value in zip(self.names, row, strict=True)
            if not math.isnan(value)
        }


def planned(
    parameters: Mapping[str, Any] | Sequence[Share], draw: Draw, trials: int | None, seed: int
) -> Plan:
    """Draw the values of all trials.

    Parameters
    ----------
    parameters : mapping or sequence of Share
        What differs.
    draw : Draw
        How.
    trials : int, optional
        How many; a grid has as many as there are combinations.
    seed : int
        Of the whole campaign.

    Raises
    ------
    SimulationError
        If nothing can be drawn so.
    """
    shares = [Share(1.0, parameters)] if isinstance(parameters, Mapping) else list(parameters)
    _check_shares(shares)
    names = tuple(dict.fromkeys(name for share in shares for name in share.parameters))
    texts = {name: _texts(shares, name) for name in names}
    texts = {name: found for name, found in texts.items() if found}
    base = 0
    if draw is Draw.GRID:
        values = _grid(shares, names, texts)
        if trials is not None and trials != len(values):
            raise SimulationError(
                f"the grid has {len(values)} combinations, and trials is {trials}: leave trials out"
            )
    else:
        count, base = _count(draw, trials, names, shares)
        values = _drawn(shares, names, texts, _uniform(draw, count, base, seed, len(names)))
    chosen = draw in (Draw.GRID, Draw.SENSITIVITY)
    return Plan(names, values, texts, _own_seeds(seed, len(values)), base, not chosen)


def typical(parameters: Mapping[str, Any] | Sequence[Share]) -> Iterator[dict[str, Any]]:
    """Yield a value of each parameter of every share, whether it is ever drawn or not.

    Of a distribution it is the median, of a list the first entry; each text of a list has its turn.

    Parameters
    ----------
    parameters : mapping or sequence of Share
        What differs.
    """
    shares = [Share(1.0, parameters)] if isinstance(parameters, Mapping) else parameters
    for share in shares:
        entries = {
            name: [float(given.ppf(0.5))] if hasattr(given, "ppf") else _listed(given)
            for name, given in share.parameters.items()
        }
        most = max(map(len, entries.values()), default=0)
        for k in range(most):
            yield {
                name: each[k if isinstance(each[0], str) and k < len(each) else 0]
                for name, each in entries.items()
            }


def own_sequence(seed: int, number: int) -> np.random.SeedSequence:
    """Return what is random in one trial: the child of that number of the campaign's seed."""
    return np.random.SeedSequence(seed, spawn_key=(number,))


def _own_seeds(seed: int, count: int) -> Integers:
    return np.array(
        [own_sequence(seed, i).generate_state(1)[0] for i in range(count)], dtype=np.int64
    )


def _count(
    draw: Draw, trials: int | None, names: tuple[str, ...], shares: Sequence[Share]
) -> tuple[int, int]:
    """Return the number of trials, and the base of a sensitivity design."""
    if trials is None or not 1 <= trials <= MOST_TRIALS:
        raise SimulationError(f"trials must be from 1 to {MOST_TRIALS}, got {trials}")
    if draw is not Draw.SENSITIVITY:
        return trials, 0
    if len(shares) > 1:
        raise SimulationError("a sensitivity design has no shares: all parameters differ in it")
    each = len(names) + 2
    base = 2 ** int(np.log2(max(trials // each, 1)))
    if base < 2:
        raise SimulationError(
            f"a sensitivity design of {len(names)} parameters has {each} trials for each of at "
            f"least 2 points, {2 * each} together; trials is {trials}"
        )
    return base * each, base


def _uniform(draw: Draw, count: int, base: int, seed: int, parameters: int) -> Floats:
    """Numbers between 0 and 1, (count, parameters + 1); the first decides about the share."""
    from scipy.stats import qmc

    columns = parameters + 1
    rng = np.random.default_rng(seed)
    found: Floats
    if draw is Draw.RANDOM:
        found = np.array(
            [np.random.default_rng(own_sequence(seed, i)).random(columns) for i in range(count)]
        )
    elif draw is Draw.SOBOL:
        sobol = qmc.Sobol(columns, seed=rng)
        found = sobol.random_base2(math.ceil(math.log2(count)))[:count] if count > 1 else (
            sobol.random(1)
        )  # fmt: skip
    elif draw is Draw.LATIN_HYPERCUBE:
        found = qmc.LatinHypercube(columns, seed=rng).random(count)
    else:
        both = qmc.Sobol(2 * parameters, seed=rng).random(base)
        a, b = both[:, :parameters], both[:, parameters:]
        mixed = [a, b]
        for column in range(parameters):
            other = a.copy()
            other[:, column] = b[:, column]
            mixed.append(other)
        found = np.hstack((np.zeros((count, 1)), np.concatenate(mixed)))
    return np.clip(found, SMALLEST, 1.0 - 2.0**-53)


def _drawn(
    shares: Sequence[Share], names: tuple[str, ...], texts: Mapping[str, tuple[str, ...]],
    uniform: Floats,
) -> Floats:  # fmt: skip
    weights = np.array([share.weight for share in shares])
    ends = np.cumsum(weights / weights.sum())
    share_of = np.minimum(np.searchsorted(ends, uniform[:, 0], side="right"), len(shares) - 1)
    values = np.full((len(uniform), len(names)), np.nan)
    for index, share in enumerate(shares):
        rows = share_of == index
        for column, name in enumerate(names):
            if name in share.parameters:
                given = share.parameters[name]
                values[rows, column] = _of_uniform(
                    name, given, texts.get(name, ()), uniform[rows, column + 1]
                )
    return values


def _of_uniform(name: str, given: Any, texts: tuple[str, ...], uniform: Floats) -> Floats:
    if hasattr(given, "ppf"):
        values = np.asarray(given.ppf(uniform), dtype=np.float64)
        if not np.isfinite(values).all():
            raise SimulationError(f"parameter {name!r}: its distribution gives no finite numbers")
        return values
    entries = _entries(name, given, texts)
    return entries[np.minimum((uniform * len(entries)).astype(np.int64), len(entries) - 1)]


def _grid(
    shares: Sequence[Share], names: tuple[str, ...], texts: Mapping[str, tuple[str, ...]]
) -> Floats:
    rows = []
    for share in shares:
        axes = []
        for name in names:
            if name not in share.parameters:
                axes.append(np.array([np.nan]))
                continue
            given = share.parameters[name]
            if hasattr(given, "ppf"):
                raise SimulationError(
                    f"parameter {name!r}: a grid is of lists of values, not of distributions; draw "
                    "random, sobol or latin-hypercube"
                )
            axes.append(_entries(name, given, texts.get(name, ())))
        if math.prod(map(len, axes)) > MOST_TRIALS:
            raise SimulationError(f"the grid has more than {MOST_TRIALS} combinations")
        rows += list(itertools.product(*axes))
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(names))


def _entries(name: str, given: Any, texts: tuple[str, ...]) -> Floats:
    """Values of a list, or of one that is the same in all trials; texts by their number."""
    listed = _listed(given)
    if texts:
        return np.array([texts.index(each) for each in listed], dtype=np.float64)
    try:
        values = np.array(listed, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.array([np.nan])
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise SimulationError(
            f"parameter {name!r} must be a distribution of scipy.stats, a number, or a list of "
            f"numbers or of texts, got {given!r}"
        )
    return values


def _listed(given: Any) -> list[Any]:
    if isinstance(given, np.ndarray):
        return list(given.tolist())
    return [given] if isinstance(given, str) or not isinstance(given, Sequence) else list(given)


def _texts(shares: Sequence[Share], name: str) -> tuple[str, ...]:
    """Texts that a parameter chooses among, in the order in which they are met."""
    given = [share.parameters[name] for share in shares if name in share.parameters]
    entries = [each for one in given if not hasattr(one, "ppf") for each in _listed(one)]
    found = tuple(dict.fromkeys(each for each in entries if isinstance(each, str)))
    if found and len(found) < len(set(map(repr, entries))):
        raise SimulationError(f"parameter {name!r} mixes texts and numbers")
    return found


def _check_shares(shares: Sequence[Any]) -> None:
    for share in shares:
        if not isinstance(share, Share):
            raise SimulationError(
                "parameters are a mapping of names to distributions or lists, or a sequence of "
                f"Share(weight, parameters); got {share!r}"
            )
        if not (math.isfinite(share.weight) and share.weight > 0.0):
            raise SimulationError(f"the weight of a share must be positive, got {share.weight!r}")
    if not any(share.parameters for share in shares):
        raise SimulationError("a campaign needs at least one parameter that differs")
