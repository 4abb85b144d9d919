"""Campaigns: the same whoever works, nothing lost, nothing twice, every trial for itself."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import campaign_cases as cases
import numpy as np
import pytest
import walking
from scipy import stats

import heelstrike as hs
from heelstrike.experiments.campaigns import Draw, Outcome, Share, sending
from heelstrike.experiments.campaigns import campaign as module
from heelstrike.experiments.campaigns import trials as trials_module
from heelstrike.experiments.campaigns.store import COLUMNS, DATABASE, Store
from heelstrike.experiments.campaigns.trials import run_block
from heelstrike.experiments.campaigns.workers import process_pool
from heelstrike.robot import Foot

FRICTION = {"ground.friction": stats.uniform(0.2, 0.6), "state.v.root_x": stats.norm(0.0, 0.3)}


def made(trials: int = 70, seed: int = 3, **others: Any) -> hs.Campaign:
    return hs.Campaign(cases.limp(), FRICTION, trials, seed, **others)


class Backwards:
    """An executor that does the last call first, when somebody asks for a result."""

    def __init__(self) -> None:
        self.calls: list[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = []

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Any:
        future: Future[Any] = Future()
        self.calls.append((future, function, arguments))
        executor = self

        class Asked:
            def result(self) -> Any:
                while executor.calls:
                    each, call, given = executor.calls.pop()
                    each.set_result(call(*given))
                return future.result()

        return Asked()


def as_text(results: hs.CampaignResults) -> str:
    """Outcomes with every digit, so that NaN equals NaN."""
    return repr((results.numbers, results.outcomes))


def test_the_same_to_the_last_bit_whoever_works_in_whatever_order() -> None:
    campaign = made()
    first = campaign.run(workers=1)
    assert len(first) == 70
    assert as_text(campaign.run(workers=3)) == as_text(first)
    assert as_text(campaign.run(executor=Backwards())) == as_text(first)
    assert len({each.distance for each in first.outcomes}) == 70


def test_a_trial_replayed_alone_is_that_of_the_campaign() -> None:
    values = {"push.impulse": stats.uniform(0.0, 150.0), "robot.mass.trunk *": stats.norm(1, 0.05)}
    campaign = hs.Campaign(cases.walks(), values, 3, 1, duration=1.6)
    results = campaign.run()
    for number, outcome in enumerate(results.outcomes):
        run = campaign.replay(number)
        assert run.time[-1] == outcome.time
        assert run.position[-1, 0] - run.position[0, 0] == outcome.distance
        assert run.status.value == outcome.status
        assert run.certificates.penetration == outcome.penetration
        assert run.robot.model.mass[2] != cases.walks().robot.model.mass[2]
    assert campaign.gait(0) is cases.walks().controller.gait
    with pytest.raises(IndexError, match="no trial 3 in a campaign of 3"):
        campaign.replay(3)


def test_a_law_may_follow_a_motion_instead_of_a_gait() -> None:
    """Then there is no gait to judge it by."""
    robot, gait = walking.bravo7(), walking.gait()
    motion = gait.motion(robot)
    law = hs.ComputedTorque(robot, motion)
    assert law.motion is motion
    trial = replace(cases.walks(), controller=law)
    campaign = hs.Campaign(trial, {"ground.friction": [0.75]}, duration=0.1, draw=Draw.GRID)
    (outcome,) = campaign.run(workers=1).outcomes
    assert outcome.status == "completed", outcome.message
    assert campaign.gait(0) is None
    assert campaign.replay(0).summary(gait=campaign.gait(0)).duration_s == pytest.approx(0.1)


class Holds:
    """A controller in Python that holds a robot."""

    def __init__(self, robot: hs.Robot) -> None:
        self.robot = robot

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        return np.zeros(self.robot.nu)


def digest_with(robot: hs.Robot) -> str:
    trial = replace(cases.limp(), controller=Holds(robot))
    return trials_module.inputs_digest(trial, 1.0)


def test_where_classes_of_robots_are_defined_is_no_input(monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder goes on after they have moved; names, feet and numbers of a robot do count."""
    robot = walking.bravo7()
    first = digest_with(robot)
    mass = robot.model.mass.copy()
    mass *= 1.0 + 1e-12
    heavier = replace(robot, model=robot.model.replaced(mass=mass))
    toes = replace(robot, feet=robot.feet[::-1])
    renamed = replace(robot, name="other")
    assert len({first, *map(digest_with, (heavier, toes, renamed))}) == 4
    monkeypatch.setattr(Foot, "__module__", "heelstrike.robot.robot")
    assert digest_with(robot) == first


