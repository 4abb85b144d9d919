"""Gaits of one robot over a grid of speeds, slopes and steps, each found from its neighbour."""

from __future__ import annotations

import enum
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.arguments import is_number, refusal, takes
from heelstrike.errors import GaitError, InfeasibleGaitError, WriteError
from heelstrike.field_texts import dataclass
from heelstrike.gait.branches import Pair, Place, on_the_cheaper_branch
from heelstrike.gait.cost import costs_of
from heelstrike.gait.file import LARGEST_NUMBER, check_robot, entries_of, gait_of
from heelstrike.gait.gait import Gait
from heelstrike.gait.optimize import optimize_gait, request_of
from heelstrike.gait.request import STEP_UNITS
from heelstrike.json_checksum import Entries, json_text, reading_json
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.whole_file import write_whole

AXES = ("step_length", "step_duration", "speed", "slope", "rise")
"""What a family may be spanned over."""
VERSION = 1
FIRST = 0.7
"""Share of the work until every place has a gait."""
LARGEST_FILE = 2**26
"""Files of families larger than this (in bytes) are refused."""


@dataclass(frozen=True, eq=False)
class GaitFamily:
    """Gaits over a grid.

    ``family[i, j]`` is the gait at a point of the grid, an index each axis, or None where there is
    none. :meth:`at` gives gaits in between.
    """

    robot: Robot
    """The robot."""
    axes: Mapping[str, Floats]
    """Values of each axis in rising order: `step_length` (m), `step_duration` (s), `speed` (m/s),
    `slope` (rad), `rise` (m)."""
    asked: Mapping[str, Any]
    """What else was asked of :func:`heelstrike.optimize_gait`, the same everywhere."""
    gaits: Mapping[Place, Gait]
    """The gaits by their place in the grid."""
    gaps: Mapping[Place, str]
    """Why there is none, where there is none."""
    settled: AbstractSet[Pair] = frozenset()
    """Neighbours of which none leads to a cheaper gait of the other."""

    def __getitem__(self, place: int | Place) -> Gait | None:
        where = place if isinstance(place, tuple) else (place,)
        sizes = tuple(axis.size for axis in self.axes.values())
        if len(where) != len(sizes) or not all(
            i in range(size) for i, size in zip(where, sizes, strict=True)
        ):
            raise GaitError(
                f"the family has {' x '.join(str(size) for size in sizes)} places, over "
                f"{', '.join(self.axes)}: give an index of each axis, from 0 on; got {place!r}"
            )
        return self.gaits.get(where)

    def at(self, **values: float) -> Gait:
        """Gait between those of the grid.

        The motions of the gaits at the corners of the cell are interpolated linearly. From there
        the optimiser looks for an optimum nearby that holds all limits, and does not start from
        other motions. If it finds none, it tries the smooth profile of the swing foot's clearance,
        unless a profile was asked for. If that fails, too, the interpolated motion is changed as
        little as makes it satisfy all equations of a step: the foot lands in its place, and the
        velocities after the impact are those with which the step began. Limits are not enforced
        then; `gait.margins` tells how far they are.

        Parameters
        ----------
        **values
            A value of every axis, within its range.

        Returns
        -------
        Gait
            The gait; `gait.optimal` tells whether it is an optimum.

        Raises
        ------
        GaitError
            If a value is missing, of no axis or out of range, or the cell has a gap.
        """
        corners = [(self._corner(place), weight) for place, weight in self._weights(values)]
        if len(corners) == 1:
            return corners[0][0]
        from heelstrike.gait.design import between

        return between(request_of(self.robot, **self.asked, **values), corners)

    def _weights(self, values: Mapping[str, float]) -> list[tuple[Place, float]]:
        """Corners of the cell that a point is in, with their weights but for zeros."""
        if set(values) != set(self.axes):
            raise GaitError(
                f"give a value of each axis, {', '.join(self.axes)}; "
                f"got {', '.join(values) or 'none'}"
            )
        along: list[list[tuple[int, float]]] = []
        for name, axis in self.axes.items():
            value = values[name]
            if not is_number(value):
                raise GaitError(refusal(name, value, ("float",)))
            if not axis[0] <= value <= axis[-1]:
                raise GaitError(
                    f"{name} = {value:g} is outside of the family, {axis[0]:g} to {axis[-1]:g}"
                )
            before = int(np.searchsorted(axis, value, side="right")) - 1
            if axis[before] == value:
                along.append([(before, 1.0)])
                continue
            share = float((value - axis[before]) / (axis[before + 1] - axis[before]))
            along.append([(before, 1.0 - share), (before + 1, share)])
        return [
            (tuple(i for i, _ in place), float(np.prod([weight for _, weight in place])))
            for place in product(*along)
        ]

    def _corner(self, place: Place) -> Gait:
        if place not in self.gaits:
            where = ", ".join(
                f"{name} = {axis[i]:g}"
                for (name, axis), i in zip(self.axes.items(), place, strict=True)
            )
            raise GaitError(f"the family has no gait at {where}: {self.gaps.get(place, 'unknown')}")
        return self.gaits[place]

    def save(self, path: str | PathLike[str]) -> None:
        """Write the family to a readable JSON file; :func:`load_gait_family` reads it.

        Parameters
        ----------
        path : str or path
            File to write.

        Raises
        ------
        GaitError
            If the file cannot be written.
        """
        entries = {
            "robot": self.robot.name,
            "axes": {name: axis.tolist() for name, axis in self.axes.items()},
            "asked": dict(self.asked),
            "gaits": [
                {"place": list(place), **entries_of(gait)} for place, gait in self.gaits.items()
            ],
            "gaps": [{"place": list(place), "why": why} for place, why in self.gaps.items()],
            "settled": [{"place": one, "next": other} for one, other in sorted(self.settled)],
        }
        try:
            write_whole(path, json_text("gait family", VERSION, entries))
        except (WriteError, TypeError) as error:
            raise GaitError(f"the family cannot be written: {error}") from error


