"""Another process, in which files from elsewhere are read, and engines of others run.

Parsers of foreign formats crash, hang or fill the memory over a file that is damaged, or made to
hurt. So they run in a process of their own, which has a limit of time everywhere and of memory on
Linux, and which hands over nothing but bytes. It is started with the first file and reads one after
another; a file that ends it ends nothing else.

The module is also the program of that process, which imports nothing of heelstrike by itself.
"""

from __future__ import annotations

import atexit
import faulthandler
import importlib
import math
import os
import runpy
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import IO

MOST_MEMORY = 4 * 2**30
"""Bytes that the reading of a file may take."""

_HEAD = struct.Struct("<dQQQ")  # patience, memory, letters of the job's name, bytes of the order
_ANSWER = struct.Struct("<BQ")  # how it went, bytes of the answer
_DONE, _RAISED, _FULL = range(3)


class ReadingError(Exception):
    """Nothing came of a file; the message says what became of its reader.

    Attributes
    ----------
    kind : str
        Name of the exception that the reader raised, or the empty string.
    """

    def __init__(self, message: str, kind: str = "") -> None:
        super().__init__(message)
        self.kind = kind


class ReaderProcess:
    """A process that is given orders, one at a time, and is started when it is needed.

    Parameters
    ----------
    python : str, optional
        Program of another Python, of version 3.11 or later, which imports its own packages and none
        of this one's; by default that of this process.
    remembers : bool
        Whether an order means something only after those before it. It is then not given again
        when the process has ended, nor ever done here.
    """

    def __init__(self, *, python: str | None = None, remembers: bool = False) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._watch: _Watch | None = None
        self._owner = os.getpid()
        self._lock = threading.Lock()
        self._python, self._remembers = python, remembers

    def ask(self, job: str, order: bytes, *, patience: float, memory: int = MOST_MEMORY) -> bytes:
        """Have a function of bytes called in the process, and return the bytes that it returns.

        Where no process can be started it is called here: Python may be part of another program.

        Parameters
        ----------
        job : str
            The function as ``module:name``. A module that is a path is read alone, without the
            packages around it.
        order : bytes
            Its argument.
        patience : float
            Seconds that it may take.
        memory : int
            Bytes that it may take beyond what the process has; heeded on Linux.

        Raises
        ------
        ReadingError
            If the function raised, or its process did not survive it.
        """
        if self._owner != os.getpid():  # a fork, to which the other's process does not answer
            self.__init__(python=self._python, remembers=self._remembers)  # type: ignore[misc]
        with self._lock:
            used = self._process is not None
            try:
                return self._asked(job, order, patience, memory)
            except _GoneError:
                if not used or self._remembers:
                    raise
            return self._asked(job, order, patience, memory)  # was it this file, or one before?

    def end(self) -> None:
        """End the process; the next order starts another."""
        process, self._process = self._process, None
        watch, self._watch = self._watch, None
        if watch is not None:
            watch.leave()
        if process is not None and self._owner == os.getpid():
            process.kill()
            process.communicate()

    def _asked(self, job: str, order: bytes, patience: float, memory: int) -> bytes:
        if self._process is None and not self._start():
            if self._remembers or self._python is not None:
                raise ReadingError(f"no process of {self._python or 'Python'} can be started")
            try:
                return _function(job)(order)
            except Exception as error:
                raise ReadingError(str(error), type(error).__name__) from error
        process, watch = self._process, self._watch
        assert process is not None
        assert watch is not None
        assert process.stdin is not None
        assert process.stdout is not None
        name = job.encode()
        watch.begin(patience)
        try:
            head = _HEAD.pack(patience, memory, len(name), len(order))
            process.stdin.write(head + name + order)
            process.stdin.flush()
            how, length = _ANSWER.unpack(_exactly(process.stdout, _ANSWER.size))
            answer = _exactly(process.stdout, length)
        except BaseException as error:  # Ctrl-C, too: what it would answer is not waited for
            self.end()
            if watch.late:
                raise ReadingError(
                    f"has not finished with this file after {patience:.0f} s"
                ) from None
            if isinstance(error, OSError | EOFError):
                raise _GoneError(f"crashes on this file (exit {process.returncode})") from None
            raise
        finally:
            watch.end()
        if how == _DONE:
            return answer
        self.end()  # who knows in what state it is
        if how == _FULL:
            raise ReadingError(f"asks for more than {memory / 2**30:.3g} GiB of memory")
        kind, _, words = answer.decode("utf-8", "replace").partition("\n")
        raise ReadingError(words, kind)

    def _start(self) -> bool:
        """Start the process; return whether there is one."""
        python, path = self._python, ""
        if python is None:
            if getattr(sys, "frozen", False) or not sys.executable:
                return False
            python, path = sys.executable, os.pathsep.join(filter(None, sys.path))
        try:
            self._process = subprocess.Popen(
                [python, "-P", __file__],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": path},
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError:
            return False
        self._watch = _Watch(self._process)
        return True


class _Watch:
    """A thread that ends a process which takes too long.

    It is one for all orders of the process, and is not woken for each: it sleeps until the first
    one should have been done, and sees then which is being done.

    Parameters
    ----------
    process : Popen
        The process.
    """

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.late = False
        self._process = process
        self._until = self._wakes = math.inf
        self._changed = threading.Condition()
        self._left = False
        threading.Thread(target=self._stay, daemon=True).start()

    def begin(self, patience: float) -> None:
        """Watch from now on, for so many seconds."""
        with self._changed:
            self._until = time.monotonic() + patience
            if self._until < self._wakes:
                self._changed.notify()

    def end(self) -> None:
        """Watch no more, until the next order."""
        with self._changed:
            self._until = math.inf

    def leave(self) -> None:
        """End the thread."""
        with self._changed:
            self._left = True
            self._changed.notify()

    def _stay(self) -> None:
        with self._changed:
            while not self._left:
                now = time.monotonic()
                if self._until <= now:
                    self.late = True
                    self._process.kill()
                    return
                self._wakes = self._until
                self._changed.wait(None if math.isinf(self._wakes) else self._wakes - now)


class _GoneError(ReadingError):
    """The process ended by itself."""


def _exactly(stream: IO[bytes], length: int) -> bytes:
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return data


@cache
def _function(job: str) -> Callable[[bytes], bytes]:
    module, _, name = job.rpartition(":")
    if module.endswith(".py"):
        found: Callable[[bytes], bytes] = runpy.run_path(module)[name]
        return found
    found = getattr(importlib.import_module(module), name)
    return found


def _bound_memory(most: int) -> None:
    """Bound what the process may take from now on, where the system does that."""
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except (ImportError, OSError):
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    soft = pages * resource.getpagesize() + most
    resource.setrlimit(resource.RLIMIT_AS, (soft if hard < 0 else min(soft, hard), hard))


def _done(job: str, order: bytes, memory: int) -> tuple[int, bytes]:
    """Follow an order; return how it went, and the answer."""
    try:
        function = _function(job)
        _bound_memory(memory)
        return _DONE, function(order)
    except MemoryError:
        return _FULL, b""
    except BaseException as error:  # whatever a file makes of its reader
        return _RAISED, f"{type(error).__name__}\n{error}".encode("utf-8", "replace")


def _follow(orders: IO[bytes], answers: IO[bytes]) -> None:
    """Follow orders until there are no more."""
    nowhere = Path(os.devnull).open("w")  # noqa: SIM115 - for as long as the process lives
    while True:
        with suppress(EOFError):
            patience, memory, *lengths = _HEAD.unpack(_exactly(orders, _HEAD.size))
            # Should nobody be left to end it.
            faulthandler.dump_traceback_later(math.ceil(patience) + 5, exit=True, file=nowhere)
            name, order = (_exactly(orders, length) for length in lengths)
            how, answer = _done(name.decode(), order, memory)
            faulthandler.cancel_dump_traceback_later()
            answers.write(_ANSWER.pack(how, len(answer)) + answer)
            answers.flush()
            continue
        return


READER = ReaderProcess()
"""The process that reads the files of this one."""
atexit.register(READER.end)

if __name__ == "__main__":
    # What a parser prints is no answer.
    written = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    _follow(sys.stdin.buffer, written)
    os._exit(0)  # a parser may not be in a state to clean up
