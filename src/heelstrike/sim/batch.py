"""simulate_batch(): many simulations in one call, on several threads."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import field
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import are_numbers, refusal, takes
from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.bundle_type import Fixed
from heelstrike.contact.ground import Ground
from heelstrike.errors import ControllerError, RobotError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.interruption import acknowledge
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind, OnError, RunStatus
from heelstrike.sim.contacts.latches import is_one, several
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.controller.law import Law, law_of
from heelstrike.sim.controller.raised import tell
from heelstrike.sim.frame import compiled_loop, fixed_for
from heelstrike.sim.memory import allocate_memory
from heelstrike.sim.method import Method, check_constraints, work_of
from heelstrike.sim.push import Push, pushes_on
from heelstrike.sim.record.size import check_runs
from heelstrike.sim.run import COUNTS, WORST, Run, Timing
from heelstrike.sim.setting import Setting, checked_on_error, checked_setting
from heelstrike.sim.simulation import (
    Ending,
    check_duration,
    checked_method,
    has_warned,
    simulation_to_the_end,
)
from heelstrike.sim.snapshot import Snapshot

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

Joints = str | int | Iterable[str | int]

NO_ROWS = 2**62
"""Steps between two rows of runs that are not recorded: more than any run has."""

SHOWN = 10
"""Runs that a warning of errors names at most, beside the first."""


@dataclass(frozen=True, eq=False)
class Batch:
    """What many simulations came to."""

    position: Floats
    """(n, nq)"""
    velocity: Floats
    """(n, nv) State of each run when it ended (m, rad; m/s, rad/s)."""
    time: Floats
    """(n,) When that was, in s."""
    status: tuple[RunStatus, ...]
    """How each run ended."""
    message: tuple[str, ...]
    """The same in a person's words."""
    steps: Integers
    saturations: Integers
    """steps, saturations: (n,) Steps taken; times that a torque was clipped to its limit."""
    events: Integers
    """(n, kinds) Events of each kind, in the order of
    :class:`~heelstrike.sim.closed_sets.EventKind`."""
    penetration: Floats
    """(n,) Deepest penetration of a contact point, in m."""
    complementarity: Floats
    cone: Floats
    non_penetration: Floats
    """complementarity, cone, non_penetration: (n,) Largest relative residuals of the contact
    problems."""
    energy_gain: Floats
    """(n,) Kinetic energy that restitution made (J)."""
    solves: Integers
    shortcuts: Integers
    fallbacks: Integers
    failures: Integers
    combinations: Integers
    relaxed: Integers
    """solves, shortcuts, fallbacks, failures, combinations, relaxed: (n,) Contact problems of each
    run, and how they were solved; see :class:`~heelstrike.sim.run.SolverCount`."""
    threads: int
    """Threads that worked on it."""
    timing: Timing
    """Seconds spent compiling, or loading compiled code, and simulating."""
    _runs: tuple[Run | None, ...] | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.status)

    @property
    def completed(self) -> NDArray[np.bool_]:
        """Which runs lasted as long as they were asked to, (n,)."""
        return np.array([status is RunStatus.COMPLETED for status in self.status], dtype=bool)

    def run(self, index: int) -> Run:
        """Return the record of one run, as :func:`~heelstrike.simulate` would have.

        Parameters
        ----------
        index : int
            Which run.

        Returns
        -------
        Run
            Its record.

        Raises
        ------
        SimulationError
            If the batch was not recorded, or was interrupted before this run began.
        IndexError
            If there is no such run.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"there is no run {index} in a batch of {len(self)}")
        run = None if self._runs is None else self._runs[index]
        if run is not None:
            return run
        if self._runs is None:
            raise SimulationError(
                "this batch kept final states only; call simulate_batch with record_every=1, or "
                "another number of steps between two rows, to have its runs"
            )
        raise SimulationError(f"the batch was interrupted before run {index} began")

    def __str__(self) -> str:
        counts = [
            f"{count} {status.value}"
            for status in RunStatus
            if (count := sum(each is status for each in self.status))
        ]
        return f"{len(self)} runs: {', '.join(counts)}"


@takes(SimulationError)
def simulate_batch(
    robot: Robot | Sequence[Robot],
    controller: Controller | Sequence[Controller] | None = None,
    *,
    state: State | Snapshot | Sequence[State],
    duration: ArrayLike,
    parameters: Bundle | Sequence[Bundle] | Mapping[str, ArrayLike] | None = None,
    pushes: Push | Sequence[Push] | Sequence[Sequence[Push]] = (),
    ground: Ground | Sequence[Ground] | None = None,
    method: Method | None = None,
    control_period: float | None = None,
    record_every: int | None = None,
    stop_when_fallen: bool | None = None,
    latched: Joints | Sequence[Joints | None] | None = None,
    braked: Joints | Sequence[Joints] = (),
    on_error: OnError | str = OnError.WARN,
    threads: int | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Batch:
    """Simulate many runs at once.

    Each argument is either for all runs or has one entry a run; n is their number. The results are
    those of n calls of :func:`~heelstrike.simulate` to the last bit, whatever the number of
    threads.

    Parameters
    ----------
    robot : Robot, or sequence of n
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
    ground : Ground, or sequence of n
        The ground; flat with μ = 0.75 and no restitution by default.
    method : Method
        Way through time of all runs; ``TimeStepping()`` by default.
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
    progress : callable or bool, optional
        Called with the numbers of finished and of all runs; true shows a bar, false nothing. By
        default there is a bar on a terminal and nothing elsewhere. If it raises, that ends all runs
        like Ctrl-C, and their messages tell.

    Returns
    -------
    Batch
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
    on_error = checked_on_error(on_error)
    workers = (os.cpu_count() or 1) if threads is None else threads
    if workers < 1:
        raise SimulationError(f"threads must be at least 1, got {threads}")
    asked = _one_a_run(
        robot=_listed(robot),
        controller=_listed(controller),
        state=_states(state),
        duration=_durations(duration),
        parameters=_parameters(parameters),
        pushes=_pushes(pushes),
        ground=_listed(ground),
        latched=[None] if latched is None else _joints("latched", latched),
        braked=_joints("braked", braked),
    )
    _check_robots([each["robot"] for each in asked])
    method = checked_method(method)
    setup: dict[str, Any] = {
        "control_period": control_period,
        "record_every": NO_ROWS if record_every is None else record_every,
        "stop_when_fallen": stop_when_fallen,
        "on_error": OnError.STOP,  # of one run; what the batch does comes at its end
    }
    laws = {id(each): _law(each) for each in _listed(controller)}
    tasks = []
    for index, each in enumerate(asked):
        with _naming(index, len(asked)):
            tasks.append(_task(method, laws[id(each["controller"])], setup, **each))
    if record_every is not None:
        rows = sum(method.rows_in(task.duration, record_every) for task in tasks)
        check_runs(tasks[0].setting.robot, rows, len(tasks), record_every)
    compile_s = 0.0
    for fixed in {_fixed(method, task.setting) for task in tasks}:
        compile_s += compiled_loop(method.kernels, method.work, fixed)[1]
    for task in tasks:
        task.law.function.finish()
    crew = _Crew(tasks, method, recorded=record_every is not None)
    threads = min(workers, len(tasks))
    with _shown(progress, len(tasks)) as show:
        crew.work(threads, show)
    crew.tell_errors(on_error)
    return crew.batch(threads, Timing(compile_s, perf_counter() - begin - compile_s))


