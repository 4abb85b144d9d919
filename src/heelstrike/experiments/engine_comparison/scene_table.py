"""The scenes with closed forms in every engine, and by us."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table

from heelstrike.analysis.told_summary import plain
from heelstrike.arguments import takes
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.entries import entries_called
from heelstrike.experiments.engine_comparison.scenes import our_scene_error, scene_error, scenes
from heelstrike.experiments.engine_comparison.settings import DEFAULTS, settings_of
from heelstrike.experiments.engine_comparison.tables import short
from heelstrike.experiments.engines.packages import PACKAGES, compared, peers
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.served import engine_process
from heelstrike.field_texts import dataclass
from heelstrike.sim import EventDriven, TimeStepping

STEP = 1e-3
"""Step of the engines, in s."""

EXACT = EventDriven(rtol=1e-11, atol=1e-13)
"""Our event-driven row."""

OURS = {"event-driven": EXACT, "time stepping": TimeStepping(step=STEP)}
"""Our rows."""


@dataclass(frozen=True)
class SceneRow:
    """A scene in an engine."""

    scene: str
    """Name of the scene."""
    engine: str
    """Name of the row's engine, or of our simulation method."""
    title: str
    """What tables call it."""
    error: float | None
    """What is measured less what the closed form gives; None if there is nothing."""
    reason: str
    """Why there is nothing."""


@dataclass(frozen=True, eq=False)
class SceneTable:
    """The scenes in every engine."""

    scenes: tuple[tuple[str, float, str, str], ...]
    """Name, exact value, unit and closed form of each."""
    settings: str
    """``defaults`` or ``best``."""
    step_s: float
    """Step of the engines, in s."""
    rows: tuple[SceneRow, ...]
    """Errors, scene by scene."""

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and texts."""
        found: dict[str, Any] = plain(
            {
                "scenes": [list(each) for each in self.scenes],
                "settings": self.settings,
                "step_s": self.step_s,
                "rows": [asdict(row) for row in self.rows],
            }
        )
        return found

    def __rich__(self) -> Group:
        parts: list[Table | str] = []
        for name, exact, unit, words in self.scenes:
            value = f"{exact:.6g} {unit}".rstrip()
            table = Table(
                title=f"{name}: {value}, {words}", title_justify="left",
                box=SIMPLE_HEAD, show_edge=False,
            )  # fmt: skip
            table.add_column("engine")
            table.add_column(f"error {unit}", justify="right")
            for row in self.rows:
                if row.scene == name:
                    error = row.reason if row.error is None else short(row.error)
                    table.add_row(row.title, error)
            parts.append(table)
        return Group(*parts)


@takes(SimulationError)
def compare_scenes(
    *,
    engines: Sequence[str] | str = "all",
    settings: str = DEFAULTS,
    step: float = STEP,
    progress: Callable[[str, float], None] | None = None,
) -> SceneTable:
    """Simulate scenes whose ends are known in every engine.

    Parameters
    ----------
    engines : sequence of str or str
        Names of the engines; ``"all"`` is all of them.
    settings : str
        ``"defaults"`` or ``"best"``.
    step : float
        Step of the engines in s.
    progress : callable, optional
        Called before each scene with a text, and the share of scenes that is done.

    Returns
    -------
    SceneTable
        Errors, scene by scene.

    Raises
    ------
    SimulationError
        If there is no engine of a name.
    """
    entries = entries_called(engines)
    versions = peers(load=False)
    everything = scenes()
    rows = []
    say = progress or (lambda text, share: None)  # noqa: ARG005
    processes = {entry.package: engine_process(entry.package) for entry in entries.values()}
    try:
        for k, scene in enumerate(everything):
            for name, method in OURS.items():
                error = our_scene_error(scene, method)
                rows.append(SceneRow(scene.name, name, f"heelstrike, {name}", error, ""))
            for name, entry in entries.items():
                say(f"{scene.name}, {entry.title}", k / len(everything))
                found, reason = None, ""
                state = versions[entry.package]
                if compared({entry.package: state}):
                    try:
                        given = settings_of(name, entry, settings)
                        found, _ = scene_error(scene, entry, step, given, processes[entry.package])
                    except InvalidRunError as refused:
                        reason = str(refused)
                else:
                    reason = f"{PACKAGES[entry.package].title} is {state}"
                rows.append(SceneRow(scene.name, name, entry.title, found, reason))
    finally:
        for process in processes.values():
            process.end()
    told = tuple((s.name, s.exact, s.unit, s.source) for s in everything)
    return SceneTable(told, settings, step, tuple(rows))