@takes(GaitError)
def gait_family(
    robot: Robot,
    *,
    step_length: float | Sequence[float] | None = None,
    step_duration: float | Sequence[float] | None = None,
    speed: float | Sequence[float] | None = None,
    slope: float | Sequence[float] = 0.0,
    rise: float | Sequence[float] = 0.0,
    file: str | PathLike[str] | None = None,
    progress: Callable[[float], None] | None = None,
    **asked: Any,
) -> GaitFamily:
    """Design gaits over a grid of steps and grounds, each started from its nearest neighbour.

    Arguments of which a sequence is given are the axes of the grid. Where neighbours move very
    differently, each is sought again from the other, and the cheaper gait is kept.

    Parameters
    ----------
    robot : Robot
        The robot.
    step_length, step_duration, speed, slope, rise : float or sequence of float, optional
        As of :func:`heelstrike.optimize_gait`; a sequence is an axis.
    file : path, optional
        Where the family is saved after every gait. If the file exists, the call resumes the family
        in it, as after Ctrl-C; a finished one is only read.
    progress : callable, optional
        Called now and then with the fraction of the work that is done.
    **asked
        Other arguments of :func:`heelstrike.optimize_gait`, the same everywhere.

    Returns
    -------
    GaitFamily
        The gaits, and where there is none the reason.

    Raises
    ------
    GaitError
        If no argument is a sequence, or the file holds another family.
    InfeasibleGaitError
        If no point of the grid can have a gait.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("rabbit")
    >>> family = hs.gait_family(robot, step_duration=0.6, speed=[0.4, 0.45], starts=1)
    >>> family.at(speed=0.42).step_length
    0.252
    """
    given: dict[str, Any] = {
        "step_length": step_length,
        "step_duration": step_duration,
        "speed": speed,
        "slope": slope,
        "rise": rise,
    }
    axes = {name: _axis(name, value) for name, value in given.items() if np.ndim(value) > 0}
    unknown = set(asked).difference(inspect.signature(optimize_gait).parameters)
    if unknown:
        raise GaitError(f"optimize_gait takes no {', '.join(sorted(unknown))}")
    if "warm_start" in asked:
        raise GaitError(
            "leave out warm_start: each gait of a family is started from its nearest neighbour"
        )
    if "cost" in asked:
        costs_of(asked["cost"])
    if not axes:
        raise GaitError(f"give a sequence of values of at least one of {', '.join(AXES)}")
    if file is not None and callable(asked.get("cost")):
        raise GaitError(
            "a cost that is a function cannot be written to a file: leave out file, or ask for one "
            "of the costs that have names"
        )
    fixed = {
        name: value
        for name, value in given.items()
        if np.ndim(value) == 0 and value is not None and (value or name in STEP_UNITS)
    }
    gaits: dict[Place, Gait] = {}
    gaps: dict[Place, str] = {}
    settled: set[Pair] = set()
    family = GaitFamily(robot, axes, _as_written({**asked, **fixed}), gaits, gaps, settled)
    places = list(_from_the_middle([axis.size for axis in axes.values()]))
    refused: list[InfeasibleGaitError] = []
    for place in places:  # what makes no sense anywhere is refused before anything is designed
        try:
            request_of(robot, **family.asked, **_point(axes, place))
        except InfeasibleGaitError as error:
            refused.append(error)
    if len(refused) == len(places):
        raise refused[-1]
    if file is not None and Path(file).exists():
        saved = load_gait_family(file, robot)
        _check_same(family, saved)
        gaits.update(saved.gaits)
        gaps.update(saved.gaps)
        settled.update(saved.settled)

    def designed(place: Place, near: Gait | None) -> Gait:
        return optimize_gait(robot, **family.asked, **_point(axes, place), warm_start=near)

    def sought(place: Place, near: Gait) -> Gait | None:
        try:
            return designed(place, near)
        except InfeasibleGaitError:
            return None

    def save() -> None:
        if file is not None:
            family.save(file)

    def settled_so_far(share: float) -> None:
        save()
        if progress is not None:
            progress(FIRST + (1.0 - FIRST) * share)

    for done, place in enumerate(places):
        if progress is not None:
            progress(FIRST * done / len(places))
        if place in gaits or place in gaps:
            continue
        try:
            gaits[place] = designed(place, _nearest(place, gaits))
        except InfeasibleGaitError as error:
            gaps[place] = str(error)
        save()
    on_the_cheaper_branch(gaits, sought, settled, settled_so_far)
    if progress is not None:
        progress(1.0)
    return family


