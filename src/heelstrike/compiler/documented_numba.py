"""Numba by the names that it documents: what every version of it can do.

:mod:`heelstrike.compiler.private_numba` does the same in half the time.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from numba import cfunc, config, njit
from numba.extending import intrinsic, overload_attribute, overload_method

from heelstrike.compiler import kept_code
from heelstrike.compiler.fingerprint import fingerprint_after
from heelstrike.interruption import kept_interrupts

Result = TypeVar("Result")

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""Division by zero follows IEEE 754 instead of raising, and the GIL is released."""

_SETTINGS = ("LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT")
"""Settings of Numba (``NUMBA_BOUNDSCHECK`` and so on) that shape machine code, beside its level."""

_alive: list[Any] = []
"""Functions whose addresses are known: they hold the code."""

_directory = threading.RLock()
"""Held while Numba has other settings than usual."""


class DocumentedNumba:
    """How functions become machine code, and where that is kept."""

    shaping: tuple[str, ...] = ("heelstrike.compiler.bundle_type", __name__)
    """Modules that shape the machine code of every kernel."""

    level: int = 1
    """Highest level of optimisation; ``NUMBA_OPT`` may be less.

    Every kernel is optimised again in each that calls it: that costs time.
    """

    def made_of(self, function: Callable[..., Any]) -> str:
        """Return the fingerprint of a kernel and of what compiles it."""
        shaping = tuple(map(import_module, self.shaping))
        return fingerprint_after((*self.settings(), *shaping), function)

    def settings(self) -> list[str]:
        """Return what Numba is set to: code for a profiler is beside that for others."""
        return [str(self._level()), *(str(getattr(config, name, None)) for name in _SETTINGS)]

    def declare(self, kind: Any) -> None:
        """Have compiled code find the members and methods of a type of bundles.

        By documented names every member that is read is a function, which has to be compiled.
        """
        with suppress(ImportError, AttributeError):
            import_module("heelstrike.compiler.private_members")
            return
        for name in (*kind.members, *kind.extents):
            overload_attribute(type(kind), name)(_reading(kind, name))
        for name in dir(kind.cls):
            if kind.method(name) is not None:
                overload_method(type(kind), name)(_calling(kind.method(name)))

    def part(self, function: Callable[..., Any], *, dissolved: bool, rare: bool) -> Any:  # noqa: ARG002
        """Return a kernel as the kernels that call it know it."""
        return njit(**OPTIONS)(function)

    def kept(self, function: Callable[..., Any], *, boundscheck: bool = False) -> Any:
        """Return a function that is compiled when it is called, and kept on disk."""
        return self._kept(njit, function, "njit", boundscheck)

    def compile(self, call: Callable[[], Result]) -> Result:
        """Make a call that compiles something."""
        settings: Any = config
        with kept_interrupts(), no_garbage_collection(), _directory:
            usual, settings.OPT = settings.OPT, self._level()
            try:
                return call()
            except OSError as error:  # it is compiled, but could not be kept
                kept_code.say_nowhere([str(error)])
                return call()
            finally:
                settings.OPT = usual

    def _level(self) -> Any:
        settings: Any = config
        return type(settings.OPT)(
            min(settings.OPT, self.level)
        )  # an integer that Numba asks questions

    def loop(
        self,
        signature: Any,
        function: Callable[..., Any],
        fixed: Any,  # noqa: ARG002
        *,
        addressed: bool,  # noqa: ARG002
    ) -> tuple[Callable[..., Any], Callable[[], int]]:
        """Return what may be called with arguments of exactly the right types, and its address.

        By documented names nothing can be put in that is `fixed`; without it code is larger. Its
        address is that of another compilation, when it is asked for.
        """
        compiled = self.kept(function)
        self.compile(lambda: compiled.compile(signature))
        compiled.disable_compile()
        return compiled, lambda: self.separate(signature, function)[1]

    def separate(
        self, signature: Any, function: Callable[..., Any], *, boundscheck: bool = False
    ) -> tuple[Any, int]:
        """Compile a function for the C calling convention; return it and its address.

        What is returned is compiled once more if it is called in another way.
        """
        decorator = partial(cfunc, signature)
        made = self.compile(lambda: self._kept(decorator, function, "cfunc", boundscheck))
        _alive.append(made)
        return self.kept(function, boundscheck=boundscheck), int(made.address)

    def is_kept(self, signature: Any, function: Callable[..., Any]) -> bool:  # noqa: ARG002
        """Whether :meth:`separate` would find machine code, or has no disk to look on."""
        place = self._place(function, "cfunc", False)
        return place is None or any(place.rglob("*.nbc"))

    def _kept(self, decorator: Any, function: Any, kind: str, boundscheck: bool) -> Any:
        """Have Numba keep a function in a directory of what it is made of.

        Numba looks at the function's own file only, and would go on using the machine code of a
        kernel whose callee in another file has changed.
        """
        settings: Any = config
        options = OPTIONS | {"boundscheck": boundscheck or None}
        place = self._place(function, kind, boundscheck)
        if place is None:
            return decorator(**options)(function)
        with _directory:
            usual, settings.CACHE_DIR = settings.CACHE_DIR, str(place)
            try:
                return decorator(cache=True, **options)(function)
            except RuntimeError:  # Numba finds no file that the function stands in
                return decorator(**options)(function)
            except OSError as error:  # a full disk
                kept_code.say_nowhere([str(error)])
                return decorator(**options)(function)
            finally:
                settings.CACHE_DIR = usual

    def _place(self, function: Callable[..., Any], kind: str, boundscheck: bool) -> Path | None:
        source = Path(function.__code__.co_filename)
        place = kept_code.first_writable(
            kept_code.directories(source if source.is_file() else None)
        )
        return (
            place
            and place / f"{function.__name__}.{kind}{boundscheck:d}.{self.made_of(function)[:32]}"
        )


def _reading(kind: Any, name: str) -> Callable[..., Any]:
    def define(context: Any, bundle: Any) -> Any:
        del context, bundle

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            del signature
            return kind.read(context, builder, values[0], name)

        return kind.member(name)(kind), generate

    read: Any = intrinsic(define)
    return lambda bundle: lambda bundle: read(bundle)  # noqa: ARG005


def _calling(method: Any) -> Callable[..., Any]:
    return lambda bundle, *arguments: (  # noqa: ARG005
        lambda bundle, *arguments: method(bundle, *arguments)
    )


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Spare the collector the compiler's many live objects, through which it would go often."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
