"""Numba made quicker to start, and at compiling many small kernels."""

from __future__ import annotations

import gc
import importlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from numba import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.types.functions import BaseFunction
from numba.np import linalg

_PLAIN = (types.Number, types.Boolean, types.Array, types.UniTuple)


def load_numba() -> None:
    """Load what Numba compiles with, but not SciPy's linear algebra.

    Numba would load that, which takes as long as all the rest, only to see whether it is there.
    This package requires SciPy. A kernel that needs it still loads it.
    """
    ensure_blas = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = ensure_blas


@contextmanager
def quick_compiling() -> Iterator[None]:
    """Compile quicker while the context lasts."""
    with ExitStack() as stack:
        stack.enter_context(global_compiler_lock)  # one thread at a time, as Numba compiles anyway
        load_numba()
        stack.enter_context(_remembered_typings())
        stack.enter_context(_no_garbage_collection())
        yield


@contextmanager
def _remembered_typings() -> Iterator[None]:
    """Remember what built-in functions return for plain arguments.

    For every ``a + b`` in a kernel Numba asks each of the many things that ``+`` can mean in turn,
    and compares all its compiler settings to do so. Within one compilation the answer for numbers
    and arrays of numbers is always the same; here it is asked for once.
    """
    functions: Any = BaseFunction
    ask = functions.get_call_type
    answers: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(isinstance(argument, _PLAIN) for argument in args):
            return ask(self, context, args, kws)
        key = (self, context, tuple(args))
        if key not in answers:
            answers[key] = ask(self, context, args, kws)
        return answers[key]

    functions.get_call_type = get_call_type
    try:
        yield
    finally:
        functions.get_call_type = ask


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Spare the collector the compiler's many live objects, through which it would go often."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
