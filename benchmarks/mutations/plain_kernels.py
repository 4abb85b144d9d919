"""Every kernel as plain Python: nothing is compiled, and a tracer sees every line.

A pytest plugin for the mutation campaign (``-p plain_kernels``). It must be loaded before anything
of heelstrike is. Loops, kernels compiled apart and straight-line programs become the twins of
:func:`heelstrike.compiler.compilation.uncompiled`; in place of addresses stand numbers under which
they are kept here. A step of a biped takes a millisecond or more, and an index out of range is an
error.
"""

from __future__ import annotations

import ctypes
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


def _compiled_for(signature: Any, function: Any, **options: Any) -> Any:
    del signature, options
    return _twin(function)


compilation.compiled_for = _compiled_for
compilation.loop_for = _compiled_for  # type: ignore[assignment]
compilation.is_kept = lambda *_, **__: True
compilation.Kernel.__call__ = lambda self, *arguments: _twin(self)(*arguments)  # type: ignore

from heelstrike import separate_kernel  # noqa: E402


def _finish(self: Any) -> Any:
    self._place[0] = _number(self._function)
    return _twin(self._function)


separate_kernel.SeparateKernel.begin = lambda _: None  # type: ignore[method-assign]
separate_kernel.SeparateKernel.finish = _finish  # type: ignore[method-assign]
separate_kernel.call_at = _call

from heelstrike.compiler import straight_line  # noqa: E402

straight_line.play = _call

from heelstrike.contact.solvers import elimination  # noqa: E402


def _eliminations() -> tuple[int, ...]:
    """Its programs know their size, the kernel takes it from its arguments."""
    kernel = _twin(elimination.eliminate)

    def of_size(n: int) -> Callable[..., None]:
        return lambda matrix, x, pivot: kernel(matrix[: n * (n + 1) // 2], x[:n], pivot[:n])

    first = len(_by_number)
    _by_number.extend(of_size(n) for n in range(1, elimination.LARGEST + 1))
    return tuple(range(first, len(_by_number)))


elimination._programs = _eliminations

from heelstrike.sim import programs  # noqa: E402
from heelstrike.sim.controller import guard  # noqa: E402


def _word_at(array: np.ndarray, place: int) -> int:
    return ctypes.c_int64.from_address(array.ctypes.data + 8 * int(place)).value


guard.word_at = _word_at


def _programs(model: Any, points: Sequence[int]) -> np.ndarray:
    found = np.zeros(len(programs.KERNELS), dtype=np.int64)
    if 0 < len(model.parent) <= programs.MOST_COORDINATES:
        count = len(programs.KERNELS) if len(points) > 0 else programs.DELASSUS
        found[:count] = [_number(kernel) for kernel in programs.KERNELS[:count]]
    return found


programs._programs = _programs
