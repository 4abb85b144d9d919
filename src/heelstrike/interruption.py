"""Ctrl-C that is not lost in code that swallows it.

Python raises ``KeyboardInterrupt`` wherever it happens to be when the signal comes. Where that is
inside a callback of C code, or of the garbage collector, the exception is printed and forgotten;
CasADi takes it for a failure of the function it evaluates, and goes on with its next try.

Handlers are replaced for the length of a block, in the main thread only, which is the only one that
signals reach; elsewhere, and where the program ignores Ctrl-C, these contexts do nothing.
"""

from __future__ import annotations

import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from weakref import ref

LOOK_EVERY = 0.05
"""Seconds between two looks whether an interrupt was lost."""


@contextmanager
def deferred_interrupts() -> Iterator[Callable[[], bool]]:
    """Hold Ctrl-C back until the block ends, and tell whether it has come.

    For a block that asks often enough and can stop by itself.

    Yields
    ------
    callable
        Returns whether an interrupt waits.
    """
    came: list[int] = []
    previous = _handler()
    if previous is None:
        yield lambda: False
        return
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGINT, previous)
        if came:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def kept_interrupts() -> Iterator[None]:
    """Raise at the end of a block what Ctrl-C raised in it and something swallowed.

    An interrupt that comes out as another exception, such as the import that it made fail, comes
    out as itself.
    """
    previous = _handler()
    if previous is None:
        yield
        return
    raised: list[BaseException] = []

    def pass_on(number: int, frame: Any) -> None:
        try:
            previous(number, frame)
        except BaseException as error:
            raised.append(error)
            raise

    printed = sys.unraisablehook

    def unless_kept(unraisable: Any) -> None:
        if not any(unraisable.exc_value is error for error in raised):
            printed(unraisable)

    signal.signal(signal.SIGINT, pass_on)
    sys.unraisablehook = unless_kept
    try:
        yield
    except Exception as error:
        if raised:
            raise raised[0] from error
        raise
    finally:
        signal.signal(signal.SIGINT, previous)
        sys.unraisablehook = printed
    if raised:
        raise raised[0]


class Interrupt(KeyboardInterrupt):
    """A Ctrl-C of :func:`insistent_interrupts`."""

    insistence: Insistence


class Insistence:
    """What became of Ctrl-C in a block of :func:`insistent_interrupts`."""

    def __init__(self) -> None:
        self.came = False
        """Whether there was one."""
        self._watched: list[ref[Interrupt]] = []
        self._lost: list[Any] = []
        self._over = threading.Event()

    def new(self) -> Interrupt:
        """Return an exception that will be missed."""
        interrupt = Interrupt()
        interrupt.insistence = self
        self._watched.append(ref(interrupt, self._lost.append))
        if not self.came:
            threading.Thread(target=self._insist, daemon=True).start()
        self.came = True
        return interrupt

    def acknowledge(self) -> None:
        """Let the exceptions of this block go: somebody has seen to them."""
        self._watched.clear()

    def end(self) -> None:
        """Be over."""
        self.acknowledge()
        self._over.set()

    def _insist(self) -> None:
        while not self._over.wait(LOOK_EVERY):
            if self._lost:
                self._lost.clear()
                interrupt_main()


@contextmanager
def insistent_interrupts() -> Iterator[Insistence]:
    """Raise Ctrl-C again, as long as the block lasts, when something has swallowed it.

    What was raised is watched: it lives until somebody has dealt with it. If it is gone, and nobody
    has called :func:`acknowledge`, it was lost on the way.
    """
    insistence = Insistence()
    previous = _handler()
    if previous is not signal.default_int_handler:
        yield insistence
        return

    def raise_watched(*_: Any) -> None:
        raise insistence.new()

    printed = sys.unraisablehook

    def unless_watched(unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, Interrupt):
            printed(unraisable)

    signal.signal(signal.SIGINT, raise_watched)
    sys.unraisablehook = unless_watched
    try:
        yield insistence
    finally:
        insistence.end()
        signal.signal(signal.SIGINT, previous)
        sys.unraisablehook = printed


def acknowledge(interrupt: KeyboardInterrupt) -> None:
    """Say that a Ctrl-C that was caught has had its effect."""
    if isinstance(interrupt, Interrupt):
        interrupt.insistence.acknowledge()


def _handler() -> Callable[[int, Any], Any] | None:
    """Return what Python does at Ctrl-C; None if nothing, or if this thread has no say in it."""
    if threading.current_thread() is not threading.main_thread():
        return None
    handler = signal.getsignal(signal.SIGINT)
    return handler if callable(handler) and not isinstance(handler, signal.Handlers) else None
