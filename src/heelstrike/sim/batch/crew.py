"""Threads that work on the lanes of a batch, each on those that are its own."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait


class Crew:
    """So many threads; with one, the work is done by the thread that asks for it.

    Parameters
    ----------
    threads : int
        How many.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0

    def work(self, task: Callable[[int], None]) -> None:
        """Do ``task(thread)`` in every thread, and wait for all; raise what the first raised."""
        if self.threads == 1:
            task(0)
            return
        if self._pool is None or self._process != os.getpid():  # threads do not survive a fork
            self._pool = ThreadPoolExecutor(self.threads, thread_name_prefix="heelstrike")
            self._process = os.getpid()
        futures = [self._pool.submit(task, thread) for thread in range(self.threads)]
        wait(futures)
        for future in futures:
            future.result()

    def close(self) -> None:
        """Let the threads go."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown(wait=False)
        self._pool = None
