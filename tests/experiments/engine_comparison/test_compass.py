"""The compass gait as engines walk it: by our own methods, of which the cycle is known.

Published for g = 9.81 on 3 degrees (Goswami, Thuilot and Espiau 1998, recomputed): a step of
0.535445415 m in 0.734346391 s, with the multipliers −0.199726 ± 0.544476i and 0.131573.
"""

from __future__ import annotations

import io
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from heelstrike.experiments.engine_comparison import compare_compass, compass_table
from heelstrike.experiments.engine_comparison import compass as module
from heelstrike.experiments.engine_comparison.compass import (
    STRIDES,
    ByOurs,
    CompassWalk,
    InEngine,
    NotWalkingError,
    _Middle,
    compass,
    compass_walk,
    on_one_foot,
    our_cycle,
)
from heelstrike.experiments.engine_comparison.entries import ENTRIES
from heelstrike.experiments.engines.packages import PACKAGES
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.served import lent
from heelstrike.robot import State
from heelstrike.sim import EventDriven, TimeStepping

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

PERIOD, STEP = 0.734346391, 0.535445415
PAIR, REAL = complex(-0.199726, 0.544476), 0.131573


@pytest.fixture(scope="module")
def cycle() -> tuple[CompassWalk, State]:
    return our_cycle()


@pytest.fixture(scope="module")
def exact(cycle: tuple[CompassWalk, State]) -> CompassWalk:
    """The walk of engines, by a method that locates its landings."""
    method = EventDriven(rtol=1e-9, atol=1e-11, output_period=1e-3)
    return compass_walk(ByOurs(lambda _: method, 1e-3), cycle[1])


def test_our_cycle_has_the_published_digits(cycle: tuple[CompassWalk, State]) -> None:
    walk, _ = cycle
    assert walk.period_s == pytest.approx(PERIOD, abs=1e-8)
    assert walk.step_m == pytest.approx(STEP, abs=1e-8)
    pair = [each for each in walk.multipliers if each.imag > 0.0]
    assert pair == pytest.approx([PAIR], abs=2e-6)
    assert walk.multipliers[2] == pytest.approx(REAL, abs=2e-6)


def test_handed_from_one_foot_to_both_it_is_the_same_walk(exact: CompassWalk) -> None:
    """Rows of 1 ms are interpolated at mid-stance: ¼ h² of accelerations of some 10 rad/s²."""
    assert exact.ending == ""
    assert exact.period_s == pytest.approx(PERIOD, abs=1e-5)
    assert exact.step_m == pytest.approx(STEP, abs=1e-7)
    assert exact.spread <= 1e-5


def test_its_multipliers_are_found_by_what_disturbances_leave(exact: CompassWalk) -> None:
    """The fit of second order leaves the third: within twice the error that it tells."""
    assert 0.0 < exact.error <= 0.05
    assert abs(exact.multipliers[0]) == pytest.approx(abs(PAIR), abs=2.0 * exact.error)
    assert abs(exact.multipliers[2].real - REAL) <= 2.0 * exact.error


def test_time_stepping_comes_to_it(cycle: tuple[CompassWalk, State]) -> None:
    """Of first order: 5 mm/m and 1 % at 1 ms."""
    walk = compass_walk(ByOurs(lambda step: TimeStepping(step=step), 1e-3), cycle[1])
    assert walk.ending == ""
    assert walk.period_s == pytest.approx(PERIOD, rel=0.01)
    assert walk.step_m == pytest.approx(STEP, rel=0.02)
    assert walk.spread > 1e-3  # landings are early or late by up to a step


def test_the_walker_is_the_same_mechanism_as_the_library_has() -> None:
    """Half the mass of the hip in each leg: 20 kg, and 5 kg in the middle of each leg."""
    robot = compass(both=True)
    assert robot.weight == pytest.approx(20.0 * 9.81)
    assert (compass(both=False).nc, robot.nc) == (1, 2)
    q, v = on_one_foot(-0.2, 0.3, (1.0, 0.5), foot=2.0)
    assert q[0] - math.sin(q[2]) == pytest.approx(2.0)
    assert q[1] - math.cos(q[2]) == pytest.approx(0.0)
    assert v[0] - math.cos(q[2]) * v[2] == pytest.approx(0.0)


def test_one_that_falls_says_so(cycle: tuple[CompassWalk, State]) -> None:
    _, start = cycle
    still = State(start.q, np.zeros(4))
    walk = compass_walk(ByOurs(lambda step: TimeStepping(step=step), 1e-3), still)
    assert walk.strides == 0
    assert walk.ending in ("it falls", "it does not take the next step")
    assert math.isnan(walk.period_s)


