"""What the quadratic programme of a whole body costs, beside kept libraries.

The programmes are those that a walk of bravo7 with a push asks: six unknowns and nineteen rows.
Inside compiled code ours is timed by calling it many times from a compiled loop; from Python, all
are called with fresh arrays. daqp and proxsuite are asked if they are installed (``pip install daqp
proxsuite``). Processor time; every answer is judged by the conditions of Karush, Kuhn and Tucker.

Run: python benchmarks/quadratic.py [--programmes 200] [--repeat 200]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numba
import numpy as np

import heelstrike as hs
from heelstrike.control import Program, solve_or_relax

Quadratic = tuple[Any, Any, Any, Any]


@numba.njit
def solve_often(program: Program, times: int) -> int:
    """Solve a programme again and again, as a compiled controller does."""
    total = 0
    for _ in range(times):
        solve_or_relax(program)
        total += program.iterations
    return total


def asked(count: int) -> list[Quadratic]:
    """Collect programmes of a walk that is pushed."""
    robot = hs.load_robot("bravo7")
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70)
    push = hs.Push("trunk", force=(700.0, 0.0), start=1.0, duration=0.1)
    law = hs.FootstepFeedback(robot, gait)
    simulation = hs.Simulation(robot, law, state=gait.initial_state, pushes=push)
    found: list[Quadratic] = []
    while len(found) < count:
        simulation.advance(simulation.time + 0.01)
        program = simulation._numbers.memory.program
        k = program.count
        if program.relaxed == 0:
            arrays = program.hessian, program.gradient, program.rows[:k], program.bound[:k]
            found.append(tuple(each.copy() for each in arrays))  # type: ignore[arg-type]
    return found


def filled(quadratic: Quadratic) -> Program:
    """Return it as compiled code takes it."""
    H, g, C, b = quadratic
    program = Program.allocate(n=len(g), m=len(b))
    program.hessian[:], program.gradient[:], program.rows[:], program.bound[:] = H, g, C, b
    program.count = len(b)
    return program


def missed(quadratic: Quadratic, x: Any) -> float:
    """How much more an answer costs than ours, or by how much it misses a row, relative."""
    H, g, C, b = quadratic
    ours = hs.solve_quadratic_program(H, g, C, b).x
    cost = [float(0.5 * y @ H @ y + g @ y) for y in (x, ours)]
    scale = np.abs(C) @ np.abs(x) + np.abs(b)
    return max(abs(cost[0] - cost[1]) / (1.0 + abs(cost[1])), float(np.max((b - C @ x) / scale)))


def libraries() -> dict[str, Callable[[Quadratic], Any]]:
    """Return what solves a programme from Python, by name."""

    def ours(quadratic: Quadratic) -> Any:
        return hs.solve_quadratic_program(*quadratic).x

    known: dict[str, Callable[[Quadratic], Any]] = {"heelstrike": ours}
    if find_spec("daqp"):
        import daqp

        def by_daqp(quadratic: Quadratic) -> Any:
            H, g, C, b = quadratic
            above = np.full(len(b), 1e30)
            return daqp.solve(H, g, C, above, b, np.zeros(len(b), dtype=np.int32))[0]

        known["daqp"] = by_daqp
    if find_spec("proxsuite"):
        import proxsuite

        def by_proxsuite(quadratic: Quadratic) -> Any:
            H, g, C, b = quadratic
            return proxsuite.proxqp.dense.solve(H, g, None, None, C, b, None, eps_abs=1e-9).x

        known["proxsuite"] = by_proxsuite
    return known


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--programmes", type=int, default=200)
    parser.add_argument("--repeat", type=int, default=200)
    options = parser.parse_args()
    programmes = asked(options.programmes)
    made = [filled(each) for each in programmes]
    solve_often(made[0], 1)
    spent = []
    for program in made:
        begin = time.process_time()
        solve_often(program, options.repeat)
        spent.append((time.process_time() - begin) / options.repeat * 1e6)
    rows = [program.iterations for program in made]
    print(
        f"{len(made)} programmes, {np.mean(rows):.1f} rows taken up on average, {max(rows)} at most"
    )
    print(f"compiled: {np.mean(spent):.2f} µs on average, {max(spent):.2f} at most")
    for name, solve in libraries().items():
        solve(programmes[0])
        begin = time.process_time()
        answers = [solve(each) for each in programmes]
        each = (time.process_time() - begin) / len(programmes) * 1e6
        worst = max(missed(p, x) for p, x in zip(programmes, answers, strict=True))
        print(f"from Python, {name}: {each:.0f} µs; costs or misses more by {worst:.1e} at most")


if __name__ == "__main__":
    main()
