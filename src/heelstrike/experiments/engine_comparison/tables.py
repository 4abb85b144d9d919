"""The comparison as tables in a terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table

if TYPE_CHECKING:
    from heelstrike.experiments.engine_comparison.comparison import EngineComparison

WALKING: Mapping[str, str] = {
    "steps": "steps",
    "tracking_rad": "tracking rad",
    "position": "from truth m, rad",
    "touchdown_s": "landing s",
    "impulse_Ns": "impulse N s",
    "zmp_m": "ZMP m",
}
BY_ITSELF: Mapping[str, str] = {
    "slip_m": "slip m",
    "penetration_m": "depth m",
    "energy_J": "energy J",
    "noise": "noise",
    "peak": "peak",
    "step_us": "µs a step",
}
"""Figures and their headings: how walks lie apart, and what each is by itself."""


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
        _table(comparison, f"{title}: differences from the truth", WALKING),
        "",
        _table(comparison, "each by itself", BY_ITSELF),
    ]
    failed = [row for row in comparison.rows if row.figures is None]
    said: dict[str, None] = {}
    for row in failed:
        said.setdefault(f"{row.title}: {row.reason}")
    parts += list(said)
    parts += [f"{name}: {why}" for name, why in comparison.absent.items()]
    return Group(*parts)


def _table(comparison: EngineComparison, title: str, columns: Mapping[str, str]) -> Table:
    table = Table(
        title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0)
    )
    table.add_column("engine", no_wrap=True)
    table.add_column("settings")
    table.add_column("step ms", justify="right")
    table.add_column("walks")
    for heading in columns.values():
        table.add_column(heading, justify="right")
    for row in comparison.rows:
        if row.figures is None:
            continue
        values = [getattr(row.figures, name) for name in columns]
        table.add_row(
            row.title,
            row.settings,
            f"{1e3 * row.step_s:g}",
            "yes" if row.figures.walks else "no",
            *(number(value) for value in values),
        )
    return table


def number(value: float) -> str:
    """Write a figure in two digits.

    Parameters
    ----------
    value : float or int
        The figure; NaN is a dash.
    """
    if isinstance(value, int):
        return str(value)
    return "–" if math.isnan(value) else f"{value:.2g}"
