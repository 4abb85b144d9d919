"""Campaigns whose work others do: pools of processes, a Dask cluster, jobs of submitit.

Outcomes must be those of own threads to the last bit. What each costs is told in processor time,
that of this process and of all workers together, and apart: what it takes to begin and end, and
what each further trial takes. A short campaign and a long one tell the two.
"""

from __future__ import annotations

import contextlib
import resource
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.experiments.campaigns.campaign import BLOCK
from heelstrike.experiments.campaigns.store import DATABASE
from heelstrike.experiments.campaigns.workers import dask_client, process_pool

WORKERS = 2
"""Processes that work."""
ADDRESS = "tcp://127.0.0.1:{port}"


def processor_time() -> float:
    """Processor time of this process and of those that it started and that have ended, in s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def own_threads(_: Path) -> contextlib.AbstractContextManager[Any]:
    """No executor: threads of this process."""
    return contextlib.nullcontext(None)


def pool(_: Path) -> contextlib.AbstractContextManager[Any]:
    """A maker of pools of processes."""
    return contextlib.nullcontext(process_pool(WORKERS))


@contextlib.contextmanager
def dask_cluster(_: Path) -> Iterator[Any]:
    """Client of a cluster of processes on this machine."""
    import distributed  # type: ignore[import-not-found]

    with (
        distributed.LocalCluster(
            n_workers=WORKERS, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@contextlib.contextmanager
def jobs(folder: Path) -> Iterator[Any]:
    """Executor of submitit whose jobs run on this machine, each in a process of its own."""
    import submitit  # type: ignore[import-not-found]

    executor = submitit.AutoExecutor(folder=folder / "jobs", cluster="local")
    executor.update_parameters(timeout_min=30)
    yield executor


EXECUTORS: dict[str, Callable[[Path], contextlib.AbstractContextManager[Any]]] = {
    "own threads": own_threads, "pool of processes": pool, "Dask": dask_cluster, "submitit": jobs,
}  # fmt: skip


FEW = 2 * WORKERS * BLOCK
"""Trials of the short campaign: every worker has begun, and has had two blocks."""
MANY = 10_000
"""Trials that the ratio is told for."""


@dataclass(frozen=True)
class Cost:
    """Seconds that a campaign takes."""

    processor: float
    """Of a processor, of all processes together."""
    wall: float
    """On the wall."""

    def beside(self, few: Cost, trials: int) -> tuple[Cost, Cost]:
        """Return what beginning and end cost, and what each trial does, by a shorter campaign."""
        each = [
            (own - other) / (trials - FEW)
            for own, other in ((self.processor, few.processor), (self.wall, few.wall))
        ]
        begin = [few.processor - FEW * each[0], few.wall - FEW * each[1]]
        return Cost(*begin), Cost(*each)


def compare(few: hs.Campaign, campaign: hs.Campaign, folder: Path, only: str | None = None) -> None:
    """Print what each executor comes to, and what it costs.

    Parameters
    ----------
    few : Campaign
        The same with `FEW` trials.
    campaign : Campaign
        Whose trials are worked on.
    folder : Path
        Where outcomes are kept.
    only : str, optional
        One of `EXECUTORS`, beside own threads.
    """
    few.run(workers=1)  # compiles
    usual: tuple[float, float] | None = None  # of a trial, and of many
    expected = ""
    for name, make in EXECUTORS.items():
        if only not in (None, name) and expected:
            continue
        try:
            short, _ = _cost(few, make, folder / f"{name}, few")
            whole, outcomes = _cost(campaign, make, folder / name)
        except ImportError as error:
            print(f"{name}: {error}")
            continue
        expected = expected or outcomes
        begin, each = whole.beside(short, len(campaign))
        many = begin.processor + MANY * each.processor
        usual = usual or (each.processor, many)
        print(
            f"{name}: outcomes the same: {outcomes == expected}; {begin.processor:.1f} s of a "
            f"processor to begin and end, then {1e3 * each.processor:.2f} ms a trial, "
            f"{each.processor / usual[0]:.3f} of own threads; {MANY} trials so "
            f"{many / usual[1]:.3f}; {len(campaign)} took {whole.wall:.1f} s on the wall",
            flush=True,
        )
        if outcomes != expected:
            raise SystemExit(1)


def _cost(
    campaign: hs.Campaign, make: Callable[[Path], contextlib.AbstractContextManager[Any]],
    folder: Path,
) -> tuple[Cost, str]:  # fmt: skip
    """Run a campaign; return what it takes, and its outcomes with every digit."""
    begin, wall = processor_time(), time.perf_counter()
    with make(folder) as executor:
        results = campaign.run(folder, executor=executor, workers=WORKERS)
    spent = Cost(processor_time() - begin, time.perf_counter() - wall)
    return spent, repr(results.outcomes)


def kill_schedulers(campaign: hs.Campaign, folder: Path, count: int, seed: int) -> None:
    """Kill the scheduler of a Dask cluster again and again; tell what was lost and what ran twice.

    The campaign must end in words, and go on with the next scheduler.
    """
    import dask  # type: ignore[import-not-found]

    dask.config.set({"distributed.comm.timeouts.connect": "600s"})  # processes begin slowly
    rng, kept, kills, port = np.random.default_rng(seed), folder / "kept", 0, 8790
    told: set[str] = set()
    while True:
        port += 1
        scheduler, workers = _started(port)
        try:
            client = dask_client(ADDRESS.format(port=port))
            client.wait_for_workers(WORKERS)
            after = int(rng.integers(1, 4)) if kills < count else sys.maxsize
            watch = _killing(scheduler, after)
            results = campaign.run(kept, executor=client, progress=watch)
            break
        except hs.SimulationError as error:
            kills += 1
            told.add(str(error).partition(":")[0])
        finally:
            for each in (scheduler, *workers):
                each.kill()
                each.wait()
            with contextlib.suppress(Exception):
                client.close(timeout=0)
    with sqlite3.connect(kept / DATABASE) as connection:
        numbers = [number for (number,) in connection.execute("SELECT number FROM trials")]
    same = repr(results.outcomes) == repr(campaign.run(workers=1).outcomes)
    print(
        f"{kills} schedulers killed: {len(campaign) - len(set(numbers))} of {len(campaign)} lost, "
        f"{len(numbers) - len(set(numbers))} twice, outcomes the same: {same}; told: {told}"
    )


def _killing(scheduler: Any, after: int) -> Callable[[Any], None]:
    """Return what kills a scheduler after so many blocks."""
    left = iter(range(after, -1, -1))

    def watch(_: Any) -> None:
        if next(left, -1) == 0:
            scheduler.kill()

    return watch


def _started(port: int) -> tuple[Any, list[Any]]:
    """Start a scheduler and workers."""
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = subprocess.Popen(
        [*command, "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet
    )
    command = [sys.executable, "-m", "distributed.cli.dask_worker", ADDRESS.format(port=port)]
    workers = [
        subprocess.Popen([*command, "--nthreads", "1", "--no-nanny", "--no-dashboard"], **quiet)
        for _ in range(WORKERS)
    ]
    return scheduler, workers
