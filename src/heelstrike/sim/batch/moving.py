"""What moves the lanes of a batch, compiled: one call for many of them, and many of their steps."""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import types

from heelstrike.compiler.bundle_type import WORD_BYTES, bundle_at
from heelstrike.compiler.compilation import loop_for
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.compiler.words import copy_between
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.clock import Clock
from heelstrike.sim.frame import FORK, PAUSED, RECORD_FULL
from heelstrike.sim.record.record import RowsAndEvents

# The columns of places: where the loop of a lane is and the bundles that it is called with, and
# where its law looks for the torques that are commanded, zero if it does not.
LOOP, MODEL, GROUND, CONTROL, MEMORY, WORK, RECORD, CLOCK, COMMAND = range(9)
PLACES = 9


@cache
def move_lanes() -> Any:
    """Return what moves lanes on: see `move` within."""
    clock_at, record_at = bundle_at(Clock), bundle_at(RowsAndEvents)

    def move(
        places: Integers, lanes: Integers, until: Floats, steps: int, command: Integers,
        outcome: Integers, events: Integers,
    ) -> int:  # fmt: skip
        """Move lanes on until a time of each, or by so many steps.

        ``command`` is (where the commanded torques are, how many a lane has). Writes why the loop
        of each came back to ``outcome`` and adds what happened in it to ``events``. Returns how
        many have ended.
        """
        ended = 0
        for place in range(lanes.shape[0]):
            lane = lanes[place]
            clock, record = clock_at(places[lane, CLOCK]), record_at(places[lane, RECORD])
            target = places[lane, COMMAND]
            if target != 0:
                source = command[0] + WORD_BYTES * command[1] * lane
                copy_between(source, target, command[1])
            clock.until = until[lane]
            clock.pause = clock.index + steps
            clock.forked = 0
            code = RECORD_FULL
            while code in (RECORD_FULL, FORK):
                code = call_at(
                    places[lane, LOOP],
                    (
                        places[lane, MODEL], places[lane, GROUND], places[lane, CONTROL],
                        places[lane, MEMORY], places[lane, WORK], places[lane, RECORD],
                        places[lane, CLOCK],
                    ),
                )  # fmt: skip
                if code != FORK:
                    for event in range(record.told.events):
                        events[lane, record.told.event_kind[event]] += 1
                    record.rows = record.told.events = record.logged = 0
            outcome[lane] = code
            ended += code > PAUSED
        return ended

    integers, table = types.int64[::1], types.int64[:, ::1]
    return loop_for(
        types.int64(
            table, integers, types.float64[::1], types.int64, integers, integers, table
        ),
        move,
    )  # fmt: skip


@cache
def put_back_lanes() -> Any:
    """Return what lets lanes be as they were: see `put_back` within."""

    def put_back(
        lanes: Integers, spots: Integers, images: Integers, new_q: Floats, new_v: Floats,
        q: Floats, v: Floats, events: Integers,
    ) -> int:  # fmt: skip
        """Copy what is at the image of each lane to its spots, and a state into it.

        ``spots`` are (lanes, arrays, place and words); ``new_q`` and ``new_v`` have a row for each
        lane that is put back. No event has happened in it then.
        """
        for place in range(lanes.shape[0]):
            lane = lanes[place]
            source = images[lane]
            for array in range(spots.shape[1]):
                words = spots[lane, array, 1]
                copy_between(source, spots[lane, array, 0], words)
                source += WORD_BYTES * words
            for i in range(q.shape[1]):
                q[lane, i] = new_q[place, i]
            for i in range(v.shape[1]):
                v[lane, i] = new_v[place, i]
            for kind in range(events.shape[1]):
                events[lane, kind] = 0
        return 0

    integers, columns = types.int64[::1], types.float64[:, :]
    given = columns, columns, columns, columns
    return loop_for(
        types.int64(integers, types.int64[:, :, ::1], integers, *given, types.int64[:, ::1]),
        put_back,
    )
