"""Mutations of our own code: which do the tests see.

A line of heelstrike is changed, and the tests that reach it run until one fails. Kernels run as
plain Python (`plain_kernels`), so that nothing is compiled and a tracer sees which tests reach
which lines (`reach`). Mutants are drawn from a seed: in each package first an operator
(`operators`), then a place, each with equal chance; those that once passed unseen (`known`) are
always among them. Words, types and looks are left alone. ``--room`` draws from parts of packages
instead, as many from each, and from them alone.

All tests are collected once, and every mutant is a fork of that process with another function in
it (`substitution`). What cannot be exchanged so, such as constants of a module, is written into a
copy of the sources, for a process that starts afresh.

The ledger is a file of JSON lines: a campaign that was stopped goes on where it was, and mutants
whose text is unchanged are not asked again.

Run, from the top folder, on a system that forks::

    python benchmarks/mutations/campaign.py reach           # which tests reach what
    python benchmarks/mutations/campaign.py run --seed 1    # about half an hour on one core
    python benchmarks/mutations/campaign.py run --seed 3 --number 60 --room sim/contacts ...
    python benchmarks/mutations/campaign.py again           # survivors, after tests were added
    python benchmarks/mutations/campaign.py table           # as Markdown

Everything is kept in ``build/mutations``. After tests were added, ``reach`` with their paths says
what they reach. ``explained.json`` beside this file tells of survivors why they survive.
"""

from __future__ import annotations

import argparse
import atexit
import compileall
import contextlib
import importlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from known import known_mutants
from operators import Mutant, is_a_change, mutants_of
from substitution import exchange, exchange_constants

HERE = Path(__file__).resolve().parent
HOME = HERE.parent.parent
PACKAGE = HOME / "src" / "heelstrike"
STATE = HOME / "build" / "mutations"
COPY = STATE / f"copy-{os.getpid()}"
REACH = STATE / "reach.jsonl"
LEDGER = STATE / "ledger.jsonl"
VERDICT = COPY / "verdict.json"
EXPLAINED = HERE / "explained.json"

CANNOT = 77
"""How a fork ends that could not exchange the function."""
KEY = ("file", "scope", "line", "changed")
"""What an entry of the ledger is known by."""
SHORT = 16
"""Lines with fewer characters are known together with the line before."""

SHARES = {"contact": 0.2, "sim": 0.3, "analysis": 0.2, "gait": 0.15, "control": 0.15}
"""How the mutants are shared among the packages."""
TESTS = ("tests/control", "tests/gait", "tests/analysis", "tests/sim", "tests/physics")
TESTS += ("tests/contact", "tests/experiments/test_library_gaits.py")

REACH_DEADLINE = 3
"""Tests that take longer than this (s of processor time, traced) are left out."""
DEADLINE = 12
"""What a test may take with a mutant (s of processor time) before it counts as caught."""
LONGEST = 120
"""What all tests together may take (s of processor time) before a mutant counts as endless."""
LONGEST_WAIT = 900.0
"""The same of a process that starts afresh, and of its children (s that pass)."""
QUICK = 20
"""Tests that run first in a new process, the quickest; the others only if these pass."""
SLOW = 0.5
"""Tests that took longer (s) come after those that are less likely to fail, but quick."""
MOST_SECONDS = 25.0
"""Tests that reach a mutant run up to this many seconds, as they took without it."""


def copy_sources() -> None:
    """Make a copy of sources and tests to work on, for as long as this process lives."""
    owner = os.getpid()

    def clear() -> None:
        if os.getpid() == owner:
            shutil.rmtree(COPY, ignore_errors=True)

    atexit.register(clear)
    COPY.mkdir(parents=True)
    for name in ("src", "tests", "benchmarks", "docs"):  # tests import benchmarks and read pages
        shutil.copytree(HOME / name, COPY / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "mkdocs.yml"):
        shutil.copy(HOME / name, COPY / name)
    for name in ("src", "tests", "benchmarks"):
        compileall.compile_dir(COPY / name, quiet=2)


def environment(**setting: str) -> dict[str, str]:
    """Variables under which pytest runs on the copy."""
    path = os.pathsep.join((str(COPY / "src"), str(HERE)))
    return {"CI": "1", "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", **setting}


OPTIONS = ("-p", "plain_kernels", "-p", "reach", "-q", "--tb=line", "--assert=plain")
UNCHANGED = ("-o", f"cache_dir={STATE / 'pytest'}")
"""Gaits are kept from one call to the next, where it is sure that no mutant designed them."""
CHANGED = ("-p", "no:cacheprovider")


