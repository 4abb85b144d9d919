"""What one contact solve costs, compiled, with both feet of bravo7 flat on the ground.

Four vertices, eight rows, rank six. The free velocities are those of 200 postures and joint
velocities around standing, under gravity and small random torques for one millisecond; cold
solves go through Lemke, warm ones are given the modes of the solution before.

Run: python benchmarks/contact_cost.py
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np
from rich.console import Console
from speed.stopwatch import best_of, timed
from table import Table

from heelstrike import load_robot
from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, Solver
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, contact_problem
from heelstrike.dynamics import bias_force, mass_matrix, point_jacobian

BATCHES = 20


@kernel
def solve_many(repeats: int, problem: Any, order: Any, first: Any, work: Any, answer: Any) -> int:
    """Solve one problem ``repeats`` times from the same first modes; return the failures."""
    failures = 0
    for _ in range(repeats):
        for i in range(problem.count):
            answer.mode[i] = first[i]
        failures += solve_contact_kernel(order, problem, work, answer) != 0
    return failures


def standing_problems(number: int) -> list[tuple[Any, Any]]:
    """Return Delassus matrices and free velocities of bravo7 on both feet, knees bent."""
    robot = load_robot("bravo7")
    rng = np.random.default_rng(0)
    bend = {"hip": -0.3, "knee": 0.6, "ankle": -0.3}
    problems = []
    for _ in range(number):
        q = robot.reference_state().q
        factor = rng.uniform(0.5, 1.5)
        for place, name in enumerate(robot.joint_names):
            for part, angle in bend.items():
                q[place] += factor * angle * (part in name)
        v = 1e-3 * rng.standard_normal(robot.nv)
        M = mass_matrix(robot, q)
        J = np.concatenate(
            [
                point_jacobian(robot, q, link, local)[[1, 0]]  # z is the normal, x the tangent
                for link, local in zip(
                    robot.model.contact_link, robot.model.contact_position, strict=True
                )
            ]
        )
        torque = rng.uniform(-5.0, 5.0, robot.nv)
        torque[:3] = 0.0
        free = J @ (v + 1e-3 * np.linalg.solve(M, torque - bias_force(robot, q, v)))
        problems.append((J @ np.linalg.solve(M, J.T), free))
    return problems


def measure(number: int = 200, repeats: int = 20) -> dict[str, dict[str, float]]:
    """Return median and 99th percentile of the time per solve, in microseconds."""
    problems = standing_problems(number)
    count = problems[0][1].size // 2
    friction = np.full(count, 0.75)
    work = contact_workspace(count)
    answer = ContactAnswer.allocate(capacity=count)
    cold = np.full(count, OPEN, np.int64)
    figures: dict[str, dict[str, float]] = {}
    for name in ("lemke", "fischer_burmeister", "gauss_seidel", "warm"):
        order = np.array([Solver("lemke" if name == "warm" else name).code], np.int64)
        times = []
        shortcuts = 0
        for delassus, free in problems:
            problem = contact_problem(
                count, count=count, delassus=delassus, free=free, friction=friction
            )
            solve_contact_kernel(order, problem, work, answer)
            first = answer.mode.copy() if name == "warm" else cold
            rest = (problem, order, first, work, answer)
            if solve_many(1, *rest) != 0:
                raise RuntimeError(f"{name} failed on a standing problem: {answer.residual}")
            work.tally.shortcuts = 0
            solve_many(repeats, *rest)
            shortcuts += work.tally.shortcuts

            def batch(rest: Any = rest) -> float:
                return timed(solve_many, repeats, *rest)[1]

            times.append(best_of({"": batch}, seconds=0.0, least=BATCHES)[""] / repeats * 1e6)
        figures[name] = {
            "median_us": float(np.median(times)),
            "p99_us": float(np.percentile(times, 99)),
            "warm_share": shortcuts / (number * repeats),
        }
    return figures


def main() -> None:
    """Print the figures as a table, or as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON")
    figures = measure()
    if parser.parse_args().json:
        print(json.dumps(figures, indent=2))
        return
    body = [
        [name, f"{row['median_us']:.2f}", f"{row['p99_us']:.2f}"] for name, row in figures.items()
    ]
    head = ["solver", "median", "99 %"]
    Console().print(Table("both feet flat, 4 vertices, µs per solve", head, body))


if __name__ == "__main__":
    main()
