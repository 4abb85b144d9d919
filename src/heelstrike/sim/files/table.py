"""Runs as tables of text (CSV), for spreadsheets and other programs.

A row is a recorded time, a column a recorded number of the dataset of
:func:`~heelstrike.sim.files.dataset.to_dataset`: its name, what it belongs to, and its unit.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Hashable, Iterator, Sequence
from typing import Any

import numpy as np

from heelstrike.robot.robot import Robot
from heelstrike.sim.files.dataset import to_dataset
from heelstrike.sim.run import Run

EVENTS = "events"
"""The last column: what happened since the row before, in words."""
OF_HINGES = ("rad", "rad/s", "N m")
"""Units of joints that turn, where a quantity has one for those and one for slides."""


def to_csv(run: Run) -> str:
    """Return a run as text: a line of headings, then a line a recorded time.

    Headings are as in ``position left_knee [rad]``. The last column, ``events``, says what happened
    after the row before and up to this one, as in ``touchdown left_heel; slip right_toe``; after
    the last row, it is in that one. Numbers read back to the last bit; a cell is empty where there
    is none. The robot, the ground and how the run ended are not in it.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    str
        The text.
    """
    data = to_dataset(run)
    headings, columns = [f"time [{data['time'].attrs['units']}]"], [run.time.tolist()]
    for name, each in data.data_vars.items():
        if each.dims[:1] != ("time",):
            continue
        labels = [_labels(data, dim, size) for dim, size in zip(each.dims, each.shape, strict=True)]
        unit, of = each.attrs.get("units", ""), str(each.dims[1]) if each.ndim > 1 else ""
        for place in np.ndindex(each.shape[1:]):
            words = [str(name), *(labels[k][i] for k, i in enumerate(place, start=1))]
            its = _unit_of(unit, run.robot, of, place)
            headings.append(" ".join(words) + (f" [{its}]" if its not in ("", "1") else ""))
            columns.append(each.values[(slice(None), *place)].tolist())
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*headings, EVENTS])
    for numbers, events in zip(zip(*columns, strict=True), _events(run), strict=True):
        table.writerow([*map(_written, numbers), events])
    return text.getvalue()


def _labels(data: Any, dim: Hashable, size: int) -> Sequence[str]:
    """What counts along a dimension, which may have numbers only."""
    return list(map(str, data[dim].values if dim in data.coords else range(size)))


def _unit_of(unit: str, robot: Robot, of: str, place: Sequence[int]) -> str:
    """Unit of a number of a joint, where hinges and slides have their own: ``m or rad``."""
    model = robot.model
    joints: dict[str, Sequence[int]] = {
        "coordinate": range(robot.nj),
        "coupling": model.coupling_joint[:, 0].tolist(),
        "brake": model.brake_joint.tolist(),
    }
    if " or " not in unit or of not in joints:
        return unit
    turns = bool(model.axis[joints[of][place[0]], 0])
    return next(one for one in unit.split(" or ") if (one in OF_HINGES) is turns)


def _written(value: Any) -> str:
    return "" if isinstance(value, float) and math.isnan(value) else repr(value)


def _events(run: Run) -> Iterator[str]:
    """What happened up to each row, since the one before."""
    told: list[list[str]] = [[] for _ in run.time]
    times = [event.time for event in run.events]
    rows = np.minimum(np.searchsorted(run.time, times), len(run.time) - 1)
    for row, event in zip(rows.tolist(), run.events, strict=True):
        told[row].append(f"{event.kind_in_words} {event.place(run.robot)}".rstrip())
    return map("; ".join, told)
