"""Running the zoo: robot by robot, its cells on several threads, each kept as it is finished."""

from __future__ import annotations

import csv
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import field, fields, replace
from pathlib import Path
from typing import Any, cast

from heelstrike.analysis.stability.trial import Trial
from heelstrike.errors import GaitError, HeelstrikeError, RobotError, SimulationError
from heelstrike.experiments.laws import CONTROLLERS, SAMPLE, Entry, gait_for, law_called
from heelstrike.experiments.zoo.disturbances import DISTURBANCES, Disturbance, Effort, chances
from heelstrike.experiments.zoo.results import (
    STANDS,
    Animal,
    Cell,
    Results,
    Settings,
    load_results,
)
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait, load_gait
from heelstrike.gait.gait import fingerprint
from heelstrike.robot import Robot, builtin_robots
from heelstrike.robot.files.options import LoadOptions
from heelstrike.robot.library import load_planar_robot
from heelstrike.sim.method import Method
from heelstrike.sim.time_stepping.method import TimeStepping
from heelstrike.wording import meant

USUAL, QUICK = Settings(), Settings(trials=1, strides=5, halvings=2)
"""Settings of a table to show, and of one for a try."""

LOOK_EVERY = 0.1
"""Seconds between two looks at what the threads do."""


@dataclass
class Progress:
    """How far a campaign is."""

    cells: int
    finished: int = 0
    """cells, finished: Cells asked for, and those that are there."""
    doing: dict[str, float] = field(default_factory=dict)
    """What is going on, and how much of it is done, from 0 to 1."""
    files: tuple[Path, ...] = ()
    """Files written since it was told last."""


