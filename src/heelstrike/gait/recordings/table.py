"""Tables of numbers by names, from text (CSV, TSV), JSON and OpenSim's MOT and STO."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.lines import (
    FEWEST,
    MOST_COLUMNS,
    Line,
    Name,
    lines_of,
    numbers_in,
    text_of,
)
from heelstrike.gait.recordings.units import TIMES, UNITS, told
from heelstrike.robot.model import Floats
from heelstrike.sim.files.table import EVENTS

NAMES_OF_TIME = ("time", "t", "seconds")
"""Columns that hold times."""
HEADER_ENDS = "endheader"
"""Line after which a table of OpenSim begins."""
SLOWEST, FASTEST = 1e-3, 1e6
"""Rows a second between which a rate can be meant."""


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers by the names of their columns, in the units of the file."""

    path: str
    """The file."""
    names: tuple[str, ...]
    """Plain names of the columns, without units."""
    written: tuple[str, ...]
    """Names as they are written."""
    units: tuple[str, ...]
    """Units of the columns; empty where none is told."""
    values: Floats
    """(n, columns) The numbers; NaN where there is none."""
    places: tuple[int, ...]
    """Line of each row in the file; 0 where it has none."""
    rate: float | None = None
    """Rows a second, if the file says it."""
    opensim: bool = False
    """Whether it is a table of OpenSim, with its names and senses of joints."""

    def column(self, name: str) -> int:
        """Return the place of a column, -1 where there is none of a plain name."""
        return self.names.index(name) if name in self.names else -1

    def whole(self, names: Sequence[str]) -> Floats:
        """Return columns in which no number is missing, (n, names), in the units of the file.

        Parameters
        ----------
        names : sequence of str
            Plain names of columns that there are.

        Raises
        ------
        GaitError
            If a number is missing; the message has the line, or the row where lines have no number.
        """
        values: Floats = self.values[:, [self.column(name) for name in names]]
        lacking = np.argwhere(~np.isfinite(values))
        if len(lacking):
            row, k = (int(each) for each in lacking[0])
            place = f"line {self.places[row]}" if self.places[row] else f"row {row + 1}"
            raise GaitError(
                f"{self.path}, {place}: column {names[k]!r} has no number there; one is "
                "wanted in every row, so fill it in or cut the recording there"
            )
        return values

    def unit(self, column: int, kinds: Sequence[str], usual: str = "") -> float:
        """Return the unit of a column in ours.

        Parameters
        ----------
        column : int
            Its place.
        kinds : sequence of str
            Units that make sense.
        usual : str
            That of a column that tells none; by default the first of them.

        Raises
        ------
        GaitError
            If it is in another one.
        """
        given = self.units[column] or usual or kinds[0]
        if given not in kinds:
            raise GaitError(
                f"{self.path}: column {self.written[column]!r} is in {given}; "
                f"{' or '.join(kinds)} is wanted"
            )
        return UNITS[given]

    @property
    def begin(self) -> float:
        """Time of the first row, as the file counts it, in s."""
        k = self.column("time")
        return 0.0 if k < 0 else float(self.values[0, k]) * self.unit(k, TIMES)

    def time(self, rate: float | None = None) -> Floats:
        """Return the times of the rows from 0 on, (n,), in s.

        Parameters
        ----------
        rate : float, optional
            Rows a second, where the file tells no times.

        Raises
        ------
        GaitError
            If there are none, they do not go on, or they are in no unit of time.
        """
        column = self.column("time")
        if column < 0:
            rate = self.rate if rate is None else rate
            if rate is None or not SLOWEST <= rate <= FASTEST:
                raise GaitError(
                    f"{self.path}: there is no column of times; say the rate (rows a second)"
                )
            return np.arange(len(self.values)) / rate
        given = self.values[:, column]
        time: Floats = (given - given[0]) * self.unit(column, TIMES)
        steps = np.diff(time) > 0.0
        if not steps.all():
            line = self.places[int(np.argmin(steps)) + 1]
            raise GaitError(f"{self.path}, line {line}: the time does not go on")
        return time


def read_table(path: Name, *, gaps: bool = False) -> Table:
    """Read a table of numbers whose columns have names.

    Parameters
    ----------
    path : path
        A file: JSON where its name ends so, of OpenSim where a header comes first, else a table of
        text with the names in its first line, separated by commas, semicolons, tabs or blanks.
    gaps : bool
        Whether numbers may be missing.

    Returns
    -------
    Table
        The table.

    Raises
    ------
    GaitError
        If it is none; the message has the line.
    """
    if Path(path).suffix.lower() == ".json":
        return _from_json(path, gaps)
    lines = lines_of(path)
    ends = [k for k, (_, line) in enumerate(lines) if line.strip().lower() == HEADER_ENDS]
    if Path(path).suffix.lower() in (".mot", ".sto") or ends:
        return _from_opensim(path, lines, ends)
    heading = lines[0][1]
    separator = next((each for each in (",", ";", "\t") if each in heading), None)
    names = [name.strip().strip('"') for name in heading.split(separator)]
    rows = lines[1:]
    if separator == "," and names[-1] == EVENTS:  # words, in tables of runs
        names = names[:-1]
        rows = [(place, line.rpartition(",")[0]) for place, line in rows]
    numbers = numbers_in(path, rows, separator, len(names), gaps=gaps)
    return table_of(path, names, numbers, tuple(place for place, _ in rows))


