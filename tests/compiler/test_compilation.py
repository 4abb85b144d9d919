"""Kernels: their cache knows all sources, and their plain twins need no compiler."""

from __future__ import annotations

import copy
import math
import os
import shutil
import subprocess
import sys
from math import sin as sine_by_another_name
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fresh_python import fresh_python
from numba import TypingError, types

import heelstrike
from heelstrike.compiler.compilation import SWITCH, compiled_for, kernel, uncompiled
from heelstrike.compiler.separate_kernel import SeparateKernel
from heelstrike.contact.solvers.certified_solve import try_solvers
from heelstrike.robot import load_robot
from heelstrike.sim.memory import allocate_memory

SOURCE = Path(heelstrike.__file__).parent

BOTH_WAYS = pytest.mark.parametrize(
    "documented", ["", "1"], ids=["private names", "documented names"]
)
BY_DOCUMENTED_NAMES = os.environ.get(SWITCH, "") not in ("", "0")

PROBE = """
import numpy as np
from heelstrike.robot import load_robot
from heelstrike.dynamics import kernels
from heelstrike.dynamics.workspace import Workspace
robot = load_robot("bravo7")
work = Workspace.allocate(robot.model.extents)
kernels.forward_kinematics(robot.model, robot.model.reference, work)
kernels.link_velocities(robot.model, np.zeros(robot.nv), work)
force = np.zeros(robot.nv)
kernels.bias_force(robot.model, work, force)
print(force[1])
"""


def probe(home: Path) -> float:
    """Weight of bravo7 by the package in `home`, in a fresh process."""
    answer = fresh_python(
        "-c",
        PROBE,
        env={**os.environ, "PYTHONPATH": str(home), "NUMBA_CACHE_DIR": str(home / "cache")},
    )
    return float(answer.stdout)


@pytest.mark.slow
def test_a_change_in_another_file_is_not_missed(tmp_path: Path) -> None:
    """`bias_force` calls a kernel that reads `model.py`'s neighbour: change the callee's file."""
    shutil.copytree(SOURCE, tmp_path / "heelstrike")
    kernels = tmp_path / "heelstrike" / "dynamics" / "kernels.py"
    callee = tmp_path / "heelstrike" / "dynamics" / "doubled.py"
    callee.write_text(
        "from heelstrike.compiler.compilation import kernel\n\n"
        "@kernel\ndef factor(x):\n    return 1.0\n"
    )
    text = kernels.read_text()
    text = text.replace(
        "    inverse_dynamics(model, work.zero, work, force)\n",
        "    inverse_dynamics(model, work.zero, work, force)\n    force[1] *= factor(1.0)\n",
    ).replace(
        "from math import", "from heelstrike.dynamics.doubled import factor\nfrom math import"
    )
    kernels.write_text(text)
    before = probe(tmp_path)
    callee.write_text(callee.read_text().replace("return 1.0", "return 2.0"))
    assert probe(tmp_path) == 2.0 * before


def test_twins_replace_names_in_all_that_they_call() -> None:
    @kernel
    def inner(x: float) -> float:
        return np.floor(x)

    # The twin of a kernel is an ordinary function.
    assert uncompiled(inner)(1.5) == 1.0
    assert not hasattr(uncompiled(inner), "py_func")


@kernel
def half_sine(x: float) -> float:
    return 0.5 * sine_by_another_name(x)


def test_twins_call_something_else_whatever_its_name() -> None:
    def outer(x: float) -> float:
        return half_sine(x) + sin(x)

    def sin(x: float) -> float:
        return 1.0

    assert uncompiled(outer, replace={math.sin: lambda x: 6.0 * x})(2.0) == 7.0


@pytest.mark.filterwarnings("error")
def test_a_function_without_a_module_is_compiled_every_time() -> None:
    """As `exec` makes them: in the next process Numba would look for their module."""
    for _ in range(2):
        scope: dict[str, Any] = {}
        exec("def double(x):\n    return 2.0 * x", scope)
        compiled = compiled_for(types.float64(types.float64), scope["double"])
        assert compiled(1.5) == 3.0
        assert not compiled.stats.cache_hits


TYPED = """
from numba import types
from heelstrike.compiler.compilation import compiled_for

def double(x):
    return 2.0 * x

compiled = compiled_for(types.float64(types.float64), double)
print(compiled(1.5), sum(compiled.stats.cache_hits.values()))
"""


