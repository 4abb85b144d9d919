"""The switch for code that every processor of the kind can run."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from heelstrike.compiler.plain_code import is_asked_for

CHOSEN = """
import heelstrike
import json
import numpy as np
from numba import types
from heelstrike.compiler.compilation import compiled_for
from heelstrike.compiler import machine_code

def largest(values):
    result = values[0]
    for i in range(values.size):
        result = max(result, 2.0 * values[i] + 1.0)
    return result

kernel = compiled_for(types.float64(types.float64[::1]), largest)
np.linalg.solve(np.eye(2), np.ones(2))
print(json.dumps({
    "numba": kernel.targetctx.codegen().magic_tuple()[1:],
    "assembly": "".join(kernel.inspect_asm().values()),
    "straight line": machine_code.processor(),
    "file": machine_code._name(b"program"),
    "key": machine_code._key(b"program", "").hex(),
    "numpy": np.show_config(mode="dicts")["SIMD Extensions"].get("found", []),
}))
"""


def python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a program without the settings of this process."""
    mine = ("HEELSTRIKE_", "NUMBA_CPU", "NPY_", "OPENBLAS_")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(mine)}
    return subprocess.run(
        [sys.executable, "-c", code],
        env=kept | {"OPENBLAS_VERBOSE": "2"} | environment,
        capture_output=True,
        text=True,
        check=True,
    )


def chosen(**environment: str) -> dict[str, Any]:
    answer = python(CHOSEN, **environment)
    found: dict[str, Any] = json.loads(answer.stdout)
    found["blas"] = [line for line in answer.stderr.splitlines() if line.startswith("Core:")]
    return found


def test_the_switch_selects_plain_code_everywhere() -> None:
    host, plain = chosen(HEELSTRIKE_PLAIN_CODE="0"), chosen(HEELSTRIKE_PLAIN_CODE="1")
    assert plain["numba"] == ["generic", ""]
    assert plain["straight line"] == ["generic", ""]
    assert plain["numpy"] == []
    if host["numba"] != plain["numba"]:
        assert host["file"] != plain["file"]
        assert host["key"] != plain["key"]
    if platform.machine().lower() in ("x86_64", "amd64"):
        for later in ("ymm", "zmm", "vfmadd", "vaddsd"):
            assert later not in plain["assembly"]
        assert set(plain["blas"]) <= {"Core: Prescott", "Core: Katmai"}


def test_settings_of_numpy_and_numba_give_way() -> None:
    plain = chosen(
        HEELSTRIKE_PLAIN_CODE="1", NPY_DISABLE_CPU_FEATURES="X86_V4", NUMBA_CPU_NAME="native"
    )
    assert plain["numpy"] == []
    assert plain["numba"] == ["generic", ""]


def test_who_was_imported_too_early_is_named() -> None:
    late = python("import numpy, heelstrike", HEELSTRIKE_PLAIN_CODE="1")
    assert late.stderr.count("RuntimeWarning") == 1
    assert "numpy had been imported before" in late.stderr
    for silent in ("1", "0"):
        told = python("import heelstrike, numpy", HEELSTRIKE_PLAIN_CODE=silent)
        assert "Warning" not in told.stderr


@pytest.mark.skipif(not is_asked_for(), reason="says whether the suite itself runs on plain code")
def test_this_suite_runs_on_plain_code() -> None:
    assert np.show_config(mode="dicts")["SIMD Extensions"].get("found", []) == []
