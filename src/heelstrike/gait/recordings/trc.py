"""OpenSim's TRC files: tables of markers with a header of five lines."""

from __future__ import annotations

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.gait.recordings.lines import Name, lines_of, numbers_in
from heelstrike.gait.recordings.table import FASTEST, SLOWEST
from heelstrike.gait.recordings.units import UNITS
from heelstrike.robot.model import Floats

ROUNDED = 1e-3
"""Times are often written to the millisecond (s); rows that are so near to the header's rate are
taken by that: accelerations would suffer from rounded times."""
HEADER = 5
"""Lines before the numbers: kind, names and values of what holds for all, markers, their axes."""


def points_of_trc(path: Name) -> tuple[Floats, tuple[str, ...], Floats]:
    """Read times (n,) in s, names of markers, and positions (n, m, 3) in m; NaN where unseen.

    Times are as the file counts them, and evenly spaced where they are so but for rounding.

    Raises
    ------
    GaitError
        If it is no such file; the message has the line.
    """
    lines = lines_of(path)
    if len(lines) <= HEADER or not lines[0][1].lower().startswith("pathfiletype"):
        raise GaitError(f"{path}: no TRC file: five lines of header begin with PathFileType")
    keys, values = (line.split() for _, line in lines[1:3])
    said = dict(zip((key.lower() for key in keys), values, strict=False))
    unit = said.get("units", "").lower()
    if UNITS.get(unit, 0.0) == 0.0 or unit not in ("mm", "cm", "m"):
        raise GaitError(f"{path}, line {lines[2][0]}: Units must be mm, cm or m, got {unit!r}")
    place, heading = lines[3]
    names = tuple(word.strip() for word in heading.split("\t")[2:] if word.strip())
    if not names:
        raise GaitError(f"{path}, line {place}: no names of markers, separated by tabs")
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise GaitError(f"{path}, line {place}: two markers are called {repeated[0]!r}")
    axes = lines[4][1].split()
    if len(axes) != 3 * len(names):
        raise GaitError(
            f"{path}, line {lines[4][0]}: {len(names)} markers have {3 * len(names)} axes, "
            f"got {len(axes)}"
        )
    numbers = numbers_in(path, lines[HEADER:], "\t", 2 + 3 * len(names), gaps=True)
    time = numbers[:, 1]
    steps = np.diff(time) > 0.0
    if not steps.all():  # a time that is missing, too
        line = lines[HEADER + int(np.argmin(steps)) + 1][0]
        raise GaitError(f"{path}, line {line}: the time does not go on")
    if not SLOWEST <= (len(time) - 1) / (time[-1] - time[0]) <= FASTEST:
        raise GaitError(f"{path}: its times are in no seconds")
    rate = said.get("datarate", "")
    if rate.replace(".", "", 1).isdecimal() and float(rate) > 0.0:
        even = time[0] + np.arange(len(time)) / float(rate)
        if np.abs(time - even).max() <= ROUNDED:
            time = even
    position = UNITS[unit] * numbers[:, 2:].reshape(len(numbers), -1, 3)
    return time, names, position
