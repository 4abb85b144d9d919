"""Ctrl-C is neither lost nor early, and handlers are what they were."""

from __future__ import annotations

import contextlib
import ctypes
import signal
import threading
import time
from collections.abc import Callable

import pytest

from heelstrike.interruption import (
    acknowledge,
    deferred_interrupts,
    insistent_interrupts,
    kept_interrupts,
)

pytestmark = pytest.mark.usefixtures("python_handles_ctrl_c")


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def swallowed() -> None:
    """An interrupt inside a function that C calls: Python can only print what it raises."""
    ctypes.CFUNCTYPE(None)(interrupt)()


def test_an_interrupt_is_held_back_until_the_block_ends() -> None:
    told = []

    def work() -> None:
        with deferred_interrupts() as came:
            told.append(came())
            interrupt()
            told.append(came())

    with pytest.raises(KeyboardInterrupt):
        work()
    assert told == [False, True]


def test_an_error_of_the_block_does_not_lose_the_interrupt() -> None:
    def work() -> None:
        with deferred_interrupts():
            interrupt()
            raise ValueError("meanwhile")

    with pytest.raises(KeyboardInterrupt) as caught:
        work()
    assert isinstance(caught.value.__context__, ValueError)


def test_a_handler_of_the_users_decides_what_is_raised() -> None:
    class TimeIsUpError(Exception):
        """What the user's handler raises."""

    def handler(*_: object) -> None:
        raise TimeIsUpError

    signal.signal(signal.SIGINT, handler)
    with pytest.raises(TimeIsUpError), deferred_interrupts():
        interrupt()
    with pytest.raises(TimeIsUpError), kept_interrupts():
        swallowed()
    with pytest.raises(TimeIsUpError), insistent_interrupts():
        interrupt()
    assert signal.signal(signal.SIGINT, signal.default_int_handler) is handler


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_what_a_callback_swallows_comes_out_at_the_end() -> None:
    reached = []

    def work() -> None:
        with kept_interrupts():
            swallowed()
            reached.append(True)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached


def test_what_comes_out_as_a_failed_import_is_the_interrupt() -> None:
    def work() -> None:
        with kept_interrupts():
            try:
                interrupt()
            except KeyboardInterrupt:
                raise ImportError("failed to import") from None

    with pytest.raises(KeyboardInterrupt) as caught:
        work()
    assert isinstance(caught.value.__cause__, ImportError)


def test_errors_without_an_interrupt_are_left_alone() -> None:
    with pytest.raises(ImportError), kept_interrupts():
        raise ImportError("no such module")


def wait_after(swallow: Callable[[], None]) -> None:
    """Wait to be interrupted again; in vain only if the test fails."""
    swallow()
    for _ in range(6000):
        time.sleep(0.01)


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_what_is_swallowed_comes_again() -> None:
    with insistent_interrupts() as interrupts:
        for swallow in (swallowed, caught, failed_import):
            with pytest.raises(KeyboardInterrupt):
                wait_after(swallow)
            interrupts.acknowledge()
    assert interrupts.came


def caught() -> None:
    with contextlib.suppress(BaseException):
        interrupt()


def failed_import() -> None:
    try:
        interrupt()
    except KeyboardInterrupt:
        with contextlib.suppress(ImportError):
            raise ImportError("failed to import") from None


def test_what_is_acknowledged_does_not_come_again() -> None:
    with insistent_interrupts():
        try:
            interrupt()
        except KeyboardInterrupt as error:
            acknowledge(error)
        time.sleep(0.3)


def test_an_interrupt_that_takes_its_time_is_not_sent_again() -> None:
    """Cleaning up after it may take long: it is alive until it is dealt with."""
    with insistent_interrupts() as interrupts:
        try:
            try:
                interrupt()
            finally:
                time.sleep(0.3)
        except KeyboardInterrupt:
            interrupts.acknowledge()


@pytest.mark.parametrize("ignored", [signal.SIG_IGN, signal.SIG_DFL])
def test_what_the_program_decided_stays(ignored: signal.Handlers) -> None:
    signal.signal(signal.SIGINT, ignored)
    with deferred_interrupts() as came, kept_interrupts():
        assert signal.getsignal(signal.SIGINT) is ignored
        assert not came()
    assert signal.signal(signal.SIGINT, signal.default_int_handler) is ignored


def test_other_threads_have_no_say() -> None:
    found = []

    def work() -> None:
        with deferred_interrupts() as came, kept_interrupts(), insistent_interrupts():
            found.append((came(), signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [(False, signal.default_int_handler)]
