"""The same gait walked in every engine: what is simulated, kept, and told."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Group

from heelstrike.analysis.told_summary import PlainEntries
from heelstrike.arguments import takes
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.entries import ABSENT, entries_called
from heelstrike.experiments.engine_comparison.figures import WalkFigures, walk_figures
from heelstrike.experiments.engine_comparison.kept import KeptRows, asked_of_engine
from heelstrike.experiments.engine_comparison.rows import EngineRow
from heelstrike.experiments.engine_comparison.settings import (
    BEST,
    DEFAULTS,
    has_best,
    settings_of,
)
from heelstrike.experiments.engine_comparison.tables import walk_table
from heelstrike.experiments.engine_comparison.walk import TRUTH, Walk
from heelstrike.experiments.engines.packages import peers
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.served import EngineProcesses, lent
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.robot import Robot
from heelstrike.sim import Controller, TimeStepping
from heelstrike.sim.controller.law import Law
from heelstrike.sim.method import Method

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from heelstrike.experiments.engine_comparison.scene_table import SceneTable

STEP_SIZES = (2e-3, 1e-3, 5e-4, 2e-4)
"""Steps (s) of the engines, unless somebody asks for others."""

CONTROL_PERIOD = 2e-3
"""Seconds between two calls of the controller, the same in all engines: the longest step."""

OURS: Mapping[str, Callable[[float], Method]] = {
    "heelstrike": lambda step: TimeStepping(step=step),
}
"""Our own rows, by the names of commands: a method of a step."""


@dataclass(frozen=True, eq=False)
class EngineComparison(PlainEntries):
    """A gait walked in every engine."""

    robot: str
    """Name of the robot."""
    steps: int
    """Steps that were to be taken."""
    control_period_s: float
    """Seconds between two calls of the controller."""
    truth: WalkFigures
    """Figures of the run that the others are held against."""
    versions: Mapping[str, str]
    """Engines and their versions, or why they are not there."""
    rows: tuple[EngineRow, ...]
    """Walks, engine by engine."""
    absent: Mapping[str, str]
    """Simulators that are not run here, and why."""

    def plot(self, scenes: SceneTable | None = None) -> Figure:
        """Draw the error over the computing time of every engine.

        Parameters
        ----------
        scenes : SceneTable, optional
            Of which landing and rest are drawn beside the walk.

        Returns
        -------
        Figure
            Matplotlib's figure.
        """
        from heelstrike.view.engines_figure import draw_engines

        return draw_engines(
            [
                (row.title, row.settings, row.step_s, asdict(row.figures))
                for row in self.rows
                if row.figures is not None
            ],
            [asdict(row) for row in scenes.at_steps if row.error is not None] if scenes else [],
        )

    def __rich__(self) -> Group:
        return walk_table(self)


@takes(SimulationError)
def compare_engines(
    robot: Robot,
    controller: Law | Controller,
    gait: Gait,
    *,
    engines: Sequence[str] | str = "all",
    steps: int = 20,
    step_sizes: Sequence[float] = STEP_SIZES,
    settings: Sequence[str] = (DEFAULTS, BEST),
    control_period: float = CONTROL_PERIOD,
    friction: float = 0.75,
    patience: float = 60.0,
    folder: Path | str | None = None,
    films: bool = False,
    longest: float | None = None,
    processes: EngineProcesses | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> EngineComparison:
    """Walk a gait under a controller in other engines, and say what each gets right.

    Each engine has the robot link by link and its contact points; the controller, which is called
    with the engine's state and forces, is the same compiled law. Every walk runs in a process of
    its own: an engine that is missing, aborts or hangs has a row that says so.

    Parameters
    ----------
    robot : Robot
        A planar robot that floats.
    controller : law or controller
        What moves it. One in Python is copied for each walk.
    gait : Gait
        What it follows, and where it begins.
    engines : sequence of str or str
        Names of `ENTRIES`; ``"all"`` is all of them.
    steps : int
        Steps to walk.
    step_sizes : sequence of float
        Steps of the engines in s.
    settings : sequence of str
        ``"defaults"``: as the engine comes; ``"best"``: as the search found them.
    control_period : float
        Seconds between two calls of the controller.
    friction : float
        Coefficient of the ground.
    patience : float
        Seconds that an engine may take for one control period before it counts as hung.
    folder : path, optional
        Where walks are kept as they come. What is there already, of the same robot, gait,
        controller and program, is not walked again.
    films : bool
        Whether to write a film (.mp4) of each walk that falls into the folder.
    longest : float, optional
        Seconds that the steps of an engine may take in a walk. Of a walk that would take longer, as
        the same walk at a longer step foretells, the row says so; one that is kept is told. By
        default there is no limit.
    processes : EngineProcesses, optional
        Where engines have been asked before; they are not ended. By default the comparison has its
        own.
    progress : callable, optional
        Called before each walk with a text, and the share of walks that is done.

    Returns
    -------
    EngineComparison
        A row each engine, settings and step.

    Raises
    ------
    SimulationError
        If there is no engine of a name, or the walk is none.
    """
    entries = entries_called(engines)
    if steps < 1:
        raise SimulationError(f"a walk has at least one step, got {steps}")
    with lent(processes) as own:
        walk = Walk(robot, controller, gait, steps, control_period, friction, patience, own)
        say = progress or (lambda text, share: None)  # noqa: ARG005
        say("the truth, event by event", 0.0)
        truth = walk.ours(TRUTH)
        versions = peers(load=False)
        kept = KeptRows(folder if walk.can_be_told else None, walk.entries())
        asked = [("heelstrike", "heelstrike", DEFAULTS, step) for step in step_sizes]
        for name, entry in entries.items():
            for which in settings:
                if which == BEST and not has_best(name):
                    continue  # none is better than the defaults
                asked += [(name, entry.title, which, step) for step in step_sizes]
        rows: list[EngineRow] = []
        for k, (name, title, which, step) in enumerate(asked):
            say(f"{title}, {which}, {1e3 * step:g} ms", k / len(asked))
            row = EngineRow(
                name, title, which, step, None, "",
                f"heelstrike compare {robot.name} --engines {'all' if name in OURS else name} "
                f"--settings {which} --sizes {step:g} --steps {steps} --period {control_period:g} "
                f"--controller {type(controller).__name__}",
            )  # fmt: skip
            if name in OURS:
                rows.append(kept.row(row, {}, partial(walk.by, OURS[name](step), truth)))
                continue
            entry = entries[name]
            given = settings_of(name, entry, which)
            told = asked_of_engine(entry.package, given, versions)
            film = Path(folder) / f"{name}-{which}-{step:g}.mp4" if films and folder else None
            make = partial(walk.in_engine, entry, step, given, truth, versions, film)
            taken = _foretold(rows, row, walk.scenario.duration)
            if longest is not None and taken > longest:
                make = partial(_refuse, row, steps, taken, longest)
            found = kept.row(row, told, make)
            fell = found.figures is not None and not found.figures.walks
            if fell and film is not None and not film.exists():
                try:
                    make()  # it was kept by a comparison without films
                except (InvalidRunError, SimulationError) as error:
                    say(f"no film of {title}, {which}: {error}", k / len(asked))
            rows.append(found)
    return EngineComparison(
        robot=robot.name,
        steps=steps,
        control_period_s=control_period,
        truth=walk_figures(truth, truth, gait, steps),
        versions={e.package: versions[e.package] for e in entries.values()},
        rows=tuple(rows),
        absent=ABSENT if engines == "all" else {},
    )


def _foretold(rows: Sequence[EngineRow], row: EngineRow, duration: float) -> float:
    """Seconds that the steps of a walk (s) will take, as the row before it has them; 0 if none."""
    before = rows[-1] if rows else row
    same = (before.engine, before.settings) == (row.engine, row.settings)
    if not same or before.figures is None or before.step_s <= row.step_s:
        return 0.0
    return 1e-6 * before.figures.step_us * duration / row.step_s


def _refuse(row: EngineRow, steps: int, taken: float, longest: float) -> WalkFigures:
    raise InvalidRunError(
        f"not walked: its {steps} steps at {1e3 * row.step_s:g} ms would take about "
        f"{taken / 60.0:.1f} min, longer than {longest / 60.0:g} min"
    )
