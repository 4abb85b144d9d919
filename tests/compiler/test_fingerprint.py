"""Fingerprints: machine code is made again for what changes it, and for nothing else."""

from __future__ import annotations

import cProfile
import inspect
import json
import os
import shutil
from collections.abc import Callable
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fresh_python import fresh_python
from numba import config, float64, njit

import heelstrike
from heelstrike.compiler.compilation import dissolved_kernel, kernel, rare_kernel
from heelstrike.compiler.fingerprint import fingerprint
from heelstrike.compiler.private_numba import PrivateNumba

PRINT = """
import json
from heelstrike.compiler import machine_code, straight_line
from heelstrike.compiler.private_numba import PrivateNumba
from heelstrike.contact.solvers import elimination
from heelstrike.contact.solvers.certified_solve import try_solvers
from heelstrike.dynamics import kernels
from heelstrike.robot import load_robot
from heelstrike.sim.contacts import straight_line as programs
from heelstrike.sim.frame import frame
from heelstrike.sim.time_stepping import TimeStepping

keys = []
def keep(names, described, made_of, write, *, vectors=False):
    keys.append(machine_code._key(described, made_of).hex())
    return [0] * len(names)
straight_line.addresses = keep
robot = load_robot("bravo7")
programs._programs(robot.model, programs.usual_points(robot))
elimination._programs()
made_of = PrivateNumba().made_of
print(json.dumps({
    "loop": made_of(frame(TimeStepping.kernels)),
    "solvers": made_of(try_solvers._function),
    "kinematics": made_of(kernels.forward_kinematics.py_func),
    "programs": keys[:-1],
    "elimination": keys[-1],
}))
"""

BY_NUMBA = {"loop", "solvers", "kinematics"}
RECORDED = {"programs", "elimination"}

# File, text, what takes its place: applied together; then what must have another fingerprint.
EDITS: dict[str, tuple[list[tuple[str, str, str]], set[str]]] = {
    "words": (
        [
            ("dynamics/dense.py", '"""Exchange', '"""# A longer line.\n\n    Exchange'),
            ("sim/time_stepping/method.py", "@kernel\n", "# a comment\n\n@kernel\n"),
            ("dynamics/kernels.py", "from __future__", "# a comment\n\nfrom __future__"),
        ],
        set(),
    ),
    "words of the compiler": (
        [
            ("compiler/bundle.py", '"""Bundles', '"""A bundle'),
            ("compiler/bundle.py", '"""Base class of bundles', '"""Class of bundles'),
            ("compiler/bundle_type.py", '"""Read a member', '"""Get a member'),
            ("compiler/private_numba.py", '"""Turn a', '# words\n    """Make of a'),
            ("compiler/recordings/recording.py", '"""What the kernel of', '"""What a kernel of'),
            ("compiler/recordings/tape.py", '"""Return the entries', '"""Give the entries'),
            ("compiler/straight_line.py", '"""Writes one', '"""Write one'),
        ],
        set(),
    ),
    "what no kernel names": (
        [
            ("sim/files/dataset.py", "FORMAT = 1", "FORMAT = 2"),
            ("view/style.py", "from __future__", "import os\nfrom __future__"),
            ("sim/push.py", "@kernel\n", "@kernel\ndef other(x):\n    return x\n\n\n@kernel\n"),
            ("compiler/machine_code.py", "import Any\n", "import Any\n\nOTHER = 1\n"),
            ("compiler/straight_line.py", "import Any\n", "import Any\n\nOTHER = 1\n"),
        ],
        set(),
    ),
    "a kernel that is called": (
        [
            (
                "dynamics/dense.py",
                "tableau[row, j] *= -inverse",
                "tableau[row, j] *= inverse",
            )
        ],
        {"solvers"},  # which loops call by their address
    ),
    "a constant in another file": (
        [("contact/solvers/elimination.py", "POOR_PIVOT = 1e-7", "POOR_PIVOT = 1e-6")],
        {"loop", "elimination"},
    ),
    "a kernel that is recorded": (
        [("dynamics/kernels.py", "cos(", "sin(")],
        {"loop", "kinematics", "programs"},
    ),
    "how a kernel is recorded": (
        [("sim/contacts/straight_line.py", '"matrix", "rows", "force"', '"matrix", "rows"')],
        {"programs"},
    ),
    "how arithmetic is folded": (
        [("compiler/recordings/tape.py", "_is(other, -1.0)", "False")],
        RECORDED,
    ),
    "which operations are one": (
        [("compiler/recordings/tape.py", "sort(key=_name)", "sort(key=id)")],
        RECORDED,
    ),
    "what is structure": (
        [("compiler/recordings/recording.py", "| (np.abs(value) == 1.0)", "| (value == 1.0)")],
        RECORDED,
    ),
    "how sines are computed": (
        [("compiler/recordings/trigonometry.py", "1.58969099521155010221e-10", "1.6e-10")],
        RECORDED,
    ),
    "how code is optimised": (
        [("compiler/machine_code.py", "_OPTIMISATION = 1", "_OPTIMISATION = 2")],
        RECORDED,
    ),
    "how code is called": (
        [("compiler/straight_line.py", "kind.layout != ", "kind.layout == ")],
        {"loop", "solvers"},
    ),
    "what compiles": (
        [("compiler/private_numba.py", ", InlineClosureLikes)\n\n", ")\n\n")],
        BY_NUMBA,
    ),
    "how bundles are read": (
        [("compiler/bundle_type.py", "place += 1 +", "place += 2 +")],
        BY_NUMBA | RECORDED,
    ),
}  # fmt: skip