def test_one_that_falls_only_when_disturbed_keeps_its_cycle(
    monkeypatch: pytest.MonkeyPatch, cycle: tuple[CompassWalk, State]
) -> None:
    """Strides that are made up: 0.7 s and 0.5 m each, until the third that is disturbed."""
    taken: list[float] = []

    def stride(_: Any, middle: Any) -> Any:
        taken.append(middle.foot)
        if len(taken) == STRIDES + 3:
            raise NotWalkingError("it falls")
        return replace(middle, foot=middle.foot + 0.5, time=0.7)

    first = _Middle(np.zeros(4), np.zeros(4), 0.0, np.array([0.5, -0.3, -1.3]), 0.0, 0.0)
    monkeypatch.setattr(module, "_to_the_middle", lambda *_: first)
    monkeypatch.setattr(module, "_stride", stride)
    walk = compass_walk(ByOurs(lambda step: TimeStepping(step=step), 1e-3), cycle[1])
    assert (walk.strides, walk.ending, walk.undetermined) == (STRIDES, "", "it falls")
    assert (walk.period_s, walk.step_m, walk.spread) == pytest.approx((0.7, 0.5, 0.0))
    assert np.isnan([*walk.multipliers, walk.error]).all()
    told = compass_table._told(walk)
    row = {"engine": "ode", "title": "ODE", "step_s": 1e-3, "walk": told, "reason": ""}
    assert compass_table.compass_cells(row) == [
        "ODE", "1", "yes", "0.7000", "0.5000", "0", "none, disturbed: it falls", "–",
    ]  # fmt: skip


@pytest.mark.slow
def test_the_table_says_who_walks_and_why_others_do_not(
    monkeypatch: pytest.MonkeyPatch, cycle: tuple[CompassWalk, State], tmp_path: Any
) -> None:
    asked: list[str] = []

    def in_engine(entry: Any, *_: Any) -> dict[str, Any]:
        asked.append(entry.title)
        if entry.title == "Bullet":
            raise InvalidRunError("its process was ended by SIGABRT")
        return compass_table._told(cycle[0])

    versions = dict.fromkeys(PACKAGES, "1.0") | {"ode": "not installed"}
    monkeypatch.setattr(compass_table, "peers", lambda load: versions)
    monkeypatch.setattr(compass_table, "_in_engine", in_engine)
    for _ in range(2):
        table = compare_compass(engines=["mujoco", "bullet", "ode"], steps=[1e-3], folder=tmp_path)
    assert asked == ["MuJoCo", "Bullet", "Bullet"]  # what is there is kept, what failed asked again
    later = State(cycle[1].q + 1e-9, cycle[1].v)
    monkeypatch.setattr(compass_table, "our_cycle", lambda: (cycle[0], later))
    compare_compass(engines=["mujoco"], steps=[1e-3], folder=tmp_path)
    assert asked[-1] == "MuJoCo"  # it begins elsewhere
    console = Console(file=io.StringIO(), width=160)
    console.print(table)
    told = console.file.getvalue()  # type: ignore[attr-defined]
    for words in ("0.734346391", "−0.199726 ± 0.544476i, 0.131573", "SIGABRT", "ODE is not inst"):
        assert words in told


@pytest.mark.slow
def test_an_engine_that_falls_at_its_defaults_is_tried_at_its_best(
    monkeypatch: pytest.MonkeyPatch, cycle: tuple[CompassWalk, State]
) -> None:
    def in_engine(entry: Any, step: float, given: Any, *_: Any) -> dict[str, Any]:
        walks = entry.title == "MuJoCo" or "elasticity" in given
        return compass_table._told(replace(cycle[0], ending="" if walks else "it falls"))

    monkeypatch.setattr(compass_table, "peers", lambda load: dict.fromkeys(PACKAGES, "1.0"))
    monkeypatch.setattr(compass_table, "_in_engine", in_engine)
    table = compare_compass(engines=["mujoco", "simbody", "ode"], steps=[1e-3])
    assert [row.title for row in table.rows[2:]] == ["MuJoCo", "Simbody", "Simbody, best", "ODE"]
    assert table.rows[-2].walk is not None
    assert table.rows[-2].walk["ending"] == ""


def test_mujoco_takes_steps(cycle: tuple[CompassWalk, State]) -> None:
    q, v = cycle[1].q, cycle[1].v
    with lent(None) as processes:
        mover = InEngine(ENTRIES["mujoco"], 1e-3, {}, processes)
        mover.begin(False, q, v)
        rows = mover.more(20)
    assert np.abs(rows[-1, :4] - q).max() > 1e-2
    foot = rows[:, 0] - np.sin(rows[:, 2]), rows[:, 1] - np.cos(rows[:, 2])
    assert np.abs(foot[0]).max() < 2e-3  # it stands on its foot, which is soft
    assert np.abs(foot[1]).max() < 5e-3
