"""Motions of joints as tables of text, for robots and other programs, and for our own reader."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.gait.recordings.lines import FEWEST, LARGEST_FILE
from heelstrike.gait.recordings.table import FASTEST, SLOWEST
from heelstrike.robot.model import Floats
from heelstrike.whole_file import write_whole
from heelstrike.wording import meant

SUFFIXES = {".csv": ",", ".tsv": "\t"}
"""Endings of tables of text, and what separates their columns."""
LETTERS = 24
"""Letters that a number takes at most, with its separator."""


def is_table(path: str | PathLike[str]) -> bool:
    """Whether a name ends as a table of text does."""
    return Path(path).suffix.lower() in SUFFIXES


def check_rate(rate: float, name: str = "rate") -> None:
    """Refuse a rate of rows that makes no sense.

    Parameters
    ----------
    rate : float
        Rows a second.
    name : str
        What it is called.

    Raises
    ------
    GaitError
        If it is too low or too high.
    """
    if not SLOWEST <= rate <= FASTEST:
        raise GaitError(f"{name} must be from {SLOWEST:g} to {FASTEST:g} rows a second, got {rate}")


def times_at(rate: float, duration: float) -> Floats:
    """Return times at a rate (1/s) from 0 to a duration (s), both included where it fits.

    Raises
    ------
    GaitError
        If the rate makes no sense, or there were fewer times than a recording has.
    """
    check_rate(rate)
    if not duration > 0.0:
        raise GaitError(f"a table of {duration:.3g} s has no rows: ask for one repetition or more")
    count = round(rate * duration)
    if count + 1 < FEWEST:
        raise GaitError(
            f"at {rate:g} rows a second {duration:.3g} s have {count + 1} rows; a recording has at "
            f"least {FEWEST}: give a higher rate"
        )
    return np.arange(count + 1) / rate


def save_joints(
    path: str | PathLike[str],
    names: Sequence[str],
    time: Floats,
    position: Floats,
    *,
    hinges: Sequence[bool],
    joints: Sequence[str] | None = None,
    degrees: bool = False,
) -> None:
    """Write a table of joints over time, which appears whole or not at all.

    Parameters
    ----------
    path : path
        File to write: .csv, or .tsv.
    names : sequence of str
        The joints.
    time : (n,) array
        In s.
    position : (n, joints) array
        In rad, m for a slide.
    hinges : sequence of bool
        Whether each joint turns.
    joints : sequence of str, optional
        Those that are written, in their order; all by default.
    degrees : bool
        Whether angles are written in degrees.

    Raises
    ------
    GaitError
        If there is no such joint, or the file cannot be written.
    """
    wanted = list(names if joints is None else joints)
    for name in wanted:
        if name not in names:
            raise GaitError(f"there is no joint {name!r}.{meant(name, names)}")
    if len(set(wanted)) < len(wanted) or not wanted:
        raise GaitError(f"joints must be different names, one or more, got {wanted}")
    order = [list(names).index(name) for name in wanted]
    turns = [bool(hinges[k]) for k in order]
    units = [("deg" if degrees else "rad") if each else "m" for each in turns]
    values = position[:, order]
    if degrees:
        values = np.where(turns, np.rad2deg(values), values)
    save_columns(
        path, [f"{name} [{unit}]" for name, unit in zip(wanted, units, strict=True)], time, values
    )


def save_columns(
    path: str | PathLike[str], headings: Sequence[str], time: Floats, values: Floats
) -> None:
    """Write a table of anything over time, which appears whole or not at all.

    Parameters
    ----------
    path : path
        File to write: .csv, or .tsv.
    headings : sequence of str
        Names of the columns after that of the times, with their units.
    time : (n,) array
        In s.
    values : (n, columns) array
        Numbers, in these units.

    Raises
    ------
    GaitError
        If there are too many rows, or the file cannot be written.
    """
    if LETTERS * len(time) * (len(headings) + 1) > LARGEST_FILE:
        raise GaitError(f"{len(time)} rows are too many for a table; give a lower rate")
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n", delimiter=SUFFIXES[Path(path).suffix.lower()])
    table.writerow(["time [s]", *headings])
    for row in np.column_stack([time, values]).tolist():
        table.writerow([repr(number) for number in row])
    write_whole(path, text.getvalue(), GaitError)
