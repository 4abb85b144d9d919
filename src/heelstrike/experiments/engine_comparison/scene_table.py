"""The scenes with closed forms in every engine, and by us; two of them at several steps."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.table import Table

from heelstrike.analysis.told_summary import PlainEntries
from heelstrike.arguments import takes
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.entries import Entry, entries_called
from heelstrike.experiments.engine_comparison.kept import KeptRows, asked_of_engine
from heelstrike.experiments.engine_comparison.scenes import (
    Scene,
    our_scene_error,
    scene_error,
    scenes,
)
from heelstrike.experiments.engine_comparison.settings import DEFAULTS, settings_of
from heelstrike.experiments.engine_comparison.tables import short
from heelstrike.experiments.engines.packages import peers, refuse_absent
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.served import PATIENCE, EngineProcesses, lent
from heelstrike.field_texts import dataclass
from heelstrike.sim import Compliant, EventDriven, TimeStepping
from heelstrike.sim.method import Method
from heelstrike.view.terminal import bare_table

MODULES = ("scenes",)
"""Modules of this room that make errors."""

STEP = 1e-3
"""Step of the engines, in s."""

EXACT = EventDriven(rtol=1e-11, atol=1e-13)
"""Our event-driven row."""

OURS = {"event-driven": EXACT, "time stepping": TimeStepping(step=STEP)}
"""Our rows."""

AT_STEPS: Mapping[str, str] = {
    "landing": "cube thrown onto a corner",
    "rest": "cube below the angle of friction",
}
"""Scenes whose error and computing time are measured at several steps, by what they show."""
STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2e-4)
"""Those steps, in s."""
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
"""Relative tolerances of our event-driven runs, which have no step, in their stead."""


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


@dataclass(frozen=True)
class StepRow:
    """A scene in an engine at one of several steps."""

    shows: str
    """``landing`` or ``rest``."""
    title: str
    """What tables call the engine."""
    step_s: float
    """Step, in s; of our event-driven runs their relative tolerance."""
    error: float | None
    """What is measured less what the closed form gives, without its sign; None if nothing is."""
    computing_s: float | None
    """Computing time, in s."""
    reason: str = ""
    """Why there is nothing."""


@dataclass(frozen=True, eq=False)
class SceneTable(PlainEntries):
    """The scenes in every engine."""

    scenes: tuple[tuple[str, float, str, str], ...]
    """Name, exact value, unit and closed form of each."""
    settings: str
    """``defaults`` or ``best``."""
    step_s: float
    """Step of the engines, in s."""
    rows: tuple[SceneRow, ...]
    """Errors, scene by scene."""
    at_steps: tuple[StepRow, ...] = ()
    """Errors and computing times of `AT_STEPS`, engine by engine."""

    def __rich__(self) -> Group:
        parts: list[Table | str] = []
        for name, exact, unit, words in self.scenes:
            value = f"{exact:.6g} {unit}".rstrip()
            table = bare_table(f"{name}: {value}, {words}", ("engine",), (f"error {unit}",))
            for row in self.rows:
                if row.scene == name:
                    error = row.reason if row.error is None else short(row.error)
                    table.add_row(row.title, error)
            parts.append(table)
        parts += [f"{each}." for each in why_not_at_steps(self.to_dict())]
        return Group(*parts)


def why_not_at_steps(found: Mapping[str, Any]) -> list[str]:
    """Tell why there is nothing at some of several steps, where the scene's row does not say so.

    Parameters
    ----------
    found : mapping
        Of ``SceneTable.to_dict()``.
    """
    said = {(row["scene"], row["title"], row["reason"]) for row in found["rows"]}
    return [
        f"{row['title']}, {AT_STEPS[row['shows']]}, {1e3 * row['step_s']:g} ms: {row['reason']}"
        for row in found.get("at_steps", ())
        if row.get("reason") and (AT_STEPS[row["shows"]], row["title"], row["reason"]) not in said
    ]


@takes(SimulationError)
def compare_scenes(
    *,
    engines: Sequence[str] | str = "all",
    settings: str = DEFAULTS,
    step: float = STEP,
    steps: Sequence[float] = STEPS,
    patience: float = PATIENCE,
    folder: Path | str | None = None,
    processes: EngineProcesses | None = None,
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
    steps : sequence of float
        Steps at which landing and rest are simulated, too.
    patience : float
        Seconds that an engine may take for a scene before it counts as hung.
    folder : path, optional
        Where errors are kept as they come, to go on from there. What is timed runs again.
    processes : EngineProcesses, optional
        Where engines have been asked before; they are not ended.
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
    with lent(processes) as own:
        asked = _Engines(folder, settings, versions, own, patience)
        rows, at_steps = [], []
        say = progress or (lambda text, share: None)  # noqa: ARG005
        for k, scene in enumerate(everything):
            for name, method in OURS.items():
                error, _ = our_scene_error(scene, method)
                rows.append(SceneRow(scene.name, name, f"heelstrike, {name}", error, ""))
            for name, entry in entries.items():
                say(f"{scene.name}, {entry.title}", k / (len(everything) + len(AT_STEPS)))
                try:
                    found = asked.error(scene, name, entry, step)
                except InvalidRunError as refused:
                    rows.append(SceneRow(scene.name, name, entry.title, None, str(refused)))
                else:
                    rows.append(SceneRow(scene.name, name, entry.title, found, ""))
        called = {scene.name: scene for scene in everything}
        for shows, of_scene in AT_STEPS.items():
            if of_scene not in called or not steps:
                continue
            scene = called[of_scene]
            at_steps += _by_ours(shows, scene, steps)
            for name, entry in entries.items():
                say(f"{scene.name}, {entry.title}, at several steps", 1.0)
                for each in steps:
                    try:
                        found, seconds = asked.timed(scene, name, entry, each)
                    except InvalidRunError as refused:
                        row = StepRow(shows, entry.title, each, None, None, str(refused))
                    else:
                        row = StepRow(shows, entry.title, each, abs(found), seconds)
                    at_steps.append(row)
    told = tuple((s.name, s.exact, s.unit, s.source) for s in everything)
    return SceneTable(told, settings, step, tuple(rows), tuple(at_steps))


def _by_ours(shows: str, scene: Scene, steps: Sequence[float]) -> list[StepRow]:
    """Simulate a scene by our methods at several steps or tolerances."""
    methods: list[tuple[str, float, Method]] = [
        ("heelstrike, event-driven", rtol, EventDriven(rtol=rtol, atol=1e-2 * rtol))
        for rtol in TOLERANCES
    ]
    for title, of in (("time stepping", TimeStepping), ("compliant", Compliant)):
        methods += [(f"heelstrike, {title}", step, of(step=step)) for step in steps]
    rows = []
    for title, step, method in methods:
        our_scene_error(scene, method)  # what is compiled or made for the first time is not timed
        error, seconds = our_scene_error(scene, method)
        rows.append(StepRow(shows, title, step, abs(error), seconds))
    return rows


class _Engines:
    """Engines that are asked for scenes, each in its process.

    Their errors are kept, but not how long they took: that is of this machine and day, as is ours.
    """

    def __init__(
        self, folder: Path | str | None, settings: str, versions: Mapping[str, str],
        processes: EngineProcesses, patience: float,
    ) -> None:  # fmt: skip
        self._kept = KeptRows(folder, {}, MODULES)
        self._settings, self._versions = settings, versions
        self._processes, self._patience = processes, patience

    def error(self, scene: Scene, name: str, entry: Entry, step: float) -> float:
        """Return the error of a scene, which may be kept."""
        given = self._given(name, entry)

        def make() -> dict[str, Any]:
            error, _ = self.timed(scene, name, entry, step)
            return {"error": error}

        words = "-".join(re.findall(r"[\w.]+", scene.name))
        told = [name, scene.exact, step, asked_of_engine(entry.package, given, self._versions)]
        error: float = self._kept.entries(f"scene-{words}-{name}-{step:g}", told, make)["error"]
        return error

    def timed(self, scene: Scene, name: str, entry: Entry, step: float) -> tuple[float, float]:
        """Simulate a scene now; return its error and the seconds that it took."""
        given = self._given(name, entry)
        process = self._processes.of(entry.package)
        error, seconds = scene_error(scene, entry, step, given, process, self._patience)
        if not math.isfinite(error):
            raise InvalidRunError("what it ends with is not finite")
        return error, seconds

    def _given(self, name: str, entry: Entry) -> dict[str, Any]:
        """Return the settings of an engine that is there."""
        refuse_absent(entry.package, self._versions)
        return settings_of(name, entry, self._settings)
