"""Numba's private names: tried before they are trusted, and dispensable."""

from __future__ import annotations

import ast
import os
import re
import threading
from ast import literal_eval
from pathlib import Path

import numpy as np
import pytest
from fresh_python import fresh_python
from numba import types
from numba.core.types.functions import BaseFunction

import heelstrike
from heelstrike.compiler import documented_numba, kept_code, private_members, private_numba
from heelstrike.compiler.compilation import SWITCH, numba_in_use
from heelstrike.compiler.private_numba import PrivateNumba

PROGRAM = """
import numpy as np
from numba import types
from heelstrike.compiler.bundle import Bundle, array, cell, extent, number
from heelstrike.compiler.compilation import compiled_for, kernel, numba_in_use

@kernel
def inner(x):
    return 2.0 * x

def outer(x):
    return inner(x) + 1.0

class Rod(Bundle):
    n: int = extent()
    mass: float = number(float)
    end: np.ndarray = array("n")
    swings: int = cell(int)

    @kernel
    def weight(self, gravity):
        return gravity * self.mass

@kernel
def swing(rod):
    rod.swings += rod.n
    return rod.end[1] + rod.weight(10.0)

rod = Rod(mass=2.0, end=np.array([3.0, 4.0]))
compiled = compiled_for(types.float64(types.float64), outer)
print(type(numba_in_use()).__name__, compiled(1.0), inner(5.0), swing(rod), rod.swings)
"""

COMPUTED = "3.0 10.0 24.0 2"


def told(tmp_path: Path, before: str = "", switch: str = "") -> tuple[str, list[str]]:
    """What the program prints after some other lines, and its warnings."""
    settings = {"NUMBA_CACHE_DIR": str(tmp_path), SWITCH: switch}
    done = fresh_python("-c", before + PROGRAM, env=os.environ | settings)
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

    monkeypatch.setattr(np, "ones", tested_again)  # no function of ours: theirs are in the key
    PrivateNumba().test()
    # Another Numba:
    monkeypatch.setattr(documented_numba, "fingerprint_after", lambda *_: "00" * 32)
    with pytest.raises(AssertionError):
        PrivateNumba().test()


def private_names() -> dict[str, list[tuple[str, str]]]:
    """Modules and names that modules of ours take from inside Numba."""
    return {
        module.__name__.rpartition(".")[2]: [
            (node.module, name.name)
            for node in ast.walk(ast.parse(Path(str(module.__file__)).read_text()))
            if isinstance(node, ast.ImportFrom)
            and node.module is not None
            and node.module.startswith(("numba.core", "numba.np"))
            for name in node.names
        ]
        for module in (private_numba, private_members)
    }


GONE = """
import builtins
import warnings
from heelstrike.compiler.compilation import numba_in_use

usual, told = builtins.__import__, []

def without(name, globals=None, locals=None, names=(), level=0):
    ours = (globals or {{}}).get("__name__", "").startswith("heelstrike")
    if ours and name == gone[0] and gone[1] in (names or ()):
        raise ImportError("cannot import name " + gone[1])
    return usual(name, globals, locals, names, level)

builtins.__import__ = without
for gone in {names!r}:
    numba_in_use.cache_clear()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        kind = type(numba_in_use()).__name__
    told.append((kind, [str(each.message) for each in said]))
numba_in_use.cache_clear()
print(told)
"""

ANOTHER_MEANING = """
import types
from numba.core.compiler import CompileResult
CompileResult._rebuild = lambda *_: types.SimpleNamespace(entry_point=lambda *_: 0.0)
"""


@pytest.mark.parametrize("file", ["private_numba", "private_members"])
def test_without_any_of_them_kernels_compute_the_same_after_one_warning(
    tmp_path: Path, file: str
) -> None:
    """One process tries all names of a module, and compiles without the last."""
    names = private_names()[file]
    out, warnings = told(tmp_path, GONE.format(names=names))
    tried, computed = out.splitlines()
    heard = "heelstrike does not know the internals of Numba"
    for name, (kind, said) in zip(names, literal_eval(tried), strict=True):
        assert kind == "DocumentedNumba", name
        assert [words[: len(heard)] for words in said] == [heard], name
    assert computed == f"DocumentedNumba {COMPUTED}"
    assert len(warnings) == 1
    assert f"CompilerWarning: {heard}" in warnings[0]


def test_no_other_module_takes_names_from_inside_numba() -> None:
    for file in Path(heelstrike.__file__).parent.rglob("*.py"):
        if not file.name.startswith("private_"):
            assert not re.search(r"^\s*(from|import) numba\.(core|np)\b", file.read_text(), re.M)


def test_with_another_meaning_kernels_compute_the_same_after_one_warning(tmp_path: Path) -> None:
    for _ in range(2):
        out, warnings = told(tmp_path, ANOTHER_MEANING)
        assert out == f"DocumentedNumba {COMPUTED}"
        assert len(warnings) == 1


def test_who_asks_for_documented_names_is_not_warned(tmp_path: Path) -> None:
    assert told(tmp_path, switch="1") == (f"DocumentedNumba {COMPUTED}", [])


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


@pytest.mark.parametrize("rare", [False, True])
def test_what_is_rare_is_called_and_not_taken_in(rare: bool) -> None:
    """By what LLVM is told of it; that it computes the same is tried before all others."""
    numba_in_use()
    apart = PrivateNumba().part(private_numba._inner, dissolved=False, rare=rare)
    signature = types.float64(types.float64[::1], types.int64)
    numba_in_use().compile(lambda: apart.compile(signature))
    text = str(apart.get_compile_result(signature).library._final_module)
    assert ("noinline" in text) == ("cold" in text) == rare
