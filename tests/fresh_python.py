"""A fresh Python at a fraction of its cost: a fork of a process that has imported Numba only.

Most of what a test waits for that starts Python again is Numba: its import, and its first function.
A process that has done both forks for each program. Nothing of heelstrike is in it yet, and
settings are read from the environment that the test gives. Where the system does not fork, a
process is started.
"""

from __future__ import annotations

import atexit
import json
import os
import runpy
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any


def fresh_python(
    *arguments: str,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    text: str = "",
    check: bool = True,
) -> subprocess.CompletedProcess[str]:
    """Run Python on arguments as the shell would give them: ``-c``, ``-m``, ``-`` or a file.

    Threads may call it at once.

    Parameters
    ----------
    *arguments : str
        The program and its arguments.
    env : mapping, optional
        The whole environment; that of this process if it is not given.
    cwd : Path, optional
        Where it runs.
    text : str
        What stands on its standard input.
    check : bool
        Raise ``CalledProcessError`` if it fails.
    """
    command = [sys.executable, "-B", *arguments]
    if hasattr(os, "fork"):
        order = {
            "arguments": arguments,
            "environment": dict(os.environ if env is None else env),
            "folder": str(cwd or Path.cwd()),
            "text": text,
        }
        done = subprocess.CompletedProcess(command, *_answer(json.dumps(order)))
    else:
        done = subprocess.run(command, env=env, cwd=cwd, input=text, capture_output=True, text=True)
    if check and done.returncode != 0:
        sys.stderr.write(done.stderr)
        done.check_returncode()
    return done


def _answer(order: str) -> tuple[int, str, str]:
    """Have an order followed; return the status, what was printed, and the errors."""
    pipes = [os.pipe() for _ in range(3)]
    with tempfile.TemporaryFile() as file:
        file.write(order.encode())
        file.seek(0)
        socket.send_fds(_template(), [b"."], [file.fileno(), *(end for _, end in pipes)])
    for _, end in pipes:
        os.close(end)
    with ThreadPoolExecutor() as threads:
        printed, errors, status = threads.map(_all_of, (begin for begin, _ in pipes))
    return int(status), printed, errors


def _all_of(pipe: int) -> str:
    with os.fdopen(pipe) as stream:
        return stream.read()


@cache
def _template() -> socket.socket:
    ours, its = socket.socketpair()
    command = [sys.executable, "-B", __file__, str(its.fileno())]
    started = subprocess.Popen(command, pass_fds=[its.fileno()])
    its.close()

    def end() -> None:
        ours.close()
        started.wait()

    atexit.register(end)
    return ours


# What follows runs in that process and its forks.


def _named_folders() -> list[str]:
    return [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]


_FOLDERS = _named_folders()


def _run(arguments: Sequence[str]) -> None:
    """Run a program in this process as its main one."""
    kind, rest = arguments[0], list(arguments[1:])
    sys.argv = [kind, *rest]
    sys.path[:] = ["", *_named_folders(), *sys.path[1 + len(_FOLDERS) :]]
    sys.modules["__main__"] = main = ModuleType("__main__")
    if kind == "-c":
        sys.argv = ["-c", *rest[1:]]
        exec(compile(rest[0], "<string>", "exec"), vars(main))
    elif kind == "-":
        exec(compile(sys.stdin.read(), "<stdin>", "exec"), vars(main))
    elif kind == "-m":
        sys.argv = rest
        runpy.run_module(rest[0], run_name="__main__", alter_sys=True)
    else:
        sys.path[0] = str(Path(kind).parent.resolve())
        runpy.run_path(kind, run_name="__main__")


def _become(order: dict[str, Any], output: int, errors: int) -> None:
    """Become the process that an order asks for, up to its program."""
    os.environ.clear()
    os.environ.update(order["environment"])
    os.chdir(order["folder"])
    given = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the process lives
    given.write(order["text"].encode())
    given.seek(0)
    for number, stream in enumerate((given.fileno(), output, errors)):
        os.dup2(stream, number)
    os.close(output)
    os.close(errors)
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(n, "rw"[n > 0]) for n in range(3))


def _reap(options: int) -> bool:
    """Take note of a fork that has ended; return whether there was one."""
    try:
        return os.waitpid(-1, options)[0] > 0
    except ChildProcessError:
        return False


def _follow(orders: socket.socket) -> None:
    """Follow orders until there are no more; in a fork, return into its program's end."""
    import numba

    numba.njit("float64(float64)")(lambda x: 2.0 * x)
    while True:
        some, descriptors, *_ = socket.recv_fds(orders, 1, 4)
        if not some:
            break
        while _reap(os.WNOHANG):
            pass
        if os.fork() != 0:
            for each in descriptors:
                os.close(each)
            continue
        orders.close()
        order, output, errors, told = descriptors
        process = os.fork()
        if process == 0:
            os.close(told)
            with os.fdopen(order) as stream:
                asked = json.load(stream)
            _become(asked, output, errors)
            numba.config.reload_config()
            _run(asked["arguments"])
            return
        os.close(output)
        os.close(errors)
        status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        os.write(told, str(status).encode())
        os._exit(0)
    while _reap(0):
        pass


if __name__ == "__main__":
    _follow(socket.socket(fileno=int(sys.argv[1])))
