"""Campaign: many trials of a walk with other numbers in each, on whatever workers there are."""

from __future__ import annotations

import math
import os
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import cache, partial
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

from heelstrike.analysis.stability.largest import Largest, largest
from heelstrike.analysis.stability.trial import ROWS, Trial
from heelstrike.arguments import takes
from heelstrike.errors import HeelstrikeError, SimulationError
from heelstrike.experiments.campaigns.outcome import CRASHED, Outcome
from heelstrike.experiments.campaigns.parameters import Draw, Share, planned, typical
from heelstrike.experiments.campaigns.results import CampaignResults
from heelstrike.experiments.campaigns.sending import Elsewhere, outcomes_of, packed
from heelstrike.experiments.campaigns.store import (
    Store,
    as_text,
    outcomes_in,
    reading,
    refuse_another,
)
from heelstrike.experiments.campaigns.trials import (
    Block,
    check_parameters,
    chosen,
    inputs_digest,
    judged_as_in,
    laid_out,
    replayed,
    run_block,
    trial_digest,
)
from heelstrike.experiments.campaigns.workers import is_death, is_lost, is_sure, was_cancelled
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.sim.run import Run

BLOCK = 32
"""Trials that go to a worker together, and are kept together."""

AHEAD = 64
"""Blocks that an executor has to do at most; our own threads have four each."""


