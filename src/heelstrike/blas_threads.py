"""Linear algebra in one thread, where its matrices are small.

OpenBLAS divides products from about 64 x 64 x 64 on between threads, which wait for more in a busy
loop. Where many small products follow each other, that occupies all processors and saves no time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let all libraries of linear algebra that are loaded use one thread, until the block ends."""
    with _threadpools().threadpool_limits(1, user_api="blas"):
        yield


@cache
def _threadpools() -> Any:
    """Return threadpoolctl, which knows the library of CasADi by its name."""
    import threadpoolctl

    class CasadiBlas(threadpoolctl.OpenBLASController):  # type: ignore[misc]
        """OpenBLAS in CasADi's wheels, which IPOPT's linear solver calls."""

        filename_prefixes = ("libcasadi-tp-openblas",)

    threadpoolctl.register(CasadiBlas)
    return threadpoolctl