def pytest_afresh(arguments: Iterable[str], **setting: str) -> int | None:
    """Run pytest on the copy in a new process; return its exit status, None if it never ended."""
    process = subprocess.Popen(
        [sys.executable, "-m", "pytest", *OPTIONS, *arguments],
        cwd=COPY,
        env=os.environ | environment(**setting),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return process.wait(LONGEST_WAIT)
    except subprocess.TimeoutExpired:
        return None
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def read_lines(path: Path) -> Iterator[dict[str, Any]]:
    """Read a file of JSON lines, if there is one."""
    if path.exists():
        for line in path.read_text().splitlines():
            yield json.loads(line)


# Which tests reach what.


def reach(paths: list[str]) -> None:
    """Find out which tests reach what, for some paths or all."""
    copy_sources()
    for path in paths or TESTS:
        status = pytest_afresh([*UNCHANGED, path], REACH=str(REACH), DEADLINE=str(REACH_DEADLINE))
        print(f"{path}: pytest ended with {status}", flush=True)


class Reached:
    """Which tests reach a line, from the file that :func:`reach` wrote."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.lines: dict[tuple[str, int], set[str]] = {}
        self.functions: dict[tuple[str, int], set[str]] = {}
        self.files: dict[str, set[str]] = {}
        newest = {each["test"]: each for each in read_lines(REACH)}
        for name, each in newest.items():
            if not each["passed"]:
                continue
            self.seconds[name] = each["seconds"]
            for file, lines in each["lines"].items():
                for line in lines:
                    self.lines.setdefault((file, line), set()).add(name)
            for file, functions in each["functions"].items():
                self.files.setdefault(file, set()).add(name)
                for first in functions:
                    self.functions.setdefault((file, first), set()).add(name)

    def tests(self, mutant: Mutant, text: str) -> list[str]:
        """Tests that reach a mutant: its line, its function, its file's tests; the quick first."""
        last = mutant.line + text.count("\n", mutant.begin, mutant.end)
        there: set[str] = set()
        for line in range(mutant.line, last + 1):
            there |= self.lines.get((mutant.file, line), set())
        around = self.functions.get((mutant.file, mutant.function), set())
        if not mutant.function:  # of the module: whatever uses it, and its own tests
            there = set()  # who happened to import it first
            folder, _, name = mutant.file.rpartition("/")
            mirrored = f"tests/{folder}/test_{name.removesuffix('.py')}"
            around = self.files.get(mutant.file, set())
            around = around | {test for test in self.seconds if test.startswith(mirrored)}
        # What a fixture made was reached in the test that asked first, and matters to all after it.
        files = {test.split("::")[0] for test in there | around}
        beside = {test for test in self.seconds if test.split("::")[0] in files}
        tiers = {test: tier for tier, tests in enumerate((beside, around, there)) for test in tests}

        def place(test: str) -> tuple[bool, int, float]:
            return self.seconds[test] > SLOW, -tiers[test], self.seconds[test]

        total, chosen = 0.0, []
        for test in sorted(tiers, key=place):
            total += self.seconds[test]
            if total > MOST_SECONDS:
                break
            chosen.append(test)
        return chosen


# The campaign.


def drawn(seed: int, number: int, rooms: Sequence[str] = ()) -> list[Mutant]:
    """Draw mutants from a seed, after those that are known; or from some rooms alone."""
    if rooms:
        shares = dict.fromkeys(rooms, 1.0 / len(rooms))
        chosen = []
    else:
        shares, chosen = SHARES, known_mutants(PACKAGE)
    begin = len(chosen)
    for place, room in enumerate(shares):
        draw = random.Random(f"{seed}/{room}")
        kinds: dict[str, list[Mutant]] = {}
        inside = sorted((PACKAGE / room).rglob("*.py")) or [PACKAGE / room]
        for file in inside:
            for mutant in mutants_of(PACKAGE, file):
                kinds.setdefault(mutant.kind, []).append(mutant)
        names = sorted(kinds)
        wanted = round(sum([*shares.values()][: place + 1]) * number) - (len(chosen) - begin)
        while wanted:
            kind = draw.choice(names)
            if not kinds[kind]:
                continue
            mutant = kinds[kind].pop(draw.randrange(len(kinds[kind])))
            if is_a_change(mutant, (PACKAGE / mutant.file).read_text()):
                chosen.append(mutant)
                wanted -= 1
    return chosen


def key(mutant: Mutant) -> tuple[str, str, str, str]:
    """What stays the same of a mutant when lines before it come and go."""
    text = (PACKAGE / mutant.file).read_text()
    begin, end = text.rfind("\n", 0, mutant.begin) + 1, text.find("\n", mutant.end)
    if len(text[begin:end].strip()) < SHORT:
        begin = text.rfind("\n", 0, begin - 1) + 1  # a line that says little, with the one before
    line = text[begin:end]
    changed = text[begin : mutant.begin] + mutant.new + text[mutant.end : end]
    return mutant.file, mutant.scope, " ".join(line.split()), " ".join(changed.split())


class Asker:
    """Asks the tests about mutants, from within pytest, which has collected all of them."""

    def __init__(self, mutants: list[Mutant]) -> None:
        self.mutants = mutants
        self.reached = Reached()

    def pytest_runtestloop(self, session: Any) -> bool:
        """Take the place of pytest's own loop over the tests."""
        self.items = {item.nodeid: item for item in session.items}
        prepare()
        for place, mutant in enumerate(self.mutants):
            found = self.ask(mutant)
            with LEDGER.open("a") as ledger:
                ledger.write(json.dumps(found, ensure_ascii=False) + "\n")
            print(
                f"{place + 1}/{len(self.mutants)} {found['outcome']:<11} "
                f"{found['seconds']:6.1f} s  {mutant.file}:{mutant.line}  {found['line']}  →  "
                f"{found['changed']}",
                flush=True,
            )
        return True

    def ask(self, mutant: Mutant) -> dict[str, Any]:
        """Run the tests that reach a mutant until one fails; return what is written down of it."""
        text = (PACKAGE / mutant.file).read_text()
        tests = [t for t in self.reached.tests(mutant, text) if t in self.items]
        found: dict[str, Any] = dict(zip(KEY, key(mutant), strict=True))
        found |= {"kind": mutant.kind, "outcome": "not reached", "tests": len(tests)}
        begin = time.monotonic()
        if tests:
            VERDICT.unlink(missing_ok=True)
            status = self.here(mutant, text, tests)
            if status == CANNOT:
                status = self.afresh(mutant, text, tests)
            found["outcome"] = {0: "survived", None: "endless"}.get(status, "caught")
            if VERDICT.exists():
                found |= json.loads(VERDICT.read_text())
        return found | {"seconds": round(time.monotonic() - begin, 1)}

    def here(self, mutant: Mutant, text: str, tests: list[str]) -> int | None:
        """Ask in a fork of this process with the function exchanged."""
        process = os.fork()
        if process == 0:
            try:
                os._exit(self._in_fork(mutant, text, tests))
            finally:
                os._exit(1)  # the mutant spoilt what runs the tests
        status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        return None if status == -signal.SIGXCPU else status

    def _in_fork(self, mutant: Mutant, text: str, tests: list[str]) -> int:
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST + 5))  # a fork begins at zero
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nowhere, stream)
        forget(mutant.file.split("/")[0])
        original = COPY / "src" / "heelstrike" / mutant.file
        if mutant.function:
            done = exchange(original, text, mutant.apply(text), mutant.function)
        else:
            name = "heelstrike." + mutant.file.removesuffix(".py").replace("/", ".")
            done = exchange_constants(importlib.import_module(name), mutant.apply(text))
        if not done:
            return CANNOT
        items = [self.items[test] for test in tests]
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if VERDICT.exists():
                return 1
        return 0

    def afresh(self, mutant: Mutant, text: str, tests: list[str]) -> int | None:
        """Ask in a new process, with the mutant written into the copy."""
        target = COPY / "src" / "heelstrike" / mutant.file
        target.write_text(mutant.apply(text))
        for compiled in (target.parent / "__pycache__").glob(f"{target.stem}.*"):
            compiled.unlink()
        order = COPY / "order.txt"
        try:
            status: int | None = 0
            for part in (tests[:QUICK], tests[QUICK:]):
                if part and status == 0:
                    order.write_text("\n".join(part) + "\n")
                    files = dict.fromkeys(test.split("::")[0] for test in part)
                    status = pytest_afresh(["-x", *CHANGED, *files], ORDER=str(order))
            return status
        finally:
            target.write_text(text)


