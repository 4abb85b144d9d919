"""How far runs of one robot lie apart."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from heelstrike.robot.model import Floats
from heelstrike.view.report.account import Account

INSTANTS = 1000
"""At how many times runs are held against each other."""

STEPS, LANDINGS = "steps", "touchdowns of steps, largest difference in time (ms)"
"""Quantities of runs whose steps are counted."""


def differences(named: Mapping[str, Account]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heading and rows of a table, a column a run: how far each is from the first.

    Coordinates are compared between robots of the same joints only.
    """
    reference = next(iter(named.values()))
    columns = [_apart(account, reference) for account in named.values()]
    rows = [(what, *(column[what] for column in columns)) for what in columns[0]]
    return ("", *named), rows


def _apart(account: Account, reference: Account) -> dict[str, str]:
    run, first = account.run, reference.run
    start = max(float(run.time[0]), float(first.time[0]))
    end = min(float(run.time[-1]), float(first.time[-1]))
    landings, theirs = account.touchdowns(), reference.touchdowns()
    apart = coordinates = late = math.nan
    if end > start:
        grid = np.linspace(start, end, INSTANTS)

        def at(time: Floats, values: Floats) -> Floats:
            return np.column_stack([np.interp(grid, time, column) for column in values.T])

        center, other = (at(each.run.time, each.center_of_mass()) for each in (account, reference))
        apart = 1e3 * float(np.linalg.norm(center - other, axis=1).max())
        if run.robot.joint_names == first.robot.joint_names:
            ours = at(run.time, account.coordinates())
            others = at(first.time, reference.coordinates())
            coordinates = float(np.abs(ours - others).max(initial=0.0))
        if landings and theirs:
            late = 1e3 * max(abs(a - b) for a, b in zip(landings, theirs, strict=False))
    found = {
        "last common time (s)": f"{end:.4g}",
        "centre of mass, largest distance (mm)": _number(apart),
        "coordinates, largest difference (rad, m)": _number(coordinates),
    }
    if landings is None:
        return found
    return {STEPS: str(len(landings)), **found, LANDINGS: _number(late)}


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"
