"""Kernels with machine code of their own, which loops call by its address.

A loop takes its kernels in and is compiled with them as a whole. What is large, used by several
loops and not called in most steps is better compiled once, apart, and so are controllers: while a
loop is compiled in this process, they are in others.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from heelstrike.compiler.compilation import numba_in_use
from heelstrike.compiler.kept_code import LONGEST_WAIT

LOOK_EVERY = 0.1
"""Seconds between two looks at a helper; Windows lets nobody interrupt a longer wait."""

# What a helper process does. Ctrl-C is for its parent to decide about; and when nobody holds the
# other end of its standard input any more, its parent is gone and so is its purpose.
_HELPER = """
import os, signal, threading
signal.signal(signal.SIGINT, signal.SIG_IGN)
threading.Thread(target=lambda: (os.read(0, 1), os._exit(1)), daemon=True).start()
from {module} import {name}
{name}.finish()
"""


class SeparateKernel(types.WrapperAddressProtocol):
    """A kernel that is compiled when it is needed, or in another process until then.

    Parameters
    ----------
    function : callable
        The kernel. Its name in its module must be that of the :class:`SeparateKernel`.
    signature : callable
        Gives its Numba signature.
    boundscheck : bool
        Whether an index beyond an array raises IndexError.

    Attributes
    ----------
    address : (1,) int64
        Where its machine code is, for :func:`call_at`; zero until :meth:`finish` was called.
        Read-only: all who call it share it.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        signature: Callable[[], Any],
        *,
        boundscheck: bool = False,
    ) -> None:
        self._place = np.zeros(1, dtype=np.int64)
        self.address: NDArray[np.int64] = self._place[:]
        self.address.flags.writeable = False
        self.__module__ = function.__module__
        self._function = function
        self._signature = signature
        self._boundscheck = boundscheck
        self._compiled: Any = None
        self._helper: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def __reduce__(self) -> str:
        """Copies and pickles are the one of that name, in any process: machine code stays here."""
        return self._function.__name__

    def begin(self) -> None:
        """Have another process compile it meanwhile, if it has no machine code on disk yet."""
        with self._lock:
            if self._compiled or self._helper or not _can_start_python():
                return
            if not numba_in_use().is_kept(self._signature(), self._function):
                self._helper = self._start_helper()

    def finish(self) -> Any:
        """Compile it, or wait until that is done, or load what there is; return it compiled."""
        with self._lock:
            if self._compiled:
                return self._compiled
            if self._helper:
                # Whether it succeeded shows in what it left on disk.
                _wait_for(self._helper)
                self._helper = None
            compiled, self._place[0] = numba_in_use().separate(
                self._signature(), self._function, boundscheck=self._boundscheck
            )
            self._compiled = compiled
            return compiled

    def __wrapper_address__(self) -> int:
        """Return what Numba asks of a function that is handed to a compiled one."""
        self.finish()
        return int(self.address[0])

    def signature(self) -> Any:
        """Return its Numba signature, which Numba asks for, too."""
        return self._signature()

    def _start_helper(self) -> subprocess.Popen[bytes] | None:
        module, name = self._function.__module__, self._function.__name__
        try:
            return subprocess.Popen(
                # -P: what lies in the current directory is imported only if it is here, too.
                [sys.executable, "-P", "-c", _HELPER.format(module=module, name=name)],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(path or "." for path in sys.path)},
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError:
            return None


def separate_kernel(
    signature: Callable[[], Any],
) -> Callable[[Callable[..., Any]], SeparateKernel]:
    """Turn a function into a :class:`SeparateKernel` of the given Numba signature."""
    return lambda function: SeparateKernel(function, signature)


def _wait_for(helper: subprocess.Popen[bytes]) -> None:
    """Wait until a helper has ended, and end it if that takes too long or Ctrl-C comes."""
    end = monotonic() + LONGEST_WAIT
    try:
        while helper.poll() is None and monotonic() < end:
            with suppress(subprocess.TimeoutExpired):
                helper.wait(LOOK_EVERY)
    finally:
        if helper.poll() is None:
            helper.kill()
            helper.wait()
        if helper.stdin is not None:
            helper.stdin.close()


def _can_start_python() -> bool:
    """Whether a second Python would run at the same time, and on the same packages."""
    is_python = Path(sys.executable or "").stem.lower().startswith("python")
    return is_python and not getattr(sys, "frozen", False) and (os.cpu_count() or 1) > 1


def _calling(result: Any) -> Any:
    def call(context: Any, address: Any, arguments: Any) -> Any:
        del context
        signature = result(address, arguments)

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kinds = [context.get_value_type(kind) for kind in signature.args[1]]
            function = ir.FunctionType(context.get_value_type(signature.return_type), kinds)
            parts = [builder.extract_value(values[1], place) for place in range(len(kinds))]
            return builder.call(builder.inttoptr(values[0], function.as_pointer()), parts)

        return signature, generate

    return intrinsic(call)


call_at: Any = _calling(types.int64)
"""``call_at(address, arguments)`` calls a :class:`SeparateKernel` that returns an integer.

The types of the arguments must be those of its signature; nothing checks them.
"""

measure_at: Any = _calling(types.float64)
"""The same of one that returns a number."""
