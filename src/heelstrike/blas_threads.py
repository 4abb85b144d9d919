"""Linear algebra in one thread, where its matrices are small.

OpenBLAS divides products from about 64 x 64 x 64 on between threads, which wait for more in a busy
loop. Where many small products follow each other, that occupies all processors and saves no time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any

_LOCK = Lock()
_USERS: list[Any] = []
"""Limits of all blocks that have begun since there was none; each knows what was before it."""
_RUNNING = 0


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let all libraries of linear algebra that are loaded use one thread, until the block ends.

    Where blocks of several threads overlap, until the last of them ends.
    """
    global _RUNNING
    with _LOCK:
        _USERS.append(_threadpools().threadpool_limits(1, user_api="blas"))
        _RUNNING += 1
    try:
        yield
    finally:
        with _LOCK:
            _RUNNING -= 1
            while not _RUNNING and _USERS:
                _USERS.pop().restore_original_limits()


@cache
def _threadpools() -> Any:
    """Return threadpoolctl, which knows the library of CasADi by its name."""
    import threadpoolctl

    class CasadiBlas(threadpoolctl.OpenBLASController):  # type: ignore[misc]
        """OpenBLAS in CasADi's wheels, which IPOPT's linear solver calls."""

        filename_prefixes = ("libcasadi-tp-openblas",)

    threadpoolctl.register(CasadiBlas)
    return threadpoolctl
