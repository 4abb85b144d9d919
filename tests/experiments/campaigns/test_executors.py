"""Executors of others: the same to the last bit, and a worker that dies of a trial is no end."""

from __future__ import annotations

import importlib.util
import pickle
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import campaign_cases as cases
import numpy as np
import pytest
from scipy import stats

import heelstrike as hs
from heelstrike.errors import SimulationError
from heelstrike.experiments.campaigns import Draw, sending
from heelstrike.experiments.campaigns.campaign import AHEAD, _by_others
from heelstrike.experiments.campaigns.workers import dask_client, is_death, process_pool

FRICTION = {"ground.friction": stats.uniform(0.2, 0.6), "state.v.root_x": stats.norm(0.0, 0.3)}


def made(trials: int = 70) -> hs.Campaign:
    return hs.Campaign(cases.limp(), FRICTION, trials, 3)


def as_text(results: hs.CampaignResults) -> str:
    return repr((results.numbers, results.outcomes))


class KilledWorker(Exception):  # noqa: N818 - as Dask calls it
    """What Dask raises of a task on which its workers died."""


@dataclass(frozen=True)
class Sent:
    """A call on its way to another machine and back, as text of bytes both times."""

    call: bytes
    deadly: Callable[[Any], bool]

    def result(self) -> Any:
        function, arguments = pickle.loads(self.call)
        if self.deadly(*arguments):
            raise KilledWorker("attempted on three workers, which all died")
        return pickle.loads(pickle.dumps(function(*arguments)))

    def cancel(self) -> None:
        """Nothing has begun before somebody asks for the result."""


class Client:
    """What has the interface of a Dask client: it outlives the workers that die."""

    def __init__(self, deadly: Callable[[Any], bool] = lambda _: False) -> None:
        self.deadly, self.submitted = deadly, 0

    def submit(self, function: Callable[..., Any], /, *arguments: Any, pure: bool = True) -> Sent:
        assert pure
        self.submitted += 1
        return Sent(pickle.dumps((function, arguments)), self.deadly)


def test_a_cluster_comes_to_the_same_to_the_last_bit() -> None:
    client = Client()
    assert as_text(made().run(executor=client)) == as_text(made().run(workers=1))
    assert client.submitted == 3  # blocks of 32


class AtOnce(ThreadPoolExecutor):
    """Finishes at once what it is to do, and knows how much that was."""

    submitted = 0

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        self.submitted += 1
        found: Future[Any] = Future()
        found.set_result([self.submitted])
        return found


def test_only_so_many_blocks_are_submitted_ahead() -> None:
    """A queue of a cluster does not hold all of a campaign: another block follows each result."""
    executor, blocks = AtOnce(1), [SimpleNamespace(number=k) for k in range(3 * AHEAD)]
    done = _by_others(executor, bytes, iter(blocks))
    for k in range(1, 3 * AHEAD + 1):
        block, outcomes = next(done)
        assert (block.number, outcomes) == (k - 1, [k])
        assert executor.submitted == min(AHEAD + k - 1, 3 * AHEAD)
    assert list(done) == []


def test_of_a_block_that_kills_workers_of_a_cluster_only_the_trial_is_lost() -> None:
    alone = made().run(workers=1).outcomes
    client = Client(lambda sent: 40 in sent.block.numbers)
    found = made().run(executor=client).outcomes
    assert found[40].status == "crashed"
    assert "the worker died of it" in found[40].message
    assert repr(found[:40] + found[41:]) == repr(alone[:40] + alone[41:])
    assert client.submitted == 3 + 2 * 5  # 32 = 2⁵ trials are halved five times


class UncompletedJobError(RuntimeError):
    """What submitit raises of a job that died, or was cancelled."""


@dataclass
class Cancelled:
    """Cancels jobs with trial 40, when it is alone a few times only."""

    left: int

    def __call__(self, sent: Any) -> bool:
        if 40 in sent.block.numbers and self.left > 0:
            self.left -= len(sent.block.numbers) == 1
            raise UncompletedJobError("cancelled")
        return False


@pytest.mark.parametrize(("times", "lost"), [(2, False), (3, True)])
def test_a_job_that_was_cancelled_is_no_death_of_its_trial(times: int, lost: bool) -> None:
    alone = made().run(workers=1).outcomes
    found = made().run(executor=Client(Cancelled(times))).outcomes
    assert (found[40].status == "crashed") is lost
    assert (repr(found) == repr(alone)) is not lost


