"""Times that mean something on a machine with other work: best of many, turn and turn about."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

Work = Callable[[], float]
"""Something to be timed; returns its own seconds, or what should count as such."""


SLOT = 3e-3
"""How long (s) a run lasts of which any part is as good as the whole."""
FEWEST = 100
"""Steps of such a run, at least."""
TURN = 20e-3
"""How long (s) each runs in its turn. What others have left behind in caches and branch predictors
takes a few milliseconds to go: runs of 1 ms that are repeated once are up to a third slower."""


def steps_in_slot(seconds_a_step: float, *, most: int) -> int:
    """Steps of a run that is about as long as that of any other engine.

    The shorter a run, the likelier that nothing disturbs it: all shall have the same chance.
    """
    return min(most, max(FEWEST, round(SLOT / seconds_a_step)))


def best_of(
    works: Mapping[str, Work], *, seconds: float, least: int = 5, turn: float = 0.0
) -> dict[str, float]:
    """Best time of each, in turn until `seconds` are over and each had `least` turns.

    Whatever else the machine does makes times longer, never shorter; taking turns lets it hit all
    of them alike. In its turn each runs twice at least and for `turn` seconds, if these are given:
    it finds itself in the caches again after others have been there.
    """
    best = dict.fromkeys(works, float("inf"))
    for work in works.values():
        work()
    enabled = gc.isenabled()
    gc.disable()
    try:
        end = perf_counter() + seconds
        rounds = 0
        while rounds < least or perf_counter() < end:
            for name, work in works.items():
                over = perf_counter() + turn
                best[name] = min(best[name], work())
                if turn > 0.0:
                    best[name] = min(best[name], work())
                while perf_counter() < over:
                    best[name] = min(best[name], work())
            rounds += 1
    finally:
        if enabled:
            gc.enable()
    return best


def timed(function: Callable[..., Any], *args: Any, **options: Any) -> tuple[Any, float]:
    """Call a function once; return what it returned, and the seconds it took."""
    begin = perf_counter()
    result = function(*args, **options)
    return result, perf_counter() - begin
