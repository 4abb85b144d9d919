"""Files appear whole or not at all, whatever happens to their writer."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from stored_files import SAVED, run_file

import heelstrike
from heelstrike import whole_file as module
from heelstrike.errors import WriteError
from heelstrike.whole_file import check_target, whole_file, write_whole

POSIX = pytest.mark.skipif(os.name != "posix", reason="limits and signals of POSIX")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("name", ["a.txt", "a", ".hidden", "x" * 240 + ".json", "é" * 100 + ".nc"])
def test_new_and_old(tmp_path: Path, name: str) -> None:
    target = tmp_path / name
    assert write_whole(target, "first ✓\n") == target
    assert target.read_bytes() == "first ✓\n".encode()
    write_whole(str(target), b"second")
    assert target.read_bytes() == b"second"
    assert names(tmp_path) == [name]


def test_the_file_beside_has_the_ending_of_the_target(tmp_path: Path) -> None:
    """Encoders go by it."""
    with whole_file(tmp_path / "film.mp4") as beside:
        assert beside.suffix == ".mp4"
        assert beside.parent == tmp_path
        beside.write_bytes(b"film")
    assert (tmp_path / "film.mp4").read_bytes() == b"film"


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_what_there_was(tmp_path: Path, error: BaseException) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")

    def fail() -> None:
        with whole_file(target) as beside:
            beside.write_text("half")
            raise error

    if isinstance(error, OSError):
        with pytest.raises(WriteError, match=r"cannot write .*a\.txt: No space left on device"):
            fail()
    else:
        with pytest.raises(KeyboardInterrupt):
            fail()
    assert target.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_what_is_no_place_for_a_file(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path, "it is a folder"),
        (tmp_path / "nowhere" / "a.txt", "there is no folder"),
        ("a\0b", "null"),
        (tmp_path / ("x" * 300), "name too long"),
    ):
        with pytest.raises(WriteError, match=f"(?i)cannot write .*{words}"):
            write_whole(path, "x")
    with pytest.raises(WriteError, match="no text"):
        write_whole(tmp_path / "a.txt", "half a character: \ud800")
    assert not names(tmp_path)


@POSIX
def test_devices_and_pipes_are_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for target in (pipe, Path(os.devnull)):
        with pytest.raises(WriteError, match="not a regular file"):
            write_whole(target, "x")
    assert pipe.is_fifo()


@POSIX
def test_links_and_permissions_stay(tmp_path: Path) -> None:
    target, link = tmp_path / "a.txt", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to("a.txt")
    write_whole(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert target.stat().st_mode & 0o777 == 0o640


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 0)() == 0, reason="root may write everywhere")
def test_write_protection_is_respected(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    target.chmod(0o444)
    with pytest.raises(WriteError, match="write-protected"):
        check_target(target)


# Leftovers

WRITER = """
import sys, time
from heelstrike.whole_file import whole_file
with whole_file(sys.argv[1]) as beside:
    beside.write_text("half")
    print(beside.name, flush=True)
    sys.stdin.readline()
    beside.write_text("whole")
"""


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Return a process in the middle of writing a.txt."""
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path / "a.txt")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process
        process.kill()


def _beside(writer: subprocess.Popen[str]) -> str:
    assert writer.stdout is not None
    return writer.stdout.readline().strip()


@POSIX
def test_leftovers_of_killed_writers_are_removed(
    tmp_path: Path, writer: subprocess.Popen[str]
) -> None:
    left = _beside(writer)
    writer.kill()
    writer.wait()
    assert names(tmp_path) == [left]
    write_whole(tmp_path / "b.txt", "another target")
    write_whole(tmp_path / "a.txt.bak", "another target, too")
    assert left in names(tmp_path)
    write_whole(tmp_path / "a.txt", "new")
    assert names(tmp_path) == ["a.txt", "a.txt.bak", "b.txt"]


def test_a_writer_at_work_is_left_alone(tmp_path: Path, writer: subprocess.Popen[str]) -> None:
    beside = _beside(writer)
    write_whole(tmp_path / "a.txt", "faster")
    assert names(tmp_path) == sorted([beside, "a.txt"])
    writer.communicate("\n")
    assert writer.returncode == 0
    assert (tmp_path / "a.txt").read_text() == "whole"
    assert names(tmp_path) == ["a.txt"]


