"""What the lines of a check add up to, in words."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenes.table import seed_words

Result = dict[str, Any]


def summary(check: str, results: Sequence[Result]) -> str:
    """Counts, the worst, and the seeds of what does not pass by its cause.

    Scenes in which there was nothing to check (`counts` is false) are told, and not counted.
    """
    idle = [one["seed"] for one in results if not one.get("counts", True)]
    results = [one for one in results if one.get("counts", True)]
    if not results:
        return f"{check}: no scenes" + (" with anything to check" if idle else "")
    passed = [one for one in results if one.get("passes")]
    lines = [f"{check}: {len(passed)} of {len(results)} scenes pass"]
    if idle:
        lines.append(f"nothing to check in {len(idle)}, not counted: {seed_words(idle)}")
    sized = [one for one in results if "size" in one]
    if sized:
        worst = max(sized, key=lambda one: one["size"])
        spread = np.percentile([one["size"] for one in sized], [50, 95, 100])
        words = " / ".join(f"{x:.1e}" for x in spread)
        lines.append(f"size (50 / 95 / 100 %): {words}, the worst is seed {worst['seed']}")
    causes: dict[str, list[Result]] = defaultdict(list)
    for one in results:
        if not one.get("passes"):
            causes[one.get("cause") or one.get("status", "?")].append(one)
    for cause, cases in sorted(causes.items(), key=lambda item: -len(item[1])):
        largest = max(one.get("size", 0.0) for one in cases)
        seeds = seed_words(one["seed"] for one in cases)
        lines.append(f"- {cause}, {len(cases)} (at most {largest:.1e}): {seeds}")
    lines += _OTHERS.get(check, lambda _: [])(results)
    seconds = [one["seconds"] for one in results if "seconds" in one]
    if seconds:
        each = f"{np.mean(seconds):.2f} s each, {max(seconds):.1f} s at most"
        lines.append(f"processor time: {sum(seconds):.0f} s, {each}")
    return "\n".join(lines)


def _energy(results: Sequence[Result]) -> list[str]:
    gains = [one for one in results if one.get("gains_named")]
    jams = [one["seed"] for one in results if one.get("jams")]
    words = []
    if gains:
        most = max(one["gained"] for one in gains)
        seeds = seed_words(one["seed"] for one in gains)
        words.append(
            f"restitution with friction makes energy, and says so, in {len(gains)} "
            f"(at most {most:.1e} of what is in play): {seeds}"
        )
    if jams:
        words.append(f"jams in {len(jams)}: {seed_words(jams)}")
    return words


def _twins(results: Sequence[Result]) -> list[str]:
    windows = sum(one.get("windows", 0) for one in results)
    agree = sum(one.get("agree", 0) for one in results)
    return [f"{agree} of {windows} windows agree"]


def _orders(results: Sequence[Result]) -> list[str]:
    orders = [one["order"] for one in results if one.get("order") is not None]
    made = max((one.get("made", 0.0) for one in results), default=0.0)
    if not orders:
        return []
    spread = " / ".join(f"{x:.2f}" for x in np.percentile(orders, [0, 5, 50]))
    return [f"order (0 / 5 / 50 %): {spread}; contacts make at most {made:.1e}"]


def _bridges(results: Sequence[Result]) -> list[str]:
    lines = []
    every = [bridge for one in results for bridge in one.get("bridges", [])]
    for struck, words in ((False, "smooth motion"), (True, "an impact within")):
        found = [bridge for bridge in every if bridge["with_impact"] is struck]
        if found:
            covered = sum(bridge["covered"] for bridge in found)
            halved = sum(bridge["halved"] for bridge in found)
            lines.append(
                f"{words}: of {len(found)} bridges {covered} are covered by their estimates "
                f"({100.0 * covered / len(found):.1f} %), {halved} halved at half the length"
            )
    return lines


_OTHERS = {"energy": _energy, "twins": _twins, "orders": _orders, "bridges": _bridges}
