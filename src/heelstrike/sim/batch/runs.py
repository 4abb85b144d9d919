"""simulate_batch(): many simulations in one call, on several threads."""

from __future__ import annotations

import math
import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter, thread_time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import one_of, takes
from heelstrike.compiler.bundle import Bundle
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.interruption import acknowledge
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.batch.batch import NO_ROWS, checked_threads
from heelstrike.sim.batch.lane import Ending, Lane
from heelstrike.sim.batch.lanes import Lanes
from heelstrike.sim.batch.planning import Joints, Plan, compile_all, naming, planned, way_of
from heelstrike.sim.closed_sets import EventKind, OnError, RunStatus
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.controller.raised import tell
from heelstrike.sim.dimension import dimension_of
from heelstrike.sim.method import Method
from heelstrike.sim.push import Push
from heelstrike.sim.record.size import check_runs
from heelstrike.sim.run import Timing
from heelstrike.sim.simulation import check_duration
from heelstrike.sim.snapshot import Snapshot

if TYPE_CHECKING:
    from heelstrike.contact.spatial.ground import SpatialGround


LANES_AT_ONCE = 64
"""Runs of each thread that are in memory at once."""

SHOWN = 10
"""Runs that a warning of errors names at most, beside the first."""


@takes(SimulationError)
def simulate_batch(
    robot: Robot | SpatialRobot | Sequence[Robot] | Sequence[SpatialRobot],
    controller: Controller | Sequence[Controller] | None = None,
    *,
    state: State | Snapshot | Sequence[State],
    duration: ArrayLike,
    parameters: Bundle | Sequence[Bundle] | Mapping[str, ArrayLike] | None = None,
    pushes: Push | Sequence[Push] | Sequence[Sequence[Push]] = (),
    ground: Ground | SpatialGround | Sequence[Ground] | Sequence[SpatialGround] | None = None,
    method: Method | None = None,
    control_period: float | None = None,
    record_every: int | None = None,
    stop_when_fallen: bool | None = None,
    latched: Joints | Sequence[Joints | None] | None = None,
    braked: Joints | Sequence[Joints] = (),
    on_error: OnError | str = OnError.WARN,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Any:
    """Simulate many runs at once.

    Each argument is either for all runs or has one entry a run; n is their number. The results are
    those of n calls of :func:`~heelstrike.simulate` to the last bit, whatever the number of
    threads.

    Parameters
    ----------
    robot : Robot or SpatialRobot, or sequence of n
        Robots may differ in every number, but must have as many coordinates, actuators, contact
        points, closed loops and coupled joints.
    controller : controller, sequence of n, or None
        Stock controllers, and those made with :func:`heelstrike.controller`. Each run has a memory
        of its own. A Python controller would run one at a time: call `simulate` instead.
    state : State, or sequence of n
        Where the runs start: `q` (nq,) or (n, nq), `v` (nv,) or (n, nv).
    duration : float, or (n,) float
        Time to simulate in seconds.
    parameters : Bundle, sequence of n, or mapping of str to (n, ...) array, optional
        Numbers of the controller, in the place of its own; a mapping names those that differ from
        run to run.
    pushes : Push, sequence of Push, or sequence of n sequences of Push
        Forces from outside; a plain sequence acts in every run.
    ground : Ground or SpatialGround, or sequence of n
        The ground; flat with μ = 0.75 and no restitution by default.
    method : Method
        Simulation method of all runs; ``TimeStepping()`` by default.
    control_period : float, optional
        Time between two calls of the controller; see :func:`~heelstrike.simulate`.
    record_every : int, optional
        Steps between two rows of the records; by default nothing is kept but how each run ended,
        so that memory does not grow with the duration. The runs are those of `simulate` with the
        same `record_every`, or a huge one: writing an event-driven row may change a last digit, or
        end a step there.
    stop_when_fallen : bool, optional
        See :func:`~heelstrike.simulate`.
    latched : joints, or sequence of n of them or None, optional
        Joints that their latches hold as a run begins: a name or index, or several. Those of a
        plain sequence are held in every run. By default they follow from the state of each run; see
        :class:`~heelstrike.Simulation`.
    braked : joints, or sequence of n of them
        Joints that their brakes hold as a run begins, where they are; likewise.
    on_error : OnError or str
        What becomes of an error in a controller when all runs have ended: ``"warn"`` tells of the
        first in a :class:`~heelstrike.ControllerWarning` with its traceback, and which runs ended
        so; ``"raise"`` raises it, and the batch is lost; ``"stop"`` does neither.
    threads : int, optional
        Threads to work with; by default one a processor.
    time_limit : float, optional
        Seconds of a processor after which a run is given up: it ends as ``INTERRUPTED``, and its
        message tells.
    progress : callable or bool, optional
        Called with the numbers of finished and of all runs; true shows a bar, false nothing. By
        default there is a bar on a terminal and nothing elsewhere. If it raises, that ends all runs
        like Ctrl-C, and their messages tell.

    Returns
    -------
    BatchResult or SpatialBatchResult
        How every run ended. A fall or a failure, of the controller too, ends its own run only;
        Ctrl-C ends all, and those that had not begun are where they started. While compiling,
        Ctrl-C raises KeyboardInterrupt.

    Raises
    ------
    SimulationError, ControllerError
        If the arguments are not usable; raised before anything is simulated.
    Exception
        With ``on_error="raise"``, what a controller raised.

    Examples
    --------
    Pushes of different strength against a robot that stands on stiff joints::

        pushes = [[Push("trunk", force=(f, 0.0), start=0.1, duration=0.1)] for f in range(100)]
        batch = simulate_batch(robot, controller, state=state, duration=2.0, pushes=pushes)
        print(batch, batch.completed)
    """
    begin = perf_counter()
    if record_every is not None and record_every < 1:
        raise SimulationError(f"record_every must be at least 1 or None, got {record_every}")
    on_error = one_of(OnError, "on_error", on_error, SimulationError)
    workers = (os.cpu_count() or 1) if threads is None else threads
    if workers < 1:
        raise SimulationError(f"threads must be at least 1, got {threads}")
    if time_limit is not None and not time_limit > 0.0:
        raise SimulationError(f"time_limit must be positive (s) or None, got {time_limit}")
    way = way_of(robot, method)
    setup: dict[str, Any] = {
        "control_period": control_period,
        "record_every": NO_ROWS if record_every is None else record_every,
        "stop_when_fallen": stop_when_fallen,
        "on_error": OnError.STOP,  # of one run; what the batch does comes at its end
    }
    plans, asked = planned(
        way, setup, robot=robot, controller=controller, state=state, parameters=parameters,
        pushes=pushes, ground=ground, latched=latched, braked=braked,
        duration=_durations(duration),
    )  # fmt: skip
    durations = [float(each["duration"]) for each in asked]
    for index, (plan, each) in enumerate(zip(plans, durations, strict=True)):
        with naming(index, len(plans)):
            check_duration(each)
            way.check_span(plan.setting, each)
    if record_every is not None:
        rows = sum(way.rows_in(each, record_every) for each in durations)
        check_runs(plans[0].setting.robot, rows, len(plans), record_every)
    compile_s = compile_all(way, plans)
    work = _Work(plans, durations, way, recorded=record_every is not None, limit=time_limit)
    threads = checked_threads(workers, len(plans))
    with _shown(progress, len(plans)) as show:
        work.finish(threads, show)
    work.tell_errors(on_error)
    return work.result(threads, Timing(compile_s, perf_counter() - begin - compile_s))


def _durations(duration: ArrayLike) -> Sequence[float]:
    values = np.asarray(duration, dtype=np.float64)
    if values.ndim > 1 or values.size == 0:
        raise SimulationError(f"duration must be one number or one a run, got shape {values.shape}")
    listed: list[float] = np.atleast_1d(values).tolist()
    return listed


@contextmanager
def _shown(
    progress: Callable[[int, int], None] | bool | None, count: int
) -> Iterator[Callable[[int, int], None]]:
    """Make a function that shows how many runs are finished."""
    if callable(progress):
        yield progress
        return
    if progress is False or (progress is None and not sys.stderr.isatty()):
        yield lambda *_: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), Remaining())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("simulating", total=count)
        yield lambda done, total: bar.update(task, completed=done, total=total)


