"""The scenarios whose instructions are counted do what their names say."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import instructions
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.sim import RunStatus


@pytest.fixture(scope="module")
def runs() -> dict[str, hs.Run]:
    """Runs by name, of those that step through time; as long as they are counted."""
    found = {}
    for name, counted in instructions.scenarios().items():
        if isinstance(counted.method, hs.TimeStepping):
            longer = (counted.first + counted.count) * instructions.STEP
            scenario = replace(counted.scenario, duration=longer)
            found[name] = scenario.run(
                counted.method, controller=counted.controller, record_every=1
            )
    return found


def slipping(run: hs.Run) -> Any:
    return (np.abs(run.slip_velocity) > 1e-9) & (run.contact_force[..., 0] > 0.0)


def test_each_is_counted_to_its_end(runs: dict[str, hs.Run]) -> None:
    assert {run.status for run in runs.values()} == {RunStatus.COMPLETED}


def test_what_stands_sticks(runs: dict[str, hs.Run]) -> None:
    standing = [run for name, run in runs.items() if name.startswith("standing")]
    assert len(standing) == 4
    for run in standing:
        assert not slipping(run).any()


def test_what_slips_slips_at_all_points(runs: dict[str, hs.Run]) -> None:
    for name, points in (("slipping, bravo7", 4), ("slipping, plank on 8 points", 8)):
        assert np.all(slipping(runs[name]).sum(axis=1) == points)


@pytest.mark.parametrize("how", ["at its stops, walker2d left alone", "at its stops, walker2d held",
                                 "against its stops, walker2d"])  # fmt: skip
def test_walker2d_stays_on_four_stops(runs: dict[str, hs.Run], how: str) -> None:
    run = runs[how]
    stop = np.abs(run.position - run.robot.model.upper) <= 1e-6
    assert np.all(stop.sum(axis=1) == 4)
    if how.startswith("against"):
        assert np.all((run.stop_torque < -1.0).sum(axis=1) == 4)


def test_stamping_changes_contacts_in_most_steps(runs: dict[str, hs.Run]) -> None:
    run = runs["stamping, bravo7"]
    pushed = run.contact_force[..., 0] > 0.0
    mode = np.where(pushed, 2 + np.where(slipping(run), np.sign(run.slip_velocity), 0.0), 0.0)
    changed = np.any(mode[1:] != mode[:-1], axis=1)
    assert changed.mean() > 0.5


@pytest.mark.parametrize("name", instructions.scenarios())
def test_no_count_hangs_on_rounding(name: str) -> None:
    """A position that is off by 1e-12 at first is off by no more than 1e-9 at the end."""
    counted = instructions.scenarios()[name]
    scenario = replace(counted.scenario, duration=0.6)
    ends = []
    for change in (0.0, 1e-12):
        q = scenario.state.q + change * np.eye(scenario.robot.nq)[2]
        begun = replace(scenario, state=hs.State(q, scenario.state.v))
        ends.append(begun.run(counted.method, controller=counted.controller).position[-1])
    assert np.abs(ends[1] - ends[0]).max() <= 1e-9


def test_each_is_held_against_the_same_robot() -> None:
    counted = instructions.scenarios()
    beside = {name: each for name, each in counted.items() if each.beside}
    assert len(beside) == 7
    for each in beside.values():
        assert counted[each.beside].scenario.robot.name == each.scenario.robot.name


def test_a_users_law_does_what_the_stock_one_does(runs: dict[str, hs.Run]) -> None:
    stock, users = (runs[f"walking, computed torque{whose}"] for whose in ("", " of a user"))
    laws = [
        instructions.scenarios()[f"walking, computed torque{whose}"].controller
        for whose in ("", " of a user")
    ]
    assert [law.function.is_ours for law in laws] == [True, False]
    np.testing.assert_allclose(users.position[-1], stock.position[-1], atol=1e-9)
