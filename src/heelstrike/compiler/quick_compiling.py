"""Numba made quicker to start, and at compiling many small kernels."""

from __future__ import annotations

import gc
import importlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from numba import types
from numba.core import ir
from numba.core.base import BaseContext
from numba.core.compiler_lock import global_compiler_lock
from numba.core.types.functions import BaseFunction
from numba.np import linalg

from heelstrike.interruption import kept_interrupts

_PLAIN = (types.Number, types.Boolean, types.Array, types.SliceType, types.NoneType)


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


_WITHOUT_VARIABLES = (str, int, bool, type(None), ir.Loc)


@contextmanager
def quick_compiling() -> Iterator[None]:
    """Compile quicker while the context lasts."""
    with ExitStack() as stack:
        # Machine code is handed over in a callback of LLVM's, which swallows what Ctrl-C raises.
        stack.enter_context(kept_interrupts())
        stack.enter_context(global_compiler_lock)  # one thread at a time, as Numba compiles anyway
        stack.enter_context(_remembered_typings())
        stack.enter_context(_arrays_as_they_are())
        stack.enter_context(_variables_listed_quickly())
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
        if kws or not all(_is_plain(argument) for argument in args):
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


def _is_plain(kind: Any) -> bool:
    members = kind.types if isinstance(kind, types.Tuple | types.UniTuple) else (kind,)
    return all(isinstance(member, _PLAIN) for member in members)


@contextmanager
def _arrays_as_they_are() -> Iterator[None]:
    """Do not ask how arrays become arrays.

    Wherever an array is touched, Numba looks in vain for a conversion from array to array, loads
    all its registries again, and looks once more.
    """
    contexts: Any = BaseContext
    ask = contexts.get_function

    def get_function(self: Any, function: Any, signature: Any, *rest: Any, **more: Any) -> Any:
        if function == "__array__" and type(signature.args[0]) is types.Array:
            raise NotImplementedError
        return ask(self, function, signature, *rest, **more)

    contexts.get_function = get_function
    try:
        yield
    finally:
        contexts.get_function = ask


@contextmanager
def _variables_listed_quickly() -> Iterator[None]:
    """List the variables of an instruction without a call for every word and number in it."""
    instructions: Any = ir.Inst
    ask = instructions._rec_list_vars

    def variables(self: Any, value: Any) -> list[Any]:
        if type(value) is not dict:
            found: list[Any] = ask(self, value)
            return found
        found = []
        for part in value.values():
            if type(part) is ir.Var:
                found.append(part)
            elif type(part) not in _WITHOUT_VARIABLES:
                found += ask(self, part)
        return found

    instructions._rec_list_vars = variables
    try:
        yield
    finally:
        instructions._rec_list_vars = ask


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
