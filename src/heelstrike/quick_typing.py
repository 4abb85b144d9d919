"""Numba made quicker at finding out the types of arithmetic.

For every ``a + b`` in a kernel Numba asks each of the many things that ``+`` can mean in turn, and
compares all its compiler settings to do so. Within one compilation the answer for numbers and
arrays of numbers is always the same; here it is asked for once.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.types.functions import BaseFunction

_PLAIN = (types.Number, types.Boolean, types.Array, types.UniTuple)


@contextmanager
def remembered_typings() -> Iterator[None]:
    """Remember what built-in functions return for plain arguments, while the context lasts.

    Other threads wait to compile until then.
    """
    functions: Any = BaseFunction
    answers: dict[Any, Any] = {}
    with global_compiler_lock:
        ask = functions.get_call_type

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
