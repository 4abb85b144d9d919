"""Random contact problems through every solver, at large.

200 000 problems of 1 to 8 contacts (tests/contact/contact_problems.py says which): redundant,
degenerate, friction from 0 to 2, masses over seven orders of magnitude. Each goes through every
solver alone and through each with its fallbacks. A solve counts as certified only if the contact
laws, written down a second time in NumPy, confirm it to 1e-9.

The answers of different solvers are compared wherever both are certified alone. An answer whose
residual is above 1e-11 is compared as users get it, sharpened by the solvers that come next.

Two certified answers with different velocities are two solutions: Coulomb's law allows several.
They are counted apart, and only if each meets the laws a hundred times more sharply than their
velocities differ; anything else that differs by more than 1e-8 is a disagreement.

Run: python benchmarks/contact_campaign.py [--number 200000] [--seed 0] [--json]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.contact.modes import SOLVED, Solver
from heelstrike.contact.problem import solve_contact_kernel, solver_order
from heelstrike.contact.search import CLEAN, contact_workspace
from heelstrike.contact.workspace import LAST_FALLBACKS

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "contact"))

from contact_oracle import residual
from contact_problems import Problem, random_problem

SOLVERS = (Solver.LEMKE, Solver.FISCHER_BURMEISTER, Solver.GAUSS_SEIDEL)
TOLERANCE = 1e-9
AGREEMENT = 1e-8


class Bench:
    """One set of buffers for all problems."""

    def __init__(self) -> None:
        self.work = contact_workspace(8)
        self.mode = np.zeros(8, np.int64)
        self.impulse, self.velocity = np.zeros(16), np.zeros(16)
        self.residual = np.zeros(3)

    def solve(self, problem: Problem, order: Any) -> tuple[bool, Any, float]:
        """Return whether the kernel claims success, the impulse, and the residual measured here."""
        self.mode[:] = 0
        status = solve_contact_kernel(
            problem.count,
            problem.delassus,
            problem.free,
            problem.friction,
            order,
            self.mode,
            self.impulse,
            self.velocity,
            self.residual,
            self.work,
        )
        impulse = self.impulse[: 2 * problem.count].copy()
        worst = residual(problem.delassus, problem.free, problem.friction, impulse)
        return status == SOLVED, impulse, worst


def compare(
    problem: Problem, first: Any, second: Any, sharpness: float
) -> tuple[str, float, float]:
    """Tell whether two certified impulses agree, are two solutions, or disagree."""
    change = problem.delassus @ (first - second)
    unit = np.abs(problem.free).max() + np.abs(problem.delassus) @ np.abs(first) + 1e-300
    velocity = float(np.max(np.abs(change) / unit))
    root = np.sqrt(np.diag(np.linalg.inv(problem.mass_matrix)))
    wrench = np.max(root * np.abs(problem.jacobian.T @ (first - second)))
    wrench /= max(np.max(root * (np.abs(problem.jacobian.T) @ np.abs(first))), 1e-300)
    if max(velocity, wrench) <= AGREEMENT:
        return "agree", velocity, wrench
    return ("several" if sharpness < 1e-2 * velocity else "disagree"), velocity, wrench


def campaign(number: int, seed: int) -> dict[str, Any]:
    """Solve ``number`` problems and return the counts."""
    bench = Bench()
    alone = {solver: solver_order(solver, fallback=False) for solver in SOLVERS}
    together = {solver: solver_order(solver) for solver in SOLVERS}
    table: dict[str, Any] = {
        "number": number,
        "seed": seed,
        "certified_alone": {s.value: 0 for s in SOLVERS},
        "certified_after_fallback": {s.value: 0 for s in SOLVERS},
        "fallbacks": {s.value: 0 for s in SOLVERS},
        "wrong_claims": 0,
        "worst_certified_residual": 0.0,
        "pairs": {"agree": 0, "several": 0, "disagree": 0},
        "worst_velocity_difference": 0.0,
        "worst_wrench_difference": 0.0,
        "unsolved": [],
        "disagreements": [],
    }
    begin = time.perf_counter()
    for index in range(number):
        problem = random_problem(np.random.default_rng([seed, index]))
        certified = {}
        for solver in SOLVERS:
            claim, impulse, worst = bench.solve(problem, alone[solver])
            table["wrong_claims"] += claim != (worst <= TOLERANCE)
            table["certified_alone"][solver.value] += claim
            itself = claim
            if worst > CLEAN:
                claim, impulse, worst = bench.solve(problem, together[solver])
                table["wrong_claims"] += claim != (worst <= TOLERANCE)
                table["fallbacks"][solver.value] += int(bench.work.counters[LAST_FALLBACKS])
                if not claim:
                    table["unsolved"].append([index, solver.value])
            if itself:
                certified[solver] = (impulse, worst)
            table["certified_after_fallback"][solver.value] += claim
            if claim:
                table["worst_certified_residual"] = max(table["worst_certified_residual"], worst)
        if Solver.LEMKE not in certified:
            continue
        first, sharp = certified[Solver.LEMKE]
        for solver in SOLVERS[1:]:
            if solver in certified:
                second, other = certified[solver]
                verdict, velocity, wrench = compare(problem, first, second, max(sharp, other))
                table["pairs"][verdict] += 1
                if verdict == "agree":
                    worst = max(table["worst_velocity_difference"], velocity)
                    table["worst_velocity_difference"] = worst
                    worst = max(table["worst_wrench_difference"], float(wrench))
                    table["worst_wrench_difference"] = worst
                elif verdict == "disagree":
                    table["disagreements"].append([index, solver.value, velocity, float(wrench)])
    table["seconds"] = time.perf_counter() - begin
    return table


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    table = campaign(options.number, options.seed)
    if options.json:
        print(json.dumps(table, indent=2))
        return
    number = table["number"]
    print(f"{number} problems in {table['seconds']:.0f} s")
    print(f"{'':20s} {'alone':>12s} {'after fallback':>16s}")
    for solver in SOLVERS:
        share = 100.0 * table["certified_alone"][solver.value] / number
        final = 100.0 * table["certified_after_fallback"][solver.value] / number
        print(f"{solver.value:20s} {share:11.4f}% {final:15.4f}%")
    print(f"claims that the residuals do not confirm: {table['wrong_claims']}")
    print(f"worst certified residual: {table['worst_certified_residual']:.1e}")
    pairs = table["pairs"]
    print(
        f"pairs of solvers: {pairs['agree']} agree, {pairs['several']} found two solutions, "
        f"{pairs['disagree']} disagree"
    )
    print(
        f"worst difference where they agree: velocity {table['worst_velocity_difference']:.1e}, "
        f"wrench {table['worst_wrench_difference']:.1e}"
    )
    for kind in ("unsolved", "disagreements"):
        if table[kind]:
            print(f"{kind}: {table[kind][:20]}")


if __name__ == "__main__":
    main()
