"""The compass gait in every engine, and by us."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from rich.table import Table

from heelstrike.analysis.told_summary import PlainEntries, plain
from heelstrike.arguments import takes
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.compass import (
    STRIDES,
    ByOurs,
    CompassWalk,
    InEngine,
    compass_walk,
    our_cycle,
)
from heelstrike.experiments.engine_comparison.entries import Entry, entries_called
from heelstrike.experiments.engine_comparison.kept import KeptRows, asked_of_engine
from heelstrike.experiments.engine_comparison.settings import (
    BEST,
    DEFAULTS,
    has_best,
    settings_of,
)
from heelstrike.experiments.engine_comparison.tables import short
from heelstrike.experiments.engines.packages import peers, refuse_absent
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.served import EngineProcesses, lent
from heelstrike.field_texts import dataclass
from heelstrike.robot import State
from heelstrike.sim import TimeStepping
from heelstrike.view.terminal import bare_table

STEPS = (1e-3, 2e-4)
"""Steps of the engines, in s."""

MODULES = ("compass", "scenes")
"""Modules of this room that make its rows."""

EXACT, OURS = "event-driven", "time stepping"
"""Our rows."""


@dataclass(frozen=True)
class CompassRow:
    """The compass gait in an engine."""

    engine: str
    """Name of the row's engine, or of our simulation method."""
    title: str
    """What tables call it."""
    step_s: float
    """Step, in s; NaN for our event-driven run."""
    walk: Mapping[str, Any] | None
    """Numbers of `CompassWalk`, complex ones as pairs; None if there are none."""
    reason: str
    """Why there are none."""


@dataclass(frozen=True, eq=False)
class CompassTable(PlainEntries):
    """The compass gait in every engine."""

    strides: int
    """Steps that it was to take."""
    settings: str
    """``defaults`` or ``best``."""
    rows: tuple[CompassRow, ...]
    """Engine by engine."""

    def __rich__(self) -> Table:
        table = bare_table("compass gait on 3 degrees")
        for heading in HEADINGS:
            table.add_column(heading)
        for row in self.to_dict()["rows"]:
            table.add_row(*compass_cells(row))
        return table


HEADINGS = (
    "engine", "h ms", "walks", "period s", "step m", "spread mrad", "multipliers", "±"
)  # fmt: skip
"""Of tables of the compass gait."""


def compass_cells(row: Mapping[str, Any]) -> list[str]:
    """Write a row in texts, one for each of `HEADINGS`.

    Parameters
    ----------
    row : mapping
        Of ``CompassTable.to_dict()``.
    """
    step = "–" if row["step_s"] is None else f"{1e3 * row['step_s']:g}"
    walk = row["walk"]
    if walk is None:
        return [row["title"], step, row["reason"], "–", "–", "–", "–", "–"]
    if walk["ending"]:
        said = f"no, {walk['strides']}: {walk['ending']}"
        return [row["title"], step, said, "–", "–", "–", "–", "–"]
    digits = 9 if row["engine"] == EXACT else 4
    if walk.get("undetermined"):  # files from before have none
        multipliers = f"none, disturbed: {walk['undetermined']}"
    else:
        multipliers = _written(walk["multipliers"], 6 if row["engine"] == EXACT else 2)
    return [
        row["title"], step, "yes", f"{walk['period_s']:.{digits}f}",
        f"{walk['step_m']:.{digits}f}", short(1e3 * walk["spread"]), multipliers,
        short(walk["error"]) if walk["error"] else "–",
    ]  # fmt: skip


def _written(multipliers: Sequence[Sequence[float]], digits: int) -> str:
    """Write multipliers, of a pair one with ±."""
    told = []
    for real, imaginary in multipliers:
        if imaginary > 0.0:
            told.append(f"{real:.{digits}f} ± {imaginary:.{digits}f}i")
        elif imaginary == 0.0:
            told.append(f"{real:.{digits}f}")
    return ", ".join(told).replace("-", "−")


@takes(SimulationError)
def compare_compass(
    *,
    engines: Sequence[str] | str = "all",
    settings: str = DEFAULTS,
    steps: Sequence[float] = STEPS,
    folder: Path | str | None = None,
    processes: EngineProcesses | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> CompassTable:
    """Let the passive compass gait walk down its slope in every engine.

    An engine in which it walks at none of the steps at its defaults has rows at its best settings,
    too.

    Parameters
    ----------
    engines : sequence of str or str
        Names of the engines; ``"all"`` is all of them.
    settings : str
        ``"defaults"`` or ``"best"``.
    steps : sequence of float
        Steps of the engines, in s.
    folder : path, optional
        Where rows are kept as they come, to go on from there.
    processes : EngineProcesses, optional
        Where engines have been asked before; they are not ended.
    progress : callable, optional
        Called before each walk with a text, and the share of them that is done.

    Returns
    -------
    CompassTable
        Cycles and multipliers, ours first.

    Raises
    ------
    SimulationError
        If there is no engine of a name.
    """
    entries = entries_called(engines)
    versions = peers(load=False)
    kept = KeptRows(folder, {}, MODULES)
    cycle, start = our_cycle()
    rows = [CompassRow(EXACT, f"heelstrike, {EXACT}", math.nan, _told(cycle), "")]
    for step in steps:
        walk = compass_walk(ByOurs(lambda h: TimeStepping(step=h), step), start)
        rows.append(CompassRow(OURS, f"heelstrike, {OURS}", step, _told(walk), ""))
    say = progress or (lambda text, share: None)  # noqa: ARG005
    begins = [start.q.tolist(), start.v.tolist()]

    def made(name: str, entry: Entry, step: float, which: str) -> CompassRow:
        title = entry.title if which == settings else f"{entry.title}, {which}"
        row = CompassRow(name, title, step, None, "")
        given = settings_of(name, entry, which)
        told = [name, step, begins, asked_of_engine(entry.package, given, versions)]
        try:
            refuse_absent(entry.package, versions)
            found = kept.entries(
                f"compass-{name}-{which}-{step:g}",
                told,
                partial(_in_engine, entry, step, given, start, processes),
            )
        except InvalidRunError as refused:
            return replace(row, reason=str(refused))
        return replace(row, walk=found)

    for k, (name, entry) in enumerate(entries.items()):
        for which in (settings,) if settings == BEST else (settings, BEST):
            own = []
            for step in steps:
                say(f"compass gait in {entry.title}, {which}, {1e3 * step:g} ms", k / len(entries))
                own.append(made(name, entry, step, which))
            rows += own
            walks = any(row.walk is not None and not row.walk["ending"] for row in own)
            if walks or not has_best(name):
                break
    return CompassTable(STRIDES, settings, tuple(rows))


def _in_engine(
    entry: Entry, step: float, given: Mapping[str, Any], start: State,
    processes: EngineProcesses | None,
) -> dict[str, Any]:  # fmt: skip
    with lent(processes) as own:
        return _told(compass_walk(InEngine(entry, step, given, own), start))


def _told(walk: CompassWalk) -> dict[str, Any]:
    """Return a walk as plain numbers and texts."""
    found = asdict(walk)
    found["multipliers"] = [[complex(each).real, complex(each).imag] for each in walk.multipliers]
    told: dict[str, Any] = plain(found)
    return told