def table_of(
    path: Name, names: list[str], values: Floats, places: tuple[int, ...], **more: Any
) -> Table:
    """Return a table of columns by their names, which may tell units.

    Raises
    ------
    GaitError
        If two columns have one name.
    """
    known, units = [], []
    for name in names:
        called, unit = told(name)
        known.append("time" if called in NAMES_OF_TIME else called)
        units.append(unit)
    for k, name in enumerate(known):
        if name in known[:k]:
            raise GaitError(f"{path}: two columns are called {name!r}")
    return Table(str(path), tuple(known), tuple(names), tuple(units), values, places, **more)


def _from_opensim(path: Name, lines: list[Line], ends: list[int]) -> Table:
    """Read a table that begins with a header of lines ``key=value``."""
    if not ends:
        raise GaitError(
            f"{path}: a .mot or .sto file needs a line {HEADER_ENDS!r} before its table"
        )
    if ends[0] + 1 >= len(lines):
        raise GaitError(f"{path}: there is nothing after {HEADER_ENDS!r}")
    header = {
        key.strip().lower(): value.strip().lower()
        for _, line in lines[: ends[0]]
        for key, equals, value in [line.partition("=")]
        if equals
    }
    separator = "\t" if "\t" in lines[ends[0] + 1][1] else None
    heading = lines[ends[0] + 1][1]
    names = [name.strip() for name in heading.rstrip().split(separator)]
    rows = [(place, line.strip()) for place, line in lines[ends[0] + 2 :]]
    numbers = numbers_in(path, rows, None, len(names))
    said = header.get("nrows", header.get("datarows", ""))
    if re.fullmatch(r"\d+", said) and int(said) != len(numbers):
        raise GaitError(f"{path}: its header says {said} rows, and there are {len(numbers)}")
    found = table_of(path, names, numbers, tuple(place for place, _ in rows), opensim=True)
    if header.get("indegrees") == "yes":
        pairs = zip(found.names, found.units, strict=True)
        angles = tuple(unit or ("deg" if _turns(name) else "") for name, unit in pairs)
        found = Table(**{**vars(found), "units": angles})
    return found


def _turns(name: str) -> bool:
    """Whether a column of OpenSim is an angle, by its name.

    What slides ends in _t and an axis, forces and where they act in _v and _p.
    """
    moves = re.search(r"_[tvp][xyz]$", name) is not None
    return not (moves or name == "time" or "force" in name or "torque" in name)


def _from_json(path: Name, gaps: bool) -> Table:
    """Read an object of columns by name, of equal length, and perhaps ``"rate_Hz"``."""

    def refuse(word: str) -> Any:
        raise GaitError(f"{path}: {word} is no number of a recording")

    try:
        data = json.loads(text_of(path), parse_constant=refuse)
    except json.JSONDecodeError as error:
        raise GaitError(f"{path}, line {error.lineno}: no JSON: {error.msg}") from error
    except (RecursionError, ValueError) as error:
        raise GaitError(
            f"{path} cannot be read: {str(error).removeprefix(f'{path}: ')[:100]}"
        ) from error
    if not isinstance(data, dict):
        raise GaitError(f'{path}: columns by name are wanted, as {{"time [s]": [0.0, ...], ...}}')
    rate = data.pop("rate_Hz", None)
    if rate is not None and (isinstance(rate, bool) or not isinstance(rate, int | float)):
        raise GaitError(f'{path}: "rate_Hz" must be a number')
    columns = {name: each for name, each in data.items() if isinstance(each, list)}
    if not columns or len(columns) > MOST_COLUMNS:
        raise GaitError(f"{path}: from 1 to {MOST_COLUMNS} columns are wanted, as lists by name")
    length = len(next(iter(columns.values())))
    if length < FEWEST:
        raise GaitError(f"{path}: a recording has at least {FEWEST} rows, got {length}")
    for name, each in columns.items():
        if len(each) != length:
            raise GaitError(f"{path}: column {name!r} has {len(each)} rows, others {length}")
        for row, number in enumerate(each):
            missing = gaps and number is None
            if not missing and (isinstance(number, bool) or not isinstance(number, int | float)):
                raise GaitError(
                    f"{path}: column {name!r}, row {row + 1}: a number is wanted, got "
                    f"{str(number)[:40]!r}"
                )
            if not missing and not abs(number) <= sys.float_info.max:
                raise GaitError(f"{path}: column {name!r}, row {row + 1}: the number is too large")
    values = np.array(list(columns.values()), dtype=np.float64).T
    return table_of(path, list(columns), values, (0,) * length, rate=rate)
