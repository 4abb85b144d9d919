"""Settings of the engines: their defaults, and the best that the search found."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.entries import Entry

DEFAULTS, BEST = "defaults", "best"

FILE = Path(__file__).with_name("best_settings.json")
"""What the search found, with the command that made it, versions and dates."""


@cache
def best_settings() -> dict[str, Any]:
    """Return what the search found, by the names of rows; empty if it has not been made."""
    if not FILE.exists():
        return {}
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def has_best(name: str) -> bool:
    """Whether the search found settings for a row that are better than its defaults."""
    return bool(best_settings().get(name, {}).get("settings"))


def settings_of(name: str, entry: Entry, which: str) -> dict[str, Any]:
    """Return settings of a row's adapter.

    Parameters
    ----------
    name : str
        Name of the row.
    entry : Entry
        The row.
    which : str
        ``"defaults"`` or ``"best"``.

    Returns
    -------
    dict
        What is handed to its adapter.

    Raises
    ------
    SimulationError
        If it is neither.
    """
    if which not in (DEFAULTS, BEST):
        raise SimulationError(f"settings are {DEFAULTS!r} or {BEST!r}, got {which!r}")
    found = dict(entry.given)
    if which == BEST:
        found |= best_settings().get(name, {}).get("settings", {})
    return found


def found_for_others(titles: Mapping[str, str], versions: Mapping[str, str]) -> list[str]:
    """Say of which engines the best settings were found with another version than is used.

    Parameters
    ----------
    titles : mapping
        Names of rows, and what tables call them.
    versions : mapping
        Versions that are used, by the names of rows.
    """
    return [
        f"{title}: the best settings were found with {best_settings()[name]['version']}, "
        f"this is {versions[name]}"
        for name, title in titles.items()
        if name in best_settings()
        and name in versions
        and versions[name] != best_settings()[name]["version"]
    ]
