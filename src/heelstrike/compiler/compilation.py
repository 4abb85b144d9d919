"""How kernels are compiled: one decorator for the CPU, one plain twin for symbolic tracing.

A *kernel* is a function over arrays that writes into arrays the caller provides, allocates
nothing and touches no Python object. The same source is compiled by Numba and, through
:func:`uncompiled`, runs over object arrays of symbols.
"""

from __future__ import annotations

import hashlib
import pickle
import re
import sys
import types
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache, partial, update_wrapper
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from heelstrike.compiler.fingerprint import fingerprint, is_ours
from heelstrike.compiler.kept_code import can_write, directories, read, write
from heelstrike.compiler.linking import InnerKernelCompiler
from heelstrike.compiler.quick_compiling import load_numba, quick_compiling

Function = TypeVar("Function", bound=Callable[..., Any])


CompileError = (NumbaError, RuntimeError, TypeError)
"""What compiling a function raises that cannot be compiled."""

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

_COMPILER = tuple(
    Path(__file__).with_name(f"{name}.py")
    for name in ("compilation", "linking", "quick_compiling", "bundle")
)
"""What shapes the machine code of every kernel."""

_SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT")
"""Settings of Numba (``NUMBA_OPT`` and so on) that do so, too."""


def made_of(function: Callable[..., Any]) -> str:
    """Return the fingerprint of a kernel and of what compiles it."""
    settings = (str(getattr(numba.config, name, None)) for name in _SETTINGS)
    return fingerprint(function, *settings, *_COMPILER)


class _PackageCache(NullCache):
    """Machine code on disk that is good for exactly what the kernel is made of.

    Numba's own cache looks at the file of a kernel only: it would go on using yesterday's machine
    code of a kernel whose callee in another file has changed, compile anew for the sake of a
    comment, and take damaged files for good.
    """

    def __init__(self, compiled: Any) -> None:
        function = compiled.py_func
        source = Path(function.__code__.co_filename)
        # To load machine code Numba imports the module by its name.
        has_module = function.__module__ in sys.modules
        self.places = directories(source if source.is_file() else None) if has_module else []
        self._made_of = made_of(function)
        self._options = sorted(compiled.targetoptions.items())
        self._is_ours = is_ours(function)
        self._name = re.sub("[<>]", "", f"{function.__module__}.{function.__qualname__}")
        self._twin = "" if self._is_ours else _twin_of(function)

    @property
    def cache_path(self) -> str:
        """Where machine code is kept if that can be written."""
        return str(self.places[0]) if self.places else ""

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Load machine code, if there is some.

        Numba first loads all that it could compile with, which takes as long as to import it. What
        kernels of this package need to run is the bare runtime.
        """
        load_numba()
        if self._is_ours:
            rtsys.initialize(context)
        else:
            context.refresh()
        found = self.read(signature, context.codegen())
        if found is None:
            return None
        try:
            parts = pickle.loads(found)
        except (AttributeError, ImportError):  # it calls kernels of modules that are not here now
            return None
        return CompileResult._rebuild(context, *parts)

    def read(self, signature: Any, codegen: Any) -> bytes | None:
        """Return what is kept for a signature, if there is something."""
        return read(self.places, *self._name_and_key(signature, codegen))

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep machine code, unless it is good for this process only."""
        if result.library.has_dynamic_globals or any(not loop.can_cache for loop in result.lifted):
            return
        name, key = self._name_and_key(signature, result.codegen)
        write(self.places, name, key, dumps(result._reduce()))

    def _name_and_key(self, signature: Any, codegen: Any) -> tuple[str, bytes]:
        """Name of the file, which the next version of the kernel takes over, and what it is for."""
        kind = repr((signature, self._options, codegen.magic_tuple(), self._twin))
        place = hashlib.sha256(kind.encode()).hexdigest()[:16]
        name = f"{self._name}.{place}.{sys.implementation.cache_tag}.machine_code"
        return name, hashlib.sha256(f"{self._made_of} {kind}".encode()).digest()


def _twin_of(function: Any) -> str:
    """Tell functions of one name apart: where they stand, and what they enclose."""
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    return fingerprint(function.__code__.co_firstlineno, *cells)


def _kept_on_disk(compiled: Any) -> Any:
    compiled._cache = _PackageCache(compiled)
    return compiled


class Kernel:
    """A function that is compiled on demand, as part of other kernels or to be called from Python.

    Compiled code that calls it takes it in (:mod:`heelstrike.compiler.linking`); only a call from
    Python makes machine code of its own, which is kept on disk.
    """

    def __init__(self, function: Callable[..., Any], *, dissolved: bool = False) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._called = False
        self.dissolved = dissolved

    @cached_property
    def _part(self) -> Any:
        """The kernel as part of others; it allocates nothing and so counts no references."""
        options = _OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
        options["forceinline"] = self.dissolved
        return njit(**options, pipeline_class=InnerKernelCompiler)(self.py_func)

    @property
    def _numba_type_(self) -> Any:
        """What Numba takes it for where another kernel names it."""
        return type_of(self._part)

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        """Bind it to the bundle whose method it is."""
        return self if instance is None else partial(self, instance)

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


def within_bounds(function: Any) -> Any:
    """Compile a function of somebody's to be called by kernels, its indices checked.

    What Numba has compiled already stays as it is.
    """
    if _is_compiled(function):
        return function
    return njit(**_OPTIONS, boundscheck=True)(function)


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
    cache: _PackageCache = compiled._cache
    found = cache.read(signature, compiled.targetctx.codegen())
    return found is not None or not can_write(cache.places)


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