def test_what_a_trial_cannot_begin_with_is_its_result() -> None:
    """One of seven masses is impossible; the six others run as if it were not there."""
    masses = [1.0, 1.1, -1.0, 1.2, 1.3, 1.4, 1.5]
    campaign = hs.Campaign(cases.limp(), {"robot.mass.trunk *": masses}, draw=Draw.GRID)
    results = campaign.run()
    assert [each.status for each in results.outcomes].count("refused") == 1
    assert "robot.mass would be -50.85" in results.outcomes[2].message
    without = hs.Campaign(cases.limp(), {"robot.mass.trunk *": masses[3:]}, draw=Draw.GRID)
    assert repr(results.outcomes[3:]) == repr(without.run().outcomes)
    assert results.causes["refused"] == 1
    with pytest.raises(hs.SimulationError, match="would be"):
        campaign.replay(2)


def test_one_that_the_simulation_refuses_is_found_among_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batch = trials_module.simulate_batch

    def choosy(*arguments: Any, ground: Any, **others: Any) -> Any:
        if any(each.friction == 0.6 for each in (ground if isinstance(ground, list) else [ground])):
            raise hs.SimulationError("not with 0.6")
        return batch(*arguments, ground=ground, **others)

    friction = [0.3, 0.4, 0.6, 0.7, 0.8]
    campaign = hs.Campaign(cases.limp(), {"ground.friction": friction}, draw=Draw.GRID)
    whole = campaign.run().outcomes
    monkeypatch.setattr(trials_module, "simulate_batch", choosy)
    outcomes = campaign.run().outcomes
    assert (outcomes[2].status, outcomes[2].message) == ("refused", "not with 0.6")
    assert repr(outcomes[:2] + outcomes[3:]) == repr(whole[:2] + whole[3:])


def test_errors_that_are_not_ours_are_results() -> None:
    class Broken:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.zeros(6)

        @property
        def gait(self) -> object:
            raise ZeroDivisionError("of a gait")

    trial = replace(cases.limp(), controller=Broken())
    (outcome,) = hs.Campaign(trial, {"ground.friction": 0.5}, 1).run().outcomes
    assert (outcome.status, outcome.message) == ("crashed", "ZeroDivisionError: of a gait")


def test_a_trial_that_takes_too_long_is_given_up() -> None:
    results = hs.Campaign(cases.limp(9.0), FRICTION, 2).run(limit=1e-9)
    for each in results.outcomes:
        assert each.status == "interrupted"
        assert "took more than 1e-09 s of the processor: interrupted at t = " in each.message
        assert not each.success
    fine = hs.simulate_batch(
        cases.limp().robot, state=cases.limp().state, duration=0.01, time_limit=60.0
    )
    assert fine.status == (hs.RunStatus.COMPLETED,)


def test_a_controller_in_python_is_given_up_as_well() -> None:
    class Slow:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.zeros(6)

    trial = replace(cases.limp(9.0), controller=Slow())
    (outcome,) = hs.Campaign(trial, {"ground.friction": 0.5}, 1).run(limit=1e-9).outcomes
    assert outcome.given_up
    assert "took more than 1e-09 s of the processor: interrupted at t = " in outcome.message


def test_a_trial_that_was_given_up_is_tried_again(tmp_path: Path) -> None:
    campaign = hs.Campaign(cases.limp(9.0), FRICTION, 3)
    assert all(each.given_up for each in campaign.run(tmp_path, limit=1e-9).outcomes)
    assert as_text(campaign.run(tmp_path)) == as_text(campaign.run())
    assert as_text(campaign.load(tmp_path)) == as_text(campaign.run())


@pytest.mark.parametrize(("rare", "words"), [
    ({"state.v.rot_x": stats.norm(0.0, 0.1)}, "rot_x"),
    ({"trial": ["usual", "usul"]}, "usul"),
])  # fmt: skip
def test_a_misspelt_name_of_a_share_is_refused_though_none_of_its_trials_is_drawn(
    rare: dict[str, Any], words: str
) -> None:
    shares = [Share(1e9, FRICTION), Share(1.0, rare)]
    with pytest.raises(hs.HeelstrikeError, match=words):
        hs.Campaign({"usual": cases.limp()}, shares, 3, 3)


class Watched(ThreadPoolExecutor):
    """A pool that notes that it was shut down."""

    down = False

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self.down = True
        super().shutdown(wait, cancel_futures=cancel_futures)


