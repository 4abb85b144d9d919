"""The same gait walked in every engine: what is simulated, kept, and told."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Group

from heelstrike.analysis.summary import plain
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.entries import ABSENT, Entry, entries_called
from heelstrike.experiments.engine_comparison.figures import WalkFigures, walk_figures
from heelstrike.experiments.engine_comparison.kept import KeptRows
from heelstrike.experiments.engine_comparison.rows import EngineRow
from heelstrike.experiments.engine_comparison.settings import (
    BEST,
    DEFAULTS,
    best_settings,
    settings_of,
)
from heelstrike.experiments.engine_comparison.tables import walk_table
from heelstrike.experiments.engine_comparison.walking import walk_in
from heelstrike.experiments.engines.packages import PACKAGES, compared, peers
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.experiments.engines.served import served
from heelstrike.experiments.walk import LAST_STEP
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.gait.file import entries_of
from heelstrike.robot import Robot
from heelstrike.robot.files.robot_json import robot_entries
from heelstrike.sim import Controller, EventDriven, Run, TimeStepping, simulate
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.law import Law
from heelstrike.sim.method import Method

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEP_SIZES = (2e-3, 1e-3, 5e-4, 2e-4)
"""Steps (s) of the engines, unless somebody asks for others."""

CONTROL_PERIOD = 2e-3
"""Seconds between two calls of the controller, the same in all engines: the longest step."""

TRUTH = EventDriven(rtol=1e-9, atol=1e-11, output_period=1e-3)
"""What the engines are held against."""

OURS: Mapping[str, Callable[[float], Method]] = {
    "heelstrike": lambda step: TimeStepping(step=step),
}
"""Our own rows, by the names of commands: a method of a step."""


@dataclass(frozen=True, eq=False)
class EngineComparison:
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

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain numbers and texts, NaN as None."""
        found: dict[str, Any] = plain(
            {
                "robot": self.robot,
                "steps": self.steps,
                "control_period_s": self.control_period_s,
                "truth": asdict(self.truth),
                "versions": dict(self.versions),
                "rows": [asdict(row) for row in self.rows],
                "absent": dict(self.absent),
            }
        )
        return found

    def plot(self) -> Figure:
        """Draw the error over the computing time of every engine."""
        from heelstrike.view.engines_figure import draw_engines

        return draw_engines(
            [
                (row.title, row.settings, row.step_s, asdict(row.figures))
                for row in self.rows
                if row.figures is not None
            ]
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
    patience: float = 600.0,
    folder: Path | str | None = None,
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
    walk = Walk(robot, controller, gait, steps, control_period, friction, patience)
    say = progress or (lambda text, share: None)  # noqa: ARG005
    say("the truth, event by event", 0.0)
    truth = walk.ours(TRUTH)
    versions = peers()
    kept = KeptRows(folder, walk.entries())
    asked = [("heelstrike", "heelstrike", DEFAULTS, step) for step in step_sizes]
    for name, entry in entries.items():
        for which in settings:
            if which == BEST and not best_settings().get(name, {}).get("settings"):
                continue  # none is better than the defaults
            asked += [(name, entry.title, which, step) for step in step_sizes]
    rows = []
    for k, (name, title, which, step) in enumerate(asked):
        say(f"{title}, {which}, {1e3 * step:g} ms", k / len(asked))
        row = EngineRow(
            name, title, which, step, None, "",
            f"heelstrike compare {robot.name} --engines {name} --settings {which} "
            f"--sizes {step:g} --steps {steps}",
        )  # fmt: skip
        if name in OURS:
            rows.append(kept.row(row, {}, partial(walk.by, OURS[name](step), truth)))
            continue
        entry = entries[name]
        given = settings_of(name, entry, which)
        told = {"given": given, "version": versions[entry.package]}
        make = partial(walk.in_engine, entry, step, given, truth, versions)
        rows.append(kept.row(row, told, make))
    return EngineComparison(
        robot=robot.name,
        steps=steps,
        control_period_s=control_period,
        truth=walk_figures(truth, truth, gait, steps),
        versions={e.package: versions[e.package] for e in entries.values()},
        rows=tuple(rows),
        absent=ABSENT if engines == "all" else {},
    )


@dataclass(frozen=True, eq=False)
class Walk:
    """What is walked, whatever moves the robot."""

    robot: Robot
    controller: Law | Controller
    gait: Gait
    steps: int
    control_period: float
    friction: float
    patience: float
    """robot, controller, gait, steps, control_period, friction, patience: As of
    :func:`compare_engines`."""

    def entries(self) -> dict[str, Any]:
        """Return all that a walk follows from but the engine, as JSON has it."""
        law = self.controller
        asked: Any = AskedLaw(self.robot, law, compiled=True) if isinstance(law, Law) else law
        begins = asked.snapshot().tolist() if hasattr(asked, "snapshot") else repr(type(law))
        return {
            "robot": robot_entries(self.robot),
            "controller": [str(getattr(asked, "name", type(law).__name__)), begins],
            "gait": entries_of(self.gait),
            "steps": self.steps,
            "control_period": self.control_period,
            "friction": self.friction,
        }

    @property
    def scenario(self) -> Scenario:
        """What the engines simulate."""
        duration = (self.steps + LAST_STEP) * self.gait.step_duration
        return Scenario(
            "walk", self.robot, self.gait.initial_state, duration, friction=self.friction
        )

    def ours(self, method: Method) -> Run:
        """Walk by a method of ours.

        Parameters
        ----------
        method : Method
            Which.
        """
        scenario = self.scenario
        return simulate(
            self.robot, self.controller, state=scenario.state, duration=scenario.duration,
            method=method, ground=Ground(friction=self.friction),
            control_period=self.control_period,
        )  # fmt: skip

    def by(self, method: Method, truth: Run) -> WalkFigures:
        """Walk by a method of ours, and measure it.

        Parameters
        ----------
        method : Method
            Which.
        truth : Run
            What is held for true.
        """
        return walk_figures(self.ours(method), truth, self.gait, self.steps)

    def in_engine(
        self, entry: Entry, step: float, given: Mapping[str, Any], truth: Run,
        versions: Mapping[str, str],
    ) -> WalkFigures:  # fmt: skip
        """Walk in an engine, and measure it.

        Parameters
        ----------
        entry : Entry
            Its row.
        step : float
            Seconds.
        given : mapping
            Its settings.
        truth : Run
            What is held for true.
        versions : mapping
            What :func:`~heelstrike.experiments.engines.peers` says of the engines.

        Raises
        ------
        InvalidRunError
            If the engine is missing, ends, hangs or refuses.
        """
        run, told = self.run_in(entry, step, given, versions)
        return walk_figures(run, truth, self.gait, self.steps, friction_told=told)

    def run_in(
        self, entry: Entry, step: float, given: Mapping[str, Any], versions: Mapping[str, str]
    ) -> tuple[Run, bool]:
        """Walk in an engine; return the run, and whether it tells tangential forces.

        Parameters
        ----------
        entry : Entry
            Its row.
        step : float
            Seconds.
        given : mapping
            Its settings.
        versions : mapping
            What :func:`~heelstrike.experiments.engines.peers` says of the engines.

        Raises
        ------
        InvalidRunError
            If the engine is missing, ends, hangs or refuses.
        """
        state = versions[entry.package]
        if not compared({entry.package: state}):
            raise InvalidRunError(f"{PACKAGES[entry.package].title} is {state}")
        peer = served(entry.package, self.scenario, step, patience=self.patience, **given)
        controller = self.controller
        if not isinstance(controller, Law):
            controller = deepcopy(controller)
        try:
            run = walk_in(peer, controller, control_period=self.control_period, name=entry.title)
        finally:
            peer.close()
        return run, bool(peer.facts["tells_friction"])