def zoo(
    robots: Mapping[str, Robot],
    *,
    controllers: Sequence[Entry] = CONTROLLERS,
    disturbances: Sequence[Disturbance] = DISTURBANCES,
    settings: Settings = USUAL,
    method: Method | None = None,
    folder: Path | None = None,
    afresh: bool = False,
    workers: int | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Results:
    """Find how large disturbances controllers withstand on robots.

    Parameters
    ----------
    robots : mapping of str to Robot
        Robots by the names that they have in the table.
    controllers : sequence of Entry
        Controllers; all of the zoo by default.
    disturbances : sequence of Disturbance
        Disturbances; all of the zoo by default.
    settings : Settings
        Seed, trials, and how finely sizes are searched; its method is the name of `method`.
    method : Method, optional
        Simulation method; ``TimeStepping(step=1e-3)`` by default.
    folder : Path, optional
        Where ``zoo.json`` is kept, with every cell that is finished, and gaits. What is there
        already is not done again; cells that are not asked for stay in the file.
    afresh : bool
        Start again whatever is there.
    workers : int, optional
        Threads; by default one a processor.
    progress : callable, optional
        Called often with how far it is.

    Returns
    -------
    Results
        The cells asked for. The same whatever the number of threads.

    Raises
    ------
    SimulationError
        If nothing is asked for, or the file in the folder is of other settings.
    WriteError
        If the folder cannot be written to.
    KeyboardInterrupt
        At Ctrl-C; the file has what was finished.
    """
    method = TimeStepping(step=1e-3) if method is None else method
    settings = replace(settings, method=in_words(method))
    for name in ("trials", "strides"):
        if getattr(settings, name) < 1:
            raise SimulationError(f"{name} must be at least 1, got {getattr(settings, name)}")
    if workers is not None and workers < 1:
        raise SimulationError(f"workers must be at least 1, got {workers}")
    keys = [
        (robot, entry.name, disturbance.name)
        for robot in robots
        for entry in controllers
        for disturbance in disturbances
    ]
    if not keys:
        raise SimulationError("there is nothing to do: name robots, controllers and disturbances")
    campaign = _Campaign(
        results=_begun(folder, settings, afresh=afresh),
        method=method,
        folder=folder,
        afresh=afresh,
        workers=workers or os.cpu_count() or 1,
        show=progress or (lambda _: None),
        progress=Progress(len(keys)),
    )
    campaign.begin()
    for name, robot in robots.items():
        campaign.visit(name, robot, controllers, disturbances)
    return campaign.results.chosen(keys, disturbances)


def in_words(method: Method) -> str:
    """Return the name of a method, with its step and all that is not as usual."""
    usual = {each.name: each.default for each in fields(cast("Any", method))}  # all have some
    told = [
        f"{name}={value}" for name, value in vars(method).items()
        if name in usual and (name == "step" or value != usual[name])
    ]  # fmt: skip
    return f"{type(method).__name__}({', '.join(told)})"


def loaded(words: str, how: LoadOptions) -> dict[str, Robot]:
    """Load robots by their names and files, with commas between; `how` is for files.

    A file whose name has a comma stands in double quotes.

    Raises
    ------
    RobotError
        If one cannot be loaded, two have the same name, or files are to be read in some way and
        none is named.
    """
    robots: dict[str, Robot] = {}
    named = _words(words)
    if any(how.values()) and all(word in builtin_robots() for word in named):
        raise RobotError(
            f"options say how files are read, and {', '.join(named)} are built in: leave out "
            f"{', '.join(name for name, value in how.items() if value)}, or name a file"
        )
    for word in named:
        built_in = word in builtin_robots()
        name = word if built_in else Path(word).name
        if name in robots:
            raise RobotError(
                f"two robots are called {name!r}: name each once, and files differently"
            )
        robots[name] = load_planar_robot(word) if built_in else load_planar_robot(word, **how)
    return robots


def chosen_controllers(words: str | None) -> tuple[Entry, ...]:
    """Return controllers by their names, with commas between; all of the zoo for None.

    Raises
    ------
    ControllerError
        If there is none of a name; see :func:`~heelstrike.experiments.laws.law_called`.
    """
    if words is None:
        return CONTROLLERS
    return tuple({entry.name: entry for entry in map(law_called, _words(words))}.values())


def chosen_disturbances(words: str | None) -> tuple[Disturbance, ...]:
    """Return disturbances by their names, with commas between; all of the zoo for None.

    Raises
    ------
    SimulationError
        If there is none of a name; the message has the nearest.
    """
    found = {each.name.lower(): each for each in DISTURBANCES}
    chosen = found if words is None else {}
    for name in _words(words or ""):
        if name.lower() not in found:
            guess = meant(name.lower(), {low: repr(each.name) for low, each in found.items()})
            raise SimulationError(
                f"there is no disturbance {name!r}.{guess} There are "
                f"{', '.join(each.name for each in DISTURBANCES)}."
            )
        chosen[name.lower()] = found[name.lower()]
    return tuple(chosen.values())


def _words(words: str) -> list[str]:
    """Words between commas; one that has a comma itself stands in double quotes."""
    read = csv.reader([" ".join(words.splitlines())], skipinitialspace=True)
    return [word.strip() for row in read for word in row if word.strip()]


def _begun(folder: Path | None, settings: Settings, *, afresh: bool) -> Results:
    """Return what a folder has already."""
    if folder is None:
        return Results(settings)
    path = folder / "zoo.json"
    if afresh or not path.exists():
        return Results(settings)
    results = load_results(path)
    differing = [
        f"{name} {there}, not {asked}"
        for name, there in vars(results.settings).items()
        if there != (asked := getattr(settings, name))
    ]
    if differing:
        raise SimulationError(
            f"{path} was made with {'; '.join(differing)}. Ask for the same to go on with it, for "
            "another folder, or to start again (--afresh)."
        )
    return results


@dataclass
class _Campaign:
    """What goes on while the zoo runs."""

    results: Results
    method: Method
    folder: Path | None
    afresh: bool
    workers: int
    show: Callable[[Progress], None]
    progress: Progress
    stop: threading.Event = field(default_factory=threading.Event)

    def begin(self) -> None:
        """Write what is there already, so that a folder that cannot be written to is told first."""
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
            self.progress.files = (self.results.save(self.folder / "zoo.json"),)
        self.show(self.progress)
        self.progress.files = ()

    def keep(self, *cells: Cell) -> None:
        """Keep cells, on the disk, too."""
        self.results.put(*cells)
        self.progress.finished += len(cells)
        if self.folder is not None and cells:
            self.results.save(self.folder / "zoo.json")
        self.show(self.progress)

    def visit(
        self, name: str, robot: Robot, controllers: Sequence[Entry],
        disturbances: Sequence[Disturbance],
    ) -> None:  # fmt: skip
        """Fill the cells of a robot that are not there."""
        known = self.results.animals.get(name)
        if known is None or known.fingerprint != fingerprint(robot):
            self.results.meet(
                Animal(robot=name, fingerprint=fingerprint(robot), mass=robot.total_mass)
            )
        missing = {
            entry.name: tuple(
                each for each in disturbances
                if (name, entry.name, each.name) not in self.results.cells
            )
            for entry in controllers
        }  # fmt: skip
        wanted = sum(map(len, missing.values()))
        self.progress.finished += len(controllers) * len(disturbances) - wanted
        self.show(self.progress)
        gait: Gait | HeelstrikeError | None = None
        work: list[tuple[Entry, Trial, Disturbance]] = []
        for entry in controllers:
            todo = missing[entry.name]
            if not todo:
                continue
            word = entry.needs(robot)
            if not word and not entry.stands and gait is None:
                gait = self._gait(name, robot)
            trial, word, reason = self._trial(name, robot, entry, gait, word)
            if trial is None:
                self.keep(*(self._empty(name, entry, each, word, reason) for each in todo))
                continue
            unfit = [each for each in todo if entry.stands and not each.standing]
            why = "a robot that stands does not come to it"
            self.keep(*(self._empty(name, entry, each, STANDS, why) for each in unfit))
            work += [(entry, trial, each) for each in todo if each not in unfit]
        self._measure(name, work)

    def _gait(self, name: str, robot: Robot) -> Gait | HeelstrikeError:
        """Load or design the gait of a robot; return why there is none."""
        path = None if self.folder is None else self.folder / f"gait-{name}.json"
        gait = None
        if path is not None and path.exists() and not self.afresh:
            try:
                gait = load_gait(path, robot)
            except GaitError:  # of another robot, or damaged
                gait = None
        if gait is None:
            self._doing({f"{name}: designing a gait": 0.0})
            try:
                gait = gait_for(robot)
            except GaitError as error:
                return error
            if path is not None:
                gait.save(path)
        self.results.animals[name] = replace(
            self.results.animals[name], step_length=gait.step_length,
            step_duration=gait.step_duration,
        )  # fmt: skip
        return gait

    def _trial(
        self, name: str, robot: Robot, entry: Entry, gait: Gait | HeelstrikeError | None, word: str
    ) -> tuple[Trial | None, str, str]:
        """Return the walk of a controller, or why there is none, in a word and in full."""
        if word:
            return None, word, ""
        if isinstance(gait, HeelstrikeError) and not entry.stands:
            return None, "no gait", str(gait)
        self._doing({f"{name}: {entry.name}, undisturbed": 0.0})
        try:
            given = gait if isinstance(gait, Gait) else None
            trial = sampled(entry.trial(robot, given), self.method)
            run = trial.run(trial.begins)
            verdict = trial.recovered(run, (trial.begins, trial.begins))
        except HeelstrikeError as error:
            return None, "refused", str(error)
        if verdict:
            return trial, "", ""
        if not run.completed:
            word = "falls"
        elif verdict.pitch >= trial.pitch:
            word = "leans"
        else:
            word = "strays"
        return None, word, f"undisturbed, {verdict.reason}"

    def _empty(
        self, name: str, entry: Entry, disturbance: Disturbance, word: str, reason: str
    ) -> Cell:
        return Cell(
            robot=name, controller=entry.name, disturbance=disturbance.name, word=word,
            reason=reason,
        )  # fmt: skip

    def _doing(self, what: dict[str, float]) -> None:
        self.progress.doing = what
        self.show(self.progress)

    def _measure(self, name: str, work: list[tuple[Entry, Trial, Disturbance]]) -> None:
        """Measure cells on threads; keep each as it is finished, those at Ctrl-C, too."""
        watches = [_Watch(self.stop, f"{name}: {e.name}, {d.name}") for e, _, d in work]
        with ThreadPoolExecutor(self.workers, thread_name_prefix="zoo") as pool:
            waiting = {
                pool.submit(self._cell, name, *each, watch)
                for each, watch in zip(work, watches, strict=True)
            }
            try:
                while waiting:
                    done, waiting = wait(waiting, LOOK_EVERY, FIRST_COMPLETED)
                    self.keep(*(future.result() for future in done))
                    self._doing({w.what: w.share for w in watches if w.begun and not w.ended})
            except BaseException:
                self.stop.set()
                begun = [future for future in waiting if not future.cancel()]
                self.keep(*(each.result() for each in begun if each.exception() is None))
                raise
            finally:
                self.progress.doing = {}

    def _cell(
        self, name: str, entry: Entry, trial: Trial, disturbance: Disturbance, watch: _Watch
    ) -> Cell:
        settings = self.results.settings
        effort = Effort(settings.strides, settings.halvings)
        by_chance = disturbance.by_chance and not entry.stands
        draws = chances(settings.seed, settings.trials)[: None if by_chance else 1]
        watch.begin(len(draws) * (effort.strides + effort.halvings + 1))
        watched = replace(trial, progress=watch)
        try:
            found = [disturbance.measure(watched, draw, effort) for draw in draws]
        except HeelstrikeError as error:
            return self._empty(name, entry, disturbance, "refused", str(error))
        finally:
            watch.ended = True
        return Cell(
            robot=name,
            controller=entry.name,
            disturbance=disturbance.name,
            withstood=tuple(each.recovered for each in found),
            failed=tuple(each.failed for each in found),
            walks=sum(each.trials for each in found),
        )


class _Watch:
    """Looks on while a cell is measured: counts its walks, and ends them when all shall stop."""

    def __init__(self, stop: threading.Event, what: str) -> None:
        self.what = what
        self.begun = self.ended = False
        self._stop, self._time, self._walks, self._most = stop, 0.0, 0, 1

    def begin(self, walks: int) -> None:
        """Begin with a cell of so many walks at most."""
        self.begun, self._most = True, walks

    def __call__(self, time: float) -> None:
        """Look at the time that a walk has reached, in s."""
        if self._stop.is_set():
            raise KeyboardInterrupt
        self._walks += time <= self._time  # a new one
        self._time = time

    @property
    def share(self) -> float:
        """How much of the cell is done, at least, from 0 to 1."""
        return min(self._walks / self._most, 1.0)


def sampled(trial: Trial, method: Method) -> Trial:
    """Return a trial by another method, its controller called once a sample, or once a step."""
    slow = isinstance(method, TimeStepping) and method.step >= SAMPLE
    return replace(trial, method=method, control_period=None if slow else SAMPLE)
