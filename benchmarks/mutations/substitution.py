"""Another function in place of one that is there already, wherever it is."""

from __future__ import annotations

import gc
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

import numpy as np


def exchange(path: Path, old: str, new: str, line: int) -> bool:
    """Let a function do what it does in another text of its module.

    All that runs the function's code changes: methods, kernels, and the plain twins of kernels.

    Parameters
    ----------
    path : Path
        File from which the module was imported.
    old, new : str
        Its text, and the text that it could have.
    line : int
        First line of the function, decorators included, or of one that is defined in it.

    Returns
    -------
    bool
        Whether that was possible: not for what happens when the module is imported, such as its
        constants and the defaults of arguments.
    """
    before = _outermost(compile(old, str(path), "exec"), line)
    if before is None:
        return False
    after = _outermost(compile(new, str(path), "exec"), before.co_firstlineno)
    if after is None or after.co_freevars != before.co_freevars or _same(before, after):
        return False
    functions = [
        function
        for function in gc.get_objects()
        if isinstance(function, FunctionType) and _is_code(function.__code__, before)
    ]
    for function in functions:
        function.__code__ = after
    return bool(functions)


def _is_code(code: CodeType, wanted: CodeType) -> bool:
    return (
        code.co_firstlineno == wanted.co_firstlineno
        and code.co_qualname == wanted.co_qualname
        and code.co_filename == wanted.co_filename
    )


def _same(first: CodeType, second: CodeType) -> bool:
    return first.replace(co_linetable=b"") == second.replace(co_linetable=b"")


def _functions(code: CodeType) -> Iterator[CodeType]:
    """Functions and methods of a module, not those that are defined in functions."""
    for part in code.co_consts:
        if isinstance(part, CodeType):
            if part.co_flags & inspect.CO_NEWLOCALS and part.co_flags & inspect.CO_OPTIMIZED:
                yield part
            else:
                yield from _functions(part)


def _lines(code: CodeType) -> Iterator[int]:
    """First lines of a function and of those defined in it."""
    yield code.co_firstlineno
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _lines(part)


def _outermost(module: CodeType, line: int) -> CodeType | None:
    """The function of a module that begins at a line, or in which one does."""
    return next((code for code in _functions(module) if line in _lines(code)), None)


PLAIN = (bool, int, float, str, tuple, list, dict, np.ndarray)


def exchange_constants(module: ModuleType, new: str) -> bool:
    """Give a module the constants that it would have with another text.

    Wherever a module took them by name, they change; not where they went into something else when
    it was imported.

    Returns
    -------
    bool
        Whether there was one that differs.
    """
    fresh = {"__name__": module.__name__, "__file__": module.__file__}
    exec(compile(new, str(module.__file__), "exec"), fresh)
    changed = {
        name: (old, fresh[name])
        for name, old in vars(module).items()
        if type(old) in PLAIN and name in fresh and not name.startswith("__")
        if not _equal(old, fresh[name])
    }
    scopes = {id(f.__globals__): f.__globals__ for f in gc.get_objects() if type(f) is FunctionType}
    scopes[id(vars(module))] = vars(module)
    for scope in scopes.values():
        for name, (old, value) in changed.items():
            if scope.get(name) is old:
                scope[name] = value
    return bool(changed)


def _equal(first: object, second: object) -> bool:
    if isinstance(first, np.ndarray):
        return np.array_equal(first, second)  # type: ignore[arg-type]
    return repr(first) == repr(second)
