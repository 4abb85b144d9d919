"""Numba by the names that it documents: what every version of it can do.

:mod:`heelstrike.compiler.private_numba` does the same in half the time.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from numba import cfunc, config, njit

from heelstrike.compiler import bundle, kept_code
from heelstrike.compiler.fingerprint import fingerprint
from heelstrike.interruption import kept_interrupts

Result = TypeVar("Result")

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
"""Division by zero follows IEEE 754 instead of raising, and the GIL is released."""

_SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT")
"""Settings of Numba (``NUMBA_OPT`` and so on) that shape machine code."""

_alive: list[Any] = []
"""Functions whose addresses are known: they hold the code."""

_directory = threading.RLock()
"""Held while Numba is told where to keep what."""


class DocumentedNumba:
    """How functions become machine code, and where that is kept."""

    shaping: tuple[ModuleType, ...] = (bundle,)
    """Modules that shape the machine code of every kernel."""

    def made_of(self, function: Callable[..., Any]) -> str:
        """Return the fingerprint of a kernel and of what compiles it."""
        settings = (str(getattr(config, name, None)) for name in _SETTINGS)
        return fingerprint(function, *settings, *self.shaping)

    def part(self, function: Callable[..., Any], *, dissolved: bool) -> Any:  # noqa: ARG002
        """Return a kernel as the kernels that call it know it."""
        return njit(**OPTIONS)(function)

    def kept(
        self,
        function: Callable[..., Any],
        *,
        address: bool = False,  # noqa: ARG002
        boundscheck: bool = False,
    ) -> Any:
        """Return a function that is compiled when it is called, and kept on disk."""
        options = OPTIONS | ({"boundscheck": True} if boundscheck else {})
        return self._kept(njit, function, f"njit{boundscheck:d}", options)

    def compile(self, call: Callable[[], Result]) -> Result:
        """Make a call that compiles something."""
        with kept_interrupts(), no_garbage_collection():
            try:
                return call()
            except OSError as error:  # it is compiled, but could not be kept
                kept_code.say_nowhere([str(error)])
                return call()

    def known(self, compiled: Any, signature: Any) -> Any:  # noqa: ARG002
        """Return a compiled function as it is quickest to hand to others."""
        return compiled

    def entry(self, compiled: Any, signature: Any) -> Callable[..., Any]:  # noqa: ARG002
        """Return what may be called with arguments of exactly the right types."""
        entry: Callable[..., Any] = compiled
        return entry

    def separate(
        self, signature: Any, function: Callable[..., Any], *, boundscheck: bool = False
    ) -> tuple[Any, int]:
        """Compile a function for the C calling convention; return it and its address.

        What is returned is compiled once more if it is called in another way.
        """
        decorator = partial(cfunc, signature)
        options = OPTIONS | ({"boundscheck": True} if boundscheck else {})
        kind = f"cfunc{boundscheck:d}"
        made = self.compile(lambda: self._kept(decorator, function, kind, options))
        _alive.append(made)
        return self.kept(function, boundscheck=boundscheck), int(made.address)

    def is_kept(self, signature: Any, function: Callable[..., Any]) -> bool:  # noqa: ARG002
        """Whether :meth:`separate` would find machine code, or has no disk to look on."""
        place = self._place(function, "cfunc0")
        return place is None or any(place.rglob("*.nbc"))

    def _kept(self, decorator: Any, function: Any, kind: str, options: dict[str, Any]) -> Any:
        """Have Numba keep a function in a directory of what it is made of.

        Numba looks at the function's own file only, and would go on using the machine code of a
        kernel whose callee in another file has changed.
        """
        settings: Any = config
        place = self._place(function, kind)
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

    def _place(self, function: Callable[..., Any], kind: str) -> Path | None:
        source = Path(function.__code__.co_filename)
        place = kept_code.first_writable(
            kept_code.directories(source if source.is_file() else None)
        )
        return place and place / f"{function.__name__}.{kind}.{self.made_of(function)[:32]}"


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
