"""Random contact problems through the solvers, at large, before a judge in exact arithmetic.

Two kinds, described in tests/contact/contact_problems.py. *Robots*: trees of links that touch
the ground; all of them have a solution. *Hard*: random rows that depend on each other exactly or
nearly, masses 1e8 apart, friction up to 1000; half are planted from a solution, the others are
drawn, and many of these have none.

A certified answer is false if its residuals, computed from the original data in whole numbers,
exceed the tolerance. Planted problems are told by their effort, the largest sum of ``|G lambda|``
of a row in units of the data's velocities: what an effort of 1e7 asks for, double precision cannot
write down. Problems of the drawn kind with up to three contacts that stay unsolved are enumerated:
every combination of modes is a linear program.

With ``--solvers`` every problem of the first kind goes through each solver alone, too, and
certified answers are compared: Coulomb's law allows several solutions, and two answers count as two
of them only if each meets the laws a hundred times more sharply than they differ.

Run: python benchmarks/contact_campaign.py [--number 100000] [--seed 0] [--solvers] [--json]
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from table import Table

from heelstrike.contact import ContactSolution, SolveStatus, solve_contact

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "contact"))

from contact_oracle import effort, enumerated, residual
from contact_problems import Problem, hard_problem, random_problem

SOLVERS = ("lemke", "fischer_burmeister", "gauss_seidel")
TOLERANCE = 1e-9
AGREEMENT = 1e-8
WRITABLE = 1e5
"""Effort up to which a planted problem counts as one that must be solved."""


def judge(problem: Problem, solution: ContactSolution) -> float:
    """Residual of an answer, by the judge."""
    return residual(problem.delassus, problem.free, problem.friction, solution.impulse.ravel())


def decade(value: float) -> str:
    """Name of the decade a number is in, small ones together."""
    return f"planted, effort 1e{max(0, math.floor(math.log10(max(value, 1.0)))):02d}"


def campaign(number: int, seed: int, *, compare_solvers: bool) -> dict[str, Any]:
    """Solve ``number`` problems of each kind and return the counts."""
    ended: dict[str, Counter[str]] = defaultdict(Counter)
    table: dict[str, Any] = {
        "number": number,
        "seed": seed,
        "ended": ended,
        "false_certificates": [],
        "certificates_withheld": [],
        "worst_certified_residual": 0.0,
        "planted_to_be_solved": 0,
        "planted_unsolved": [],
        "planted_beyond_neither_solved_nor_undecidable": [],
        "enumerated_without_solution": 0,
        "enumerated_with_solution": [],
        "pairs": Counter(),
        "disagreements": [],
    }
    begin = time.perf_counter()
    for kind in ("robots", "hard"):
        for index in range(number):
            rng = np.random.default_rng([seed, index, kind == "hard"])
            planted = None
            if kind == "robots":
                problem = random_problem(rng)
            else:
                problem, impulse = hard_problem(rng)
                planted = impulse if np.all(np.isfinite(impulse)) else None
            solution = solve_contact(problem.delassus, problem.free, problem.friction)
            worst = judge(problem, solution)
            status = solution.certificate.status
            if solution.certificate.valid:
                table["worst_certified_residual"] = max(table["worst_certified_residual"], worst)
                if not worst <= TOLERANCE:
                    table["false_certificates"].append([kind, index, worst])
            elif worst <= TOLERANCE:
                table["certificates_withheld"].append([kind, index, worst])
            if planted is not None:
                needed = effort(problem.delassus, problem.free, planted)
                name = decade(needed)
                if needed <= WRITABLE:
                    table["planted_to_be_solved"] += 1
                    if status is not SolveStatus.SOLVED:
                        table["planted_unsolved"].append([index, needed, status.name])
                elif status not in (SolveStatus.SOLVED, SolveStatus.UNDECIDABLE):
                    table["planted_beyond_neither_solved_nor_undecidable"].append([index, needed])
            else:
                name = "robots" if kind == "robots" else "drawn"
                if status is not SolveStatus.SOLVED and problem.count <= 3:
                    enumerate_unsolved(problem, index, table)
            ended[name][status.name] += 1
            if compare_solvers and kind == "robots":
                compare_all(problem, index, table)
    table["seconds"] = time.perf_counter() - begin
    return table


def enumerate_unsolved(problem: Problem, index: int, table: dict[str, Any]) -> None:
    """See whether an unsolved problem has a solution that can be written down after all."""
    data = (problem.delassus, problem.free, problem.friction)
    for impulse in enumerated(*data):
        if residual(*data, impulse) <= TOLERANCE and effort(*data[:2], impulse) <= WRITABLE:
            table["enumerated_with_solution"].append(index)
            return
    table["enumerated_without_solution"] += 1


def compare_all(problem: Problem, index: int, table: dict[str, Any]) -> None:
    """Compare the answers of the solvers alone with that of the first."""
    data = (problem.delassus, problem.free, problem.friction)
    alone = {name: solve_contact(*data, solver=name, fallback=False) for name in SOLVERS}
    for name, solution in alone.items():
        table["ended"][f"{name} alone"][solution.certificate.status.name] += 1
    first = alone[SOLVERS[0]]
    for name in SOLVERS[1:]:
        second = alone[name]
        if first.certificate.valid and second.certificate.valid:
            verdict, difference = compare(problem, first, second)
            table["pairs"][verdict] += 1
            if verdict == "disagree":
                table["disagreements"].append([index, name, difference])


def compare(problem: Problem, first: ContactSolution, second: ContactSolution) -> tuple[str, float]:
    """Tell whether two certified impulses agree, are two solutions, or disagree."""
    one, two = first.impulse.ravel(), second.impulse.ravel()
    unit = np.abs(problem.free).max() + np.abs(problem.delassus) @ np.abs(one) + 1e-300
    velocity = float(np.max(np.abs(problem.delassus @ (one - two)) / unit))
    root = np.sqrt(np.diag(np.linalg.inv(problem.mass_matrix)))
    wrench = np.max(root * np.abs(problem.jacobian.T @ (one - two)))
    wrench /= max(np.max(root * (np.abs(problem.jacobian.T) @ np.abs(one))), 1e-300)
    if max(velocity, wrench) <= AGREEMENT:
        return "agree", velocity
    sharpness = max(first.certificate.worst, second.certificate.worst)
    return ("several" if sharpness < 1e-2 * velocity else "disagree"), velocity


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--solvers", action="store_true")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    table = campaign(options.number, options.seed, compare_solvers=options.solvers)
    if options.json:
        print(json.dumps(table, indent=2))
        return
    print(f"{2 * table['number']} problems, seed {table['seed']}, in {table['seconds']:.0f} s")
    statuses = [status.name for status in SolveStatus]
    rows = [
        [name, *(str(counts[status]) for status in statuses)]
        for name, counts in sorted(table["ended"].items())
    ]
    Console().print(Table("", ["problems", *(name.lower() for name in statuses)], rows))
    print(f"worst certified residual: {table['worst_certified_residual']:.1e}")
    unsolved = len(table["planted_unsolved"])
    share = 100.0 * (1.0 - unsolved / max(1, table["planted_to_be_solved"]))
    print(f"planted, effort up to 1e5: {share:.4f} % of {table['planted_to_be_solved']} solved")
    print(f"enumerated and without a solution: {table['enumerated_without_solution']}")
    if table["pairs"]:
        print(f"pairs of solvers: {dict(table['pairs'])}")
    for kind in (
        "false_certificates",
        "certificates_withheld",
        "planted_unsolved",
        "planted_beyond_neither_solved_nor_undecidable",
        "enumerated_with_solution",
        "disagreements",
    ):
        print(f"{kind.replace('_', ' ')}: {len(table[kind])} {table[kind][:10] or ''}")


if __name__ == "__main__":
    main()
