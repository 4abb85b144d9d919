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

from heelstrike.sim.files.dataset import to_dataset
from heelstrike.sim.files.layout import layout_of
from heelstrike.sim.run import AnyRun

EVENTS = "events"
"""The last column: what happened since the row before, in words."""


def to_csv(run: AnyRun) -> str:
    """Return a run as text: a line of headings, then a line a recorded time.

    Headings are as in ``position left_knee [rad]``. The last column, ``events``, says what happened
    after the row before and up to this one, as in ``touchdown left_heel; slip right_toe``; after
    the last row, it is in that one. Numbers read back to the last bit; a cell is empty where there
    is none. The robot, the ground and how the run ended are not in it.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.

    Returns
    -------
    str
        The text.
    """
    data, layout = to_dataset(run), layout_of(run)
    headings, columns = [f"time [{data['time'].attrs['units']}]"], [run.time.tolist()]
    for name, each in data.data_vars.items():
        if each.dims[:1] != ("time",):
            continue
        labels = [_labels(data, dim, size) for dim, size in zip(each.dims, each.shape, strict=True)]
        unit, of = each.attrs.get("units", ""), str(each.dims[1]) if each.ndim > 1 else ""
        for place in np.ndindex(each.shape[1:]):
            words = [str(name), *(labels[k][i] for k, i in enumerate(place, start=1))]
            its = layout.unit_of(run.robot, of, place[0], unit) if of else unit
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


def _written(value: Any) -> str:
    return "" if isinstance(value, float) and math.isnan(value) else repr(value)


def _events(run: AnyRun) -> Iterator[str]:
    """What happened up to each row, since the one before."""
    told: list[list[str]] = [[] for _ in run.time]
    times = [event.time for event in run.events]
    rows = np.minimum(np.searchsorted(run.time, times), len(run.time) - 1)
    for row, event in zip(rows.tolist(), run.events, strict=True):
        told[row].append(f"{event.kind_in_words} {event.place(run.robot)}".rstrip())
    return map("; ".join, told)
