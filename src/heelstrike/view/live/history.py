"""Rows of a simulation that goes on, as far back as there is room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.robot.model import Floats
from heelstrike.sim.run import QUANTITIES
from heelstrike.tolerances import SAME_ROW

if TYPE_CHECKING:
    from heelstrike.sim.run import AnyRun
    from heelstrike.view.live.dimension import AnyEvent

MOST_ROWS = 100_000
"""Rows that are kept; some 60 MB of bravo7."""
MOST_EVENTS = 5000


class History:
    """Rows and events of consecutive pieces of a record, the newest `MOST_ROWS`.

    A piece begins with the instant at which the one before ended, and that row is replaced: what
    was set in between acts from it on.

    Parameters
    ----------
    quantities : sequence of str
        What its runs record beside the time; by default those of the plane.

    Attributes
    ----------
    events : list of Event
        In the order of time.
    """

    def __init__(self, quantities: Sequence[str] = tuple(QUANTITIES)) -> None:
        self.events: list[AnyEvent] = []
        self._run: AnyRun | None = None
        self._names = ("time", *quantities)
        self._rows: dict[str, Floats] = {}
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def time(self) -> Floats:
        """Times of the rows, (nt,), in s."""
        return self._kept("time") if self._rows else np.zeros(0)

    @property
    def newest(self) -> AnyRun | None:
        """The piece that was taken last."""
        return self._run

    def take(self, run: AnyRun) -> list[AnyEvent]:
        """Take a piece that follows on the last; return its events that are new."""
        self._run = run
        if not len(run.time):
            return []
        self._end = self._first + int(np.searchsorted(self.time, run.time[0] - SAME_ROW))
        self._make_room(run)
        for name, rows in self._rows.items():
            rows[self._end : self._end + len(run.time)] = getattr(run, name)
        self._end += len(run.time)
        newest = takewhile(lambda e: e.time >= run.time[0] - SAME_ROW, reversed(self.events))
        known = {(e.time, e.kind, e.contact) for e in newest}
        new = [e for e in run.events if (e.time, e.kind, e.contact) not in known]
        self.events = (self.events + new)[-MOST_EVENTS:]
        return new

    def cut(self, time: float) -> None:
        """Forget what is later than a time (s)."""
        self._end = self._first + int(np.searchsorted(self.time, time + SAME_ROW))
        self.events = [event for event in self.events if event.time <= time + SAME_ROW]

    def row_at(self, time: float) -> int:
        """Index of the last row that is not later than a time (s), or of the first row."""
        return max(int(np.searchsorted(self.time, time + SAME_ROW)) - 1, 0)

    def part(self, first: int, last: int) -> AnyRun:
        """Rows from one index to another, the last one included, as a run with their events."""
        assert self._run is not None
        rows: dict[str, Any] = {name: self._kept(name)[first : last + 1] for name in self._rows}
        begin, end = rows["time"][0] - SAME_ROW, rows["time"][-1] + SAME_ROW
        events: list[Any] = []
        for event in reversed(self.events):
            if event.time < begin:
                break
            if event.time <= end:
                events.append(event)
        whole: Any = self._run
        part: AnyRun = replace(whole, **rows, events=tuple(reversed(events)))
        return part

    def _kept(self, name: str) -> Floats:
        return self._rows[name][self._first : self._end]

    def _make_room(self, run: AnyRun) -> None:
        """See to it that the rows of a piece fit behind those that are kept."""
        if not self._rows:
            self._rows = {
                name: np.zeros((0, *getattr(run, name).shape[1:])) for name in self._names
            }
        size, needed = len(self._rows["time"]), self._end + len(run.time)
        if needed <= size:
            return
        kept = max(min(self._end - self._first, MOST_ROWS - len(run.time)), 0)
        room = max(2 * (kept + len(run.time)), 4096)
        for name, rows in self._rows.items():
            larger = np.zeros((room, *rows.shape[1:]))
            larger[:kept] = rows[self._end - kept : self._end]
            self._rows[name] = larger
        self._first, self._end = 0, kept
