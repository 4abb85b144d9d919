"""The largest push in engines: each goes on from our run, under a law that remembers it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import walking
from experiments.engine_comparison.our_engine import OurPeer
from rich.console import Console

import heelstrike as hs
from heelstrike.analysis.stability.largest import Largest
from heelstrike.experiments.engine_comparison import pushes as module
from heelstrike.experiments.engine_comparison.entries import ENTRIES
from heelstrike.experiments.engine_comparison.pushes import (
    STEP,
    UNPUSHED,
    PushRow,
    PushTable,
    compare_pushes,
    pushed,
    since,
    stands,
    stands_by_ours,
    stands_in,
    told_the_past,
)
from heelstrike.experiments.engine_comparison.walk import TRUTH, Walk
from heelstrike.experiments.engine_comparison.walking import seen, walk_in
from heelstrike.experiments.engines import Scenario
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.sim import Run, TimeStepping
from heelstrike.sim.closed_sets import RunStatus

TOO_MUCH = 600.0
"""Impulse (N s) that throws a robot of 75 kg over."""


@pytest.fixture(scope="module")
def walk() -> Walk:
    robot, gait = walking.bravo7(), walking.gait()
    return Walk(robot, hs.FootstepFeedback(robot, gait), gait, 2, 2e-3, 0.75, 60.0)


@pytest.fixture(scope="module")
def past(walk: Walk) -> Run:
    push, _ = pushed(walk, 20.0)
    return walk.ours(TRUTH, pushes=[push], until=push.end)


def test_a_push_has_its_impulse_and_whole_control_periods(walk: Walk) -> None:
    push, until = pushed(walk, -20.0)
    assert push.force[0] * push.duration == pytest.approx(-20.0, rel=1e-12)
    for instant in (push.start, push.end):
        assert instant / 2e-3 == pytest.approx(round(instant / 2e-3), abs=1e-9)
    assert until == pytest.approx(push.end + 7.0)


def test_a_law_that_was_told_the_past_goes_on_as_the_one_that_lived_it(
    walk: Walk, past: Run
) -> None:
    push, _ = pushed(walk, 20.0)
    lived = walk.ours(TRUTH, pushes=[push], until=push.end + 0.05)
    # A row has the torques by which the robot came to it: the next one has those asked for here.
    row = int(np.searchsorted(lived.time, push.end + 1e-9, side="right"))
    q, v = past.position[-1], past.velocity[-1]
    contacts = seen(walk.robot, q, past.contact_force[-1])
    told = told_the_past(walk, past).torque(push.end, hs.State(q, v), contacts)
    assert np.abs(told - lived.torque[row]).max() <= 1e-7
    fresh = walk.asked().torque(push.end, hs.State(q, v), contacts)
    assert np.abs(fresh - lived.torque[row]).max() > 0.1


def test_an_engine_like_ours_goes_on_like_ours(walk: Walk, past: Run) -> None:
    push, _ = pushed(walk, 20.0)
    until = push.end + 0.3
    start = hs.State(past.position[-1], past.velocity[-1])
    scenario = Scenario("pushed", walk.robot, start, until - push.end, friction=0.75)
    taken_over = walk_in(
        OurPeer(scenario, STEP), told_the_past(walk, past), control_period=2e-3, begins=push.end
    )
    ours = walk.ours(TRUTH, pushes=[push], until=until)
    assert taken_over.time[0] == push.end
    assert taken_over.time[-1] == pytest.approx(until)
    assert np.abs(taken_over.position[-1] - ours.position[-1]).max() <= 5e-3  # of first order


def test_a_push_can_be_too_much(walk: Walk) -> None:
    method = TimeStepping(step=STEP)
    assert stands_by_ours(walk, method, 1.0, 0.0)
    assert not stands_by_ours(walk, method, 1.0, TOO_MUCH)
    push, until = pushed(walk, TOO_MUCH)
    fallen = walk.ours(method, pushes=[push], until=until)
    assert not stands(walk, since(fallen, push.end), push)


def test_ours_is_judged_by_what_engines_know(walk: Walk, past: Run) -> None:
    """From the end of the push on, as the runs of engines that take over then."""
    push, _ = pushed(walk, 20.0)
    lived = walk.ours(TRUTH, pushes=[push], until=push.end + 0.6)
    cut = since(lived, push.end)
    assert cut.time[0] == pytest.approx(push.end)
    assert len(cut.position) == len(cut.time) == np.sum(lived.time >= push.end - 1e-9)
    assert cut.events
    assert len(cut.events) < len(lived.events)
    assert all(event.time >= push.end - 1e-9 for event in cut.events)


def test_a_walk_that_fell_before_the_push_ended_stands_it_in_no_engine(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fell(self: Walk, push: hs.Push) -> Run:
        return replace(short, status=RunStatus.FELL)

    short = walk.ours(TimeStepping(step=STEP), until=0.01)
    monkeypatch.setattr(Walk, "past", fell)
    assert not stands_in(walk, ENTRIES["mujoco"], {}, {}, 1.0, 20.0)


def test_the_past_of_a_push_is_the_same_for_all_engines(walk: Walk) -> None:
    push, _ = pushed(walk, 0.0)
    assert walk.past(push) is walk.past(push)


LEAST = Largest(recovered=0.0, failed=0.0, trials=1, unit="N s")


def test_of_a_walk_that_fails_unpushed_it_is_said() -> None:
    row = PushRow("a", "A", "defaults", "forward", LEAST, "")
    console = Console(width=120)
    with console.capture() as told:
        console.print(PushTable("bravo7", (row,)))
    assert UNPUSHED in told.get()


def test_rows_of_engines_are_kept_and_say_why_there_is_nothing(
    walk: Walk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def by_ours(walk: Walk, method: object, sign: float, impulse: float) -> bool:
        asked.append("ours")
        return True

    def in_engine(
        walk: Walk, entry: object, given: object, versions: object, sign: float, impulse: float
    ) -> bool:
        asked.append("theirs")
        if sign < 0.0:
            raise InvalidRunError("its process was ended by SIGABRT")
        return impulse <= 50.0

    monkeypatch.setattr(module, "stands_by_ours", by_ours)
    monkeypatch.setattr(module, "stands_in", in_engine)
    compare = partial(
        compare_pushes, walk.robot, walk.controller, walk.gait, engines=["mujoco"], most=80.0,
        strides=2, halvings=2, folder=tmp_path,
    )  # fmt: skip
    table = compare()
    rows = {(row.engine, row.direction): row for row in table.rows}
    found = rows["mujoco", "forward"].largest
    assert found is not None
    assert (found.recovered, found.failed) == (50.0, 60.0)
    assert rows["mujoco", "backward"].largest is None
    assert rows["mujoco", "backward"].reason == "its process was ended by SIGABRT"
    ours = rows["event-driven", "forward"].largest
    assert ours is not None
    assert math.isinf(ours.failed)
    asked.clear()
    again = compare()
    assert asked == ["theirs"]  # what failed is asked again, and fails at once
    assert again.to_dict() == table.to_dict()
