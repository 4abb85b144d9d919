"""What the zoo has found, cell by cell, and the file in which it is kept.

The file appears again, whole, with every cell that is finished, so that a second call goes on.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, field, replace
from pathlib import Path
from typing import Any

from heelstrike import __version__
from heelstrike.errors import SimulationError
from heelstrike.experiments.zoo.disturbances import DISTURBANCES, Disturbance
from heelstrike.field_texts import dataclass
from heelstrike.json_checksum import Entries, json_text, reading_json
from heelstrike.whole_file import write_whole

KIND, VERSION, LARGEST = "zoo", 1, 1e12

STANDS = "stands"
"""Word of cells of robots that stand and are not disturbed so."""

Key = tuple[str, str, str]
"""Robot, controller, disturbance."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the search: all that the numbers depend on besides its subjects."""

    seed: int = 0
    """Of all that chance decides."""
    trials: int = 4
    """Phases of pushes and shapes of the ground that are tried."""
    strides: int = 10
    halvings: int = 3
    """strides, halvings: How finely sizes are searched."""
    method: str = ""
    """Simulation method."""
    version: str = __version__
    """Version of heelstrike."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """How large a disturbance a controller withstands on a robot."""

    robot: str
    controller: str
    disturbance: str
    """robot, controller, disturbance: Their names."""
    withstood: tuple[float, ...] = ()
    """Of each trial, the size such that the walk recovers from it and from all smaller ones
    tried."""
    failed: tuple[float, ...] = ()
    """Of each trial, the smallest size from which it does not; infinite if there was none."""
    walks: int = 0
    """Walks simulated."""
    word: str = ""
    reason: str = ""
    """word, reason: Why there is nothing, in a word and in full; nothing if there is."""

    @property
    def key(self) -> Key:
        """Robot, controller, disturbance."""
        return self.robot, self.controller, self.disturbance

    def worst(self, *, less: bool) -> float:
        """Return the size withstood in every trial.

        Parameters
        ----------
        less : bool
            Whether less of the disturbance is better.

        Returns
        -------
        float
            The size; NaN if there is none.
        """
        if not self.withstood:
            return math.nan
        return max(self.withstood) if less else min(self.withstood)

    @property
    def middle(self) -> float:
        """Median over the trials; NaN if there is none."""
        return statistics.median(self.withstood) if self.withstood else math.nan

    @property
    def beyond(self) -> bool:
        """Whether nothing that was tried was too much."""
        return bool(self.failed) and all(math.isinf(each) for each in self.failed)


@dataclass(frozen=True, kw_only=True)
class Animal:
    """A robot of the zoo, and the gait on which it is disturbed."""

    robot: str
    """Its name."""
    fingerprint: str
    """What tells its numbers from others."""
    mass: float
    """In kg."""
    step_length: float = 0.0
    step_duration: float = 0.0
    """step_length, step_duration: Of its gait, in m and s; zero if it has none."""


@dataclass
class Results:
    """The cells that are finished."""

    settings: Settings
    """Those of all cells."""
    animals: dict[str, Animal] = field(default_factory=dict)
    """Robots by name."""
    cells: dict[Key, Cell] = field(default_factory=dict)
    """By robot, controller and disturbance, in the order in which they were finished."""
    disturbances: Sequence[Disturbance] = DISTURBANCES
    """Those that cells are of, in the order of the table."""

    def put(self, *cells: Cell) -> None:
        """Add cells.

        Parameters
        ----------
        *cells : Cell
            What was found.
        """
        self.cells |= {cell.key: cell for cell in cells}

    def meet(self, animal: Animal) -> None:
        """Add a robot, and forget what was found with another of its name.

        Parameters
        ----------
        animal : Animal
            The robot.
        """
        known = self.animals.get(animal.robot)
        if known is not None and known.fingerprint != animal.fingerprint:
            self.cells = {key: cell for key, cell in self.cells.items() if key[0] != animal.robot}
        self.animals[animal.robot] = animal

    def chosen(self, keys: Iterable[Key], disturbances: Sequence[Disturbance]) -> Results:
        """Return those cells of some keys that are there, in the order of the keys.

        Parameters
        ----------
        keys : iterable of (str, str, str)
            Robot, controller and disturbance.
        disturbances : sequence of Disturbance
            Those of the keys.

        Returns
        -------
        Results
            What is there of them.
        """
        cells = {key: self.cells[key] for key in keys if key in self.cells}
        animals = {name: self.animals[name] for name in dict.fromkeys(key[0] for key in cells)}
        return replace(self, animals=animals, cells=cells, disturbances=disturbances)

    def robots(self) -> Iterator[tuple[Animal, dict[str, dict[str, Cell]]]]:
        """Go through the robots: each with its cells by controller and disturbance."""
        for name, animal in self.animals.items():
            rows: dict[str, dict[str, Cell]] = {}
            for (robot, controller, disturbance), cell in self.cells.items():
                if robot == name:
                    rows.setdefault(controller, {})[disturbance] = cell
            yield animal, rows

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data, a size that was not found as None."""
        cells = []
        for cell in self.cells.values():
            failed = [each if math.isfinite(each) else None for each in cell.failed]
            cells.append({**asdict(cell), "withstood": [*cell.withstood], "failed": failed})
        return {
            "settings": asdict(self.settings),
            "robots": [asdict(animal) for animal in self.animals.values()],
            "cells": cells,
        }

    def save(self, path: Path) -> Path:
        """Write a file.

        Parameters
        ----------
        path : Path
            File to write, JSON.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        WriteError
            If it cannot be written; an older one is as it was.
        """
        return write_whole(path, json_text(KIND, VERSION, self.to_dict()))


def load_results(path: Path) -> Results:
    """Read a file.

    Raises
    ------
    SimulationError
        If it is none, or damaged.
    """
    with reading_json(path, KIND, (VERSION,), LARGEST, SimulationError) as entries:
        given = entries.object("settings")
        settings = Settings(
            **{name: int(given.number(name)) for name in ("seed", "trials", "strides", "halvings")},
            method=given.text("method"),
            version=given.text("version"),
        )
        animals = [_animal(each) for each in entries.objects("robots")]
        cells = [_cell(each) for each in entries.objects("cells")]
        known = {animal.robot for animal in animals}
        if strange := {cell.robot for cell in cells} - known:
            raise SimulationError(f"cells are of robots that are not among its own: {strange}")
    return Results(
        settings, {each.robot: each for each in animals}, {each.key: each for each in cells}
    )


def _animal(entries: Entries) -> Animal:
    numbers = {name: entries.number(name) for name in ("mass", "step_length", "step_duration")}
    return Animal(robot=entries.text("robot"), fingerprint=entries.text("fingerprint"), **numbers)


def _cell(entries: Entries) -> Cell:
    texts = ("robot", "controller", "disturbance", "word", "reason")
    sizes = entries.of_kind("withstood", list, "a list of numbers")
    failed = entries.of_kind("failed", list, "a list of numbers, null where nothing failed")
    finite = replace(entries, data={"failed": [0.0 if each is None else each for each in failed]})
    return Cell(
        **{name: entries.text(name) for name in texts},
        withstood=tuple(entries.numbers("withstood", len(sizes)).tolist()) if sizes else (),
        failed=tuple(
            math.inf if each is None else number
            for each, number in zip(failed, finite.numbers("failed", len(failed)), strict=True)
        ) if failed else (),
        walks=int(entries.number("walks")),
    )  # fmt: skip
