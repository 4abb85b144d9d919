"""Recorded motions of joints, read from tables of text: names, units, rate."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.wording import meant

LARGEST_FILE = 2**26
"""Bytes from which on a file is refused."""
FEWEST = 8
"""Rows of the shortest motion."""
TIMES = ("time", "t", "seconds")
"""Columns that hold times."""
UNITS = {"rad": 1.0, "deg": np.pi / 180.0, "degrees": np.pi / 180.0, "m": 1.0, "s": 1.0,
         "ms": 1e-3}  # fmt: skip
"""Units, in those of ours."""
BEYOND = 1.2
"""How far beyond its range a joint goes, in that range, where degrees were taken for radians."""


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """How the driven joints of a robot move."""

    time: Floats
    """(n,) In s, from 0 on."""
    position: Floats
    """(n, nu) Of the actuated joints, in the order of the actuators (rad, m)."""
    ignored: tuple[str, ...]
    """Columns of the file that were of no use."""

    @property
    def rate(self) -> float:
        """Rows a second."""
        return float((len(self.time) - 1) / self.time[-1])

    def seems_degrees(self, robot: Robot) -> bool:
        """Whether its numbers make sense as degrees and not as radians.

        Parameters
        ----------
        robot : Robot
            The robot, whose joints have ranges.

        Returns
        -------
        bool
            Whether most joints go far beyond their ranges, or turn right round, and would not as
            degrees.
        """
        joints = robot.model.actuator_joint
        limit = np.maximum(np.abs(robot.model.lower[joints]), np.abs(robot.model.upper[joints]))
        limit = np.where(np.isfinite(limit), limit, np.pi)
        hinges = robot.model.axis[joints, 0] != 0.0
        far = np.abs(self.position).max(axis=0) > BEYOND * limit
        near = np.abs(np.deg2rad(self.position)).max(axis=0) <= BEYOND * limit
        return bool(hinges.any() and far[hinges].mean() > 0.5 and near[hinges].all())


def load_recorded_motion(
    path: str | os.PathLike[str], robot: Robot, *, rate: float | None = None, unit: str = ""
) -> RecordedMotion:
    """Read a motion from a table of text.

    Its first line names the columns: the actuated joints, each perhaps with a unit as in
    ``left_hip [deg]`` or ``left_hip_deg``, and the time. Columns are separated by commas,
    semicolons, tabs or blanks.

    Parameters
    ----------
    path : path
        The file.
    robot : Robot
        The robot whose motion it is.
    rate : float, optional
        Rows a second, where the file has no times.
    unit : str
        Of the joints whose columns name none: ``"rad"`` or ``"deg"``; rad by default.

    Returns
    -------
    RecordedMotion
        The motion.

    Raises
    ------
    GaitError
        If it is no such file, a joint is missing, or numbers are; the message has the place.
    """
    if unit not in ("", "rad", "deg"):
        raise GaitError(f"unit must be rad or deg, got {unit!r}")
    lines = _lines(path)
    if not lines:
        raise GaitError(f"{path}: there is nothing in it")
    heading = lines[0][1]
    separator = next((each for each in (",", ";", "\t") if each in heading), None)
    names = [name.strip().strip('"') for name in heading.split(separator)]
    wanted = {_plain(name): index for index, name in enumerate(robot.actuator_names)}
    column_of: dict[str, int] = {}
    scale = np.ones(len(names))
    for column, name in enumerate(names):
        known, given = _told(name)
        if known in TIMES:
            known = "time"
        if known in column_of:
            raise GaitError(f"{path}: two columns are called {known!r}")
        column_of[known] = column
        is_joint = known in wanted
        scale[column] = UNITS[given or (unit if is_joint and unit else "rad")]
    missing = [name for name in robot.actuator_names if _plain(name) not in column_of]
    if missing:
        guess = meant(missing[0], {name: repr(name) for name in column_of})
        raise GaitError(
            f"{path}: no column for {', '.join(missing)}.{guess} The first line names the columns; "
            f"it has {', '.join(names[:12])}"
        )
    numbers = _numbers(path, lines[1:], separator, len(names)) * scale
    order = [column_of[_plain(name)] for name in robot.actuator_names]
    time = _times(path, numbers, column_of.get("time"), rate, [place for place, _ in lines[1:]])
    used = {*order, column_of.get("time", -1)}
    ignored = tuple(name for column, name in enumerate(names) if column not in used)
    return RecordedMotion(time, numbers[:, order], ignored)


def _lines(path: str | os.PathLike[str]) -> list[tuple[int, str]]:
    """Return the lines that say something, each with its number in the file."""
    try:
        file = Path(path)
        if file.stat().st_size > LARGEST_FILE:
            raise GaitError(f"{path}: larger than {LARGEST_FILE // 2**20} MB; is it a motion?")
        text = file.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise GaitError(f"{path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise GaitError(f"{path}: not a text file; a motion is a table of text") from error
    numbered = enumerate(text.splitlines(), start=1)
    return [(i, line) for i, line in numbered if line.strip() and not line.startswith("#")]


def _told(name: str) -> tuple[str, str]:
    """Return the plain name of a column and its unit, if it names one."""
    bracket = re.fullmatch(r"(.*?)\s*[\[(]\s*(\w+)\s*[\])]", name)
    if bracket and bracket[2].lower() in UNITS:
        return _plain(bracket[1]), bracket[2].lower()
    plain = _plain(name)
    before, _, last = plain.rpartition("_")
    return (before, last) if before and last in UNITS else (plain, "")


def _plain(name: str) -> str:
    return re.sub(r"[\s.\-/]+", "_", name.strip().lower())


def _numbers(
    path: str | os.PathLike[str], lines: list[tuple[int, str]], separator: str | None, columns: int
) -> Floats:
    rows = []
    for place, line in lines:
        words = line.split(separator)
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != columns or not np.isfinite(row).all():
            raise GaitError(
                f"{path}, line {place}: {columns} finite numbers are wanted, got {line[:60]!r}"
            )
        rows.append(row)
    if len(rows) < FEWEST:
        raise GaitError(f"{path}: a motion has at least {FEWEST} rows, got {len(rows)}")
    return np.array(rows)


def _times(
    path: str | os.PathLike[str], numbers: ArrayLike, column: int | None, rate: float | None,
    places: list[int],
) -> Floats:  # fmt: skip
    table = np.asarray(numbers, dtype=np.float64)
    if column is None:
        if rate is None or not 0.0 < rate < np.inf:
            raise GaitError(f"{path}: there is no column of times; say the rate (rows a second)")
        return np.arange(len(table)) / rate
    time: Floats = table[:, column] - table[0, column]
    if (np.diff(time) <= 0.0).any():
        line = places[int(np.argmax(np.diff(time) <= 0.0)) + 1]
        raise GaitError(f"{path}, line {line}: the time does not go on")
    return time
