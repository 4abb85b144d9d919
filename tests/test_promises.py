"""What README.md promises is what the tests ask: each row of its table names where, and how much.

A row gives a figure and a test. The test must be there, and the figure must be one that it asks
for: in an assertion, or as a constant of the file or a parameter of the test. So neither can change
without the other. Figures of speed are not asked of any machine; they are those of
docs/performance.md, which `make bench` measures.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import robot_cases

from heelstrike.cli.main import app
from heelstrike.cli.walk import walk
from heelstrike.compiler.recordings.recording import Program, Recording
from heelstrike.compiler.recordings.tape import Entry, Operation, Result
from heelstrike.dynamics.kernels import state_equations
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot import builtin_robots, load_robot

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PERFORMANCE = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")


def rows(page: str, heading: str) -> list[list[str]]:
    """Cells of the first table after the words `heading`, without its head."""
    _, found, after = page.partition(heading)
    assert found, heading
    table = re.search(r"(?:^\|.*\|$\n?)+", after, re.MULTILINE)
    assert table is not None, heading
    return [
        [cell.strip() for cell in line.strip("|").split(" | ")]
        for line in table[0].splitlines()[2:]
    ]


PROMISES = {what: (figure, test) for what, figure, test in rows(README, "## What it promises")}
TESTED = {what: promise for what, promise in PROMISES.items() if "`tests/" in promise[1]}
MEASURED = {what: promise for what, promise in PROMISES.items() if what not in TESTED}


def numbers_asked_for(file: Path) -> set[float]:
    """Numbers in the assertions, constants and parameters of a file of tests."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    places: list[ast.AST] = [node for node in tree.body if isinstance(node, ast.Assign)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Assert):
            places.append(node)
        elif isinstance(node, ast.FunctionDef):
            places += node.decorator_list
        elif isinstance(node, ast.Call) and "assert_" in ast.unparse(node.func):
            places.append(node)
    return {
        float(node.value)
        for place in places
        for node in ast.walk(place)
        if isinstance(node, ast.Constant) and type(node.value) in (int, float)
    }


def test_there_are_promises_of_both_kinds() -> None:
    assert len(TESTED) >= 10
    assert len(MEASURED) == 3


@pytest.mark.parametrize("what", TESTED)
def test_the_figure_of_a_promise_is_asked_for_by_its_test(what: str) -> None:
    figure, named = TESTED[what]
    files: set[Path] = set()
    for path in re.findall(r"`(tests/[^`]+)`", named):
        place = ROOT / path
        assert place.exists(), path
        files |= {place} if place.is_file() else set(place.glob("test_*.py"))
    asked = set().union(*map(numbers_asked_for, files))
    for text in re.findall(r"[\d.]+e-\d+", figure):
        assert float(text) in asked, f"{text} in none of {sorted(file.name for file in files)}"


def test_counts_are_those_of_the_tests() -> None:
    spoilt = (ROOT / "tests" / "robot" / "files" / "test_spoilt_files.py").read_text(
        encoding="utf-8"
    )
    each = re.search(r"^EACH = (\d+)", spoilt, re.MULTILINE)
    assert each is not None
    files = int(each[1]) * len(builtin_robots()) * 2  # MJCF and URDF
    assert any(what.startswith(f"{files} spoilt robot files") for what in TESTED)
    trees = len(robot_cases.MANY)
    assert any(f"all built-in robots and {trees} random trees" in what for what in TESTED)
    assert {case.name for case in robot_cases.NAMED} >= set(builtin_robots())


def test_commands_do_what_is_said_of_them() -> None:
    commands = {command.name or command.callback.__name__ for command in app.registered_commands}
    named = {word for word in re.findall(r"`heelstrike (\w+)", README) if word.islower()}
    assert {"walk", "inspect", "paper", "compare", "robots"} <= named <= commands
    steps = inspect.signature(walk).parameters["steps"].default
    assert f"walks {steps} steps" in README
    assert all("`make bench`" in place for _, place in MEASURED.values())


def test_fifteen_lines_are_fifteen() -> None:
    _, _, after = README.partition("## Fifteen lines")
    block = re.search(r"```python\n(.*?)```", after, re.DOTALL)
    assert block is not None
    assert len(block[1].splitlines()) == 15


# Speeds: README says in short what the page says in full.