class Ended:
    """A job of SLURM that was cancelled, as submitit tells it."""

    def __init__(self, state: str) -> None:
        self.state = state

    def result(self) -> Any:
        raise UncompletedJobError("Job has not produced any output")

    def cancel(self) -> None:
        """It has ended."""


class Cluster(Client):
    """Jobs with trial 40 are ended a few times, in some state."""

    def __init__(self, state: str, times: int) -> None:
        super().__init__()
        self.state, self.left = state, times

    def submit(self, function: Callable[..., Any], /, *arguments: Any, pure: bool = True) -> Any:
        if 40 in arguments[0].block.numbers and self.left > 0:
            self.left -= 1
            return Ended(self.state)
        return super().submit(function, *arguments, pure=pure)


@pytest.mark.parametrize("state", ["CANCELLED by 1000", "PREEMPTED", "NODE_FAIL"])
def test_a_job_that_somebody_cancels_is_submitted_again_as_it_was(state: str) -> None:
    cluster = Cluster(state, 2)
    assert as_text(made().run(executor=cluster)) == as_text(made().run(workers=1))
    assert cluster.submitted == 3  # blocks; none was halved


def test_jobs_that_are_cancelled_again_and_again_end_the_campaign(tmp_path: Path) -> None:
    """What was finished is kept, no trial has crashed, and the next call does the rest."""
    with pytest.raises(SimulationError, match="was cancelled 3 times"):
        made().run(tmp_path, executor=Cluster("CANCELLED", 100))
    assert len(made().load(tmp_path)) == 32
    assert as_text(made().run(tmp_path)) == as_text(made().run(workers=1))


def test_a_scheduler_that_is_gone_ends_the_campaign_in_words(tmp_path: Path) -> None:
    class Lost(Client):
        def submit(self, *arguments: Any, **named: Any) -> Any:
            if self.submitted == 2:
                raise ConnectionError("the scheduler is gone")
            return super().submit(*arguments, **named)

    with pytest.raises(SimulationError, match="any more: the scheduler is gone"):
        made().run(tmp_path, executor=Lost())
    assert as_text(made().run(tmp_path)) == as_text(made().run(workers=1))


@pytest.mark.parametrize("executor", [None, Client()])
def test_an_error_of_who_is_told_of_the_progress_is_no_loss_of_workers(executor: Any) -> None:
    def progress(so_far: Any) -> None:
        if so_far.finished:
            raise BrokenPipeError("who read it has gone")

    with pytest.raises(BrokenPipeError, match="who read it has gone"):
        made(2).run(executor=executor, workers=1, progress=progress)


def test_a_scheduler_that_is_gone_before_a_result_ends_it_in_words() -> None:
    class Lost(Client):
        def submit(self, *_: Any, **__: Any) -> Any:
            return self

        def result(self) -> Any:
            raise ConnectionError("the scheduler is gone")

    with pytest.raises(SimulationError, match="any more: the scheduler is gone"):
        made(2).run(executor=Lost())


class Jams:
    """A controller whose link to something breaks when the robot moves forward."""

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        if state.v[0] > 0.0:
            raise ConnectionError("the motors do not answer")
        return np.zeros(6)


def test_an_oserror_of_a_trial_is_its_outcome_and_no_loss_of_workers() -> None:
    trial = replace(cases.limp(), controller=Jams())
    speeds = {"state.v.root_x": [-0.5, 0.5, 0.0]}
    campaign = hs.Campaign(trial, speeds, draw=Draw.GRID)
    results = campaign.run(executor=Client())
    assert as_text(results) == as_text(campaign.run(workers=1))
    assert [each.status for each in results.outcomes].count("controller_failed") >= 1
    assert "the motors do not answer" in results.outcomes[1].message


@pytest.mark.parametrize(
    "executor", [Client(), pytest.param(process_pool(1), marks=pytest.mark.slow)]
)
def test_what_a_worker_cannot_read_is_no_loss_of_workers_and_no_crash_of_trials(
    tmp_path: Path, executor: Any
) -> None:
    """It is told as it is, nothing is kept of it, and the same folder goes on without it."""
    trial = replace(cases.limp(), controller=cases.Reads())
    campaign = hs.Campaign(trial, FRICTION, 40, 3)
    with pytest.raises(SimulationError, match="worker cannot read the trials: FileNotFound") as at:
        campaign.run(tmp_path, executor=executor)
    assert "policy.npz" in str(at.value)
    assert "nobody works" not in str(at.value)
    assert len(campaign.load(tmp_path)) == 0
    results = campaign.run(tmp_path, workers=1)
    assert len(results) == 40
    assert not {each.status for each in results.outcomes} & {"refused", "crashed"}