def fingerprints(home: Path) -> dict[str, str]:
    """Fingerprints by the package in `home`, in a fresh process."""
    settings = {"PYTHONPATH": str(home), "NUMBA_CACHE_DIR": str(home / "cache")}
    answer = fresh_python("-c", PRINT, env=os.environ | settings)
    found: dict[str, str] = json.loads(answer.stdout)
    return found


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    home = tmp_path_factory.mktemp("copied")
    shutil.copytree(Path(heelstrike.__file__).parent, home / "heelstrike")
    return home, fingerprints(home)


QUICK = ("words", "a kernel that is called", "a constant in another file")
"""Edits that stand for all where time is short."""


@pytest.mark.parametrize(
    "case",
    [each if each in QUICK else pytest.param(each, marks=pytest.mark.slow) for each in EDITS],
)
def test_an_edit_changes_what_it_must(copied: tuple[Path, dict[str, str]], case: str) -> None:
    home, before = copied
    edits, expected = EDITS[case]
    texts = {}
    try:
        for name, old, new in edits:
            file = home / "heelstrike" / name
            text = file.read_text()
            texts.setdefault(file, text)
            assert old in text, (name, old)
            file.write_text(text.replace(old, new, 1))
        after = fingerprints(home)
    finally:
        for file, text in texts.items():
            file.write_text(text)
    assert {name for name in before if after[name] != before[name]} == expected


