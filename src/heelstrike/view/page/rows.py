"""Which rows of a run a page shows, and what acts between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.analysis.intervals import mean_between, mean_over_intervals
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.run import AnyRun, Run

Rows = Integers

INTERVAL = 0.01
"""Time between two rows that are shown (s): a display shows some sixty a second."""
CLOSE = 0.002
"""Time between two rows about an impact (s), which is shown in slow motion."""
BEFORE, AFTER = 0.01, 0.03
"""How long before and after an impact rows lie close (s)."""
MOST_ROWS = 6000
"""Rows that a page may have: of a longer run they lie further apart."""

IMPACTS = (EventKind.TOUCHDOWN, EventKind.IMPACT, EventKind.JOINT_STOP, EventKind.PAINLEVE)


def shown_rows(run: AnyRun, *, most: int = MOST_ROWS) -> Rows:
    """Choose the rows of a run that a page shows, as indices in the order of time.

    Rows some `INTERVAL` apart, closer about impacts, the first and the last, and those on both
    sides of every event. Where that is more than `MOST_ROWS`, rows between events are fewer first,
    then events.
    """
    impacts = [event.time for event in run.events if event.kind in IMPACTS]
    return rows_about(run.time, [event.time for event in run.events], impacts, most=most)


def rows_about(
    time: Floats, events: Sequence[float], impacts: Sequence[float], *, most: int = MOST_ROWS
) -> Rows:
    """Choose rows by the times of all rows (nt,), of events and of the impacts among them (s)."""
    count = len(time)
    if count <= 2:
        return np.arange(count)
    ends = np.array([0, count - 1])
    duration = float(time[-1] - time[0])
    at_events = _beside(time, np.array(events, dtype=np.float64))
    at_events = at_events[:: -(-len(at_events) // (most // 2)) or 1]
    about = np.arange(-BEFORE, AFTER, CLOSE)
    close = _nearest(time, (np.unique(np.array(impacts))[:, None] + about).ravel())
    interval = max(INTERVAL, 2.0 * duration / most)
    usual = _nearest(time, np.arange(time[0], time[-1], interval))
    rows = np.unique(np.concatenate((ends, at_events, usual, close)))
    return rows if len(rows) <= most else np.unique(np.concatenate((ends, at_events, usual)))


def _nearest(time: Floats, instants: Floats) -> Rows:
    """Rows at or just after some instants."""
    return np.clip(np.searchsorted(time, instants - 1e-9), 0, len(time) - 1)


def _beside(time: Floats, instants: Floats) -> Rows:
    """Last rows before events, first ones at them or after, and the next, in which they show."""
    after = np.searchsorted(time, instants - 1e-9)
    return np.unique(np.clip(np.concatenate((after - 1, after, after + 1)), 0, len(time) - 1))


def means(run: Run, values: Floats, rows: Rows) -> Floats:
    """Mean of a force over the time from each row shown to the next, as `values`, but (n, ...).

    What pushes for one step between two rows is seen with its impulse. The last row, and one that
    has the time of the next, has its own value.
    """
    held = np.diff(run.time).reshape(-1, *[1] * (values.ndim - 1))
    gained = mean_over_intervals(run, values) * held
    return mean_between(run.time, gained, rows, values[rows])
