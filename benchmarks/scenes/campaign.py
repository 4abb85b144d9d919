"""Many scenes in worker processes, one result a line, resumable after any kill.

A scene that takes more than LIMIT seconds of processor time hangs: its worker dies of it and
another takes its place. (Where the system cannot count processor time, CLOCK seconds on the clock.)
Results are appended to a file as they come; what is in it is not run again.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import multiprocessing.connection
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

LIMIT = 30.0
"""Processor seconds after which a scene hangs."""
CLOCK = 3600.0
"""Seconds on the clock after which it does, however busy the machine."""


def _limit_processor_time(seconds: float) -> None:
    """Let the system end this process after so many more seconds of work, where it can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        soft = hard if seconds == float("inf") else int(time.process_time() + seconds + 1.0)
        resource.setrlimit(resource.RLIMIT_CPU, (soft, hard))


def seeds(text: str) -> range:
    """Return the seeds of FIRST:END, or so many from zero on."""
    first, _, last = text.partition(":")
    return range(int(first), int(last)) if last else range(int(first))


def add_arguments(
    parser: argparse.ArgumentParser, count: int, *, kept: bool, of: str = "", choices: Any = ()
) -> None:
    """Have a command of many scenes ask for the file of results, the seeds and the workers.

    And for what the scenes are of, if there is a choice.
    """
    parser.add_argument("--out", type=Path, required=kept, help="file of results, one a line")
    if of:
        parser.add_argument(f"--{of}", nargs="+", choices=choices, default=choices)
    parser.add_argument(
        "--seeds", type=seeds, default=range(count), help="FIRST:END or their number"
    )
    parser.add_argument("--workers", type=int, choices=(1, 2), default=1)


@dataclass(frozen=True)
class Task:
    """What workers do with a method and a seed.

    Attributes
    ----------
    run : callable
        Gets method and seed, and whether to compare twins; returns a result that JSON can hold.
    prepare : callable
        Gets a method before its first scene, with no clock running.
    limit, clock : float
        Seconds of processor time, and on the clock, after which a scene hangs.
    """

    run: Callable[..., dict[str, Any]]
    prepare: Callable[[str], None]
    limit: float = LIMIT
    clock: float = CLOCK


def _work(pipe: Any, task: Task) -> None:
    warnings.simplefilter("ignore")
    warm: set[str] = set()
    while True:
        try:
            job = pipe.recv()
        except EOFError:
            return
        method, seed, twins = job
        if method not in warm:
            task.prepare(method)
            warm.add(method)
        pipe.send("begun")
        _limit_processor_time(task.limit)
        result = task.run(method, seed, twins=twins)
        _limit_processor_time(float("inf"))
        pipe.send(result)


class _Worker:
    """A process that runs one scene after the other."""

    def __init__(self, task: Task) -> None:
        self.task = task
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, task), daemon=True)
        self.process.start()
        theirs.close()
        self.job: tuple[str, int, bool] | None = None
        self.deadline = float("inf")

    def give(self, job: tuple[str, int, bool]) -> None:
        self.job, self.deadline = job, float("inf")
        self.pipe.send(job)

    def answer(self) -> dict[str, Any] | None:
        """Return the result of its job if there is one, or what became of it."""
        assert self.job is not None
        method, seed, _ = self.job
        lost = {"method": method, "seed": seed}
        if self.pipe.poll():
            try:
                message = self.pipe.recv()
            except EOFError:
                self.process.join()
                code = self.process.exitcode
                hung = code == -24  # SIGXCPU
                words = (
                    f"more than {self.task.limit:g} s" if hung else f"the process ended with {code}"
                )
                return lost | {"status": "hang" if hung else "crashed", "message": words}
            if message == "begun":
                self.deadline = time.monotonic() + self.task.clock
                return None
            return dict(message)
        if time.monotonic() > self.deadline:
            self.end()
            words = f"more than {self.task.clock:g} s on the clock"
            return lost | {"status": "hang", "message": words}
        return None

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def results_in(path: Path) -> list[dict[str, Any]]:
    """Read the results of a file; a last line cut short by a kill is left out."""
    results = []
    if path.exists():
        for line in path.read_text().splitlines():
            with suppress(json.JSONDecodeError):
                results.append(json.loads(line))
    return results


def campaign(
    path: Path, methods: Sequence[str], seeds: Sequence[int], *, workers: int = 1,
    task: Task, twins: bool = True,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Run what is not in a file of results yet and append it; yield each result as it comes."""
    known = {(one["method"], one["seed"]) for one in results_in(path)}
    jobs = [(m, s, twins) for m in methods for s in seeds if (m, s) not in known]
    jobs.reverse()
    whole = not path.exists() or path.read_bytes()[-1:] in (b"\n", b"")
    busy: list[_Worker] = []
    with path.open("a") as file:
        if not whole:
            file.write("\n")
        try:
            while jobs or busy:
                while jobs and len(busy) < workers:
                    busy.append(_Worker(task))
                    busy[-1].give(jobs.pop())
                multiprocessing.connection.wait([one.pipe for one in busy], timeout=1.0)
                for worker in list(busy):
                    result = worker.answer()
                    if result is None:
                        continue
                    file.write(json.dumps(result) + "\n")
                    file.flush()
                    yield result
                    if jobs and worker.process.is_alive():
                        worker.give(jobs.pop())
                    else:
                        busy.remove(worker)
                        worker.end()
        finally:
            for worker in busy:
                worker.end()