def test_a_pool_is_shut_down_after_an_error() -> None:
    pools: list[Watched] = []

    def make() -> Watched:
        pools.append(Watched(1))
        return pools[-1]

    def fails(_: Any) -> None:
        if pools:
            raise ZeroDivisionError("of who watches")

    with pytest.raises(ZeroDivisionError, match="of who watches"):
        made().run(executor=make, progress=fails)
    assert [pool.down for pool in pools] == [True]


def counted(monkeypatch: pytest.MonkeyPatch, most: int = 10**9) -> list[int]:
    """Note the trials that are simulated; end the process, as it were, after some blocks."""
    seen: list[int] = []

    def run(block: Any, *stopped: Any) -> list[Outcome]:
        if len(seen) >= most:
            raise MemoryError("killed")
        seen.extend(block.numbers)
        return run_block(block, *stopped)

    for each in (module, sending):  # own threads, and others
        monkeypatch.setattr(each, "run_block", run)
    return seen


def test_nothing_is_lost_and_nothing_runs_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = as_text(made().run())
    seen = counted(monkeypatch, most=32)
    with pytest.raises(MemoryError):
        made().run(tmp_path, executor=Backwards())
    seen.clear()
    with pytest.raises(MemoryError):
        made().run(tmp_path, workers=1)
    assert len(made().load(tmp_path)) == 32
    first = list(seen)
    seen = counted(monkeypatch)
    told: list[Any] = []
    assert as_text(made().run(tmp_path, progress=told.append)) == whole
    assert sorted(first + seen) == list(range(70))
    assert (told[0].found, told[0].finished, told[-1].finished, told[-1].trials) == (32, 32, 70, 70)
    seen.clear()
    assert as_text(made().run(tmp_path)) == whole
    assert seen == []
    assert len(made(90).run(tmp_path)) == 90
    assert sorted(seen) == list(range(70, 90))  # more trials are the same ones and others
    seen.clear()
    made().run(tmp_path, afresh=True)
    assert len(seen) == 70


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="kill -9 is of POSIX")
def test_killed_at_any_moment_it_goes_on(tmp_path: Path) -> None:
    program = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "import test_campaign as t; t.made(2000).run(sys.argv[1], workers=1)"
    )
    here = Path(__file__).parent
    child = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path), str(here), str(here.parents[1])]
    )
    while not (tmp_path / DATABASE).exists() or not rows(tmp_path):
        assert child.poll() is None
        time.sleep(0.01)
    with pytest.raises(hs.SimulationError, match="another process is running the campaign"):
        made(2000).run(tmp_path)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    there = rows(tmp_path)
    assert 0 < there < 2000
    assert there % 32 == 0
    results = made(2000).load(tmp_path)
    assert len(results) == there
    number = results.numbers[-1]
    assert made(2000).replay(number).time[-1] == results.outcomes[-1].time


def rows(folder: Path) -> int:
    try:
        with sqlite3.connect(folder / DATABASE) as connection:
            return int(connection.execute("SELECT COUNT(*) FROM trials").fetchone()[0])
    except sqlite3.OperationalError:  # not begun
        return 0


def test_a_folder_keeps_one_campaign(tmp_path: Path) -> None:
    made(3).run(tmp_path)
    for other, what in ((made(3, seed=4), "seed"), (made(3, draw=Draw.SOBOL), "draw")):
        with pytest.raises(hs.SimulationError, match=f"another campaign: its .*{what}"):
            other.run(tmp_path)
        with pytest.raises(hs.SimulationError, match="another campaign"):
            other.load(tmp_path)
    changed = hs.Campaign(replace(cases.limp(), undisturbed=3), FRICTION, 3, 3)
    with pytest.raises(hs.SimulationError, match="its trial was other"):
        changed.run(tmp_path)
    assert len(made(3).load(tmp_path)) == 3
    with pytest.raises(hs.SimulationError, match="has no campaign"):
        made(3).load(tmp_path / "elsewhere")


def test_a_full_disk_is_told_and_keeps_what_was_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = Store.begin

    def small(self: Store, *arguments: Any, **options: Any) -> None:
        begin(self, *arguments, **options)
        (pages,) = self._database.execute("PRAGMA page_count").fetchone()
        self._database.execute(f"PRAGMA max_page_count = {pages + 4}")

    monkeypatch.setattr(Store, "begin", small)
    with pytest.raises(hs.WriteError, match=r"disk is full.*What was finished is kept"):
        made(200).run(tmp_path, workers=1)
    kept = len(made(200).load(tmp_path))
    assert 0 < kept < 200
    assert kept % 32 == 0
    monkeypatch.undo()
    assert as_text(made(200).run(tmp_path)) == as_text(made(200).run())


