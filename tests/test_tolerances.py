"""Tolerances have names, one each, and kernels hold no number that has none."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import heelstrike as hs
from heelstrike import tolerances

HOME = Path(hs.__file__).parent
SOURCES = sorted(HOME.rglob("*.py"))
STILL = ("analysis/stability", "analysis/poincare_map", "analysis/limit_cycle", "sim/contacts",
         "sim/event_driven", "sim/time_stepping", "control/gait_lqr")  # fmt: skip
"""Where tolerances still have names of others, or none."""

BASE_OF_POWERS = {
    ("contact/solvers/fischer_burmeister.py", "fischer_burmeister", 10.0),
    ("contact/solvers/lemke.py", "covering", 10.0),
}
OF_A_POLYNOMIAL = {("control/stepping_constraints.py", "blend", 10.0)}
"""The smoothest step of degree five is 10 s³ - 15 s⁴ + 6 s⁵."""


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def place(path: Path) -> str:
    return path.relative_to(HOME).as_posix()


def small_constants(path: Path) -> Iterator[tuple[str, float]]:
    """Constants of a module that are less than a thousandth, as tolerances are."""
    for statement in tree_of(path).body:
        if not isinstance(statement, ast.Assign):
            continue
        target, value = statement.targets[0], statement.value
        both = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
        pairs = zip(target.elts, value.elts, strict=True) if both else [(target, value)]  # type: ignore[attr-defined]
        for name, number in pairs:
            known = isinstance(number, ast.Constant) and isinstance(number.value, float)
            if known and isinstance(name, ast.Name) and 0.0 < number.value < 1e-3:
                yield name.id, number.value


def test_no_name_stands_for_two_tolerances() -> None:
    found = defaultdict(set)
    for path in SOURCES:
        if not place(path).startswith(STILL):
            for name, _ in small_constants(path):
                found[name].add(place(path))
    assert {name: places for name, places in found.items() if len(places) > 1} == {}


def test_every_shared_tolerance_says_what_it_decides_and_is_used() -> None:
    body = ast.parse(Path(tolerances.__file__).read_text(encoding="utf-8")).body
    names = set()
    for statement, below in zip(body, [*body[1:], None], strict=True):
        if isinstance(statement, ast.Assign):
            assert isinstance(below, ast.Expr), ast.unparse(statement)
            names.add(ast.unparse(statement.targets[0]))
    users = defaultdict(set)
    for path in SOURCES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ImportFrom) and node.module == tolerances.__name__:
                for alias in node.names:
                    users[alias.name].add(place(path))
    assert names
    assert set(users) == names


def is_kernel(function: ast.FunctionDef) -> bool:
    marks = (mark.func if isinstance(mark, ast.Call) else mark for mark in function.decorator_list)
    return any(isinstance(mark, ast.Name) and mark.id.endswith("kernel") for mark in marks)


def is_coefficient(number: float) -> bool:
    """Whether a number is one of formulas: whole, or made of quarters; ten is a tolerance's."""
    return (4.0 * number).is_integer() and abs(number) < 100.0 and number != 10.0


def nameless(path: Path) -> set[tuple[str, str, float]]:
    """Numbers of kernels that are no coefficients: file, kernel and number."""
    tree = tree_of(path)
    kernels = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and is_kernel(n)]
    return {
        (place(path), kernel.name, node.value)
        for kernel in kernels
        for node in ast.walk(kernel)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, float)
        and not is_coefficient(node.value)
    }


def test_numbers_of_kernels_have_names() -> None:
    """But for the exceptions, each of which is one."""
    found = set().union(*map(nameless, SOURCES))
    exceptions = BASE_OF_POWERS | OF_A_POLYNOMIAL
    assert {each for each in found - exceptions if not each[0].startswith(STILL)} == set()
    assert found >= exceptions