class _Work:
    """Runs that are simulated to their ends, some lanes at a time."""

    def __init__(
        self, plans: Sequence[Plan], durations: Sequence[float], method: Method, *, recorded: bool,
        limit: float | None,
    ) -> None:  # fmt: skip
        self._plans, self._durations, self._method = plans, durations, method
        self._recorded, self._limit = recorded, math.inf if limit is None else limit
        self._stop = threading.Event()
        self._why = ""
        self._lock = threading.Lock()
        self._done = 0
        self._dimension = dimension_of(plans[0].setting.robot)
        nothing = self._dimension.nothing_counted()
        self._endings = [_not_begun(plan.setting.state, nothing) for plan in plans]

    def finish(self, threads: int, show: Callable[[int, int], None]) -> None:
        """Simulate everything; Ctrl-C ends the runs at work and leaves the others."""
        some = LANES_AT_ONCE * threads
        with ThreadPoolExecutor(threads, thread_name_prefix="heelstrike") as pool:
            try:
                for first in range(0, len(self._plans), some):
                    if not self._stop.is_set():
                        self._finish_some(first, some, pool, threads, show)
            except KeyboardInterrupt as interrupt:
                acknowledge(interrupt)
            finally:
                self._stop.set()

    def _finish_some(
        self, first: int, some: int, pool: ThreadPoolExecutor, threads: int,
        show: Callable[[int, int], None],
    ) -> None:  # fmt: skip
        plans = self._plans[first : first + some]
        lanes = Lanes(plans, self._method, threads, keep_rows=self._recorded)

        def finish(thread: int) -> None:
            for index in np.flatnonzero(lanes.thread == thread).tolist():
                if self._stop.is_set():
                    return
                self._endings[first + index] = self._end(
                    lanes.take(index), self._durations[first + index]
                )
                with self._lock:
                    self._done += 1

        futures: set[Future[None]] = {pool.submit(finish, thread) for thread in range(threads)}
        while futures:
            done, futures = wait(futures, timeout=0.1, return_when=FIRST_EXCEPTION)
            for future in done:
                future.result()
            self._show(show)

    def _end(self, lane: Lane, duration: float) -> Ending:
        """Simulate a run to its end, or until it has taken too long."""
        end = thread_time() + self._limit
        ending = lane.to_the_end(duration, lambda: self._stop.is_set() or thread_time() > end)
        late = thread_time() > end and not self._stop.is_set()
        if late and ending.status is RunStatus.INTERRUPTED:
            told = f"took more than {self._limit:g} s of the processor: {ending.message}"
            run = ending.run and replace(ending.run, message=told)
            return replace(ending, message=told, run=run)
        return ending

    def _show(self, show: Callable[[int, int], None]) -> None:
        """Show how far it is; what that raises ends all runs, unless all have ended."""
        try:
            show(self._done, len(self._plans))
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self._why = f": progress raised {type(error).__name__}: {error}"
            self._stop.set()

    def tell_errors(self, on_error: OnError) -> None:
        """Do with errors in controllers as `on_error` says."""
        failed = [i for i, end in enumerate(self._endings) if _is_error(end)]
        if failed:
            first = self._endings[failed[0]]
            assert first.error is not None
            message = f"run {failed[0]}: {first.message}"
            if others := ", ".join(map(str, failed[1 : 1 + SHOWN])):
                more = ", ..." if len(failed) > 1 + SHOWN else ""
                message += f". Errors ended {len(failed) - 1} more: {others}{more}"
            tell(message, first.error, on_error)

    def result(self, threads: int, timing: Timing) -> Any:
        """Return what came out."""
        endings = self._endings
        interrupted = [ending.status is RunStatus.INTERRUPTED for ending in endings]
        if self._why and not any(interrupted):
            warnings.warn(f"all runs ended{self._why}", stacklevel=3)
        count = len(endings)
        columns = {
            name: np.array([ending.counts[name] for ending in endings])
            for name in endings[0].counts
        }
        return self._dimension.batch_result(
            position=np.array([ending.state.q for ending in endings]).reshape(count, -1),
            velocity=np.array([ending.state.v for ending in endings]).reshape(count, -1),
            time=np.array([ending.time for ending in endings]),
            status=tuple(ending.status for ending in endings),
            message=tuple(
                ending.message + (self._why if stopped else "")
                for ending, stopped in zip(endings, interrupted, strict=True)
            ),
            events=np.array([ending.events for ending in endings]),
            **columns,
            threads=threads,
            timing=timing,
            _runs=tuple(ending.run for ending in endings) if self._recorded else None,
        )


def _is_error(ending: Ending) -> bool:
    return ending.status is RunStatus.CONTROLLER_FAILED and ending.error is not None


def _not_begun(state: State, counts: dict[str, Any]) -> Ending:
    events = np.zeros(len(EventKind), dtype=np.int64)
    message = "interrupted before it began"
    return Ending(RunStatus.INTERRUPTED, message, None, state, 0.0, events, counts, None)
