"""How kernels are compiled: one decorator for the CPU, one plain twin for symbolic tracing.

A *kernel* is a function over arrays that writes into arrays the caller provides, allocates
nothing and touches no Python object. The same source is compiled by Numba and, through
:func:`uncompiled`, runs over object arrays of symbols.
"""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit
from numba.core.caching import FunctionCache
from numba.core.registry import CPUDispatcher

Function = TypeVar("Function", bound=Callable[..., Any])


_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

# Packages whose sources end up in machine code.
_COMPILED = ("robot", "dynamics", "contact", "sim", "control", "analysis")


@lru_cache(maxsize=1)
def _sources() -> str:
    """Fingerprint of all sources that kernels are made of."""
    home = Path(__file__).parent
    files = [Path(__file__)]
    for package in _COMPILED:
        files += sorted((home / package).rglob("*.py"))
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


class _PackageCache(FunctionCache):
    """Machine code on disk that is good for exactly these sources.

    Numba looks at the file of a kernel only, and would go on using yesterday's machine code of a
    kernel whose callee in another file has changed.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        index = self._cache_file
        index._source_stamp = (_sources(), index._source_stamp)


def _kept_on_disk(compiled: Any) -> Any:
    try:
        compiled._cache = _PackageCache(compiled.py_func)
    except AttributeError:  # a Numba that keeps its books differently
        compiled.enable_caching()
    return compiled


def kernel(function: Function) -> Function:
    """Compile a kernel for the CPU, with its machine code cached on disk.

    Division by zero follows IEEE 754 instead of raising, and the GIL is released.
    """
    compiled: Function = _kept_on_disk(njit(**_OPTIONS)(function))
    return compiled


def inner_kernel(function: Function) -> Function:
    """Compile a kernel that only other kernels call.

    Without the wrappers that convert Python arguments it compiles much faster, the more so the
    more arrays it takes; in return Python cannot call it.
    """
    options = _OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    compiled: Function = _kept_on_disk(njit(**options)(function))
    return compiled


def compiled_for(signature: Any, function: Function, *, address: bool = False) -> Function:
    """Compile a kernel at once for the given Numba signature, or load its machine code.

    Parameters
    ----------
    signature : numba signature
        Types of the result and the arguments.
    function : callable
        The kernel.
    address : bool
        Whether its address is needed, to pass it as an argument to other kernels.
    """
    options = _OPTIONS | {"no_cfunc_wrapper": not address}
    compiled = _kept_on_disk(njit(**options)(function))
    compiled.compile(signature)
    compiled.disable_compile()
    result: Function = compiled
    return result


def type_of(value: Any) -> Any:
    """Return the Numba type of an example value."""
    return numba.typeof(value)  # type: ignore[no-untyped-call]


def uncompiled(function: Function, replace: Mapping[str, Any] | None = None) -> Function:
    """Return the plain Python twin of a kernel, and of every kernel it calls.

    Parameters
    ----------
    function : kernel
        A function decorated with :func:`kernel`, or a plain one that calls kernels.
    replace : mapping of str to object, optional
        Global names to replace in all twins, for example ``{"sin": casadi.sin}``.
    """
    twins: dict[int, Any] = {}
    return _twin(function, dict(replace or {}), twins)


def _twin(function: Any, replace: dict[str, Any], twins: dict[int, Any]) -> Any:
    source = function.py_func if isinstance(function, CPUDispatcher) else function
    if id(source) in twins:
        return twins[id(source)]
    scope = dict(source.__globals__)
    twin = types.FunctionType(
        source.__code__, scope, source.__name__, source.__defaults__, source.__closure__
    )
    twins[id(source)] = twin
    for name in source.__code__.co_names:
        if name in replace:
            scope[name] = replace[name]
        elif isinstance(scope.get(name), CPUDispatcher):
            scope[name] = _twin(scope[name], replace, twins)
    return twin
