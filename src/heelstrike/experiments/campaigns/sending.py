"""Blocks on their way to workers elsewhere, so that errors of both ends are told from theirs.

The trials of a campaign are pickled once, when the first block goes, and go as bytes. A worker
reads them when the first block comes and keeps them for the next. What it cannot read, it says in
its answer: an error that comes instead of an answer is one of the executor. Threads of this process
take trials as they are.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from typing import Any

from heelstrike.analysis.stability.trial import Trial
from heelstrike.errors import SimulationError
from heelstrike.experiments.campaigns.outcome import Outcome
from heelstrike.experiments.campaigns.trials import Block, run_block
from heelstrike.field_texts import dataclass


@dataclass(frozen=True, eq=False)
class SentBlock:
    """A block whose trials are bytes."""

    trials: bytes
    """Pickled trials, by their names."""
    block: Block
    """All else of it."""


@dataclass(frozen=True)
class Unread:
    """The answer of a worker that cannot read what it was sent."""

    reason: str


def work_on(sent: SentBlock) -> list[Outcome] | Unread:
    """Read the trials of a block, unless they have been read, and simulate them.

    Parameters
    ----------
    sent : SentBlock
        The block.
    """
    try:
        trials = _read(sent.trials)
    except Exception as error:
        return Unread(f"{type(error).__name__}: {error}")
    return run_block(replace(sent.block, trials=trials))


@lru_cache(maxsize=1)
def _read(content: bytes) -> Mapping[str, Trial]:
    found: Mapping[str, Trial] = pickle.loads(content)
    return found


class Elsewhere:
    """An executor that works on blocks of one campaign.

    Parameters
    ----------
    executor : object with ``submit(function, argument)``
        Who works.
    trials : callable
        Makes the trials of the campaign bytes, as :func:`packed` does, or returns those it made.
    """

    def __init__(self, executor: Any, trials: Callable[[], bytes]) -> None:
        self._executor, self._trials = executor, trials

    def submit(self, block: Block) -> Any:
        """Send a block; return what has its ``result()``, which :func:`outcomes_of` looks at."""
        if isinstance(self._executor, ThreadPoolExecutor):
            return self._executor.submit(run_block, block)
        sent = SentBlock(self._trials(), replace(block, trials={}))
        return self._executor.submit(work_on, sent)

    def shutdown(self) -> None:
        """End the executor."""
        self._executor.shutdown()


def packed(trials: Mapping[str, Trial]) -> bytes:
    """Pickle the trials of a campaign.

    Raises
    ------
    SimulationError
        If they cannot be pickled.
    """
    dumps: Any = pickle.dumps
    with suppress(ImportError):  # that of Dask and submitit lets classes of a notebook go along
        dumps = import_module("cloudpickle").dumps
    try:
        found: bytes = dumps(dict(trials))
    except Exception as error:
        raise SimulationError(
            f"the trials cannot be sent to workers: {type(error).__name__}: {error}. Write their "
            "controllers into a module, and give them attributes that pickle takes"
        ) from error
    return found


def outcomes_of(answer: list[Outcome] | Unread) -> list[Outcome]:
    """Return the outcomes in the answer of a worker.

    Raises
    ------
    SimulationError
        If it could not read what it was sent.
    """
    if isinstance(answer, Unread):
        raise SimulationError(
            f"a worker cannot read the trials: {answer.reason}. Install and copy what they need "
            "to where the workers run. What was finished is kept; the same command goes on"
        )
    return answer
