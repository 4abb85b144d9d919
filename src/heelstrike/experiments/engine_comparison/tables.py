"""The comparison as tables in a terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.console import Group
from rich.table import Table

from heelstrike.experiments.engine_comparison.entries import ENTRIES
from heelstrike.experiments.engine_comparison.settings import BEST, found_for_others
from heelstrike.view.terminal import bare_table

if TYPE_CHECKING:
    from heelstrike.experiments.engine_comparison.comparison import EngineComparison
    from heelstrike.experiments.engine_comparison.figures import WalkFigures

WALKING: Mapping[str, tuple[str, float]] = {
    "tracking_rad": ("tracking mrad", 1e3),
    "position": ("error mm,mrad", 1e3),
    "touchdown_s": ("touchdown ms", 1e3),
    "impulse_Ns": ("impulse N s", 1.0),
    "zmp_m": ("ZMP mm", 1e3),
}
BY_ITSELF: Mapping[str, tuple[str, float]] = {
    "slip_m": ("slip mm", 1e3),
    "penetration_m": ("depth mm", 1e3),
    "energy_J": ("energy J", 1.0),
    "noise": ("noise %", 1e2),
    "peak": ("peak", 1.0),
    "step_us": ("step µs", 1.0),
}
"""Figures, their headings, and what they are multiplied by for the units of these: how walks lie
apart, and what each is by itself."""


def walk_table(comparison: EngineComparison) -> Group:
    """Return the walks of a comparison, two tables and what is to be said beside them.

    Parameters
    ----------
    comparison : EngineComparison
        The walks.
    """
    title = (
        f"{comparison.robot}, {comparison.steps} steps, a control period of "
        f"{1e3 * comparison.control_period_s:g} ms"
    )
    parts: list[Table | str] = [
        _table(comparison, f"{title}: differences from the reference", WALKING),
        "",
        _table(comparison, "each by itself", BY_ITSELF),
    ]
    failed = [row for row in comparison.rows if row.figures is None]
    said: dict[str, None] = {}
    for row in failed:
        said.setdefault(f"{row.title}: {row.reason}")
    parts += list(said)
    best = {
        row.engine: row.title for row in comparison.rows if row.settings == BEST and row.figures
    }
    used = {name: comparison.versions[ENTRIES[name].package] for name in best}
    parts += found_for_others(best, used)
    parts += [f"{name}: {why}" for name, why in comparison.absent.items()]
    return Group(*parts)


def _table(
    comparison: EngineComparison, title: str, columns: Mapping[str, tuple[str, float]]
) -> Table:
    headings = (heading for heading, _ in columns.values())
    table = bare_table(title, ("engine", "set", "h ms", "walks"), headings)
    for row in comparison.rows:
        if row.figures is None:
            continue
        table.add_row(
            row.title,
            row.settings[:4],
            f"{1e3 * row.step_s:g}",
            "yes" if row.figures.walks else f"no, {row.figures.steps}",
            *(cells(row.figures, columns)),
        )
    return table


def cells(figures: WalkFigures, columns: Mapping[str, tuple[str, float]]) -> list[str]:
    """Write the figures of some columns.

    Parameters
    ----------
    figures : WalkFigures
        Of a walk.
    columns : mapping
        `WALKING` or `BY_ITSELF`.

    Returns
    -------
    list of str
        A text each; differences from the truth of a walk that fell are dashes.
    """
    told = []
    for name, (_, factor) in columns.items():
        value = getattr(figures, name)
        if math.isnan(value) or (columns is WALKING and not figures.walks):
            told.append("–")
        else:
            told.append(short(factor * value))
    return told


def short(value: float) -> str:
    """Write a number in two digits, without a power of ten where it is near one.

    Parameters
    ----------
    value : float
        The number.
    """
    if value != 0.0 and (abs(value) < 1e-3 or abs(value) >= 1e5):
        return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:.2g}"
