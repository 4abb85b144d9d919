"""Rows that are kept as they come: an interrupted comparison goes on where it was.

A row has a file of its own, named by a digest of all that it follows from: robot, gait, law, the
engine's version and settings, and the text of what simulates and measures. What only writes tables
and pages is not in it, nor are the adapters of other engines.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from heelstrike.analysis.told_summary import plain
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.figures import WalkFigures
from heelstrike.experiments.engine_comparison.rows import EngineRow
from heelstrike.experiments.engines.packages import PACKAGES
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.kept_files import program_digest
from heelstrike.whole_file import write_whole

ROOMS = (
    *(f"experiments/engines/{name}" for name in ("peer", "links", "served", "serving", "scenario")),
    *(f"experiments/{name}" for name in ("comparison", "walk", "passive")),
    "analysis", "sim", "control", "contact", "dynamics", "gait", "robot", "compiler", "tolerances",
)  # fmt: skip
"""Rooms and modules of this package whose text is in every digest."""

IMPORTED: Mapping[str, tuple[str, ...]] = {"pinocchio_contact_peer": ("pinocchio_peer",)}
"""Other adapters that an adapter imports."""

MODULES = ("walk", "walking", "figures")
"""Modules of this room that make walks."""

ELSEWHERE = "experiments/engines/elsewhere"
"""Room of the scripts of engines that another Python has."""


def asked_of_engine(
    package: str, given: Mapping[str, Any], versions: Mapping[str, str]
) -> dict[str, Any]:
    """Return what a row follows from beside the walk: the engine, its adapter and its settings.

    Parameters
    ----------
    package : str
        Name of the engine.
    given : mapping
        Its settings.
    versions : mapping
        What :func:`~heelstrike.experiments.engines.peers` says of the engines.
    """
    known = PACKAGES[package]
    adapters = (str(known.adapter), *IMPORTED.get(str(known.adapter), ()))
    rooms = tuple(f"experiments/engines/{name}" for name in adapters)
    if known.elsewhere:
        script = str(known.adapter).replace("_peer", "_server")
        rooms += (f"{ELSEWHERE}/exchange", f"{ELSEWHERE}/{script}")
    return {
        "given": dict(given),
        "version": versions[package],
        "adapter": program_digest(rooms, known.distribution).hex(),
    }


class KeptRows:
    """Rows in a folder.

    Parameters
    ----------
    folder : path or None
        Where they are; None keeps nothing.
    walk : mapping
        All that a row follows from but the engine, as JSON has it.
    modules : tuple of str
        Modules of this room that make the rows.
    """

    def __init__(
        self,
        folder: Path | str | None,
        walk: Mapping[str, Any],
        modules: tuple[str, ...] = MODULES,
    ) -> None:
        self._folder = None if folder is None else Path(folder)
        self._begun = json.dumps(walk, sort_keys=True).encode()
        own = tuple(f"experiments/engine_comparison/{name}" for name in modules)
        self._begun += program_digest((*ROOMS, *own), "numba")
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)

    def row(
        self, row: EngineRow, told: Mapping[str, Any], make: Callable[[], WalkFigures]
    ) -> EngineRow:
        """Return a row with its figures, from the folder if they are there.

        Parameters
        ----------
        row : EngineRow
            The row without figures.
        told : mapping
            What else they follow from: settings and version of the engine.
        make : callable
            Returns the figures, or raises why there are none.
        """
        name = f"{row.engine}-{row.settings}-{row.step_s:g}"
        own = [row.engine, row.step_s, dict(told)]
        try:
            found = self.entries(name, own, lambda: asdict(make()))
        except (InvalidRunError, SimulationError) as error:
            return replace(row, reason=str(error))  # the next comparison asks again
        return replace(row, figures=_figures(found))

    def entries(self, name: str, told: Any, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return numbers and texts, from the folder if they are there.

        Parameters
        ----------
        name : str
            Of their file, to which a digest is added.
        told : object
            What else they follow from, as JSON has it.
        make : callable
            Makes them, or raises why there are none.

        Returns
        -------
        dict
            Numbers that are not finite are None.
        """
        if self._folder is None:
            made: dict[str, Any] = plain(make())
            return made
        own = json.dumps(told, sort_keys=True).encode()
        digest = hashlib.sha256(self._begun + own).hexdigest()[:16]
        file = self._folder / f"{name}-{digest}.json"
        if file.exists():
            kept: dict[str, Any] = json.loads(file.read_text())
            return kept
        made = plain(make())
        write_whole(file, json.dumps(made, indent=1))
        return made


def _figures(entries: Mapping[str, Any]) -> WalkFigures:
    numbers: dict[str, Any] = {
        name: math.nan if each is None else each for name, each in entries.items()
    }
    return WalkFigures(**numbers)
