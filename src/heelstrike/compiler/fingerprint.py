"""What a kernel is made of, as a fingerprint: machine code is good while that stays the same.

Kernels are followed through what they name: the kernels they call, the constants they read, in
whatever file those are. Their bytecode counts, their docstrings, comments and line numbers do not.
Python that shapes machine code without being compiled itself, such as what records straight-line
code, counts with the whole text of its file and with all that the file names.
"""

from __future__ import annotations

import enum
import hashlib
import os
import sys
import types
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np

_PACKAGE = __name__.split(".")[0]
_BY_VERSION = {"numpy", "numba", "llvmlite"} | sys.stdlib_module_names
"""Packages that count with their version, which is in every fingerprint."""

_VERSIONS = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, np.__version__)
_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic, np.dtype)


def fingerprint(*parts: Any) -> str:
    """Return the fingerprint of kernels, constants, modules of Python and files.

    Parameters
    ----------
    *parts : kernel, function, constant, module or Path
        A function counts as a kernel does, a module with its text and all that it names, a file
        with its text.
    """
    account = _Account()
    for part in parts:
        if isinstance(part, types.ModuleType):
            account.add_module(part.__name__)
        elif isinstance(part, Path):
            account.add(_text(str(part)))
        elif isinstance(part, types.FunctionType):
            account.add_function(part)
        else:
            account.add(part)
    return account.digest()


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

    def add(self, value: Any) -> None:
        """Add a value that is known by a name."""
        if isinstance(value, _PLAIN):
            self._write(type(value).__name__, value)
        elif isinstance(value, tuple | frozenset):
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
            self._write(getattr(value, "dissolved", False), sorted(map(repr, options.items())))
            self.add_function(value.py_func)
        elif isinstance(value, types.FunctionType):
            self.add_function(value)
            self.add_module(value.__module__ or "")
        else:  # a class, an intrinsic, an object: what it does stands in its module
            home = getattr(value, "__module__", None) or type(value).__module__
            named = (getattr(value, name, None) for name in ("__qualname__", "__name__"))
            self._write(home, type(value).__qualname__, *map(str, named))
            self.add_module(home)

    def add_module(self, name: str) -> None:
        """Add the text of a module, and what it names if it belongs to this package."""
        if _root(name) in _BY_VERSION or not self._is_new(name, name):
            return
        module = sys.modules.get(name)
        self._write("module", name)
        self._digest.update(_text(getattr(module, "__file__", None) or ""))
        if _root(name) == _PACKAGE:
            for member, value in sorted(vars(module).items()):
                if member.startswith("__"):
                    continue
                self._write(member)
                if isinstance(value, types.ModuleType):
                    self.add_module(value.__name__)
                else:
                    self.add(value)

    def add_function(self, function: types.FunctionType) -> None:
        """Add what a function computes: its bytecode, and all that it names."""
        if not self._is_new(id(function), function):
            return
        self._add_code(function.__code__, function.__doc__, function.__globals__)
        for cell in function.__closure__ or ():
            self.add(cell.cell_contents)
        self.add(function.__defaults__)
        self.add(tuple(sorted((function.__kwdefaults__ or {}).items())))

    def _add_code(self, code: types.CodeType, doc: str | None, scope: dict[str, Any]) -> None:
        self._write(
            code.co_name, code.co_code, code.co_names, code.co_varnames, code.co_freevars,
            code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags,
            code.co_exceptiontable,
        )  # fmt: skip
        for place, constant in enumerate(code.co_consts):
            if isinstance(constant, types.CodeType):
                self._add_code(constant, None, scope)
            elif place > 0 or doc is None or constant != doc:
                self.add(constant)
        for name in code.co_names:
            if name in scope:
                self._write(name)
                self._add_named(scope[name], code.co_names)

    def _add_named(self, value: Any, names: tuple[str, ...]) -> None:
        """Add a value, and of a module what might be read from it."""
        self.add(value)
        if isinstance(value, types.ModuleType) and _root(value.__name__) not in _BY_VERSION:
            for name in names:
                member = vars(value).get(name)
                if name in vars(value) and self._is_new((value.__name__, name), member):
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


def _root(module: str) -> str:
    return module.split(".")[0]


@cache
def _text(file: str) -> bytes:
    try:
        return Path(file).read_bytes()
    except OSError:  # typed at a prompt, or in no language that could be read
        return os.urandom(16)  # good for this process only
