"""Numba's private names: tried before they are trusted, and dispensable."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from numba.core.types.functions import BaseFunction

from heelstrike.compiler import kept_code, private_numba
from heelstrike.compiler.compilation import SWITCH, numba_in_use
from heelstrike.compiler.private_numba import PrivateNumba

PROGRAM = """
import numpy as np
from numba import types
from heelstrike.compiler.compilation import compiled_for, kernel, numba_in_use

@kernel
def inner(x):
    return 2.0 * x

def outer(x):
    return inner(x) + 1.0

compiled = compiled_for(types.float64(types.float64), outer)
print(type(numba_in_use()).__name__, compiled(1.0), inner(5.0))
"""


def told(tmp_path: Path, before: str = "", switch: str = "") -> tuple[str, list[str]]:
    """What the program prints after some other lines, and its warnings."""
    done = subprocess.run(
        [sys.executable, "-c", before + PROGRAM],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), SWITCH: switch},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip(), [line for line in done.stderr.splitlines() if "Warning" in line]


@pytest.mark.skipif(bool(os.environ.get(SWITCH)), reason="asked for documented names")
def test_they_are_used_with_the_numba_that_is_installed() -> None:
    assert isinstance(numba_in_use(), PrivateNumba)


def test_what_has_passed_is_not_tested_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_code, "directories", lambda _: [tmp_path])
    PrivateNumba().test()
    assert len(list(tmp_path.iterdir())) == 1

    def tested_again(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(PrivateNumba, "compile", tested_again)
    PrivateNumba().test()
    monkeypatch.setattr(private_numba, "fingerprint", lambda *_: "00" * 32)  # another Numba
    with pytest.raises(AssertionError):
        PrivateNumba().test()


MISSING = """
import numba.core.codegen
del numba.core.codegen.JITCodeLibrary
"""

RAISING = """
import numba.core.codegen
numba.core.codegen.JITCodeLibrary.add_llvm_module = None
"""

ANOTHER_MEANING = """
import types
from numba.core.compiler import CompileResult
CompileResult._rebuild = lambda *_: types.SimpleNamespace(entry_point=lambda *_: 0.0)
"""


@pytest.mark.parametrize("before", [MISSING, ANOTHER_MEANING], ids=["missing", "another meaning"])
def test_without_them_kernels_compute_the_same_after_one_warning(
    tmp_path: Path, before: str
) -> None:
    for _ in range(2):
        out, warnings = told(tmp_path, before)
        assert out == "DocumentedNumba 3.0 10.0"
        assert len(warnings) == 1
        assert "CompilerWarning: Numba" in warnings[0]


def test_who_asks_for_documented_names_is_not_warned(tmp_path: Path) -> None:
    assert told(tmp_path, switch="1") == ("DocumentedNumba 3.0 10.0", [])


def test_threads_that_compile_at_once_leave_numba_as_it_was() -> None:
    before = BaseFunction.get_call_type
    numba = PrivateNumba()

    def compile_meanwhile() -> None:
        other = threading.Thread(target=lambda: numba.compile(lambda: None))
        other.start()
        other.join(0.1)
        others.append(other)

    others: list[threading.Thread] = []
    numba.compile(compile_meanwhile)
    others[0].join()
    assert BaseFunction.get_call_type is before