def prepare() -> None:
    """Do once what many tests begin with."""
    walking = importlib.import_module("walking")
    walking.gait()


def forget(package: str) -> None:
    """Undo it where a mutant might have had a part in it."""
    if package == "gait":
        importlib.import_module("walking").gait.cache_clear()
    if package in ("gait", "contact", "dynamics"):  # the text of the files tells nothing of it
        os.environ["HEELSTRIKE_KEEP_GAITS"] = "0"


def run(mutants: list[Mutant], *, again: bool = False) -> None:
    """Ask for all mutants that the ledger does not know, or for all."""
    import pytest

    copy_sources()
    known = set() if again else {_entry_key(each) for each in read_lines(LEDGER)}
    asker = Asker([mutant for mutant in mutants if key(mutant) not in known])
    os.chdir(COPY)
    setting = {"DEADLINE": str(DEADLINE), "VERDICT": str(VERDICT)}
    os.environ.update(environment(**setting))
    sys.path[:0] = [str(COPY / "src"), str(HERE)]
    files = sorted({test.split("::")[0] for test in asker.reached.seconds})
    pytest.main([*OPTIONS, *CHANGED, "-s", *files], plugins=[asker])


def _entry_key(entry: dict[str, Any]) -> tuple[str, ...]:
    return tuple(entry[name] for name in KEY)


