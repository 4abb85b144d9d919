"""Workers beyond own threads: processes, and those of clusters."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

from heelstrike.errors import SimulationError

DEATHS = ("BrokenExecutor", "KilledWorker", "UncompletedJobError")
"""Errors by which executors of Python, Dask and submitit say that a worker died of its work."""

SURE = ("KilledWorker",)
"""Those raised after several workers died of the same work."""

CANCELLED = ("CANCELLED", "PREEMPTED", "NODE_FAIL", "BOOT_FAIL", "REVOKED")
"""States of jobs of SLURM that somebody else ended, or a machine; submitit calls them uncompleted,
as it does those that die."""

LOST = ("OSError", "CancelledError")
"""Errors by which executors say that nobody works any more, as when a scheduler of Dask has ended
and its connection is closed."""


def is_death(error: BaseException) -> bool:
    """Whether an error says that a worker died, of whatever executor; none need be installed.

    Parameters
    ----------
    error : BaseException
        What ``result()`` raised.
    """
    return _is_called(error, DEATHS)


def is_sure(error: BaseException) -> bool:
    """Whether an error says that several workers died of the same work.

    Parameters
    ----------
    error : BaseException
        What ``result()`` raised.
    """
    return _is_called(error, SURE)


def was_cancelled(work: Any) -> bool:
    """Whether a job that did not complete was ended by somebody, and not by its own work.

    Parameters
    ----------
    work : Any
        What an executor returned for it; those of submitit have the ``state`` of their job.
    """
    return str(getattr(work, "state", "")).startswith(CANCELLED)


def is_lost(error: BaseException) -> bool:
    """Whether an error says that nobody is there any more who would work.

    Parameters
    ----------
    error : BaseException
        What ``submit()`` or ``result()`` raised.
    """
    return _is_called(error, LOST)


def _is_called(error: BaseException, names: tuple[str, ...]) -> bool:
    return any(kind.__name__ in names for kind in type(error).__mro__)


def process_pool(processes: int) -> Callable[[], ProcessPoolExecutor]:
    """Return a maker of pools of processes, for :meth:`~heelstrike.Campaign.run`.

    Parameters
    ----------
    processes : int
        How many each has. They are started again, not copied: threads of this process do no harm.
    """
    context = multiprocessing.get_context("spawn")
    return partial(ProcessPoolExecutor, processes, mp_context=context)


def dask_client(address: str) -> Any:
    """Return the client of a Dask scheduler.

    Raises
    ------
    SimulationError
        If Dask is not installed, or nobody answers at the address.
    """
    try:
        from distributed import Client  # type: ignore[import-not-found]
    except ImportError as error:
        raise SimulationError(
            "a scheduler needs Dask: pip install distributed, here and for its workers"
        ) from error
    try:
        return Client(address)
    except (OSError, ValueError) as error:
        raise SimulationError(f"no Dask scheduler answers at {address}: {error}") from error