@pytest.mark.skipif(BY_DOCUMENTED_NAMES, reason="Numba keeps functions of files only")
def test_a_function_typed_at_a_prompt_is_kept_for_the_next(tmp_path: Path) -> None:
    def answer(text: str) -> str:
        told = fresh_python(
            "-",
            text=text,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        )
        return told.stdout.strip()

    assert answer(TYPED) == "3.0 0"
    assert answer(TYPED) == "3.0 1"
    assert answer(TYPED.replace("2.0 * x", "3.0 * x")) == "4.5 0"


HELPER = """
from heelstrike.compiler.compilation import kernel

SLOPE = 1.0

@kernel
def scaled(x):
    return 3.0 * x
"""

CALLER = """
import helper
from helper import SLOPE, scaled
from numba import types
from heelstrike.compiler.compilation import compiled_for

def both(x):
    return SLOPE * scaled(x) + helper.SLOPE + helper.scaled(x)

compiled = compiled_for(types.float64(types.float64), both)
print(compiled(1.0), sum(compiled.stats.cache_hits.values()))
"""


@BOTH_WAYS
def test_a_change_in_another_file_of_a_user_is_not_missed(tmp_path: Path, documented: str) -> None:
    def answer(helper: str) -> tuple[float, int]:
        (tmp_path / "helper.py").write_text(helper)
        (tmp_path / "caller.py").write_text(CALLER)
        os.utime(tmp_path / "caller.py", (0, 0))
        told = fresh_python(
            "caller.py",
            cwd=tmp_path,
            env={
                **os.environ,
                "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
                SWITCH: documented,
            },
        )
        value, hits = told.stdout.split()
        return float(value), int(hits)

    assert answer(HELPER) == (7.0, 0)
    assert answer(HELPER) == (7.0, 1)
    assert answer(HELPER.replace("3.0 * x", "5.0 * x")) == (11.0, 0)
    assert answer(HELPER.replace("SLOPE = 1.0", "SLOPE = 2.0")) == (11.0, 0)


CHECKED = """
import numpy as np
from numba import types
from heelstrike.compiler.compilation import compiled_for

def third(values):
    return values[2]

compiled = compiled_for(types.float64(types.float64[::1]), third)
try:
    compiled(np.arange(3.0)[:2])
    told = "read"
except IndexError:
    told = "refused"
print(told, sum(compiled.stats.cache_hits.values()))
"""


@BOTH_WAYS
def test_code_made_with_other_settings_is_not_taken(tmp_path: Path, documented: str) -> None:
    (tmp_path / "checked.py").write_text(CHECKED)

    def answer(check: str) -> str:
        told = fresh_python(
            "checked.py",
            cwd=tmp_path,
            env={
                **os.environ,
                "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
                "NUMBA_BOUNDSCHECK": check,
                SWITCH: documented,
            },
        )
        return told.stdout.strip()

    assert answer("1") == "refused 0"
    assert answer("0") == "read 0"
    assert answer("0") == "read 1"


FACTORY = """
from numba import types
from heelstrike.compiler.compilation import compiled_for

def scaling(factor):
    def scale(x):
        return factor * x
    return scale

compiled = [compiled_for(types.float64(types.float64), scaling(factor)) for factor in (2.0, 3.0)]
print([one(1.0) for one in compiled], [sum(one.stats.cache_hits.values()) for one in compiled])
"""


@BOTH_WAYS
def test_functions_of_one_name_are_kept_beside_each_other(tmp_path: Path, documented: str) -> None:
    """Such as controllers that a function makes, with gains that it has been given."""
    (tmp_path / "factory.py").write_text(FACTORY)

    def answer() -> str:
        told = fresh_python(
            "factory.py",
            cwd=tmp_path,
            env={
                **os.environ,
                "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
                SWITCH: documented,
            },
        )
        return told.stdout.strip()

    assert answer() == "[2.0, 3.0] [0, 0]"
    assert answer() == "[2.0, 3.0] [1, 1]"


ENCLOSING = """
import numpy as np
from numba import types
from heelstrike.compiler.bundle import Bundle, cell
from heelstrike.compiler.compilation import compiled_for, kernel

class Turns(Bundle):
    count: int = cell(int)

@kernel
def twice(turns):
    turns.count += 2
    return turns.count

def loop_of(inner):
    def loop(turns):
        return inner(turns) + 1
    return loop

turns = Turns()
compiled = compiled_for(types.int64(Turns.compiled_type()), loop_of(twice))
print(compiled(turns), turns.count, sum(compiled.stats.cache_hits.values()))
"""