def test_a_damaged_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / DATABASE).write_bytes(b"no database at all" * 100)
    with pytest.raises(hs.SimulationError, match="damaged, or no campaign"):
        made(3).run(tmp_path)
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(hs.WriteError, match="cannot write"):
        made(3).run(blocked)


def test_a_folder_is_read_whose_writer_was_killed_within_a_block(tmp_path: Path) -> None:
    """What lies there then is a half-written database and a journal that undoes the half."""
    there, copy = tmp_path / "there", tmp_path / "copy"
    copy.mkdir()
    results = made(5).run(there)
    database = sqlite3.connect(there / DATABASE)
    database.execute("PRAGMA cache_size = 1")
    names = ", ".join(f'"{name}"' for name in COLUMNS[1:])
    for number in range(2000):
        database.execute(
            "INSERT INTO trials SELECT randomblob(16), number + 5, status, "
            f"{names} FROM trials WHERE number = {number % 5} LIMIT 1"
        )
    for file in there.iterdir():
        if file.name.startswith(DATABASE):
            shutil.copy(file, copy)
    database.close()
    assert (copy / f"{DATABASE}-journal").stat().st_size > 0
    assert as_text(made(5).load(copy)) == as_text(results)


class Deadly:
    """A controller that ends its process when the robot is thrown up."""

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        if state.v[1] > 0.5:
            os._exit(9)
        return np.zeros(6)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="workers of this test are copies")
def test_a_worker_that_dies_is_replaced_and_its_trial_named() -> None:
    trial = replace(cases.limp(), controller=Deadly())
    speeds = {"state.v.root_z": [0.0, 0.0, 1.0, 0.0]}
    campaign = hs.Campaign(trial, speeds, draw=Draw.GRID)
    pool = partial(ProcessPoolExecutor, 1, mp_context=multiprocessing.get_context("fork"))
    results = campaign.run(executor=pool)
    assert [each.status == "crashed" for each in results.outcomes] == [False, False, True, False]
    assert "the worker died" in results.outcomes[2].message
    with pool() as given, pytest.raises(BrokenExecutor):
        campaign.run(executor=given)


@pytest.mark.slow
def test_the_same_in_processes_that_begin_anew() -> None:
    assert as_text(made(40).run(executor=process_pool(2))) == as_text(made(40).run())


def test_results_as_a_dataset() -> None:
    results = made(5).run()
    data = results.to_dataset()
    np.testing.assert_array_equal(data["ground.friction"], results.values[:, 0])
    np.testing.assert_array_equal(data["outcome_distance"], results.column("distance"))
    assert data.sizes["trial"] == 5
    assert str(results).startswith(f"{int(results.success.sum())} of 5 trials walked on")


def test_several_trials_are_chosen_by_name() -> None:
    fast = replace(cases.limp(), method=hs.TimeStepping(step=2e-3))
    both = {"fine": cases.limp(), "coarse": fast}
    campaign = hs.Campaign(
        both, {"trial": ["coarse", "fine"], "ground.friction": [0.3, 0.6]}, draw=Draw.GRID
    )
    results = campaign.run()
    assert campaign.replay(0).method.step == 2e-3
    assert campaign.replay(2).method.step == 1e-3
    assert results.to_dataset()["trial_name"].values.tolist() == ["coarse"] * 2 + ["fine"] * 2
    with pytest.raises(hs.SimulationError, match="there is no trial 'fin'"):
        hs.Campaign(both, {"trial": ["fin"], "ground.friction": 0.5}, 2)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"trial": "bravo7"}, "trial must be a Trial or a mapping"),
        ({"trial": {}}, "a campaign is of a Trial"),
        ({"seed": -1}, "seed must be"),
        ({"duration": 0.0}, "duration of trials"),
        ({"parameters": {"ground.fricton": 0.5}}, "Did you mean 'friction'"),
    ],
)
def test_what_makes_no_campaign_is_refused(given: dict[str, Any], words: str) -> None:
    usual: dict[str, Any] = {"trial": cases.limp(), "parameters": FRICTION, "trials": 3}
    with pytest.raises(hs.SimulationError, match=words):
        hs.Campaign(**usual | given)
    with pytest.raises(hs.SimulationError, match="workers"):
        made(3).run(workers=0)
