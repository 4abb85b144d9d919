"""Workers beyond own threads: processes, and the workers of a Dask cluster."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

from heelstrike.errors import SimulationError


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
