"""What a kernel is made of, as a fingerprint: machine code is good while that stays the same.

Functions and classes are followed through what they name: the kernels they call, the constants
they read, in whatever file those are. Their bytecode counts; docstrings, comments, line numbers and
whatever else stands in their files do not. Of a module, and of an object whose making nobody can
follow, all counts that its module defines.
"""

from __future__ import annotations

import enum
import functools
import hashlib
import inspect
import sys
import types
from collections.abc import Mapping
from typing import Any

import llvmlite
import numba
import numpy as np

_PACKAGE = __name__.split(".")[0]
_BY_VERSION = {"numpy", "numba", "llvmlite"} | sys.stdlib_module_names
"""Packages that count with their version, which is in every fingerprint."""

_VERSIONS = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, np.__version__)
_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic, np.dtype)
_METHOD = (types.FunctionType, classmethod, staticmethod)
# A package may lie anywhere, and the words of a module are for people.
_NOT_OF_CODE = {"__file__", "__path__", "__cached__", "__doc__"}
# The other flags say nothing that bytecode does not; Numba clears some of what a profiler sees run.
_CALLED_WITH = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS | inspect.CO_GENERATOR
_HAS_DOCSTRING = 0x4000000  # since Python 3.13


def fingerprint(*parts: Any) -> str:
    """Return the fingerprint of kernels, functions, classes, constants and modules."""
    return fingerprint_after((), *parts)


def fingerprint_after(before: tuple[Any, ...], *parts: Any) -> str:
    """Return the fingerprint of some parts and more, of which the first are looked at once.

    They are many, and the same for all kernels. What they are made of must not change.
    """
    account = _account(before).copy()
    account.add_parts(parts)
    return account.digest()


@functools.lru_cache(8)
def _account(parts: tuple[Any, ...]) -> _Account:
    account = _Account()
    account.add_parts(parts)
    return account


def is_ours(function: Any) -> bool:
    """Whether a function belongs to this package."""
    return _root(getattr(function, "__module__", None) or "") == _PACKAGE