def promise(words: str) -> str:
    (figure,) = [figure for what, (figure, _) in MEASURED.items() if words in what]
    return figure


def test_speeds_are_those_of_the_page() -> None:
    times = {
        cells[0]: [float(re.findall(r"\(([\d.]+) ×\)", cell)[0]) for cell in cells[2:6]]
        for cells in rows(PERFORMANCE, "µs a step of 1 ms")
    }
    standing = [factors[0] for scenario, factors in times.items() if "standing" in scenario]
    others = [factor for factors in times.values() for factor in factors[1:]]
    assert promise("a step of 1 ms") == (
        f"{min(standing):.1f}–{max(standing):.1f} × faster standing on four points, "
        f"{times['bravo7 walking'][0]:.1f} × walking, {times['bravo7 falling'][0]:.1f} × falling, "
        f"{times['bravo7 lying'][0]:.1f} × lying; "
        f"{min(others):.0f}–{max(others):.0f} × faster than Drake, Bullet and DART"
    )


def test_precision_is_that_of_the_page() -> None:
    table = rows(PERFORMANCE, "least computing time for an error of 0.0001 rad")
    sides = {cells[0]: cells for cells in table}
    ours = 1e3 * float(sides["heelstrike"][2])
    bullet, dart, drake = (float(sides[name][3]) for name in ("Bullet", "DART", "Drake"))
    assert sides["MuJoCo"][1].startswith("not reached")
    assert min(dart, drake) > bullet
    assert promise("1 s of walking, joints exact to 1e-4 rad") == (
        f"{ours:.0f} ms; Bullet takes {round(bullet, -2):.0f} × as long, DART and Drake longer; "
        "MuJoCo does not reach this precision"
    )


def test_growth_is_that_of_the_page() -> None:
    tables = [rows(PERFORMANCE, title) for title in ("a chain of hinges*", "plank on many points")]
    ranges = [
        f"{sizes[0]} to {sizes[-1]}"
        for table in tables
        for sizes in [[cells[0] for cells in table if cells[0].isdigit()]]
    ]
    assert promise(f"a chain of {ranges[0]} joints, {ranges[1]} contact points") == (
        "faster than each of them at every size"
    )
    for table in tables:
        for cells in table:
            if cells[0].isdigit():
                peers = [float(cell) for cell in cells[2:6] if re.fullmatch(r"[\d.e+]+", cell)]
                assert min(peers) > float(cells[1])


def test_instructions_are_those_that_are_kept() -> None:
    kept = json.loads((ROOT / "benchmarks" / "instructions.json").read_text(encoding="utf-8"))
    table = rows(PERFORMANCE, "benchmark: instructions")
    told = {name: float(count) for name, count, *_ in table}
    assert told == {name: round(n) for name, n in kept["instructions_a_step"].items()}
    beside = {name: float(times) for name, _, times in table if times}
    assert beside == kept["times_sticking"]


def test_operations_are_those_that_are_recorded() -> None:
    """What straight-line code of bravo7's equations of motion computes, and reads to do so."""
    robot = load_robot("bravo7")
    matrix, vector = np.zeros((robot.nv, robot.nv)), np.zeros(robot.nv)
    equations = Program(
        state_equations,
        {
            "model": robot.model, "q": vector, "v": vector,
            "tree": Workspace.allocate(robot.model.extents),
            "matrix": matrix, "factor": matrix, "bias": vector,
        },
    )  # fmt: skip
    recording = Recording(equations, known={"tree.zero": np.zeros(robot.nv)})
    results = [value for value in recording.tape.values if isinstance(value, Result)]
    count = Counter(value.operation for value in results)
    sines = count[Operation.SINE]
    assert sines == count[Operation.COSINE]
    operands = {operand for value in results for operand in value.operands}
    read = sum(isinstance(operand, Entry) for operand in operands)
    assert (
        f"{len(results) + read} operations for bravo7: {count[Operation.MULTIPLY]} products, "
        f"{count[Operation.ADD] + count[Operation.SUBTRACT]} sums and differences, "
        f"{count[Operation.NEGATE]} negations, {count[Operation.DIVIDE]} divisions, "
        f"{sines} sines, {sines} cosines, {read} numbers read"
    ) in " ".join(PERFORMANCE.split())