class Submits(Protocol):
    """What can work for a campaign: executors, clients of clusters."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Any:
        """Begin a call; return what has its ``result()``."""


@dataclass(frozen=True)
class Progress:
    """How far a campaign is."""

    trials: int
    finished: int
    success: int
    """trials, finished, success: Trials asked for, finished, and among those the good ones."""
    found: int
    """Trials that were there already."""
    seconds: float
    """Time since it began."""

    @property
    def rate(self) -> float:
        """Trials a second."""
        return (self.finished - self.found) / max(self.seconds, 1e-9)

    @property
    def left(self) -> float:
        """Seconds that it will go on; infinite before the first are finished."""
        return (self.trials - self.finished) / self.rate if self.rate > 0.0 else float("inf")


class Campaign:
    """Many trials of a walk with other numbers in each.

    Parameters
    ----------
    trial : Trial, or mapping of str to Trial
        The walk as it is before anything differs. Of several, which may have other gaits,
        controllers and methods, the parameter ``"trial"`` chooses one by its name.
    parameters : mapping of str, or sequence of Share
        What differs: a distribution of `scipy.stats` (``uniform(0.4, 0.5)``), a list of values, or
        a number, by name. A name is ``"GROUP.NUMBER"`` or ``"GROUP.NUMBER.WHERE"``, and may end in
        ``*`` or ``+``, which multiply, or add to, what is there: see Notes. Shares are parts of the
        trials, each with parameters of its own.
    trials : int, optional
        How many; a grid has as many as it has combinations.
    seed : int
        Of everything that is random. Each trial has a child of its own.
    draw : Draw
        How values are drawn.
    duration : float, optional
        How long each trial lasts, in s; by default until its walk has settled.
    description : mapping of str to str
        What else is kept in the folder, such as the text of the file that it was read from.

    Raises
    ------
    SimulationError
        If there is no such parameter, or nothing can be drawn so.

    Notes
    -----
    ``robot.NUMBER[.LINK, JOINT, MOTOR or CONTACT]``
        Any number of :class:`~heelstrike.robot.model.Model`, of the robot that is simulated; what
        the controller knows of it stays. ``"robot.length.LINK *"`` stretches a link.
    ``state.q.JOINT``, ``state.v.JOINT``
        Where it begins.
    ``ground.friction``, ``.restitution``, ``.slope`` (rad), ``.roughness`` (m)
        The latter two beyond the edge of level ground (:class:`~heelstrike.Trial`).
    ``push.impulse[.LINK]`` (N s), ``.angle`` (rad), ``.start``, ``.duration`` (s)
        One push, forwards on the trunk where a disturbance may begin, by default.
    ``controller.NAME``
        Numbers of the controller's parameters.
    ``sensors.delay`` (s), ``.encoder_noise``, ``.pitch_noise``, ``.rate_noise``, ``.force_noise``
        As :class:`~heelstrike.control.Sensed` has them.
    ``actuators.delay`` (s), ``.bandwidth`` (Hz), ``.efficiency``
        As :class:`~heelstrike.Actuated` has them. Delays are rounded to whole periods.

    Examples
    --------
    >>> import heelstrike as hs
    >>> from scipy.stats import uniform
    >>> robot = hs.load_robot("bravo7")
    >>> still = hs.Trial(
    ...     robot=robot, controller=None, state=robot.reference_state(), step_length=0.0,
    ...     step_duration=0.1, settling=0.1,
    ... )
    >>> campaign = hs.Campaign(still, {"ground.friction": uniform(0.2, 0.6)}, trials=4, seed=1)
    >>> len(campaign.run())
    4
    """

    @takes(SimulationError)
    def __init__(
        self,
        trial: Trial | Mapping[str, Trial],
        parameters: Mapping[str, Any] | Sequence[Share],
        trials: int | None = None,
        seed: int = 0,
        *,
        draw: Draw = Draw.RANDOM,
        duration: float | None = None,
        description: Mapping[str, str] | None = None,
    ) -> None:
        several = {"": trial} if isinstance(trial, Trial) else trial
        if not (
            isinstance(several, Mapping)
            and several
            and all(isinstance(each, Trial) for each in several.values())
        ):
            raise SimulationError(
                "a campaign is of a Trial, or of a mapping of names to several, got "
                f"{type(trial).__name__}"
            )
        self.trials = dict(several)
        if not (isinstance(seed, int) and seed >= 0):
            raise SimulationError(f"the seed must be a whole number from 0 on, got {seed!r}")
        first = next(iter(self.trials.values()))
        self.duration = first.begins + first.settling if duration is None else float(duration)
        if not self.duration > 0.0:
            raise SimulationError(f"the duration of trials must be positive, got {duration!r}")
        self.seed, self.draw = seed, draw
        self.plan = planned(parameters, draw, trials, seed)
        check_parameters(self.trials, list(typical(parameters)))
        self._description = dict(description or {})
        self._bases = {
            name: inputs_digest(each, self.duration) for name, each in self.trials.items()
        }

    def __len__(self) -> int:
        return len(self.plan.values)

    def run(
        self,
        folder: str | os.PathLike[str] | None = None,
        *,
        executor: Submits | Callable[[], Submits] | None = None,
        workers: int | None = None,
        limit: float | None = None,
        progress: Callable[[Progress], None] | None = None,
        afresh: bool = False,
    ) -> CampaignResults:
        """Simulate all trials that are not there yet.

        Parameters
        ----------
        folder : path, optional
            Where outcomes are kept, block by block. A campaign that was ended in whatever way goes
            on from there.
        executor : optional
            Who works: anything with ``submit(function, argument)`` that returns what has a
            ``result()``, such as a `ProcessPoolExecutor`, a `distributed.Client` or an executor of
            submitit. A function that makes one is asked for another when it breaks because a
            worker died; clusters go on by themselves. By default own threads.
        workers : int, optional
            Number of own threads; one a processor by default.
        limit : float, optional
            Seconds of a processor after which a trial is given up; the next call tries it again.
            A controller in Python is interrupted between two of its calls.
        progress : callable, optional
            Called often with how far it is.
        afresh : bool
            Discard what is in the folder and start again.

        Returns
        -------
        CampaignResults
            The same to the last bit, whoever worked in whatever order.

        Raises
        ------
        SimulationError
            If the folder has another campaign, another process is at work in it, the workers are
            gone, as when a scheduler has ended, or jobs of theirs are cancelled again and again.
        WriteError
            If the folder cannot be written to; what was finished is there.
        KeyboardInterrupt
            At Ctrl-C; what was finished is there.
        """
        if workers is not None and workers < 1:
            raise SimulationError(f"workers must be at least 1, got {workers}")
        if limit is not None and not limit > 0.0:
            raise SimulationError(f"limit must be a positive number of seconds, got {limit}")
        digests = self._digests()
        store = None if folder is None else Store(Path(folder))
        try:
            known: dict[bytes, Outcome] = {}
            if store is not None:
                store.begin(self.about, self._description, afresh=afresh)
                known = {key: each for key, each in store.known().items() if not each.given_up}
            wanted = [i for i, digest in enumerate(digests) if digest not in known]
            begin, found = perf_counter(), len(self) - len(wanted)
            show = progress or (lambda _: None)
            good = sum(known[digest].success for digest in digests if digest in known)
            finished = found
            show(Progress(len(self), finished, good, found, 0.0))
            blocks = self._blocks(wanted, limit)
            with (
                _worked(self.trials, executor, workers or os.cpu_count() or 1) as work,
                closing(work(blocks)) as done,
            ):
                for block, outcomes in done:
                    own = [digests[number] for number in block.numbers]
                    if store is not None:
                        store.keep(own, block.numbers, outcomes)
                    known |= zip(own, outcomes, strict=True)
                    finished += len(outcomes)
                    good += sum(each.success for each in outcomes)
                    seconds = perf_counter() - begin
                    show(Progress(len(self), finished, good, found, seconds))
        finally:
            if store is not None:
                store.close()
        return self._results(known)

    def load(self, folder: str | os.PathLike[str]) -> CampaignResults:
        """Return the outcomes that are in a folder, while the campaign is running, too.

        Parameters
        ----------
        folder : path
            Where they are kept.

        Returns
        -------
        CampaignResults
            Those that are finished.

        Raises
        ------
        SimulationError
            If the folder has none, or those of another campaign.
        """
        with reading(Path(folder)) as connection:
            refuse_another(connection, self.about, Path(folder))
            return self._results(outcomes_in(connection))

    def replay(self, number: int, *, record_every: int = ROWS) -> Run:
        """Simulate one trial alone, as it was in the campaign to the last bit.

        Parameters
        ----------
        number : int
            Which.
        record_every : int
            Steps of the method between two rows.

        Returns
        -------
        Run
            Its record.

        Raises
        ------
        IndexError
            If there is no such trial.
        HeelstrikeError
            If it cannot begin.
        """
        if not 0 <= number < len(self):
            raise IndexError(f"there is no trial {number} in a campaign of {len(self)}")
        values = self.plan.of(number)
        _, trial = chosen(self.trials, values)
        lane = laid_out(trial, values, int(self.plan.seeds[number]))
        return replayed(trial, lane, self.duration, record_every)

    def margin(
        self, name: str, most: float, *, strides: int = 8, halvings: int = 4, unit: str = ""
    ) -> Largest:
        """Find how large one parameter may be while nothing else differs, by bisection.

        Parameters
        ----------
        name : str
            The parameter, such as ``"push.impulse"`` or ``"ground.slope"``.
        most : float
            Largest size tried; a negative one is tried downwards.
        strides, halvings : int
            As of :func:`heelstrike.analysis.stability.largest.largest`.
        unit : str
            Of its values.

        Returns
        -------
        Largest
            Sizes of both outcomes, without a sign.

        Raises
        ------
        HeelstrikeError
            If there is no such parameter, or a value is impossible.
        """
        trial = next(iter(self.trials.values()))
        sign, seed = math.copysign(1.0, most), int(self.plan.seeds[0])

        def recovers(size: float) -> bool:
            lane = laid_out(trial, {name: sign * size}, seed)
            return judged_as_in(trial, replayed(trial, lane, self.duration)).success

        return largest(recovers, most=abs(most), strides=strides, halvings=halvings, unit=unit)

    def gait(self, number: int) -> Gait | None:
        """Return the gait that the robot of a trial follows.

        Parameters
        ----------
        number : int
            Which.

        Returns
        -------
        Gait or None
            Nothing if its law follows none.
        """
        _, trial = chosen(self.trials, self.plan.of(number))
        found: Gait | None = getattr(trial.controller, "gait", None)
        return found

    @property
    def about(self) -> dict[str, str]:
        """What decides about its trials, by name, as it is kept in folders."""
        return {
            "seed": str(self.seed), "draw": self.draw.value, "trial": as_text(self._bases),
            "parameters": as_text([self.plan.names, self.plan.of(0)]),
        }  # fmt: skip

    def _digests(self) -> list[bytes]:
        found = []
        for number in range(len(self)):
            values = self.plan.of(number)
            name = str(values.get("trial", next(iter(self.trials))))
            base = self._bases.get(name, "")
            found.append(trial_digest(base, values, int(self.plan.seeds[number])))
        return found

    def _blocks(self, wanted: Sequence[int], limit: float | None) -> Iterator[Block]:
        for first in range(0, len(wanted), BLOCK):
            numbers = tuple(wanted[first : first + BLOCK])
            yield Block(
                self.trials, numbers, tuple(map(self.plan.of, numbers)),
                tuple(self.plan.seeds[list(numbers)].tolist()), self.duration, limit,
            )  # fmt: skip

    def _results(self, known: Mapping[bytes, Outcome]) -> CampaignResults:
        there = [(i, known[digest]) for i, digest in enumerate(self._digests()) if digest in known]
        return CampaignResults(
            self.plan, tuple(i for i, _ in there), tuple(outcome for _, outcome in there)
        )


TRIES = 3
"""How often a worker of a cluster must die of a single trial until that is its outcome, and how
often a job may be cancelled until the campaign ends."""

Done = tuple[Block, list[Outcome]]


@contextmanager
def _worked(
    trials: Mapping[str, Trial], executor: Any, workers: int
) -> Iterator[Callable[[Iterable[Block]], Generator[Done]]]:
    """Make a function that has blocks worked on, and yields them in their order as they come."""
    if executor is not None:
        yield partial(_by_others, executor, cache(partial(packed, trials)))
        return
    stop = threading.Event()
    with ThreadPoolExecutor(workers, thread_name_prefix="heelstrike") as pool:
        try:
            yield lambda blocks: _in_order(
                lambda block: pool.submit(run_block, block, stop.is_set), blocks, 4 * workers
            )
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)


def _in_order(
    submit: Callable[[Block], Any], blocks: Iterable[Block], ahead: int
) -> Generator[Done]:
    waiting: deque[tuple[Block, Any]] = deque()
    for block in blocks:
        waiting.append((block, submit(block)))
        if len(waiting) >= ahead:
            block, future = waiting.popleft()
            yield block, future.result()
    for block, future in waiting:
        yield block, future.result()


def _by_others(
    executor: Any, trials: Callable[[], bytes], blocks: Iterable[Block]
) -> Generator[Done]:
    """Have blocks worked on by an executor; where one dies of a block, find the trial.

    A maker of executors is asked for another then; an executor that was given is broken for good.
    """
    again = None if hasattr(executor, "submit") else lambda: Elsewhere(executor(), trials)
    worker = Elsewhere(executor, trials) if again is None else again()
    waiting: deque[tuple[Block, Any]] = deque()
    source = iter(blocks)
    try:
        while True:
            try:
                for block in source:
                    waiting.append((block, None))
                    with _somebody_works():
                        waiting[-1] = block, worker.submit(block)
                    if len(waiting) >= AHEAD:
                        break
                if not waiting:
                    break
                block, future = waiting[0]
                outcomes = _answer(future)
                waiting.popleft()
                yield block, outcomes
            except BrokenExecutor:
                if again is None:
                    raise
                # One of those that were at work did it: each by itself now.
                suspects, waiting = [block for block, _ in waiting], deque()
                worker = again()
                for block in suspects:
                    try:
                        outcomes = _together(worker, block)
                    except BrokenExecutor as error:
                        outcomes, worker = _by_halves(partial(_alone, again), block, error), again()
                    yield block, outcomes
            except Exception as error:  # of a cluster, which goes on without a worker that died
                if not is_death(error):
                    raise
                block, future = waiting.popleft()
                yield block, _again(worker, block, future, error)
    finally:
        for _, future in waiting:
            if hasattr(future, "cancel"):
                future.cancel()
        if again is not None:
            worker.shutdown()


@contextmanager
def _somebody_works() -> Iterator[None]:
    """Tell in words that nobody is there any more who would work."""
    try:
        yield
    except Exception as error:
        if isinstance(error, HeelstrikeError) or not is_lost(error):
            raise
        raise SimulationError(
            f"nobody works on the campaign any more: {error or type(error).__name__}. What was "
            "finished is kept; the same command goes on"
        ) from error


def _answer(future: Any) -> list[Outcome]:
    """Wait for the outcomes of a block."""
    with _somebody_works():
        found = future.result()
    return outcomes_of(found)


def _alone(make: Callable[[], Elsewhere], block: Block) -> list[Outcome]:
    """Work on a block with an executor of its own; if that dies, on each half of it."""
    worker = make()
    try:
        return _together(worker, block)
    except BrokenExecutor as error:
        return _by_halves(partial(_alone, make), block, error)
    finally:
        worker.shutdown()


def _together(worker: Elsewhere, block: Block, died: int = 0, cancelled: int = 0) -> list[Outcome]:
    """Work on a block with an executor that goes on when a worker dies, as some did before."""
    with _somebody_works():
        future = worker.submit(block)
    try:
        return _answer(future)
    except Exception as error:
        if isinstance(error, BrokenExecutor) or not is_death(error):
            raise
        return _again(worker, block, future, error, died, cancelled)


def _again(
    worker: Elsewhere, block: Block, future: Any, error: Exception, died: int = 0,
    cancelled: int = 0,
) -> list[Outcome]:  # fmt: skip
    """Work again on a block that did not complete.

    One that was cancelled is worked on as it was. One that workers died of is halved; a single
    trial is tried several times.
    """
    if was_cancelled(future):
        if cancelled + 1 >= TRIES:
            raise SimulationError(
                f"a job of the campaign was cancelled {TRIES} times. What was finished is kept; "
                "the same command goes on"
            ) from error
        return _together(worker, block, died, cancelled + 1)
    if len(block.numbers) == 1 and died + 1 < TRIES and not is_sure(error):
        return _together(worker, block, died + 1)
    return _by_halves(partial(_together, worker), block, error)


def _by_halves(
    work: Callable[[Block], list[Outcome]], block: Block, error: Exception
) -> list[Outcome]:
    """Work on each half of a block that a worker died of; a single trial is the one."""
    if len(block.numbers) == 1:
        return [Outcome(CRASHED, f"the worker died of it: {error}", success=False)]
    half = len(block.numbers) // 2
    return [*work(_part(block, slice(0, half))), *work(_part(block, slice(half, None)))]


def _part(block: Block, rows: slice) -> Block:
    return Block(
        block.trials, block.numbers[rows], block.values[rows], block.seeds[rows], block.duration,
        block.limit,
    )  # fmt: skip