@takes(GaitError)
def load_gait_family(path: str | PathLike[str], robot: Robot) -> GaitFamily:
    """Read a family that :meth:`GaitFamily.save` wrote.

    Parameters
    ----------
    path : path
        The file.
    robot : Robot
        The robot; the gaits must have been designed for it.

    Returns
    -------
    GaitFamily
        The family.

    Raises
    ------
    GaitError
        If there is no such file, it is damaged or none of a family, or of another robot.
    """
    with reading_json(
        path, "gait family", (VERSION,), LARGEST_NUMBER, GaitError, LARGEST_FILE
    ) as entries:
        named = entries.object("axes")
        axes = {name: named.numbers(name, None) for name in named.data}
        if not axes or not set(axes) <= set(AXES):
            raise GaitError(f"axes must be some of {', '.join(AXES)}")
        gaits = {_place(each, axes): gait_of(each) for each in entries.objects("gaits")}
        for gait in gaits.values():
            check_robot(gait, robot)
        gaps = {_place(each, axes): each.text("why") for each in entries.objects("gaps")}
        # Files from before it was kept have none.
        pairs = entries.objects("settled") if "settled" in entries.data else []
        settled = {(_place(each, axes), _place(each, axes, "next")) for each in pairs}
        return GaitFamily(robot, axes, entries.object("asked").data, gaits, gaps, settled)


def _place(entries: Entries, axes: Mapping[str, Floats], key: str = "place") -> Place:
    place = tuple(int(i) for i in entries.numbers(key, len(axes)))
    if not all(0 <= i < axis.size for i, axis in zip(place, axes.values(), strict=True)):
        raise GaitError(f"place {place} is not in the grid")
    return place


def _axis(name: str, values: Any) -> Floats:
    try:
        axis = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        axis = np.zeros(0)
    if (
        axis.ndim != 1
        or not axis.size
        or not np.all(np.isfinite(axis))
        or np.any(np.diff(axis) <= 0)
    ):
        raise GaitError(f"{name} must be a number, or numbers in rising order, got {values!r}")
    return axis


def _point(axes: Mapping[str, Floats], place: Place) -> dict[str, Any]:
    """Values of the axes at a place."""
    return {name: float(axis[i]) for (name, axis), i in zip(axes.items(), place, strict=True)}


def _as_written(value: Any) -> Any:
    """Return arguments as a file has them: names of enums, numbers of Python, lists."""
    if isinstance(value, Mapping):
        return {_as_written(name): _as_written(each) for name, each in value.items()}
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_as_written(each) for each in value] if isinstance(value, list | tuple) else value


def _check_same(family: GaitFamily, saved: GaitFamily) -> None:
    """Raise a `GaitError` if a file holds another family."""
    same = list(family.axes) == list(saved.axes) and dict(family.asked) == dict(saved.asked)
    if not same or any(not np.array_equal(a, saved.axes[k]) for k, a in family.axes.items()):
        raise GaitError("the file holds a family with other axes or arguments; give another file")


def _from_the_middle(sizes: Sequence[int]) -> Iterator[Place]:
    """Places of a grid, those near its middle first, so that each has a neighbour before it."""
    middle = [(size - 1) // 2 for size in sizes]
    places = product(*(range(size) for size in sizes))
    yield from sorted(places, key=lambda place: (_distance(place, middle), place))


def _nearest(place: Place, gaits: Mapping[Place, Gait]) -> Gait | None:
    if not gaits:
        return None
    return gaits[min(gaits, key=lambda other: (_distance(place, other), other))]


def _distance(one: Sequence[int], other: Sequence[int]) -> int:
    return sum(abs(i - j) for i, j in zip(one, other, strict=True))