def survivors(mutants: list[Mutant]) -> list[Mutant]:
    """Those of some mutants that were not caught at last and are not explained."""
    outcome = {_entry_key(each): each["outcome"] for each in read_lines(LEDGER)}
    explained = {_entry_key(each) for each in explanations()}
    return [
        mutant
        for mutant in mutants
        if outcome.get(key(mutant)) in ("survived", "not reached") and key(mutant) not in explained
    ]


def explanations() -> list[dict[str, Any]]:
    """Why some mutants survive, and whether they change anything."""
    found: list[dict[str, Any]] = json.loads(EXPLAINED.read_text()) if EXPLAINED.exists() else []
    return found


def table(mutants: list[Mutant], seed: int) -> str:
    """What became of the mutants, as Markdown."""
    ledger = {_entry_key(each): each for each in read_lines(LEDGER)}
    reasons = {_entry_key(each): each for each in explanations()}
    counts: dict[str, Counter[str]] = {}
    lines: list[str] = []
    for mutant in mutants:
        entry = ledger.get(key(mutant))
        if entry is None:
            continue
        package = counts.setdefault(mutant.file.split("/")[0], Counter())
        reason = reasons.get(key(mutant), {"equivalent": False, "why": "**not explained**"})
        if entry["outcome"] in ("caught", "endless"):
            package["caught"] += 1
        else:
            package["equivalent" if reason["equivalent"] else "survived"] += 1
            word = "no change" if reason["equivalent"] else "survives"
            lines.append(
                f"- `{mutant.file}`: `{entry['line']}` → `{entry['changed']}`: {word}. "
                f"{reason['why']}"
            )
    rows = ["| package | mutants | caught | survived | share caught | no change of behaviour |"]
    rows += ["|---|--:|--:|--:|--:|--:|"]
    total: Counter[str] = sum(counts.values(), Counter())
    for name, count in [*sorted(counts.items()), ("all", total)]:
        real = count["caught"] + count["survived"]
        rows.append(
            f"| {name} | {real} | {count['caught']} | {count['survived']} | "
            f"{100.0 * count['caught'] / max(real, 1):.1f} % | {count['equivalent']} |"
        )
    return "\n".join([f"Seed {seed}.", "", *rows, "", "Those that passed:", "", *lines])


def main() -> None:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("reach").add_argument("paths", nargs="*")
    for name in ("run", "again", "table", "list"):
        command = commands.add_parser(name)
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--number", type=int, default=160)
        command.add_argument("--package", action="append", choices=list(SHARES))
        command.add_argument("--room", nargs="+", default=[], help="files or folders to draw from")
    asked = parser.parse_args()
    STATE.mkdir(parents=True, exist_ok=True)
    if asked.command == "reach":
        reach(asked.paths)
        return
    mutants = drawn(asked.seed, asked.number, asked.room)
    if asked.package:
        mutants = [m for m in mutants if m.file.split("/")[0] in asked.package]
    if asked.command == "run":
        run(mutants)
    elif asked.command == "again":
        run(survivors(mutants), again=True)
    elif asked.command == "list":
        for mutant in mutants:
            print(mutant.kind, *key(mutant), sep="\t")
    else:
        print(table(mutants, asked.seed))


if __name__ == "__main__":
    main()
