"""The search for the best settings of an engine: the same for all.

A walk of three steps at 1 ms is held against the truth. From the defaults on, each setting among an
engine's choices is tried in its turn with each of its values, and a value is kept if the distance
from the truth falls by at least `GAIN`. A walk that falls counts as infinitely far. It is one pass,
so that the order of the choices matters; what it finds is good, not proven to be the best.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import date
from typing import Any

from heelstrike.experiments.engine_comparison.entries import Entry
from heelstrike.experiments.engine_comparison.figures import WalkFigures, walk_figures
from heelstrike.experiments.engine_comparison.walk import TRUTH, Walk
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.field_texts import dataclass

STEPS, STEP = 3, 1e-3
"""Walking steps, and step of the engine (s), of the search."""

GAIN = 0.02
"""Part by which the distance from the truth must fall for a value to be kept."""


@dataclass(frozen=True)
class Found:
    """What a search found."""

    settings: Mapping[str, Any]
    """Settings beyond those of the row; empty if the defaults are best."""
    error: float
    default_error: float
    """error, default_error: Distance from the truth of the best settings and of the defaults (root
    mean square of all coordinates, m and rad)."""
    tried: int
    """Walks that were walked."""
    version: str
    """Of the engine."""
    date: str
    """Day on which it was found."""
    command: str
    """What makes it again."""


def search_settings(
    name: str,
    entry: Entry,
    walk: Walk,
    versions: Mapping[str, str],
    progress: Callable[[str], None] | None = None,
) -> Found:
    """Search for the best settings of a row.

    Parameters
    ----------
    name : str
        Name of the row.
    entry : Entry
        The row, with its choices.
    walk : Walk
        What is walked, usually for `STEPS` steps.
    versions : mapping
        What :func:`~heelstrike.experiments.engines.peers` says of the engines.
    progress : callable, optional
        Called with what is tried.

    Returns
    -------
    Found
        The settings, and how they were found.

    Raises
    ------
    InvalidRunError
        If the engine is missing.
    """
    say = progress or (lambda text: None)  # noqa: ARG005
    truth = walk.ours(TRUTH)
    tried = 0

    def error(settings: Mapping[str, Any]) -> float:
        nonlocal tried
        tried += 1
        try:
            run, told = walk.run_in(entry, STEP, {**entry.given, **settings}, versions)
        except InvalidRunError as refused:
            if tried == 1:
                raise
            say(f"{settings}: {refused}")
            return math.inf
        figures: WalkFigures = walk_figures(run, truth, walk.gait, walk.steps, forces_told=told)
        found = figures.position if figures.walks else math.inf
        say(f"{settings}: {found:.3g}")
        return found

    best: dict[str, Any] = {}
    default = least = error(best)
    for setting, values in entry.choices.items():
        for value in values:
            trial = best | {setting: value}
            found = error(trial)
            if found < (1.0 - GAIN) * least:
                best, least = trial, found
    return Found(
        settings=best,
        error=least,
        default_error=default,
        tried=tried,
        version=versions[entry.package],
        date=date.today().isoformat(),
        command=(
            f"heelstrike compare {walk.robot.name} --engines {name} --search --controller "
            f"{type(walk.controller).__name__}"
            + (f" --steps {walk.steps}" if walk.steps != STEPS else "")
        ),
    )