class _Account:
    """Everything that was found, each thing once, in the order in which it was met."""

    def __init__(self) -> None:
        self._digest = hashlib.sha256(repr(_VERSIONS).encode())
        self._known: dict[Any, tuple[int, Any]] = {}  # objects are kept: their ids must stay theirs

    def digest(self) -> str:
        return self._digest.hexdigest()

    def copy(self) -> _Account:
        """Return another that goes on from here."""
        other = _Account()
        other._digest, other._known = self._digest.copy(), self._known.copy()
        return other

    def add_parts(self, parts: tuple[Any, ...]) -> None:
        """Add parts; of a module, what it defines."""
        for part in parts:
            if isinstance(part, types.ModuleType):
                self.add_module(part.__name__)
            else:
                self.add(part)

    def add(self, value: Any) -> None:
        """Add a value that is known by a name."""
        if isinstance(value, _PLAIN):
            self._write(type(value).__name__, value)
        elif isinstance(value, tuple | frozenset):  # what lists hold may change, and shapes nothing
            self._write(type(value).__qualname__, len(value))
            for item in sorted(value, key=repr) if isinstance(value, frozenset) else value:
                self.add(item)
        elif isinstance(value, enum.Enum):
            self._write(type(value).__qualname__, value.name, repr(value.value))
        elif isinstance(value, enum.EnumType):
            members: dict[str, Any] = dict(value.__members__)
            self._write(value.__qualname__, {name: item.value for name, item in members.items()})
        elif isinstance(value, np.ndarray):
            self._write("array", value.dtype.str, value.shape)
            self._digest.update(value.tobytes())
        elif isinstance(value, types.ModuleType):
            self._write("module", value.__name__)
        elif hasattr(value, "py_func"):  # a kernel, or a function compiled by Numba
            options = getattr(value, "targetoptions", None) or {}
            placed = getattr(value, "dissolved", False), getattr(value, "rare", False)
            self._write(*placed, sorted(map(repr, options.items())))
            self.add_function(value.py_func)
        elif isinstance(value, types.FunctionType):
            self.add_function(value)
        elif isinstance(value, type):
            self.add_class(value)
        elif (function := _wrapped(value)) is not None:  # a method, a property, an intrinsic
            self._write(type(value).__qualname__)
            self.add(function)
        elif isinstance(value, Mapping) and self._is_new(id(value), value):
            self._write(type(value).__qualname__, len(value))
            for key, item in value.items():
                self.add(key)
                self.add(item)
        else:  # an object: what it does stands in its module
            home = getattr(value, "__module__", None) or type(value).__module__
            named = (getattr(value, name, None) for name in ("__qualname__", "__name__"))
            self._write(home, type(value).__qualname__, *map(str, named))
            self.add_module(home)

    def add_module(self, name: str) -> None:
        """Add what a module defines."""
        self._write("module", name)
        if _root(name) in _BY_VERSION or name not in sys.modules or not self._is_new(name, name):
            return
        for member, value in sorted(vars(sys.modules[name]).items()):
            own = isinstance(value, _PLAIN) or getattr(value, "__module__", None) == name
            if own and not member.startswith("__"):
                self._write(member)
                self.add(value)

    def add_class(self, kind: type) -> None:
        """Add what a class is made of: its bases, and all that it defines."""
        self._write("class", kind.__module__, kind.__qualname__)
        if _root(kind.__module__) in _BY_VERSION or not self._is_new(kind, kind):
            return
        self.add(kind.__bases__)
        for name, member in sorted(vars(kind).items()):
            # Python keeps its own notes in a class, of other kinds and some of them later.
            if not name.startswith("__") or isinstance(member, _METHOD):
                self._write(name)
                self.add(member)

    def add_function(self, function: types.FunctionType) -> None:
        """Add what a function computes: its bytecode, and all that it names."""
        if _root(function.__module__ or "") in _BY_VERSION:
            self._write(function.__module__, function.__qualname__)
            return
        if not self._is_new(id(function), function):
            return
        self._add_code(function.__code__, function.__globals__)
        for cell in function.__closure__ or ():
            self.add(cell.cell_contents)
        self.add(function.__defaults__)
        self.add(tuple(sorted((function.__kwdefaults__ or {}).items())))

    def _add_code(self, code: types.CodeType, scope: dict[str, Any]) -> None:
        self._write(
            code.co_name, code.co_code, code.co_names, code.co_varnames, code.co_freevars,
            code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount,
            code.co_flags & _CALLED_WITH, code.co_exceptiontable,
        )  # fmt: skip
        for constant in code.co_consts[_begins_with_docstring(code) :]:
            if isinstance(constant, types.CodeType):
                self._add_code(constant, scope)
            else:
                self.add(constant)
        for name in code.co_names:
            if name in scope and name not in _NOT_OF_CODE:
                self._write(name)
                self._add_named(scope[name], code.co_names)

    def _add_named(self, value: Any, names: tuple[str, ...]) -> None:
        """Add a value, and of a module what might be read from it."""
        self.add(value)
        if isinstance(value, types.ModuleType) and _root(value.__name__) not in _BY_VERSION:
            for name in names:
                member = vars(value).get(name)
                if (
                    name in vars(value)
                    and name not in _NOT_OF_CODE
                    and self._is_new((value.__name__, name), member)
                ):
                    self._write(name)
                    self._add_named(member, names)

    def _is_new(self, key: Any, value: Any) -> bool:
        if key in self._known:
            self._write("known", self._known[key][0])
            return False
        self._known[key] = (len(self._known), value)
        return True

    def _write(self, *parts: Any) -> None:
        self._digest.update(repr(parts).encode())


def _begins_with_docstring(code: types.CodeType) -> bool:
    """Whether the first constant of a function is its docstring."""
    if sys.version_info >= (3, 13):
        return bool(code.co_flags & _HAS_DOCSTRING)
    # Functions have a docstring there or None, and comprehensions whatever comes first.
    return code.co_name[0] != "<" and isinstance(next(iter(code.co_consts), None), str)


def _wrapped(value: Any) -> Any:
    """Return the functions that something is a wrapper of, or None."""
    if isinstance(value, property):
        return (value.fget, value.fset)
    if isinstance(value, functools.cached_property):
        return value.func
    return getattr(value, "__wrapped__", None)


def _root(module: str) -> str:
    return module.split(".")[0]
