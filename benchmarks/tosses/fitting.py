"""Numbers of an engine fitted to some tosses, and how well it foretells the others."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.optimize import minimize

from tosses.engines import Engine
from tosses.reading import HALF_WIDTH, Floats, Toss

WIDTH = 2.0 * HALF_WIDTH
NARROW = 0.25
"""Size of the first simplex, as part of what is fitted."""


def errors(tosses: Sequence[Toss], paths: Sequence[Floats]) -> Floats:
    """Return the mean distance of the centre over the samples of each toss, in widths.

    The first sample, from which tosses are rolled out, does not count.

    Parameters
    ----------
    tosses : sequence of Toss
        As they were measured.
    paths : sequence of (n, 3) float
        As they were rolled out.

    Returns
    -------
    (tosses,) float
        Mean distances over the cube's width.
    """
    each = [
        np.linalg.norm(path - toss.position, axis=1)[1:].mean()
        for toss, path in zip(tosses, paths, strict=True)
    ]
    return np.array(each) / WIDTH


def fitted(engine: Engine, tosses: Sequence[Toss], evaluations: int) -> tuple[float, ...]:
    """Fit the numbers of an engine to tosses: the best of its grid, then a simplex.

    Parameters
    ----------
    engine : Engine
        The engine.
    tosses : sequence of Toss
        What it is fitted to: the least mean of :func:`errors`.
    evaluations : int
        At most so many of Nelder and Mead's method after the grid.

    Returns
    -------
    tuple of float
        Values of `engine.names`.
    """

    def cost(numbers: Sequence[float]) -> float:
        return float(errors(tosses, engine.thrown(tosses, numbers)).mean())

    begin = np.array(min(product(*engine.grid), key=cost))
    simplex = np.vstack([begin, begin + np.diag(NARROW * np.maximum(begin, 0.1))])
    lower, upper = np.array(engine.limits).T
    found = minimize(
        cost, begin, method="Nelder-Mead", bounds=engine.limits,
        options={
            "initial_simplex": np.clip(simplex, lower, upper), "maxfev": evaluations,
            "xatol": 1e-4, "fatol": 1e-5,
        },
    )  # fmt: skip
    return tuple(found.x.tolist())


def drawn(count: int, fit: int, seed: int) -> tuple[list[int], list[int]]:
    """Draw which tosses are fitted; return their places and those of the others.

    Parameters
    ----------
    count, fit : int
        Of how many, how many.
    seed : int
        Of the draw.
    """
    order = np.random.default_rng(seed).permutation(count)
    return sorted(order[:fit].tolist()), sorted(order[fit:].tolist())
