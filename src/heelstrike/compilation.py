"""How kernels are compiled: one decorator for the CPU, one plain twin for symbolic tracing.

A *kernel* is a function over arrays that writes into arrays the caller provides, allocates
nothing and touches no Python object. The same source is compiled by Numba and, through
:func:`uncompiled`, runs over object arrays of symbols.
"""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache, update_wrapper
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba import njit
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.core.runtime.nrt import rtsys

from heelstrike.linking import InnerKernelCompiler
from heelstrike.quick_compiling import load_numba, quick_compiling

Function = TypeVar("Function", bound=Callable[..., Any])


_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

# Packages whose sources end up in machine code.
_COMPILED = ("robot", "dynamics", "contact", "sim", "control", "analysis")


@lru_cache(maxsize=1)
def source_fingerprint() -> str:
    """Fingerprint of all sources that kernels are made of."""
    home = Path(__file__).parent
    files = sorted(home.glob("*.py"))
    for package in _COMPILED:
        files += sorted((home / package).rglob("*.py"))
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


def cache_directory() -> Path:
    """Return the directory in which machine code is kept.

    Raises
    ------
    RuntimeError
        If there is no place to write.
    """
    return Path(FunctionCache(source_fingerprint.__wrapped__).cache_path)


class _PackageCache(FunctionCache):
    """Machine code on disk that is good for exactly these sources.

    Numba looks at the file of a kernel only, and would go on using yesterday's machine code of a
    kernel whose callee in another file has changed.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        index = self._cache_file
        index._source_stamp = (source_fingerprint(), _what_it_names(function), index._source_stamp)
        self._is_ours = _is_ours(function)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Load machine code, if there is some.

        Numba first loads all that it could compile with, which takes as long as to import it. What
        kernels of this package need to run is the bare runtime.
        """
        load_numba()
        if self._is_ours:
            rtsys.initialize(context)
            with self._guard_against_spurious_io_errors():
                found = self._load_overload(signature, context)
            if found is not None:
                return found
        return super().load_overload(signature, context)


def _is_ours(function: Callable[..., Any]) -> bool:
    """Whether a function belongs to this package."""
    return (function.__module__ or "").split(".")[0] == __name__.split(".")[0]


def _what_it_names(function: Callable[..., Any]) -> str:
    """Fingerprint of the kernels and constants that a function of a user takes in by name.

    They may be in other files than the function.
    """
    digest = hashlib.sha256()
    found: list[Any] = [function]
    for one in found:  # grows as it goes
        if _is_ours(one):
            continue
        names = one.__code__.co_names
        modules = [one.__globals__.get(name) for name in names]
        scopes = [one.__globals__, *(vars(m) for m in modules if isinstance(m, types.ModuleType))]
        for name, scope in ((name, scope) for name in names for scope in scopes):
            value = scope.get(name)
            inner = getattr(value, "py_func", None)
            if inner is not None and inner not in found:
                found.append(inner)
                code = inner.__code__
                digest.update(repr((name, code.co_code, code.co_names)).encode())
                digest.update(
                    repr([c for c in code.co_consts if not isinstance(c, types.CodeType)]).encode()
                )
            elif isinstance(value, bool | int | float | complex | str | tuple):
                digest.update(repr((name, value)).encode())
            elif isinstance(value, np.ndarray):
                digest.update(repr((name, value.dtype, value.shape)).encode() + value.tobytes())
    return digest.hexdigest()


def _kept_on_disk(compiled: Any) -> Any:
    try:
        compiled._cache = _PackageCache(compiled.py_func)
    except AttributeError:  # a Numba that keeps its books differently
        compiled.enable_caching()
    except RuntimeError:  # typed at a prompt, or no place to write: compiled anew every time
        pass
    return compiled


class Kernel:
    """A function that is compiled on demand, as part of other kernels or to be called from Python.

    Compiled code that calls it takes it in (:mod:`heelstrike.linking`); only a call from Python
    makes machine code of its own, which is kept on disk.
    """

    def __init__(self, function: Callable[..., Any], *, dissolved: bool = False) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._called = False
        self._dissolved = dissolved

    @cached_property
    def _part(self) -> Any:
        """The kernel as part of others; it allocates nothing and so counts no references."""
        options = _OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
        options["forceinline"] = self._dissolved
        return njit(**options, pipeline_class=InnerKernelCompiler)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        """What Numba takes it for where another kernel names it."""
        return type_of(self._part)

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        if self._called:
            return self._callable(*arguments)
        with quick_compiling():
            result = self._callable(*arguments)
        self._called = True
        return result

    @cached_property
    def _callable(self) -> Any:
        return _kept_on_disk(njit(**_OPTIONS)(self.py_func))


