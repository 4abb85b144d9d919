"""The page that sums up a campaign."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from table import markdown

from scenes.methods import METHODS

GROSS = 1e-3
"""Objections larger than this (relative, or in m and rad) are gross; those below it may be what a
tolerance, a projection or the round-off of a tiny bounce leaves."""

Result = dict[str, Any]

STATUSES = ("completed", "diverged", "solver_failed", "fell", "hang", "refused", "crashed")
BALANCE = ("balance", "balance of an impact", "linear momentum")


def page(results: Sequence[Result], command: str) -> str:
    """Return the page as Markdown: tables of endings and laws, and every scene that failed."""
    by_method: dict[str, list[Result]] = defaultdict(list)
    for one in results:
        by_method[one["method"]].append(one)
    methods = [name for name in METHODS if name in by_method]
    parts = [
        "# Random scenes: where the methods stand",
        "",
        "`benchmarks/scenes` draws random robots, grounds and starts (its `scene.py` says which),",
        "simulates each for 1 s, and judges the records by code of its own. This page is what",
        "",
        *("    " + line for line in command.splitlines()),
        "",
        "says of today's methods, failures included; [causes.md](causes.md) says why they are.",
        "",
        "## How the runs end",
        "",
        *_endings(methods, by_method),
        "",
        "`hang`: more than 30 s of processor time. Time is that of simulating the scenes that came",
        "back.",
        "",
        "## What the judge found",
        "",
        *_verdicts(methods, by_method),
        "",
        "Scenes with an objection, and in brackets with a gross one (above "
        f"{GROSS:g}: relative to the",
        "size of the data, or m and rad). `law` counts contacts, friction, stops, dry joints,",
        "impacts and what the record says of its own geometry; `balance` momentum of steps,",
        "intervals and impacts. Figures are the worst of each scene; the last column is that of",
        "momentum. `other solution`: instants at which a twin took another way that breaks no law",
        "either.",
        "",
        "## Laws that were broken",
        "",
        *_laws(methods, by_method),
        "",
        "## Scenes that did not complete",
        "",
        *_failures(methods, by_method),
        "",
        "## Scenes with gross objections",
        "",
        *_gross(methods, by_method),
    ]
    return "\n".join(parts) + "\n"


def seed_words(seeds: Iterable[int]) -> str:
    """Seeds in order, runs of them as ranges."""
    ordered = sorted(set(seeds))
    words = []
    i = 0
    while i < len(ordered):
        j = i
        while j + 1 < len(ordered) and ordered[j + 1] == ordered[j] + 1:
            j += 1
        words.append(f"{ordered[i]}" if i == j else f"{ordered[i]}–{ordered[j]}")
        i = j + 1
    return ", ".join(words)


def _endings(methods: Sequence[str], by_method: dict[str, list[Result]]) -> list[str]:
    body = []
    for name in methods:
        results = by_method[name]
        counts = [sum(one["status"] == status for one in results) for status in STATUSES]
        seconds = sum(one.get("simulated_s", 0.0) for one in results)
        share = 100.0 * counts[0] / len(results)
        body.append(
            [name, str(len(results)), seed_words(one["seed"] for one in results)]
            + [str(count) for count in counts]
            + [f"{share:.1f} %", f"{seconds:.0f} s"]
        )
    return markdown(["method", "scenes", "seeds", *STATUSES, "completed", "time"], body)


def _objections(one: Result) -> list[dict[str, Any]]:
    return one.get("objections", []) + one.get("twins", {}).get("objections", [])


def _kind(law: str) -> str:
    if law.startswith("twin"):
        return "twins"
    if law in BALANCE:
        return "balance"
    if law in ("teleport", "teleport between rows", "length of a step", "time runs back"):
        return "teleport"
    if "energy" in law:
        return "energy"
    if law in ("penetration", "sunk at a corner"):
        return "penetration"
    return "law"


def _count(results: Sequence[Result], kind: str) -> str:
    every = sum(any(_kind(o["law"]) == kind for o in _objections(one)) for one in results)
    gross = sum(
        any(_kind(o["law"]) == kind and o["size"] > GROSS for o in _objections(one))
        for one in results
    )
    return f"{every} ({gross})" if every else "0"


def _spread(values: Sequence[float]) -> str:
    if not values:
        return "–"
    return " / ".join(f"{x:.0e}" for x in np.percentile(values, [50, 99, 100]))


def _verdicts(methods: Sequence[str], by_method: dict[str, list[Result]]) -> list[str]:
    kinds = ("teleport", "balance", "law", "penetration", "energy", "twins")
    body = []
    for name in methods:
        results = [one for one in by_method[name] if "worst" in one]
        clean = sum(not _objections(one) for one in results)
        deep = [one["figures"]["penetration"] for one in results]
        drift = [
            one["figures"][k] for one in results for k in ("energy drift",) if k in one["figures"]
        ]
        drift += [one["worst"]["energy"] for one in results if "energy" in one["worst"]]
        moved = [max(one["worst"].get(k, 0.0) for k in BALANCE) for one in results]
        compared = [one["twins"]["figures"] for one in results if "twins" in one]
        pairs = sum(one["twins compared"] for one in compared)
        other = sum(one["twins with another solution"] for one in compared)
        body.append(
            [name, str(len(results)), str(clean)]
            + [_count(results, kind) for kind in kinds]
            + [f"{other} of {pairs}", _spread(deep), _spread(drift), _spread(moved)]
        )
    head = ["method", "judged", "no objection", *kinds, "other solution"]
    spread = "50 / 99 / 100 %"
    head += [f"penetration (m), {spread}", f"energy drift, {spread}", f"momentum, {spread}"]
    return markdown(head, body)


def _laws(methods: Sequence[str], by_method: dict[str, list[Result]]) -> list[str]:
    body = []
    for name in methods:
        found: dict[str, list[tuple[float, int]]] = defaultdict(list)
        for one in by_method[name]:
            for objection in _objections(one):
                found[objection["law"]].append((objection["size"], one["seed"]))
        for law, cases in sorted(found.items(), key=lambda item: -len(item[1])):
            sizes = [size for size, _ in cases]
            worst, seed = max(cases)
            gross = sum(size > GROSS for size in sizes)
            body.append(
                [name, law, str(len(cases)), str(gross), f"{np.median(sizes):.0e}",
                 f"{worst:.0e}", str(seed)]
            )  # fmt: skip
    if not body:
        return ["None."]
    return markdown(["method", "law", "scenes", "gross", "median", "worst", "in seed"], body)


def reason(one: Result) -> str:
    """Why a scene did not complete, without its numbers."""
    words = re.sub(r" at t = [-+.\de]+ s", "", one["message"])
    words = re.sub(r"residuals \[.*\]", "", words)
    words = re.sub(r"[-+]?\d[\d.]*(e[-+]?\d+)?", "…", words)
    return f"{one['status']}: {words.strip(' ;')}"


def _failures(methods: Sequence[str], by_method: dict[str, list[Result]]) -> list[str]:
    lines = []
    for name in methods:
        grouped: dict[str, list[int]] = defaultdict(list)
        for one in by_method[name]:
            if one["status"] != "completed":
                grouped[reason(one)].append(one["seed"])
        for why, seeds in sorted(grouped.items(), key=lambda item: -len(item[1])):
            lines.append(f"- **{name}**, {len(seeds)}, {why}: {seed_words(seeds)}")
    return lines or ["None."]


def _gross(methods: Sequence[str], by_method: dict[str, list[Result]]) -> list[str]:
    lines = []
    for name in methods:
        grouped: dict[str, list[int]] = defaultdict(list)
        for one in by_method[name]:
            for objection in _objections(one):
                if objection["size"] > GROSS:
                    grouped[objection["law"]].append(one["seed"])
        for law, seeds in sorted(grouped.items(), key=lambda item: -len(item[1])):
            lines.append(f"- **{name}**, {law}, {len(seeds)}: {seed_words(seeds)}")
    return lines or ["None."]
