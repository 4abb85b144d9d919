"""Machine code on disk: faults of the disk and of what is on it cost time and one warning."""

from __future__ import annotations

import hashlib
import os
import random
import sys
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from fresh_python import fresh_python
from numba import config

from heelstrike.compiler import kept_code
from heelstrike.compiler.compilation import SWITCH
from heelstrike.compiler.kept_code import CacheWarning, directories, first_writable, read, write

BY_PRIVATE_NAMES = pytest.mark.skipif(
    os.environ.get(SWITCH, "") not in ("", "0"), reason="Numba keeps files of its own there"
)
NAME, KEY, CODE = "kernel.machine_code", b"k" * kept_code.KEY, bytes(range(256)) * 20


@pytest.fixture(autouse=True)
def _nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_code, "_said", set())


def damages(whole: bytes, seed: int) -> list[bytes]:
    """What may become of a file: flipped bits, torn and cut ends, holes."""
    chance = random.Random(seed)
    found = [b"", whole[:10], whole[:-1], whole + b"\0", bytes(len(whole))]
    for _ in range(40):
        place = chance.randrange(len(whole))
        flipped = bytearray(whole)
        flipped[place] ^= 1 << chance.randrange(8)
        found += [bytes(flipped), whole[:place], whole[:place] + bytes(len(whole) - place)]
    return [damaged for damaged in found if damaged != whole]


def test_damaged_files_are_missing_files(tmp_path: Path) -> None:
    write([tmp_path], NAME, KEY, CODE)
    assert read([tmp_path], NAME, KEY) == CODE
    whole = (tmp_path / NAME).read_bytes()

    def read_damaged(damaged: bytes) -> bytes | None:
        (tmp_path / NAME).write_bytes(damaged)
        return read([tmp_path], NAME, KEY)

    with pytest.warns(CacheWarning, match="digest is wrong") as said:
        found = [read_damaged(damaged) for damaged in damages(whole, 10)]
    assert found == [None] * len(found)
    assert len(said) == 1
    write([tmp_path], NAME, KEY, CODE)
    assert read([tmp_path], NAME, KEY) == CODE


@pytest.mark.filterwarnings("error")
def test_code_for_something_else_is_missing_without_a_word(tmp_path: Path) -> None:
    assert read([tmp_path / "missing", tmp_path], NAME, KEY) is None
    write([tmp_path], NAME, b"o" * kept_code.KEY, CODE)
    assert read([tmp_path], NAME, KEY) is None


def test_the_next_place_is_taken_where_the_first_is_none(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("no directory")
    write([file / "below", tmp_path], NAME, KEY, CODE)
    assert read([file / "below", tmp_path], NAME, KEY) == CODE
    with pytest.warns(CacheWarning, match="NUMBA_CACHE_DIR"):
        write([file / "below"], NAME, KEY, CODE)
    with warnings.catch_warnings(action="error"):
        assert first_writable([file / "below"]) is None


def test_what_killed_processes_left_is_cleared(tmp_path: Path) -> None:
    old, new = tmp_path / "1.unfinished", tmp_path / "2.unfinished"
    for file in (old, new):
        file.write_bytes(b"half")
    hours_ago = time.time() - 1.5 * kept_code.FORGOTTEN
    os.utime(old, (hours_ago, hours_ago))
    write([tmp_path], NAME, KEY, CODE)
    assert {file.name for file in tmp_path.iterdir()} == {new.name, NAME}


def test_where_machine_code_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(config, "CACHE_DIR", "")
    beside, users = directories(tmp_path / "controller.py")
    assert beside == tmp_path / "__pycache__"
    assert users.parent.name == "heelstrike"
    assert len(directories(None)) == 1
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "named"))
    (named,) = directories(tmp_path / "controller.py")
    assert named.parent == tmp_path / "named"
    assert directories(tmp_path / "other" / "controller.py") != [named]


KERNELS = """
from numba import types
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import separate_kernel

@kernel
def inner(x):
    return 2.0 * x

def outer(x):
    return inner(x) + 1.0

@kernel
def from_python(x):
    return inner(x)

@separate_kernel(lambda: types.int64(types.int64))
def apart(x):
    return 3 * x
"""

# One kernel of each kind: compiled by Numba at once, when called, and apart; straight-line code.
PROGRAM = """
import ctypes
import numpy as np
from numba import types
from heelstrike.compiler.compilation import compiled_for
from heelstrike.contact.solvers.elimination import _programs
from kernels import apart, from_python, outer

apart.begin()
compiled = compiled_for(types.float64(types.float64), outer)
matrix, x, pivot = np.array([2.0]), np.array([6.0]), np.zeros(1)
kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
program = kind(_programs()[0])  # 2 x = 6
program(matrix.ctypes.data, x.ctypes.data, pivot.ctypes.data)
apart.finish()
tripled = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(int(apart.address[0]))
print(compiled(1.0), from_python(5.0), tripled(4), x[0])
"""

ANSWER = "3.0 10.0 12 3.0"


@pytest.fixture
def program(tmp_path: Path) -> Path:
    file = tmp_path / "program.py"
    file.write_text(PROGRAM)
    (tmp_path / "kernels.py").write_text(KERNELS)
    return file