def kernel(function: Function) -> Function:
    """Turn a function into a :class:`Kernel`.

    Division by zero follows IEEE 754 instead of raising, and the GIL is released.
    """
    compiled: Any = Kernel(function)
    result: Function = compiled
    return result


def dissolved_kernel(function: Function) -> Function:
    """Turn a function into a :class:`Kernel` that dissolves in those that call it.

    For kernels of the innermost loop with one caller: arrays passed by value cost as much as a
    small kernel does.
    """
    compiled: Any = Kernel(function, dissolved=True)
    result: Function = compiled
    return result


def compiled_for(
    signature: Any, function: Function, *, address: bool = False, boundscheck: bool = False
) -> Function:
    """Compile a kernel at once for the given Numba signature, or load its machine code.

    Parameters
    ----------
    signature : numba signature
        Types of the result and the arguments.
    function : callable
        The kernel.
    address : bool
        Whether its address is needed, to pass it as an argument to other kernels.
    boundscheck : bool
        Whether an index beyond an array raises IndexError.
    """
    compiled = _with_cache(function, address, boundscheck)
    with quick_compiling():
        compiled.compile(signature)
    compiled.disable_compile()
    if address:
        known = _KnownResult(compiled.get_compile_result(signature))
        compiled.get_compile_result = lambda _: known
    result: Function = compiled
    return result


def _with_cache(function: Function, address: bool, boundscheck: bool = False) -> Any:
    options = _OPTIONS | {"no_cfunc_wrapper": not address}
    if boundscheck:
        options["boundscheck"] = True
    return _kept_on_disk(njit(**options)(function))


def is_kept(signature: Any, function: Callable[..., Any], *, address: bool = False) -> bool:
    """Whether :func:`compiled_for` would find machine code on disk, or has no disk to look on."""
    compiled = _with_cache(function, address)
    if not isinstance(compiled._cache, _PackageCache):
        return True
    key = compiled._cache._index_key(signature, compiled.targetctx.codegen())
    return key in compiled._cache._cache_file._load_index()


def loop_for(signature: Any, function: Function) -> Function:
    """Compile a kernel like :func:`compiled_for`, to be called without a look at its arguments.

    Numba compares the types of a hundred arrays with those it compiled for, at every call. Only for
    loops whose arguments this package makes: anything but the right types crashes.
    """
    compiled: Any = compiled_for(signature, function)
    entry: Function = compiled.overloads[tuple(signature.args)].entry_point
    return entry


class _KnownResult:
    """A compiled function that remembers where its machine code is.

    Numba asks twice, and takes 0.2 ms to answer, each time that the function is an argument.
    """

    def __init__(self, result: Any) -> None:
        self.fndesc = result.fndesc
        self.signature = result.signature
        self.library = _KnownLibrary(result.library)


class _KnownLibrary:
    def __init__(self, library: Any) -> None:
        self._library = library
        self.get_pointer_to_function = lru_cache(library.get_pointer_to_function)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name)


def type_of(value: Any) -> Any:
    """Return the Numba type of an example value."""
    return numba.typeof(value)


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
    source = function.py_func if _is_compiled(function) else function
    if id(source) in twins:
        return twins[id(source)]
    scope = dict(source.__globals__)
    cells = [types.CellType(cell.cell_contents) for cell in source.__closure__ or ()]
    twin = types.FunctionType(
        source.__code__, scope, source.__name__, source.__defaults__, tuple(cells)
    )
    twins[id(source)] = twin
    for name in source.__code__.co_names:
        if name in replace:
            scope[name] = replace[name]
        elif _is_compiled(scope.get(name)):
            scope[name] = _twin(scope[name], replace, twins)
    for cell in cells:
        if _is_compiled(cell.cell_contents):
            cell.cell_contents = _twin(cell.cell_contents, replace, twins)
    return twin


def _is_compiled(value: Any) -> bool:
    return isinstance(value, Kernel | Dispatcher)