def test_a_copy_of_the_package_elsewhere_finds_all_of_it(
    copied: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    home, before = copied
    shutil.copytree(home / "heelstrike", tmp_path / "heelstrike")
    assert fingerprints(tmp_path) == before


class Gait(Enum):
    WALK = 1.0


FACTOR = 2.0
TABLE = np.arange(3.0)
PAIR = (1, 2.0)
KIND = Gait


@kernel
def inner(x: float) -> float:
    return FACTOR * x


@njit
def jitted(x: float) -> float:
    return FACTOR * x


def with_default(x: float, y: float = 1.0) -> float:
    return x + y


@kernel
def outer(x: float) -> float:
    return inner(x) + TABLE[0] + PAIR[1] + KIND.WALK.value + with_default(x) + jitted(x)


def test_a_profiler_that_sees_a_kernel_run_changes_nothing() -> None:
    def three(x: float) -> float:
        return x + 3.0

    called = kernel(three)
    before = fingerprint(called)
    with cProfile.Profile():
        called(1.0)
    assert fingerprint(called) == before


def test_what_is_computed_with_other_settings_lies_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    def name() -> str:
        cache = PrivateNumba().kept(with_default)._cache
        return str(cache._name_and_key(float64(float64, float64))[0])

    usual = name()
    monkeypatch.setattr(config, "DEBUGINFO_DEFAULT", 1)
    assert name() != usual


class Other(Enum):
    WALK = 2.0


def changed_inner(x: float) -> float:
    return FACTOR * x * x


def changed_default(x: float, y: float = 2.0) -> float:
    return x + y


changed_default.__name__ = "with_default"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("FACTOR", 2),
        ("FACTOR", -2.0),
        ("TABLE", np.array([0.0, 1.0, 3.0])),
        ("TABLE", np.arange(3)),
        ("PAIR", (1, 2)),
        ("KIND", Other),
        ("inner", kernel(changed_inner)),
        ("inner", dissolved_kernel(inner.py_func)),  # type: ignore[attr-defined]
        ("inner", rare_kernel(inner.py_func)),  # type: ignore[attr-defined]
        ("jitted", njit(fastmath=True)(jitted.py_func)),
        ("with_default", changed_default),
    ],
)
def test_values_count_wherever_they_come_from(
    monkeypatch: pytest.MonkeyPatch, name: str, value: Any
) -> None:
    before = fingerprint(outer)
    assert fingerprint(outer) == before
    monkeypatch.setitem(globals(), name, value)
    assert fingerprint(outer) != before


def test_what_a_function_encloses_counts() -> None:
    def scaled(factor: Any) -> Callable[[float], float]:
        def function(x: float) -> float:
            return factor * x

        return function

    assert fingerprint(scaled(2.0)) == fingerprint(scaled(2.0)) != fingerprint(scaled(3.0))


class Scale:
    """A class that a function names."""

    factor = 2.0

    @staticmethod
    def applied(x: float) -> float:
        """Return a multiple."""
        return 2.0 * x

    @property
    def described(self) -> str:
        return "twice"


def scaled(x: float) -> float:
    return Scale.applied(x)


class Documented:
    """Another docstring."""

    factor = 2.0

    @staticmethod
    def applied(x: float) -> float:
        """Return twice."""
        return 2.0 * x

    @property
    def described(self) -> str:
        return "twice"


Documented.__qualname__ = "Scale"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("factor", 3.0),
        ("applied", staticmethod(lambda x: 3.0 * x)),
        ("described", property(lambda self: "thrice")),
        ("more", 1),
    ],
)
def test_a_class_counts_with_all_that_it_defines(
    monkeypatch: pytest.MonkeyPatch, name: str, value: Any
) -> None:
    before = fingerprint(scaled)
    monkeypatch.setattr(Scale, name, value, raising=False)
    assert fingerprint(scaled) != before


def outer_with_words() -> Callable[[], str]:
    """Some words."""

    def inner() -> str:
        """Some words of a function in it."""
        return "a constant"

    return inner


def test_docstrings_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    def defined(text: str) -> str:
        scope: dict[str, Any] = {}
        exec(text, scope)
        return fingerprint(scope["outer"])

    text = inspect.getsource(outer_with_words).replace("outer_with_words", "outer")
    assert "words" in text
    assert defined(text) == defined(text.replace("words", "more words"))
    assert defined(text) != defined(text.replace('"a constant"', '"another"'))
    before = fingerprint(scaled)
    monkeypatch.setitem(globals(), "Scale", Documented)
    assert fingerprint(scaled) == before


def test_a_function_that_remembers_counts_as_what_it_computes() -> None:
    def twice(x: float) -> float:
        return 2.0 * x

    def thrice(x: float) -> float:
        return 3.0 * x

    thrice.__name__ = thrice.__qualname__ = "twice"
    assert fingerprint(lru_cache(twice)) == fingerprint(lru_cache(twice))
    assert fingerprint(lru_cache(twice)) != fingerprint(lru_cache(thrice))
