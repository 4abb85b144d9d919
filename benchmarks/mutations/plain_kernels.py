"""Every kernel as plain Python: nothing is compiled, and a tracer sees every line.

A pytest plugin for the mutation campaign (``-p plain_kernels``). It must be loaded before anything
of heelstrike is. Loops, kernels compiled apart and straight-line programs become the twins of
:func:`heelstrike.compiler.compilation.uncompiled`; in place of addresses stand numbers under which
they are kept here. A step of a biped takes a millisecond or more, and an index out of range is an
error. Programs that differentiate stay machine code: what they record of kernels is as it was when
they were first made.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import heelstrike.compiler.compilation as compilation

if "heelstrike.compiler.separate_kernel" in __import__("sys").modules:
    raise RuntimeError("load plain_kernels before heelstrike: pytest -p plain_kernels")

_by_number: list[Callable[..., Any]] = [lambda *_: None]
_numbers: dict[Any, int] = {}
_twins: dict[Any, Callable[..., Any]] = {}


def _twin(function: Any) -> Callable[..., Any]:
    source = getattr(function, "py_func", function)
    if source not in _twins:
        _twins[source] = compilation.uncompiled(function)
    return _twins[source]


def _number(function: Any) -> int:
    source = getattr(function, "py_func", function)
    if source not in _numbers:
        _numbers[source] = len(_by_number)
        _by_number.append(_twin(function))
    return _numbers[source]


def _call(number: int, arguments: tuple[Any, ...]) -> Any:
    return _by_number[int(number)](*arguments)


def _compiled_for(signature: Any, function: Any, *fixed: Any, **options: Any) -> Any:
    del signature, fixed, options
    return _twin(function)


import heelstrike.compiler.bundle as bundles  # noqa: E402
from heelstrike.compiler import bundle_type, words  # noqa: E402

_by_address: weakref.WeakValueDictionary[int, Any] = weakref.WeakValueDictionary()
_make_table = bundles.Bundle._new_table


def _new_table(self: Any) -> Any:
    table = _make_table(self)
    _by_address[table.ctypes.data] = self
    return table


def _copy_words(source: np.ndarray, target: np.ndarray) -> None:
    """Copy an array into another, as far as both go."""
    count = min(source.size, target.size)
    target.reshape(-1)[:count] = source.reshape(-1)[:count]


def _word_at(array: np.ndarray, place: int) -> int:
    return ctypes.c_int64.from_address(array.ctypes.data + 8 * int(place)).value


def _copy_between(source: int, target: int, count: int) -> None:
    ctypes.memmove(int(target), int(source), 8 * int(count))


def _keep_value(function: Any, place: np.ndarray) -> None:
    place[0] = _by_number.index(function)


bundles.Bundle._new_table = _new_table  # type: ignore[method-assign]
words.copy_words = _copy_words
words.word_at = _word_at
words.copy_between = _copy_between
words.word_from = lambda address: ctypes.c_int64.from_address(int(address)).value
words.keep_value = _keep_value
words.kept_value = lambda _: lambda place: _by_number[int(place[0])]
bundle_type.address_of = lambda bundle: bundle.address
bundle_type.bundle_at = lambda _: lambda address: _by_address[int(address)]

compilation.compiled_for = _compiled_for
compilation.loop_for = _compiled_for  # type: ignore[assignment]


class _AddressedLoop:
    """A loop in Python; by its address it is called with the addresses of its bundles."""

    def __init__(self, signature: Any, function: Any, fixed: Any = ()) -> None:
        del signature, fixed
        self.call = twin = _twin(function)
        self.address = len(_by_number)
        _by_number.append(lambda *places: twin(*(_by_address[int(place)] for place in places)))


compilation.AddressedLoop = _AddressedLoop  # type: ignore[assignment,misc]
compilation.Kernel.__call__ = lambda self, *arguments: _twin(self)(*arguments)  # type: ignore

from heelstrike.compiler import mold, separate_kernel  # noqa: E402

_cast_quietly = mold._cast


def _cast(*arguments: Any) -> Any:
    made = _cast_quietly(*arguments)
    _by_address[made.address] = made
    return made


mold._cast = _cast


def _finish(self: Any) -> Any:
    self._place[0] = _number(self._function)
    return _twin(self._function)


separate_kernel.SeparateKernel.begin = lambda _: None  # type: ignore[method-assign]
separate_kernel.SeparateKernel.finish = _finish  # type: ignore[method-assign]
separate_kernel.call_at = separate_kernel.measure_at = _call

from heelstrike.compiler import straight_line  # noqa: E402

straight_line.play = _call


def _recorded(program: Any) -> int:
    """Straight-line code knows the sizes of its arrays, the kernel takes them as they are."""
    kernel = _twin(program.kernel)
    sizes = [
        len(given) if isinstance(given, np.ndarray) and given.ndim == 1 else None
        for given in program.arguments.values()
    ]

    def run(*arguments: Any) -> None:
        pairs = zip(arguments, sizes, strict=True)
        kernel(*(given if size is None else given[:size] for given, size in pairs))

    _by_number.append(run)
    return len(_by_number) - 1


_machine_code = straight_line.straight_line_code


def _differentiated(program: Any, known: Any) -> int:
    """Derivatives are found on the tape alone: such a program stays machine code."""
    (address,) = _machine_code([program], known)
    parameters = [ctypes.c_void_p] * len(program.arguments)
    function = ctypes.CFUNCTYPE(None, *parameters)(address)

    def run(*arguments: Any) -> None:
        function(*(a.ctypes.data if isinstance(a, np.ndarray) else a.address for a in arguments))

    _by_number.append(run)
    return len(_by_number) - 1


def _straight_line_code(programs: Sequence[Any], known: Any = None) -> tuple[int, ...]:
    return tuple(
        _differentiated(program, known) if program.derivatives else _recorded(program)
        for program in programs
    )


straight_line.straight_line_code = _straight_line_code