def run(program: Path, cache: Path, before: str = "pass") -> list[str]:
    """The warnings of a process, which must have come to the right answer."""
    code = f"import sys; sys.path[0] = {str(program.parent)!r}; {before}; import program"
    done = fresh_python("-c", code, env=os.environ | {"NUMBA_CACHE_DIR": str(cache)})
    assert done.stdout.strip() == ANSWER
    return [line for line in done.stderr.splitlines() if "CacheWarning" in line]


def kept(cache: Path) -> list[Path]:
    return sorted(file for file in cache.rglob("*") if file.is_file())


def is_whole(file: Path) -> bool:
    content = file.read_bytes()
    return hashlib.sha256(content[kept_code.DIGEST :]).digest() == content[: kept_code.DIGEST]


@pytest.mark.slow
@BY_PRIVATE_NAMES
def test_damaged_machine_code_is_made_anew(program: Path, tmp_path: Path) -> None:
    """Unpickled or run, each of these takes the process along or fails until it is deleted."""
    cache = tmp_path / "cache"
    assert run(program, cache) == []
    whole = {file: file.read_bytes() for file in kept(cache)}
    kinds = {"kernels", "straight_line", "private_numba"}
    assert {file.name.split(".")[0] for file in whole} == kinds
    assert len(whole) == 5
    for seed in range(3):
        for file, content in whole.items():
            file.write_bytes(random.Random(seed).choice(damages(content, seed)))
        (said,) = run(program, cache)
        assert str(cache) in said
        assert kept(cache) == sorted(whole)
        assert all(is_whole(file) for file in whole)  # written again


def test_without_a_place_to_write_it_runs_and_says_so_once(program: Path, tmp_path: Path) -> None:
    """As on a read-only disk: the directory cannot be made, whoever asks."""
    file = tmp_path / "file"
    file.write_text("no directory")
    (said,) = run(program, file / "cache")
    assert "cannot be kept" in said
    assert "NUMBA_CACHE_DIR" in said


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of POSIX")
def test_a_full_disk_costs_a_warning(program: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64))"
    (said,) = run(program, cache, limit)
    assert "cannot be kept" in said
    assert kept(cache) == []


@pytest.mark.slow
@BY_PRIVATE_NAMES
def test_processes_that_write_the_same_files_leave_whole_ones(
    program: Path, tmp_path: Path
) -> None:
    cache = tmp_path / "cache"
    with ThreadPoolExecutor() as threads:
        assert list(threads.map(lambda _: run(program, cache), range(3))) == [[]] * 3
    assert len(kept(cache)) == 5
    assert all(is_whole(file) for file in kept(cache))


ALONE = """
import time
from pathlib import Path
from heelstrike.compiler.kept_code import KEY, alone, read, write

places, key = [Path("cache")], b"k" * KEY
with alone(places, "kernel"):
    found = read(places, "kernel", key)
    if found is None:
        time.sleep(0.5)
        write(places, "kernel", key, b"code")
print(found)
"""

LOOP = """
import pathlib
import sys
from numba import types
from heelstrike.compiler.compilation import loop_for

replace = pathlib.Path.replace

def told(self, target):
    print(pathlib.Path(target).name.split(".")[0], file=sys.stderr)
    return replace(self, target)

pathlib.Path.replace = told

def loop(x):
    return 2.0 * x

sys.modules["loop_of_this"] = sys.modules["__main__"]
loop.__module__ = "loop_of_this"
print(loop_for(types.float64(types.float64), loop)(1.5))
"""


def at_once(program: str, folder: Path) -> list[tuple[str, str]]:
    """What three processes print, and their errors."""
    (folder / "program.py").write_text(program)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")}

    def answer(_: int) -> tuple[str, str]:
        done = fresh_python("program.py", cwd=folder, env=environment)
        return done.stdout.strip(), done.stderr

    with ThreadPoolExecutor() as threads:
        return list(threads.map(answer, range(3)))


def test_of_processes_that_need_the_same_one_makes_it(tmp_path: Path) -> None:
    found = [printed for printed, _ in at_once(ALONE, tmp_path)]
    assert sorted(found) == ["None", "b'code'", "b'code'"]
    assert [file.name for file in kept(tmp_path / "cache")] == ["kernel"]


@BY_PRIVATE_NAMES
def test_a_loop_that_processes_need_at_once_is_compiled_by_one(tmp_path: Path) -> None:
    answers = at_once(LOOP, tmp_path)
    assert [printed for printed, _ in answers] == ["3.0"] * 3
    made = "".join(errors for _, errors in answers).split()
    assert made.count("loop_of_this") == 2  # as a module without constants, and finished


@pytest.mark.parametrize("lock", ["no database", "a directory"])
def test_where_nothing_can_be_locked_all_make_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lock: str
) -> None:
    if lock == "a directory":
        (tmp_path / "kernel.lock").mkdir()
    else:
        monkeypatch.setitem(sys.modules, "sqlite3", None)
    with kept_code.alone([tmp_path], "kernel"), kept_code.alone([tmp_path], "kernel"):
        write([tmp_path], NAME, KEY, CODE)
    assert read([tmp_path], NAME, KEY) == CODE
    with kept_code.alone([], "kernel"):
        pass


def test_nobody_waits_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_code, "LONGEST_WAIT", 0.1)
    with kept_code.alone([tmp_path], "kernel"), kept_code.alone([tmp_path], "kernel"):
        pass
    assert kept(tmp_path) == []
