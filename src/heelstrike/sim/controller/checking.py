"""A law in Python, every index looked at.

The law and the functions of its author run in Python, where NumPy looks at every index. NumPy names
no array; so what it refuses is done once more, with arrays that know what they are called.

A query of this package is looked at index by index when it is asked with such sizes and whole
numbers for the first time: its indices follow from these. Asked likewise again it runs compiled,
unless it is asked too seldom for that to pay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property, partial
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import uncompiled
from heelstrike.compiler.straight_line import is_code
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Integers
from heelstrike.sim.controller.robot import ControlledRobot

SCRATCH = ("kinematics.acceleration", "kinematics.force", "kinematics.composite")
"""Of the state, what queries write to."""

FREE = ("robot", "memory", "log", "torque")
"""What a law may write to."""

SELDOM = 50
"""Calls of a query that are not worth compiling it."""

Arrays = Callable[[str, Any, bool], Any]
"""``arrays(name, array, writable)`` returns the array as a law is shown it."""

Queries = Callable[[Any], Callable[..., Any]]
"""What a kernel of a bundle is called as."""


class CheckedCall:
    """A law, called with arrays that are looked after.

    Parameters
    ----------
    name : str
        Of the law.
    function : callable
        What it is in Python.
    names : iterable of str
        Its arguments.
    given : dict of str to array or Bundle
        What they are, but for the time.
    kept : (n,) int
        Words of its memory and log.
    repeats : bool
        Whether it may be called twice at an instant: not if it asks an object in Python.
    """

    def __init__(
        self, name: str, function: Any, names: Iterable[str], given: dict[str, Any],
        kept: Integers, *, repeats: bool,
    ) -> None:  # fmt: skip
        self._name, self._function, self._names = name, function, list(names)
        self._given, self._kept, self._repeats = given, kept, repeats
        self._queries: dict[Any, _Query] = {}
        self._call: Any = uncompiled(function, ours=self._query)
        self._shown = self._all_shown(_plain, self._query)

    def __call__(self, t: Any) -> None:
        """Call it at a time (s).

        Raises
        ------
        ControllerError
            If it reads or writes beyond an array, or writes to one not its own.
        """
        torque = self._given["torque"]
        before = self._kept.copy(), torque.copy()
        shown = self._shown
        refused: Exception
        try:
            self._call(*[t if name == "t" else shown[name] for name in self._names])
            return
        except (IndexError, ValueError) as error:
            if not self._repeats:
                raise
            refused = error
        self._kept[:], torque[:] = before
        self._call_by_name(t)
        raise refused

    def _call_by_name(self, t: Any) -> None:
        """Call it with arrays that say what they are when they refuse something."""
        shown = self._all_shown(partial(_named, self._name), uncompiled) | {"t": t}
        uncompiled(self._function)(*(shown[name] for name in self._names))

    def _query(self, kernel: Any) -> _Query:
        return self._queries.setdefault(kernel, _Query(kernel))

    def _all_shown(self, arrays: Arrays, queries: Queries) -> dict[str, Any]:
        return {
            name: _shown(name, value, arrays, queries)
            if isinstance(value, Bundle)
            else arrays(name, value, name in FREE)
            for name, value in self._given.items()
        }


class _Query:
    """A kernel, in Python where it is asked something new, and compiled otherwise."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self._known: set[Any] = set()
        self._calls = 0

    @cached_property
    def _python(self) -> Any:
        # Straight-line code looks at no index: in its place the kernel does the same in Python.
        return uncompiled(self._kernel, replace={is_code: lambda _: False})

    def __call__(self, *arguments: Any) -> Any:
        question = _what_indices_follow_from(arguments)
        self._calls += 1
        if self._calls > SELDOM and question in self._known:
            return self._kernel(*arguments)
        result = self._python(*arguments)
        self._known.add(question)
        return result


def _what_indices_follow_from(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return sizes of arrays, whether they may be written, whole numbers, and which bundles."""
    return tuple(
        [
            (each.shape, each.flags.writeable)
            if isinstance(each, np.ndarray)
            else id(each)
            if isinstance(each, Bundle)
            else None
            if isinstance(each, _NO_INDICES)
            else each
            for each in arguments
        ]
    )


_NO_INDICES = (float, tuple)


def _shown(name: str, bundle: Bundle, arrays: Arrays, queries: Queries) -> Bundle:
    """Return a bundle as a law is shown it."""
    members: dict[str, Any] = bundle.members()
    if isinstance(bundle, ControlledRobot):
        model = members["model"]
        members["model"] = model.stored(
            lambda part, array: arrays(f"{name}.model.{part}", array, False)
        )
    copy = type(bundle)(**members)
    copy.__dict__["_cells"] = bundle.__dict__["_cells"]
    free = name in FREE
    shown = copy.stored(
        lambda part, array: arrays(f"{name}.{part}", array, free or part in SCRATCH)
    )
    _ask_by(queries, shown)
    return shown


def _ask_by(queries: Queries, bundle: Bundle) -> None:
    """Have the kernels of a bundle, and of its parts, called in another way."""
    kind = type(bundle)
    for name in dir(kind):
        kernel = getattr(kind, name)
        if hasattr(kernel, "py_func"):
            bundle.__dict__[name] = partial(queries(kernel), bundle)
    for name, member in kind.declared.items():
        if member.role == "part":
            _ask_by(queries, getattr(bundle, name))


def _plain(name: str, array: Any, writable: bool) -> Any:  # noqa: ARG001
    shown = array.view()
    shown.flags.writeable = writable
    return shown


class _Shown(np.ndarray[Any, np.dtype[Any]]):
    """An array that knows what it is called, and who uses it."""

    name = ""
    controller = ""

    def __array_finalize__(self, other: Any) -> None:
        self.name = getattr(other, "name", "")
        self.controller = getattr(other, "controller", "")

    def __getitem__(self, index: Any) -> Any:
        try:
            part = super().__getitem__(index)
        except IndexError:
            raise self._beyond("reads", index) from None
        if isinstance(part, _Shown):
            part.name = f"{self.name}[{_text(index)}]"
        return part

    def __setitem__(self, index: Any, value: Any) -> None:
        if not self.flags.writeable:
            raise ControllerError(
                f"controller {self.controller!r} writes to {self.name}[{_text(index)}]: it may "
                f"write only to torque, memory, log and robot.estimate"
            )
        try:
            super().__setitem__(index, value)
        except IndexError:
            raise self._beyond("writes to", index) from None

    def _beyond(self, does: str, index: Any) -> ControllerError:
        return ControllerError(
            f"controller {self.controller!r} {does} {self.name}[{_text(index)}], beyond its shape "
            f"{self.shape}"
        )


def _named(controller: str, name: str, array: Any, writable: bool) -> Any:
    shown = np.asarray(array).view(_Shown)
    shown.name = name
    shown.controller = controller
    shown.flags.writeable = writable
    return shown


def _text(index: Any) -> str:
    """Write an index as in Python."""
    if isinstance(index, tuple):
        return ", ".join(_text(part) for part in index)
    if isinstance(index, slice):
        ends = ("" if end is None else str(end) for end in (index.start, index.stop))
        return ":".join(ends)
    return str(index)
