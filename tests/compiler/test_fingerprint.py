"""Fingerprints: machine code is made anew for what changes it, and for nothing else."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit

import heelstrike
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.fingerprint import fingerprint

PRINT = """
import json
from heelstrike.contact.solvers import elimination
from heelstrike.contact.solvers.search import try_solvers
from heelstrike.compiler import machine_code
from heelstrike.dynamics import kernels
from heelstrike.compiler.fingerprint import fingerprint
from heelstrike.compiler.compilation import made_of
from heelstrike.sim import programs
from heelstrike.sim.time_stepping import method as time_stepping
print(json.dumps({
    "loop": made_of(time_stepping._advance),
    "solvers": made_of(try_solvers._function),
    "kinematics": made_of(kernels.forward_kinematics.py_func),
    "programs": machine_code._key(b"", programs.straight_line_programs).hex(),
    "elimination": machine_code._key(b"", elimination.elimination_programs).hex(),
}))
"""

ALL = {"loop", "solvers", "kinematics", "programs", "elimination"}

# File, text, what takes its place: applied together; then what must have another fingerprint.
EDITS: dict[str, tuple[list[tuple[str, str, str]], set[str]]] = {
    "words": (
        [
            ("contact/solvers/pivoting.py", '"""Exchange', '"""# A longer line.\n\n    Exchange'),
            ("sim/time_stepping/method.py", "@kernel\n", "# a comment\n\n@kernel\n"),
            ("dynamics/kernels.py", "from __future__", "# a comment\n\nfrom __future__"),
        ],
        set(),
    ),
    "what no kernel names": (
        [
            ("sim/files/dataset.py", "FORMAT = 1", "FORMAT = 2"),
            ("view/style.py", "from __future__", "import os\nfrom __future__"),
            ("sim/push.py", "@kernel\n", "@kernel\ndef other(x):\n    return x\n\n\n@kernel\n"),
        ],
        set(),
    ),
    "a kernel that is called": (
        [
            (
                "contact/solvers/pivoting.py",
                "tableau[row, j] *= -inverse",
                "tableau[row, j] *= inverse",
            )
        ],
        {"solvers"},  # which loops call by their address
    ),
    "a constant in another file": (
        [("contact/solvers/elimination.py", "POOR_PIVOT = 1e-7", "POOR_PIVOT = 1e-6")],
        {"loop", "solvers", "elimination"},
    ),
    "a kernel that is recorded": (
        [("dynamics/kernels.py", "cos(", "sin(")],
        {"loop", "kinematics", "programs"},
    ),
    "how a kernel is recorded": (
        [("sim/programs.py", '"matrix", "rows", "force"', '"matrix", "rows"')],
        {"programs"},
    ),
    "what records": (
        [("compiler/tape.py", "repr(entry[2]) < repr(entry[1])", "False")],
        {"loop", "solvers", "programs", "elimination"},
    ),
    "what compiles": ([("compiler/linking.py", "preserve=True", "preserve=False")], ALL),
    "how bundles are read": ([("compiler/bundle.py", "_BYTES = 8", "_BYTES = 4 + 4")], ALL),
}  # fmt: skip


def fingerprints(home: Path) -> dict[str, str]:
    """Fingerprints by the package in `home`, in a fresh process."""
    answer = subprocess.run(
        [sys.executable, "-B", "-c", PRINT],
        env={**os.environ, "PYTHONPATH": str(home), "NUMBA_CACHE_DIR": str(home / "cache")},
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, str] = json.loads(answer.stdout)
    return found


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    home = tmp_path_factory.mktemp("copied")
    shutil.copytree(Path(heelstrike.__file__).parent, home / "heelstrike")
    return home, fingerprints(home)


@pytest.mark.parametrize("case", EDITS)
def test_an_edit_changes_what_it_must(copied: tuple[Path, dict[str, str]], case: str) -> None:
    home, before = copied
    edits, expected = EDITS[case]
    texts = {}
    try:
        for name, old, new in edits:
            file = home / "heelstrike" / name
            texts[file] = file.read_text()
            assert old in texts[file], (name, old)
            file.write_text(texts[file].replace(old, new, 1))
        after = fingerprints(home)
    finally:
        for file, text in texts.items():
            file.write_text(text)
    assert {name for name in before if after[name] != before[name]} == expected


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
