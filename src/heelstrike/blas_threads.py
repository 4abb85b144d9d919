"""Linear algebra in one thread, where its matrices are small.

OpenBLAS divides products from about 64 x 64 x 64 on between threads, which wait for more in a busy
loop. Where many small products follow each other, that occupies all processors and saves no time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import RLock
from typing import Any

_ONE_THREAD_LIMITS = RLock()
"""What thread of Python limits the libraries: they are of the whole process."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let all libraries of linear algebra that are loaded use one thread, until the block ends.

    A block that another thread begins meanwhile changes nothing: what it would put back at its end
    might be one thread.
    """
    if not _ONE_THREAD_LIMITS.acquire(blocking=False):
        yield
        return
    try:
        with _threadpools().threadpool_limits(1, user_api="blas"):
            yield
    finally:
        _ONE_THREAD_LIMITS.release()


@cache
def _threadpools() -> Any:
    """Return threadpoolctl, which knows the library of CasADi by its name."""
    import threadpoolctl

    class CasadiBlas(threadpoolctl.OpenBLASController):  # type: ignore[misc]
        """OpenBLAS in CasADi's wheels, which IPOPT's linear solver calls."""

        filename_prefixes = ("libcasadi-tp-openblas",)

    threadpoolctl.register(CasadiBlas)
    return threadpoolctl