class _Task(NamedTuple):
    """One run of a batch."""

    setting: Setting
    law: Law
    duration: float


def _fixed(method: Method, setting: Setting) -> Fixed:
    """Return what the loop of a run can take for granted."""
    ground = setting.ground.model()
    return fixed_for(setting.robot, ground, work_of(method, setting.robot), method.usual_numbers)


def _task(
    method: Method, law: Law, setup: dict[str, Any], *, robot: Robot, state: State, duration: float,
    parameters: Any, **about: Any,
) -> _Task:  # fmt: skip
    """Check what one run is to be."""
    about.pop("controller")
    setting = checked_setting(robot, state, **setup, **about)
    check_duration(duration)
    check_constraints(method, setting)
    method.check(setting)
    has_warned(method, setting)
    method.check_span(setting, duration)
    method.set_clock(setting, Clock())
    if isinstance(parameters, Mapping):
        try:
            parameters = law.parameters.replaced(**parameters)
        except TypeError as error:
            raise SimulationError(f"parameters: {error}") from error
    law = law if parameters is None else law.with_parameters(parameters)
    law.numbers(robot)
    return _Task(setting, law, duration)


def _one_a_run(**entries: Sequence[Any]) -> list[dict[str, Any]]:
    """Return the arguments of each run, where those with one entry are for all."""
    sizes = {name: len(values) for name, values in entries.items()}
    for name, size in sizes.items():
        if size == 0:
            raise SimulationError(f"{name} is empty: there is nothing to simulate")
    several = {name: size for name, size in sizes.items() if size > 1}
    if len(set(several.values())) > 1:
        described = ", ".join(f"{name} for {size}" for name, size in several.items())
        raise SimulationError(
            f"the arguments are for different numbers of runs: {described}. Each must have one "
            "entry for all runs, or as many as the others"
        )
    return [
        {name: values[index % len(values)] for name, values in entries.items()}
        for index in range(max(sizes.values()))
    ]


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, Sequence) else [value]


