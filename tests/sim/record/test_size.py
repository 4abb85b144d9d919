"""Runs that cannot fit are refused before they begin, with advice that is true when followed."""

from __future__ import annotations

import dataclasses
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fresh_python import fresh_python
from synthetic_runs import box, make_run

import heelstrike as hs
from heelstrike.sim.record import size as record_size
from heelstrike.sim.setting import Setting, checked_setting

SHORT: dict[str, Any] = {
    "step": lambda step: hs.TimeStepping(step=step),
    "step of samples": lambda step: hs.Compliant(step=step),
    "output_period": lambda step: hs.EventDriven(output_period=step),
    "max_step": lambda step: hs.EventDriven(max_step=step, output_period=None),
}
SMALL = 60_000
"""Bytes of memory of a machine of the tests: some hundred rows."""


@pytest.fixture
def small_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_size, "machine_memory", lambda: SMALL / record_size.SHARE)
    monkeypatch.setattr(record_size, "FEW_ROWS", 0)
    monkeypatch.setattr(record_size, "ALWAYS_THERE", 0)
    monkeypatch.setattr(record_size, "BESIDE", 4)


def simulate(method: Any, **options: Any) -> hs.Run:
    robot = box()
    return hs.simulate(robot, state=robot.reference_state(), method=method, **options)


def setting(record_every: int = 1) -> Setting:
    return checked_setting(box(), box().reference_state(), record_every=record_every)


@pytest.mark.parametrize("name", SHORT)
@pytest.mark.parametrize(
    ("step", "rows"), [(1e-300, "7e+300"), (5e-324, "more than 1e308"), (1e-16, "7e+16")]
)
def test_steps_beyond_counting(name: str, step: float, rows: str) -> None:
    with pytest.raises(hs.SimulationError) as caught:
        simulate(SHORT[name](step), duration=7.0)
    words = str(caught.value)
    assert words.startswith(f"{name.split()[0]} = ")
    assert f"would have {re.escape(rows)} rows".replace("\\", "") in words
    # What it says is true: so short a step can be counted, and so seldom its rows fit.
    shortest = float(re.search(r"The shortest is (\S+) s\.", words)[1])  # type: ignore[index]
    every = int(re.search(r"record_every=(\d+)", words)[1])  # type: ignore[index]
    assert shortest > step
    record_size.check_steps(setting(), 7.0, "step", shortest)
    record_size.check_room(setting(every), 7.0, "step", shortest)
    with pytest.raises(hs.SimulationError):
        record_size.check_steps(setting(), 7.0, "step", shortest / 1.2)


def test_periods_beyond_counting() -> None:
    for method, options in (
        (hs.EventDriven(max_step=1e-300), {}),
        (hs.EventDriven(), {"control_period": 1e-300}),
        (hs.TimeStepping(), {"control_period": 1e-300}),
        (hs.TimeStepping(), {"duration": 1e300}),
    ):
        with pytest.raises(hs.SimulationError, match=r"e[-+]30"):
            simulate(method, **({"duration": 1.0} | options))


@pytest.mark.parametrize("name", SHORT)
@pytest.mark.usefixtures("small_machine")
def test_the_advice_is_true_when_followed(name: str) -> None:
    method = SHORT[name](1e-4)
    with pytest.raises(hs.SimulationError, match="does not fit into memory") as caught:
        simulate(method, duration=0.05)
    words = str(caught.value)
    rows = float(re.search(r"memory: (\S+) rows", words)[1])  # type: ignore[index]
    assert rows == pytest.approx(500, abs=10)
    every = int(re.search(r"It fits with record_every=(\d+)", words)[1])  # type: ignore[index]
    run = simulate(method, duration=0.05, record_every=every)
    assert run.completed
    assert 2 * len(run.time) * record_size.row_size(run.robot) <= SMALL
    assert every > 1
    with pytest.raises(hs.SimulationError):  # and it is not far from the least
        simulate(method, duration=0.05, record_every=every // 2)


@pytest.mark.usefixtures("small_machine")
def test_runs_of_a_batch_share_the_memory() -> None:
    robot = box()
    options: dict[str, Any] = {"state": robot.reference_state(), "method": hs.TimeStepping()}
    durations = np.full(6, 0.05)
    hs.simulate_batch(robot, duration=durations[:1], record_every=1, **options)
    hs.simulate_batch(robot, duration=durations, **options)  # final states only
    with pytest.raises(hs.SimulationError, match="of all runs do not fit") as caught:
        hs.simulate_batch(robot, duration=durations, record_every=1, **options)
    every = int(re.search(r"record_every=(\d+)", str(caught.value))[1])  # type: ignore[index]
    batch = hs.simulate_batch(robot, duration=durations, record_every=every, **options)
    size = record_size.row_size(robot)
    assert sum(len(batch.run(i).time) for i in range(6)) * size <= SMALL
    with pytest.raises(hs.SimulationError, match="fewer runs at once"):
        hs.simulate_batch(robot, duration=np.full(300, 0.05), record_every=50, **options)


def test_the_size_of_a_row_is_that_of_a_run() -> None:
    run = make_run(hs.load_robot("bravo7"), np.arange(10.0))
    arrays = [getattr(run, field.name) for field in dataclasses.fields(run)]
    size = sum(each.nbytes for each in arrays if isinstance(each, np.ndarray))
    assert record_size.row_size(run.robot) == size / 10


@pytest.mark.skipif(not Path("/proc/meminfo").exists(), reason="Linux tells it here")
def test_the_memory_of_this_machine() -> None:
    found = re.search(r"MemTotal: +(\d+) kB", Path("/proc/meminfo").read_text())
    assert found
    assert 2**24 < record_size.machine_memory() <= 1024 * int(found[1])


def test_limits_of_a_container(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    places = [tmp_path / name for name in ("none", "max", "limit", "gone")]
    for place, content in zip(places, ["max\n", "9223372036854771712\n", "123456\n"], strict=False):
        place.write_text(content)
    monkeypatch.setattr(record_size, "_LIMITS", [str(place) for place in places])
    assert record_size.machine_memory() == 123456


@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
def test_what_the_system_does_not_grant(tmp_path: Path) -> None:
    script = (
        "import resource; from heelstrike.sim.record import size as record_size;"
        "resource.setrlimit(resource.RLIMIT_AS, (2**31, 2**31));"
        "record_size.machine_memory = lambda: 2**40; print(record_size.room())"
    )
    done = fresh_python("-c", script)
    assert 2**27 < int(done.stdout) < 2**31


@pytest.mark.parametrize("every", [0, -1, 2.5, np.nan, "1", None, 2**63, 10**30])
def test_rows_every_so_many_steps(every: Any) -> None:
    with pytest.raises(hs.SimulationError, match="record_every must be a whole number"):
        simulate(hs.TimeStepping(), duration=0.1, record_every=every)
