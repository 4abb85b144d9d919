"""How kernels are compiled: one decorator for the CPU, one plain twin for symbolic tracing.

A *kernel* is a function over arrays that writes into arrays the caller provides, allocates
nothing and touches no Python object. The same source is compiled by Numba and, through
:func:`uncompiled`, runs over object arrays of symbols.
"""

from __future__ import annotations

import importlib
import os
import types
import warnings
from collections.abc import Callable, Mapping
from functools import cache, cached_property, partial, update_wrapper
from typing import TYPE_CHECKING, Any, TypeVar

import numba
from numba import njit
from numba.extending import typeof_impl

from heelstrike.compiler.documented_numba import OPTIONS, DocumentedNumba
from heelstrike.compiler.fingerprint import is_ours as is_ours

if TYPE_CHECKING:
    from heelstrike.compiler.bundle_type import Fixed

Function = TypeVar("Function", bound=Callable[..., Any])

SWITCH = "HEELSTRIKE_DOCUMENTED_NUMBA"
"""Set to 1 in the environment, it has kernels compiled by Numba's documented names only."""

CompileError = (numba.errors.NumbaError, RuntimeError, TypeError)
"""What compiling a function raises that cannot be compiled."""


class CompilerWarning(UserWarning):
    """The internals of this Numba are not known here: compiling takes longer."""


@cache
def numba_in_use() -> DocumentedNumba:
    """Return the way to compile: the quick one if it works with the Numba that is installed."""
    if os.environ.get(SWITCH, "") not in ("", "0"):
        return DocumentedNumba()
    try:
        private = importlib.import_module("heelstrike.compiler.private_numba").PrivateNumba()
        private.test()
    except Exception as error:
        warnings.warn(
            f"heelstrike does not know the internals of Numba {numba.__version__}: kernels take "
            f"about twice as long to compile. Results are the same. ({error!r})",
            CompilerWarning,
            stacklevel=2,
        )
        return DocumentedNumba()
    made: DocumentedNumba = private
    return made


class Kernel:
    """A function that is compiled on demand, as part of other kernels or to be called from Python.

    Compiled code that calls it takes it in; only a call from Python makes machine code of its own,
    which is kept on disk.
    """

    def __init__(
        self, function: Callable[..., Any], *, dissolved: bool = False, rare: bool = False
    ) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._called = False
        self.dissolved = dissolved
        self.rare = rare

    def __reduce__(self) -> str | tuple[Any, ...]:
        """Copies and pickles are the one of that name: so Numba knows loops that enclose it."""
        if "<locals>" in self.py_func.__qualname__:
            return Kernel, (self.py_func,), {"dissolved": self.dissolved, "rare": self.rare}
        return self.py_func.__qualname__

    @cached_property
    def part(self) -> Any:
        """What Numba takes it for where another kernel names it."""
        return numba_in_use().part(self.py_func, dissolved=self.dissolved, rare=self.rare)

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        """Bind it to the bundle whose method it is."""
        return self if instance is None else partial(self, instance)

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        if self._called:
            return self._callable(*arguments)
        result = numba_in_use().compile(lambda: self._callable(*arguments))
        self._called = True
        return result

    @cached_property
    def _callable(self) -> Any:
        return numba_in_use().kept(self.py_func)


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


def rare_kernel(function: Function) -> Function:
    """Turn a function into a :class:`Kernel` that stays out of those that call it.

    For kernels that most steps do without: what a loop has taken in takes registers and room in the
    instruction cache from what it does always.
    """
    compiled: Any = Kernel(function, rare=True)
    result: Function = compiled
    return result


def within_bounds(function: Any) -> Any:
    """Compile a function of somebody's to be called by kernels, its indices checked.

    What Numba has compiled already stays as it is.
    """
    if _is_compiled(function):
        return function
    return njit(**OPTIONS, boundscheck=True)(function)


@typeof_impl.register(Kernel)
def _typeof_kernel(value: Kernel, _: Any) -> Any:
    return numba.typeof(value.part)


def compiled_for(signature: Any, function: Function) -> Function:
    """Compile a kernel at once for the given Numba signature, or load its machine code.

    Parameters
    ----------
    signature : numba signature
        Types of the result and the arguments.
    function : callable
        The kernel.
    """
    compiled = numba_in_use().kept(function)
    numba_in_use().compile(lambda: compiled.compile(signature))
    compiled.disable_compile()
    result: Function = compiled
    return result


def loop_for(signature: Any, function: Function, fixed: Fixed = ()) -> Function:
    """Compile a kernel like :func:`compiled_for`, to be called without a look at its arguments.

    Only for loops whose arguments this package makes: anything but the right types crashes.

    Parameters
    ----------
    signature : numba signature
        Types of the result and the arguments.
    function : callable
        The kernel.
    fixed : tuple of str and int
        Extents and whole numbers that are these in all bundles that it will be called with. They
        are put in last: loops that differ in them alone are but one until they are optimised.
    """
    entry: Any
    entry, _ = numba_in_use().loop(signature, function, fixed, addressed=False)
    loop: Function = entry
    return loop


class AddressedLoop:
    """A loop like those of :func:`loop_for`, which other compiled code can call, too.

    Parameters
    ----------
    signature : numba signature
        Types of the result, an integer, and of the arguments.
    function : callable
        The kernel.
    fixed : tuple of str and int
        As those of :func:`loop_for`.
    """

    def __init__(self, signature: Any, function: Callable[..., int], fixed: Fixed = ()) -> None:
        self.call, self._find = numba_in_use().loop(signature, function, fixed, addressed=True)

    @cached_property
    def address(self) -> int:
        """Where its machine code is, for :func:`~heelstrike.compiler.separate_kernel.call_at`.

        What is raised in it is not seen by those who call it so.
        """
        return self._find()


def uncompiled(
    function: Function, replace: Mapping[Any, Any] | None = None, *,
    ours: Callable[[Any], Any] | None = None,
) -> Function:  # fmt: skip
    """Return the plain Python twin of a kernel, and of every kernel it calls.

    Parameters
    ----------
    function : kernel
        A function decorated with :func:`kernel`, or a plain one that calls kernels.
    replace : mapping of function to function, optional
        What the twins call instead, for example ``{math.sin: casadi.sin}``.
    ours : callable, optional
        ``ours(kernel)`` returns what the twins call in the place of a kernel of this package.
    """
    return _twin(function, {id(old): new for old, new in (replace or {}).items()}, ours, {})


def _twin(
    function: Any, replace: dict[int, Any], ours: Callable[[Any], Any] | None,
    twins: dict[int, Any],
) -> Any:  # fmt: skip
    source = function.py_func if _is_compiled(function) else function
    if id(source) in twins:
        return twins[id(source)]
    scope = dict(source.__globals__)
    cells = [types.CellType(cell.cell_contents) for cell in source.__closure__ or ()]
    twin = types.FunctionType(
        source.__code__, scope, source.__name__, source.__defaults__, tuple(cells)
    )
    twins[id(source)] = twin

    def other(value: Any) -> Any:
        if id(value) in replace:
            return replace[id(value)]
        if ours is not None and isinstance(value, Kernel) and is_ours(value.py_func):
            return ours(value)
        return _twin(value, replace, ours, twins) if _is_compiled(value) else value

    for name in source.__code__.co_names:
        if name in scope:
            scope[name] = other(scope[name])
    for cell in cells:
        cell.cell_contents = other(cell.cell_contents)
    return twin


def _is_compiled(value: Any) -> bool:
    """Whether it is a kernel, or a function compiled by Numba."""
    return hasattr(value, "py_func")