def _states(state: State | Snapshot | Sequence[State]) -> Sequence[State]:
    if any(isinstance(each, Snapshot) for each in _listed(state)):
        raise SimulationError(
            "a batch begins anew, from states: simulate(state=snapshot) goes on where a snapshot "
            "was taken"
        )
    if isinstance(state, Sequence):
        return state
    if not isinstance(state, State):
        raise SimulationError(f"state must be a State or several, got {type(state).__name__}")
    if state.q.ndim == 1 and state.v.ndim == 1:
        return [state]
    for name, array in (("q", state.q), ("v", state.v)):
        if array.ndim not in (1, 2):
            raise SimulationError(
                f"state.{name} must have shape (n{name},) or (runs, n{name}), got {array.shape}"
            )
    q, v = np.atleast_2d(state.q), np.atleast_2d(state.v)
    if len(q) != len(v) and 1 not in (len(q), len(v)):
        raise SimulationError(f"state.q is for {len(q)} runs and state.v for {len(v)}")
    size = max(len(q), len(v))
    return [State(q[i % len(q)], v[i % len(v)]) for i in range(size)]


def _durations(duration: ArrayLike) -> Sequence[float]:
    values = np.asarray(duration, dtype=np.float64)
    if values.ndim > 1 or values.size == 0:
        raise SimulationError(f"duration must be one number or one a run, got shape {values.shape}")
    listed: list[float] = np.atleast_1d(values).tolist()
    return listed


def _parameters(parameters: Any) -> Sequence[Bundle | Mapping[str, Floats] | None]:
    """Parameters run by run: bundles, or members by name."""
    if parameters is None:
        return [None]
    bundles = _listed(parameters)
    if all(isinstance(each, Bundle) for each in bundles):
        return bundles
    if not isinstance(parameters, Mapping):
        raise SimulationError(
            "parameters are a bundle, one bundle a run, or a mapping of names to arrays with one "
            f"entry a run; got {type(parameters).__name__}"
        )
    for name, values in parameters.items():
        if not are_numbers(values):
            raise SimulationError(refusal(f"parameters: {name}", values, ("ArrayLike",)))
    columns = {name: np.asarray(values, dtype=np.float64) for name, values in parameters.items()}
    shapes = {name: values.shape for name, values in columns.items()}
    if len({shape[:1] for shape in shapes.values()} | {()}) != 2:
        raise SimulationError(f"parameters must have one entry a run, got arrays of shape {shapes}")
    for name, values in columns.items():
        if not np.all(np.isfinite(values)):
            raise SimulationError(f"parameters: {name} must be finite")
    rows = zip(*columns.values(), strict=True)
    return [
        {name: np.array(value) for name, value in zip(columns, row, strict=True)} for row in rows
    ]


def _pushes(pushes: Any) -> Sequence[Sequence[Push]]:
    if isinstance(pushes, Push):
        return [(pushes,)]
    if not isinstance(pushes, Sequence):
        raise SimulationError(f"pushes must be Push(...) or several, got {pushes!r}")
    if all(isinstance(each, Push) for each in pushes):
        return [tuple(pushes)]
    if all(isinstance(each, Sequence) for each in pushes):
        return [tuple(each) for each in pushes]
    raise SimulationError(
        "pushes are either a sequence of Push for all runs, or one such sequence a run; this "
        "mixes the two"
    )


def _joints(name: str, joints: Any) -> Sequence[Any]:
    """Joints run by run: those of a plain sequence are for all."""
    listed = list(several(name, joints))
    single = [is_one(each) for each in listed]
    if all(single):
        return [tuple(listed)]
    if any(single):
        raise SimulationError(
            f"{name} are either joints for all runs, or several such lists, one a run; this mixes "
            "the two. The list of a run with one joint has one entry, that of a run without is []"
        )
    return [each if each is None else tuple(several(name, each)) for each in listed]