@BOTH_WAYS
def test_a_loop_is_found_again_with_the_kernels_that_it_encloses(
    tmp_path: Path, documented: str
) -> None:
    """Numba's own cache tells enclosed functions apart by a number that is new in each process."""
    (tmp_path / "enclosing.py").write_text(ENCLOSING)

    def answer() -> str:
        told = fresh_python(
            "enclosing.py",
            cwd=tmp_path,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), SWITCH: documented},
        )
        return told.stdout.strip()

    assert answer() == "3 2 0"
    assert answer() == "3 2 1"


APART = """
from numba import types
from heelstrike.compiler.separate_kernel import separate_kernel

@separate_kernel(lambda: types.int64(types.int64, types.float64[::1]))
def doubled(x, written):
    written[0] = 0.5 * x
    return 2 * x
"""

APART_CALLER = """
import sys
import numpy as np
from numba import njit
from apart import doubled
from heelstrike.compiler.compilation import numba_in_use
from heelstrike.compiler.separate_kernel import call_at

@njit
def call(address, x, written):
    return call_at(address[0], (x, written))

sys.executable = sys.argv[1] if len(sys.argv) > 1 else sys.executable
doubled.begin()
helped = doubled._helper is not None
if helped:
    doubled._helper.wait()
hits = int(numba_in_use().is_kept(doubled.signature(), doubled._function))
doubled.finish()
written = np.zeros(1)
assert doubled.__wrapper_address__() == doubled.address[0] != 0  # as Numba asks for functions
print(call(doubled.address, 21, written), written[0], helped, hits)
"""


@pytest.mark.slow
@BOTH_WAYS
def test_a_separate_kernel_is_compiled_by_another_process_once(
    tmp_path: Path, documented: str
) -> None:
    """By this one if the other fails, or cannot be started, or is no Python."""
    (tmp_path / "apart.py").write_text(APART)
    (tmp_path / "caller.py").write_text(APART_CALLER)

    def answer(cache: str, *executable: str) -> list[str]:
        told = fresh_python(
            "caller.py",
            *executable,
            cwd=tmp_path,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / cache), SWITCH: documented},
        )
        return told.stdout.split()

    assert answer("cache") == ["42", "10.5", "True", "1"]
    assert answer("cache") == ["42", "10.5", "False", "1"]
    assert answer("second", "python-that-is-not-there") == ["42", "10.5", "False", "0"]
    assert answer("third", "blender") == ["42", "10.5", "False", "0"]
    failing = tmp_path / "python_that_fails.bat"
    failing.write_text("#!/bin/sh\nexit 1\n")
    failing.chmod(0o755)
    assert answer("fourth", str(failing))[:2] == ["42", "10.5"]


def test_the_other_process_imports_what_this_one_does(tmp_path: Path) -> None:
    """Not what lies in the directory that a script is called from."""
    (tmp_path / "apart.py").write_text(APART)
    (tmp_path / "caller.py").write_text(APART_CALLER)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "llvmlite.py").write_text("open('imported', 'w').close()\n")
    told = fresh_python(
        "../caller.py",
        cwd=elsewhere,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
    )
    assert told.stdout.split() == ["42", "10.5", "True", "1"]
    assert not (elsewhere / "imported").exists()


def test_ctrl_c_ends_the_process_that_one_waits_for(monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import time; time.sleep(600)"
    helper = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE)
    wait = helper.wait

    def interrupted(timeout: float | None = None) -> int:
        monkeypatch.setattr(helper, "wait", wait)
        raise KeyboardInterrupt

    monkeypatch.setattr(helper, "wait", interrupted)
    slow = SeparateKernel(lambda: None, lambda: None)
    monkeypatch.setattr(slow, "_helper", helper)
    with pytest.raises(KeyboardInterrupt):
        slow.finish()
    assert helper.poll() is not None


def test_memory_put_back_knows_the_machine_code_made_meanwhile() -> None:
    """As in a batch on soft ground, begun before anybody asked for the contact solvers."""
    robot = load_robot("bravo7")
    memory = allocate_memory(robot)
    before = copy.deepcopy(memory)
    before.solver.solvers[:] = 0
    try_solvers.finish()
    memory.become(before)
    assert memory.solver.solvers[0] == try_solvers.address[0] != 0


@pytest.mark.skipif(BY_DOCUMENTED_NAMES, reason="Numba counts references there")
def test_a_kernel_that_returns_an_array_is_refused() -> None:
    """Nobody would count its reference, and the caller would free its own array twice."""

    @kernel
    def same(array: np.ndarray) -> np.ndarray:
        return array

    def caller(size: int) -> float:
        array = np.ones(size)
        return same(array)[0]

    with pytest.raises(TypingError, match="same: a kernel returns numbers"):
        compiled_for(types.float64(types.int64), caller)