def test_trials_that_cannot_be_sent_are_refused() -> None:
    class Local:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.zeros(6)

        def __reduce__(self) -> Any:
            raise OSError("a device")

    trial = replace(cases.limp(), controller=Local())
    with pytest.raises(SimulationError, match="cannot be sent to workers: OSError: a device"):
        hs.Campaign(trial, FRICTION, 2, 3).run(executor=Client())


class Held:
    """A controller that holds a device: it can be copied, but not be sent."""

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        return np.zeros(6)

    def __reduce__(self) -> Any:
        raise OSError("a device")

    def __deepcopy__(self, _: object) -> Held:
        return Held()


def test_trials_are_packed_only_if_a_block_goes_to_another_process(tmp_path: Path) -> None:
    """Not for threads of this process, nor where nothing is left to do."""
    campaign = hs.Campaign(replace(cases.limp(), controller=Held()), FRICTION, 3, 3)
    alone = as_text(campaign.run(workers=1))
    with ThreadPoolExecutor(1) as pool:
        assert as_text(campaign.run(tmp_path, executor=pool)) == alone
    assert as_text(campaign.run(executor=lambda: ThreadPoolExecutor(1))) == alone
    assert as_text(campaign.run(tmp_path, executor=Client())) == alone


class Counts:
    """A controller that counts the runs that it was in, and breaks off to tell."""

    runs = 0

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        if t > 0.0:
            raise ValueError(f"run {self.runs}")
        self.runs += 1
        return np.zeros(6)


@pytest.mark.parametrize("executor", [None, Client(), lambda: ThreadPoolExecutor(2)])
def test_a_controller_keeps_nothing_from_one_trial_to_the_next(executor: Any) -> None:
    """Neither in a block nor from block to block of one worker."""
    controller = Counts()
    campaign = hs.Campaign(replace(cases.limp(), controller=controller), FRICTION, 40, 3)
    results = campaign.run(executor=executor, workers=2)
    assert all("run 1" in each.message for each in results.outcomes)
    for number in (0, 39, 39):
        assert campaign.replay(number).message == results.outcomes[number].message
    assert controller.runs == 0


def test_a_controller_that_cannot_be_copied_is_refused_in_words() -> None:
    class Stuck(Held):
        def __deepcopy__(self, _: object) -> Held:
            raise TypeError("a lock")

    campaign = hs.Campaign(replace(cases.limp(), controller=Stuck()), FRICTION, 1, 3)
    outcome = campaign.run(workers=1).outcomes[0]
    assert outcome.status == "refused"
    assert "controller Stuck cannot be copied: TypeError: a lock" in outcome.message


def test_workers_read_the_trials_once() -> None:
    """Of several blocks, though each brings their bytes: a robot that is the same is known."""
    sending._read.cache_clear()
    made().run(executor=Client())
    assert (sending._read.cache_info().misses, sending._read.cache_info().hits) == (1, 2)


def test_what_is_no_death_ends_the_campaign() -> None:
    class Broken(Client):
        def submit(self, *_: Any, **__: Any) -> Any:
            raise RuntimeError("a bug")

    with pytest.raises(RuntimeError, match="a bug"):
        made().run(executor=Broken())


def test_deaths_are_told_by_the_names_that_libraries_give_them() -> None:
    class PreemptedError(UncompletedJobError):
        pass

    assert is_death(KilledWorker())
    assert is_death(PreemptedError())
    assert not is_death(RuntimeError("a bug"))


def test_without_dask_it_says_what_to_install() -> None:
    if importlib.util.find_spec("distributed") is not None:
        pytest.skip("Dask is installed")
    with pytest.raises(SimulationError, match="pip install distributed"):
        dask_client("tcp://127.0.0.1:8786")


@pytest.mark.slow
def test_the_same_on_a_dask_cluster() -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert as_text(made().run(executor=client)) == as_text(made().run(workers=1))


@pytest.mark.slow
def test_the_same_by_submitit(tmp_path: Any) -> None:
    submitit = pytest.importorskip("submitit")
    executor = submitit.LocalExecutor(folder=tmp_path)
    grid = hs.Campaign(cases.limp(), {"ground.friction": [0.2, 0.8]}, draw=Draw.GRID)
    assert as_text(grid.run(executor=executor)) == as_text(grid.run(workers=1))
    assert np.isfinite(grid.run(workers=1).column("distance")).all()