_ALIKE = {
    "nv": "coordinates", "nu": "actuators", "nc": "contact points", "loops": "closed loops",
    "couplings": "coupled joints", "latches": "latches", "brakes": "brakes",
}  # fmt: skip


def _check_robots(robots: Sequence[Any]) -> None:
    for index, robot in enumerate(robots):
        if not isinstance(robot, Robot):
            raise SimulationError(f"robot must be a Robot or several, got {robot!r}")
        for name, what in _ALIKE.items():
            first, other = getattr(robots[0].model, name), getattr(robot.model, name)
            if first != other:
                raise SimulationError(
                    f"the robots of a batch must be built alike: robot {index} has {other} "
                    f"{what}, the first has {first}"
                )


def _law(controller: Any) -> Law:
    """Return the law that a controller is, which must be one that can be compiled."""
    law = law_of(controller, begin=True)
    if law is None or not law.function.compiles:
        raise ControllerError(
            f"{type(controller).__name__} runs in Python, so a batch of it would run one at a "
            "time. Write it as a function and compile that with heelstrike.controller, or call "
            "simulate for each run"
        )
    return law


@contextmanager
def _naming(index: int, count: int) -> Iterator[None]:
    """Tell which of several runs an error is about."""
    try:
        yield
    except (RobotError, SimulationError) as error:
        if count == 1:
            raise
        raise type(error)(f"run {index}: {error}") from error


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


class _Crew:
    """Threads that take one run after the other."""

    def __init__(self, tasks: Sequence[_Task], method: Method, *, recorded: bool) -> None:
        self._tasks, self._method, self._recorded = tasks, method, recorded
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._why = ""
        self._next = 0
        self._done = 0
        self._endings = [_not_begun(task.setting.state) for task in tasks]

    def work(self, threads: int, show: Callable[[int, int], None]) -> None:
        """Simulate everything; Ctrl-C ends the runs at work and leaves the others."""
        with ThreadPoolExecutor(threads, thread_name_prefix="heelstrike") as pool:
            futures: set[Future[None]] = {pool.submit(self._take_runs) for _ in range(threads)}
            try:
                while futures:
                    done, futures = wait(futures, timeout=0.1, return_when=FIRST_EXCEPTION)
                    for future in done:
                        future.result()
                    self._show(show)
            except KeyboardInterrupt as interrupt:
                acknowledge(interrupt)
            finally:
                self._stop.set()

    def _show(self, show: Callable[[int, int], None]) -> None:
        """Show how far it is; what that raises ends all runs, unless all have ended."""
        try:
            show(self._done, len(self._tasks))
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self._why = f": progress raised {type(error).__name__}: {error}"
            self._stop.set()

    def _take_runs(self) -> None:
        """Work of one thread, which allocates memory once for all of its runs, if they allow it."""
        memory = fresh = robot = None
        while not self._stop.is_set():
            with self._lock:
                index = self._next
                self._next += 1
            if index >= len(self._tasks):
                return
            setting, law, duration = self._tasks[index]
            # Straight-line code, dry joints and sizes of the memory are those of its robot.
            if (
                memory is None
                or fresh is None
                or robot is not setting.robot
                or len(memory.pushes.link) != len(setting.pushes)
            ):
                robot = setting.robot
                memory = allocate_memory(robot, setting.pushes)
                fresh = deepcopy(memory)
            else:
                memory.become(fresh)
                memory.pushes.become(pushes_on(robot, setting.pushes))
            self._endings[index] = simulation_to_the_end(
                setting, self._method, law, duration,
                memory=memory, keep_rows=self._recorded, stopped=self._stop.is_set,
            )  # fmt: skip
            with self._lock:
                self._done += 1

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

    def batch(self, threads: int, timing: Timing) -> Batch:
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
        return Batch(
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


def _not_begun(state: State) -> Ending:
    counts = dict.fromkeys(COUNTS, 0) | dict.fromkeys(WORST, 0.0)
    events = np.zeros(len(EventKind), dtype=np.int64)
    message = "interrupted before it began"
    return Ending(RunStatus.INTERRUPTED, message, None, state, 0.0, events, counts, None)