def test_two_writers_in_one_process(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with whole_file(target) as first:
        first.write_text("first")
        write_whole(target, "second")
        assert first.exists()
    assert target.read_text() == "first"
    assert names(tmp_path) == ["a.txt"]


def test_many_writers_of_one_file(tmp_path: Path) -> None:
    """Whoever is last, the file is that of one of them, whole."""
    target = tmp_path / "a.txt"
    failures: list[Exception] = []

    def write(letter: str) -> None:
        try:
            for _ in range(20):
                write_whole(target, letter * 10000)
        except WriteError as error:  # Windows does not let two replace at the same instant
            failures.append(error)

    threads = [threading.Thread(target=write, args=(letter,)) for letter in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert os.name == "nt" or not failures
    content = target.read_text()
    assert content == content[0] * 10000
    assert names(tmp_path) == ["a.txt"]


def test_writers_on_another_machine_have_a_day(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "a.txt"
    monkeypatch.setattr(module, "_machine", lambda: "0123abcd")
    young, old = (tmp_path / module._name_beside(target) for _ in range(2))
    monkeypatch.undo()
    for path in (young, old):
        path.write_text("half")
    long_ago = time.time() - 2.0 * module.LONGEST_AGE
    os.utime(old, (long_ago, long_ago))
    write_whole(target, "new")
    assert names(tmp_path) == sorted(["a.txt", young.name])


def test_a_process_of_the_same_number_has_died(tmp_path: Path) -> None:
    """In a container every process may have the number 1."""
    target = tmp_path / "a.txt"
    (tmp_path / module._name_beside(target)).write_text("half")
    write_whole(target, "new")
    assert names(tmp_path) == ["a.txt"]


# Every writer

WRITERS = """
import json, os, resource, signal, sys
from pathlib import Path
import heelstrike as hs
from heelstrike.experiments.results import Results
from heelstrike.experiments.zoo import Cell, Settings, Results as Cells
from heelstrike.experiments.zoo.campaign import Animal
from heelstrike.experiments.zoo.writing import Targets

folder, saved = Path(sys.argv[1]), Path(sys.argv[2])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
robot = hs.load_robot("bravo7")
run = hs.load_run(sys.argv[3])
gait = hs.load_gait(saved / "gait.json")
before = {name: array.tobytes() for name, array in vars(run).items() if hasattr(array, "tobytes")}
results = Results(folder)
cells = Cells(Settings())
cells.meet(Animal(robot="r", fingerprint="f", mass=1.0))
cells.put(Cell(robot="r", controller="c", disturbance="price", withstood=(1.0,), failed=(2.0,)))
zoo = Targets(folder, folder / "page.md", folder / "panels.svg")
WRITERS = {
    "run.nc": run.save,
    "gait.json": gait.save,
    "state.json": lambda path: robot.save_state(run.final_state, path),
    "robot.xml": robot.save,
    "robot.urdf": robot.save,
    "zmp.png": lambda path: run.plot("torque", path=path),
    "zmp.svg": lambda path: run.plot("torque", path=path),
    "zmp.pdf": lambda path: run.plot("torque", path=path),
    "film.gif": lambda path: run.animate(path, size=(64, 64), speed=0.1),
    "film.mp4": lambda path: run.animate(path, size=(64, 64), speed=0.1),
    "zoo.json": cells.save,
    "zoo.csv": lambda path: zoo.write(cells, "heelstrike zoo"),
}
# All once without a limit, which compiles what it needs.
run.animate(folder / "film.gif", size=(64, 64), speed=0.1)
def all_of_a_run():
    return {each.path.name: each.error for each in results.save_run(run, gait, animation=None)}
could = {name for name, error in all_of_a_run().items() if not error}
for name in WRITERS:
    (folder / name).write_text("old")
answers = []
for limit in (100, 0):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    told = {}
    for name, write in WRITERS.items():
        try:
            write(folder / name)
            told[name] = ["written", ""]
        except Exception as error:
            told[name] = [type(error).__name__, str(error)]
    # What a figure is drawn for comes to the same end at either limit.
    walk = {} if limit else {
        name: type(error).__name__ for name, error in all_of_a_run().items() if name in could
    }
    same = all(getattr(run, name).tobytes() == value for name, value in before.items())
    answers.append({"told": told, "walk": walk, "same": same})
print(json.dumps(answers))
"""
ERRORS = {
    "run.nc": "RunFileError",
    "gait.json": "GaitError",
    "state.json": "RobotError",
    "robot.xml": "RobotError",
    "robot.urdf": "RobotError",
    "zmp.png": "ViewError",
    "zmp.svg": "ViewError",
    "zmp.pdf": "ViewError",
    "film.gif": "ViewError",
    "film.mp4": "ViewError",
    "zoo.json": "WriteError",
    "zoo.csv": "WriteError",
}


@POSIX
@pytest.mark.slow
def test_every_writer_beyond_a_quota(tmp_path: Path) -> None:
    """A limit on the size of files stands for a quota: write(2) fails, in the middle or at once."""
    folder = tmp_path / "out"
    run = run_file("time_stepping", tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", WRITERS, str(folder), str(SAVED), str(run)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for answer in json.loads(done.stdout):
        assert answer["same"]
        told = answer["told"]
        assert {name: kind for name, (kind, _) in told.items()} == ERRORS
        for name, (_, words) in told.items():
            assert f"cannot write {folder / name}" in words
            assert (folder / name).read_text() == "old", name
            assert name == "film.mp4" or "File too large" in words
        assert "still in memory" in told["run.nc"][1]
    walk = json.loads(done.stdout)[-1]["walk"]
    assert len(walk) > 5
    assert walk.pop("run.nc") == "RunFileError"
    assert walk.pop("summary.json") == "WriteError"
    assert set(walk.values()) == {"ViewError"}
    assert not [name for name in names(folder) if ".part-" in name]


@pytest.fixture
def full_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a disk of its own, which has 8 kB left."""
    folder = tmp_path / "disk"
    folder.mkdir()
    options = ["-t", "tmpfs", "-o", "size=256k", "none", str(folder)]
    try:
        mounted = subprocess.run(["mount", *options], capture_output=True, check=False)
    except OSError:
        pytest.skip("there is no mount")
    if mounted.returncode:
        pytest.skip("only root may mount a disk")
    try:
        room = os.statvfs(folder)
        (folder / "fill").write_bytes(bytes(room.f_bavail * room.f_frsize - 8192))
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@POSIX
def test_a_full_disk(tmp_path: Path, full_disk: Path) -> None:
    run = heelstrike.load_run(run_file("time_stepping", tmp_path))
    target = full_disk / "run.nc"
    target.write_text("old")
    with pytest.raises(heelstrike.RunFileError, match="No space left on device") as caught:
        run.save(target)
    assert "still in memory" in str(caught.value)
    assert target.read_text() == "old"
    film = full_disk / "film.mp4"
    with pytest.raises(heelstrike.ViewError, match="No space left on device"):
        run.animate(film, speed=0.01)
    assert names(full_disk) == ["fill", "run.nc"]
    elsewhere = run.save(tmp_path / "run.nc")
    assert heelstrike.load_run(elsewhere).time.tolist() == run.time.tolist()


def test_nobody_writes_past_it() -> None:
    """Every file that a user asks for goes through this module."""
    package = Path(heelstrike.__file__).parent
    writing = re.compile("write_text|write_bytes|savefig|to_netcdf|imsave|tofile")
    found = set()
    for room in ("cli", "experiments", "view", "gait", "sim", "robot"):
        for source in (package / room).rglob("*.py"):
            for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Attribute) and writing.fullmatch(node.attr):
                    found.add((source.relative_to(package).as_posix(), node.attr))
    assert found == {
        ("view/animation.py", "write_bytes"),  # into the file beside
        ("view/live/viewer.py", "write_text"),  # into a folder of its own, for the browser
        ("view/report/writing.py", "savefig"),  # into memory
        ("view/style.py", "savefig"),  # into memory
    }
