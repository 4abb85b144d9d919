"""Recorded markers on the body of a person, in the sagittal plane.

From OpenSim's TRC files, tables of text or JSON with columns ``heel_x``, ``heel_y`` …, and C3D
files where ezc3d is installed. x is forward and z up; which axes of the file these are is told by
where the toes are ahead of the heels, unless it is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.c3d import points_of_c3d
from heelstrike.gait.recordings.landmarks import landmark_of
from heelstrike.gait.recordings.lines import Name
from heelstrike.gait.recordings.table import Table, read_table
from heelstrike.gait.recordings.trc import points_of_trc
from heelstrike.gait.recordings.units import LENGTHS, plain
from heelstrike.robot.model import Floats
from heelstrike.wording import meant

AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Points:
    """Markers as a file has them."""

    time: Floats
    """(n,) In s, as the file counts it."""
    names: tuple[str, ...]
    """Their m names."""
    position: Floats
    """(n, m, 3) Along the axes of the file, in m; NaN where one was not seen."""
    up: str
    """The axis that is usually up in such files."""


@dataclass(frozen=True, eq=False)
class RecordedMarkers:
    """Markers on a walking person, seen from the side."""

    time: Floats
    """(n,) In s, from 0 on."""
    names: tuple[str, ...]
    """Landmarks of the body, as ``right_heel``."""
    position: Floats
    """(n, m, 2) Forward and up, in m; NaN where a marker was not seen."""
    ignored: tuple[str, ...] = ()
    """Markers of the file that are no landmarks that are known."""
    begin: float = 0.0
    """When it begins, as the file counts time, in s: forces of another file go by that."""
    forward: str = "x"
    """Axis of the file in which the person walks, with a minus where that is against it."""
    up: str = "z"
    """Axis of the file that is up; forces of another file go by these, too."""

    @property
    def rate(self) -> float:
        """Rows a second."""
        return float((len(self.time) - 1) / self.time[-1])

    def has(self, *names: str) -> bool:
        """Whether there are landmarks.

        Parameters
        ----------
        *names : str
            The landmarks.
        """
        return set(names) <= set(self.names)

    def of(self, name: str) -> Floats:
        """Return the positions of a landmark, (n, 2), in m.

        Parameters
        ----------
        name : str
            The landmark.

        Raises
        ------
        GaitError
            If there is none of that name.
        """
        if name not in self.names:
            raise GaitError(
                f"the recording has no marker {name!r}; it has {', '.join(self.names) or 'none'}"
            )
        return self.position[:, self.names.index(name)]


def load_markers(
    path: Name,
    *,
    names: Mapping[str, str] | None = None,
    rate: float | None = None,
    up: str | None = None,
    forward: str | None = None,
) -> RecordedMarkers:
    """Read markers on a person, and take them to the sagittal plane.

    Parameters
    ----------
    path : path
        A TRC file (.trc), a C3D file (.c3d), or a table of text or JSON whose columns are called as
        ``right_heel_x [m]``.
    names : mapping, optional
        Names of markers by landmark, as ``{"right_hip": "R.GTRO"}``, beside the usual ones.
    rate : float, optional
        Rows a second, where the file tells none.
    up : str, optional
        Axis of the file that is up: ``"y"`` or ``"z"``; the usual one of such files by default.
    forward : str, optional
        Axis in which the person walks: ``"x"``, ``"-x"``, ``"y"`` …; by default that in which the
        toes are ahead of the heels.

    Returns
    -------
    RecordedMarkers
        The markers that are known landmarks.

    Raises
    ------
    GaitError
        If it is no such file, or axes or markers are missing; the message has the place.
    """
    for what, axis in (("up", up), ("forward", forward)):
        if axis is not None:
            axis_and_sense(axis, what)
    points = _points(path, rate)
    found = _landmarks(path, points, names or {})
    places = points.position[:, list(found.values())]
    vertical, upward = axis_and_sense(up or points.up)
    if forward is None:
        horizontal, ahead = _forward(path, places, list(found), vertical)
    else:
        horizontal, ahead = axis_and_sense(forward)
    if horizontal == vertical:
        raise GaitError(f"{path}: one axis cannot be both up and forward")
    plane = np.stack([ahead * places[..., horizontal], upward * places[..., vertical]], axis=-1)
    used = set(found.values())
    ignored = tuple(name for k, name in enumerate(points.names) if k not in used)
    begin = float(points.time[0])
    walked = ("-" if ahead < 0.0 else "") + AXES[horizontal]
    return RecordedMarkers(
        points.time - begin, tuple(found), plane, ignored, begin, walked, up or points.up
    )


def axis_and_sense(name: str, what: str = "axis") -> tuple[int, float]:
    """Return the number of an axis by its name, and 1, or -1 where a minus stands before it.

    Parameters
    ----------
    name : str
        As ``"x"`` or ``"-x"``.
    what : str
        What the axis is, for the message.

    Raises
    ------
    GaitError
        If there is no such axis.
    """
    if name.removeprefix("-") not in tuple(AXES):
        raise GaitError(f"{what} must be x, y or z, or one with a minus before it, got {name!r}")
    return AXES.index(name.removeprefix("-")), -1.0 if name.startswith("-") else 1.0


def _points(path: Name, rate: float | None) -> Points:
    suffix = Path(path).suffix.lower()
    if suffix == ".c3d":
        time, names, position = points_of_c3d(path)
        return Points(time, names, position, "z")
    if suffix == ".trc":
        time, names, position = points_of_trc(path)
        return Points(time, names, position, "y")
    return _points_of_table(read_table(path, gaps=True), rate)


def _points_of_table(table: Table, rate: float | None) -> Points:
    """Markers whose coordinates are columns, as ``heel_x`` and ``heel_y``."""
    columns: dict[str, dict[str, int]] = {}
    for k, name in enumerate(table.names):
        before, _, axis = name.rpartition("_")
        if before and axis in tuple(AXES):
            columns.setdefault(before, {})[axis] = k
    columns = {name: each for name, each in columns.items() if len(each) > 1}
    if not columns:
        raise GaitError(
            f"{table.path}: no markers; columns are called as right_heel_x and right_heel_y. It "
            f"has {', '.join(table.written[:8])}"
        )
    position = np.full((len(table.values), len(columns), 3), np.nan)
    for k, each in enumerate(columns.values()):
        for axis, column in each.items():
            unit = table.unit(column, LENGTHS)
            position[:, k, AXES.index(axis)] = table.values[:, column] * unit
    flat = all("z" not in each for each in columns.values())
    return Points(table.begin + table.time(rate), tuple(columns), position, "y" if flat else "z")


def _landmarks(path: Name, points: Points, given: Mapping[str, str]) -> dict[str, int]:
    """Places of the markers by the landmarks that they are."""
    index = {plain(name): k for k, name in enumerate(points.names)}
    found: dict[str, int] = {}
    for landmark, name in given.items():
        if landmark_of(landmark) != plain(landmark):
            raise GaitError(f"there is no landmark {landmark!r}; one is called as right_heel")
        if plain(name) not in index:
            guess = meant(name, points.names)
            raise GaitError(f"{path}: no marker {name!r}.{guess}")
        found[plain(landmark)] = index[plain(name)]
    for name, k in index.items():
        known = landmark_of(name)
        if known is not None and known not in found:
            found[known] = k
    if not found:
        raise GaitError(
            f"{path}: none of its markers is a known landmark ({', '.join(points.names[:8])} …); "
            "say which is which, as right_hip=NAME"
        )
    return found


def _forward(path: Name, places: Floats, names: Sequence[str], vertical: int) -> tuple[int, float]:
    """Axis, and sense, in which the toes are ahead of the heels."""
    ahead = np.zeros(3)
    for side in ("right", "left"):
        if {f"{side}_heel", f"{side}_toe"} <= set(names):
            heel, toe = (places[:, names.index(f"{side}_{end}")] for end in ("heel", "toe"))
            ahead += _mean(toe - heel)
    ahead[vertical] = 0.0
    if not np.any(ahead):
        raise GaitError(
            f"{path}: the markers of heel and toe do not show which way the person walks; give the "
            "axis that points forward (forward=, --forward-axis)"
        )
    axis = int(np.argmax(np.abs(ahead)))
    return axis, float(np.sign(ahead[axis]))


def _mean(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of what was seen, 0 along axes that nothing is known of."""
    seen = np.isfinite(rows)
    return np.where(seen, rows, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
