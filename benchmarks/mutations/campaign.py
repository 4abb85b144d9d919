"""Mutations of our own code: which would the tests see?

A line of heelstrike is changed, in a copy of the sources, and the tests that reach it run until one
fails. Kernels run as plain Python (`plain_kernels`), so that nothing is compiled and a tracer sees
which tests reach which lines (`reach`). Mutants are drawn from a seed: first a package, in turn,
then an operator (`operators`), then a place, each with equal chance; those that once passed unseen
(`known`) are always among them. Words, types and looks are left alone.

The ledger is a file of JSON lines: a campaign that was stopped goes on where it was, and mutants
whose text is unchanged are not asked again.

Run, from the top folder::

    python benchmarks/mutations/campaign.py reach           # which tests reach what; half an hour
    python benchmarks/mutations/campaign.py run --seed 1    # an hour or two on one core
    python benchmarks/mutations/campaign.py again           # survivors, after tests were added
    python benchmarks/mutations/campaign.py table           # as Markdown

Everything is kept in ``build/mutations``. After tests were added, ``reach`` with their paths says
what they reach. ``explained.json`` beside this file tells of survivors why they survive.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import math
import os
import random
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from known import known_mutants
from operators import Mutant, is_a_change, mutants_of

HERE = Path(__file__).resolve().parent
HOME = HERE.parent.parent
PACKAGE = HOME / "src" / "heelstrike"
STATE = HOME / "build" / "mutations"
COPY = STATE / "copy"
REACH = STATE / "reach.jsonl"
LEDGER = STATE / "ledger.jsonl"
EXPLAINED = HERE / "explained.json"

KEY = ("file", "scope", "line", "changed")
"""What an entry of the ledger is known by."""
SHORT = 16
"""Lines with fewer characters are known together with the line before."""

SHARES = {"contact": 0.2, "sim": 0.3, "analysis": 0.2, "gait": 0.15, "control": 0.15}
"""How the mutants are shared among the packages."""
TESTS = ("tests/control", "tests/gait", "tests/analysis", "tests/sim", "tests/physics")
TESTS += ("tests/contact", "tests/experiments/test_library_gaits.py")

LIBRARIES = ("_pytest.assertion.rewrite", "numpy", "numba", "scipy.optimize", "casadi", "mujoco")
LIBRARIES += ("xarray", "h5netcdf", "matplotlib.figure", "rich.console", "hypothesis")
"""What takes long to import; nothing of heelstrike."""

REACH_DEADLINE = 6
"""Tests that take longer than this (s of processor time, traced) are left out."""
DEADLINE = 30
"""What a test may take with a mutant (s of processor time) before it counts as caught."""
QUICK = 40
"""Tests that run first, the quickest; the others only if these pass."""
MOST_SECONDS = 60.0
"""Tests that reach a mutant run up to this many seconds, as they took without it."""


def copy_sources() -> None:
    """Make a fresh copy of sources and tests to work on."""
    shutil.rmtree(COPY, ignore_errors=True)
    COPY.mkdir(parents=True)
    for name in ("src", "tests"):
        shutil.copytree(HOME / name, COPY / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(HOME / name, COPY / name)


def load_libraries() -> None:
    """Import what heelstrike and its tests import, once for all processes."""
    for name in LIBRARIES:
        importlib.import_module(name)


def pytest(arguments: Iterable[str], *, limit: float = math.inf, **setting: str) -> int | None:
    """Run pytest on the copy in a process of its own; return its exit status.

    None if it took more than `limit` seconds.
    """
    process = os.fork()  # libraries are loaded already, heelstrike is not
    if process == 0:
        try:
            os._exit(_pytest_here(list(arguments), setting))
        finally:
            os._exit(70)
    begin = time.monotonic()
    try:
        while True:
            finished, status, _ = os.wait4(process, os.WNOHANG)
            if finished:
                return os.waitstatus_to_exitcode(status)
            if time.monotonic() - begin > limit:
                return None
            time.sleep(0.05)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process, signal.SIGKILL)


def _pytest_here(arguments: list[str], setting: dict[str, str]) -> int:
    import pytest

    os.setsid()
    os.chdir(COPY)
    os.environ.update({"CI": "1", "PYTHONHASHSEED": "0", **setting})
    sys.dont_write_bytecode = True
    sys.path[:0] = [str(COPY / "src"), str(HERE)]
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    options = ("-p", "plain_kernels", "-p", "reach", "-p", "no:cacheprovider", "-q", "--tb=line")
    return int(pytest.main([*options, *arguments]))


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
        status = pytest([path], REACH=str(REACH), DEADLINE=str(REACH_DEADLINE))
        print(f"{path}: pytest ended with {status}")


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
        """Tests that reach a mutant, those that reach its line first, the quick before the slow."""
        last = mutant.line + text.count("\n", mutant.begin, mutant.end)
        there: set[str] = set()
        for line in range(mutant.line, last + 1):
            there |= self.lines.get((mutant.file, line), set())
        around = self.functions.get((mutant.file, mutant.function), set())
        if not mutant.function and not there:  # of the module: whatever uses the module
            around = self.files.get(mutant.file, set())
        quick = sorted(there, key=self.seconds.__getitem__)
        quick += sorted(around - there, key=self.seconds.__getitem__)
        total, chosen = 0.0, []
        for test in quick:
            total += self.seconds[test]
            if total > MOST_SECONDS:
                break
            chosen.append(test)
        return chosen


# The campaign.


def drawn(seed: int, number: int) -> list[Mutant]:
    """Draw mutants from a seed, after those that are known."""
    chosen = known_mutants(PACKAGE)
    for package, share in SHARES.items():
        draw = random.Random(f"{seed}/{package}")
        kinds: dict[str, list[Mutant]] = {}
        for file in sorted((PACKAGE / package).glob("*.py")):
            for mutant in mutants_of(PACKAGE, file):
                kinds.setdefault(mutant.kind, []).append(mutant)
        wanted, names = round(share * number), sorted(kinds)
        found = 0
        while found < wanted:
            kind = draw.choice(names)
            if not kinds[kind]:
                continue
            mutant = kinds[kind].pop(draw.randrange(len(kinds[kind])))
            if is_a_change(mutant, (PACKAGE / mutant.file).read_text()):
                chosen.append(mutant)
                found += 1
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


def ask(mutant: Mutant, reached: Reached) -> dict[str, Any]:
    """Run the tests that reach a mutant until one fails; return what is written down of it."""
    text = (PACKAGE / mutant.file).read_text()
    tests = reached.tests(mutant, text)
    found: dict[str, Any] = dict(zip(KEY, key(mutant), strict=True)) | {"kind": mutant.kind}
    found |= {"number": mutant.line, "outcome": "not reached", "tests": len(tests)}
    target = COPY / "src" / "heelstrike" / mutant.file
    target.write_text(mutant.apply(text))
    begin = time.monotonic()
    order, verdict = STATE / "order.txt", STATE / "verdict.json"
    try:
        for part in (tests[:QUICK], tests[QUICK:]):
            if not part:
                continue
            order.write_text("\n".join(part) + "\n")
            verdict.unlink(missing_ok=True)
            files = dict.fromkeys(test.split("::")[0] for test in part)
            status = pytest(
                ["-x", *files],
                limit=300.0 + 20.0 * sum(reached.seconds[test] for test in part),
                ORDER=str(order),
                VERDICT=str(verdict),
                DEADLINE=str(DEADLINE),
            )
            found["outcome"] = {0: "survived", None: "endless"}.get(status, "caught")
            if verdict.exists():
                found |= json.loads(verdict.read_text())
            if found["outcome"] != "survived":
                break
    finally:
        target.write_text(text)
    return found | {"seconds": round(time.monotonic() - begin, 1)}


def run(mutants: list[Mutant], *, anew: bool = False) -> None:
    """Ask for all mutants that the ledger does not know, or for all."""
    copy_sources()
    reached = Reached()
    known = set() if anew else {_entry_key(each) for each in read_lines(LEDGER)}
    for place, mutant in enumerate(mutants):
        if key(mutant) in known:
            continue
        found = ask(mutant, reached)
        with LEDGER.open("a") as ledger:
            ledger.write(json.dumps(found, ensure_ascii=False) + "\n")
        print(
            f"{place + 1}/{len(mutants)} {found['outcome']:<11} {found['seconds']:6.1f} s  "
            f"{mutant.file}:{mutant.line}  {found['line']}  →  {found['changed']}",
            flush=True,
        )


def _entry_key(entry: dict[str, Any]) -> tuple[str, ...]:
    return tuple(entry[name] for name in KEY)


def survivors(mutants: list[Mutant]) -> list[Mutant]:
    """Those of some mutants that the ledger's last word is not caught."""
    outcome = {_entry_key(each): each["outcome"] for each in read_lines(LEDGER)}
    return [m for m in mutants if outcome.get(key(m)) in ("survived", "not reached")]


def table(mutants: list[Mutant], seed: int) -> str:
    """What became of the mutants, as Markdown."""
    ledger = {_entry_key(each): each for each in read_lines(LEDGER)}
    explained = json.loads(EXPLAINED.read_text()) if EXPLAINED.exists() else []
    reasons = {_entry_key(each): each for each in explained}
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
        command.add_argument("--number", type=int, default=240)
        command.add_argument("--package", action="append", choices=list(SHARES))
    asked = parser.parse_args()
    STATE.mkdir(parents=True, exist_ok=True)
    if asked.command in ("reach", "run", "again"):
        load_libraries()
    if asked.command == "reach":
        reach(asked.paths)
        return
    mutants = drawn(asked.seed, asked.number)
    if asked.package:
        mutants = [m for m in mutants if m.file.split("/")[0] in asked.package]
    if asked.command == "run":
        run(mutants)
    elif asked.command == "again":
        run(survivors(mutants), anew=True)
    elif asked.command == "list":
        for mutant in mutants:
            print(mutant.kind, *key(mutant), sep="\t")
    else:
        print(table(mutants, asked.seed))


if __name__ == "__main__":
    main()
