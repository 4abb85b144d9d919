"""What the quadratic programme of a whole body costs, beside kept libraries.

The programmes are those that a walk of bravo7 with a push asks: six unknowns and nineteen rows.
Inside compiled code ours is timed by calling it many times from a compiled loop; from Python, all
are called with fresh arrays. daqp and proxsuite are asked if they are installed (``pip install daqp
proxsuite``). Processor time; every answer is judged by the conditions of Karush, Kuhn and Tucker.

With ``--campaign`` so many programmes are made from a seed and solved in compiled code, in equal
parts of each kind: with rows that a point keeps with room to spare; with that point on eight of
the rows, more than there are unknowns, from where one direction leads inside all of them; with
pairs of rows that leave a gap of 1e-3 to 1e-8 between them; with pairs that contradict each other,
of which a level may be given up; and those of the walk, with forces and bounds disturbed by up to a
tenth. Rows differ in size by 1e6, costs by up to 1e8. Counted are those that are not solved, and
the worst of each residual of the certificate, which is relative to the size of a row's terms.

Run: python benchmarks/quadratic.py [--programmes 200] [--repeat 200] [--campaign 1000000 --seed 1]
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


# Generators of numpy go into compiled code as arguments.
KINDS = ("room", "corner", "gap", "contradiction", "walk")
UNKNOWNS, ROWS, MOTORS = 6, 19, 12
"""Of a whole body: twelve rows are those of motors, which are never given up."""


@numba.njit
def make_cost(draw: Any, program: Program) -> None:
    """Make a cost whose curvatures differ by up to 1e8."""
    n = program.x.shape[0]
    spread = 4.0 * draw.random()
    factor = draw.standard_normal((n, n))
    for i in range(n):
        scale = 10.0 ** (spread * (2.0 * draw.random() - 1.0))
        for j in range(n):
            factor[i, j] *= scale
    product = factor.T @ factor
    floor = 1e-8 * np.trace(product)
    for i in range(n):
        program.gradient[i] = 10.0 ** (6.0 * draw.random() - 3.0) * draw.standard_normal()
        for j in range(n):
            program.hessian[i, j] = product[i, j] + (floor if i == j else 0.0)


@numba.njit
def make_rows(draw: Any, kind: int, program: Program) -> None:
    """Make rows that a point keeps, or of which all below the level that goes can be kept."""
    n, m = program.x.shape[0], program.bound.shape[0]
    point, inwards = draw.standard_normal(n), draw.standard_normal(n)
    program.count, program.equalities = m, 0
    for row in range(m):
        scale = 10.0 ** (6.0 * draw.random() - 3.0)
        size = 0.0
        value = 0.0
        for i in range(n):
            program.rows[row, i] = scale * draw.standard_normal()
            value += program.rows[row, i] * point[i]
            size += abs(program.rows[row, i] * point[i])
        room = size * draw.random()
        if kind == 1 and row < 8:
            room = 0.0
            towards = 0.0
            for i in range(n):
                towards += program.rows[row, i] * inwards[i]
            if towards < 0.0:
                value = -value
                for i in range(n):
                    program.rows[row, i] *= -1.0
        program.bound[row] = value - room
        program.level[row] = 0 if row < MOTORS else 1 + row % 4
    if kind == 2 or kind == 3:
        for pair in range(3):
            row, twin = MOTORS + 2 * pair, MOTORS + 2 * pair + 1
            size = abs(program.bound[row])
            value = 0.0
            for i in range(n):
                program.rows[twin, i] = -program.rows[row, i]
                value += program.rows[row, i] * point[i]
                size += abs(program.rows[row, i] * point[i])
            gap = size * 10.0 ** (-3.0 - 5.0 * draw.random())
            if kind == 3:
                gap = -gap
            program.bound[row] = value - 0.5 * gap
            program.bound[twin] = -value - 0.5 * gap


@numba.njit
def disturb(draw: Any, seen: Program, program: Program) -> None:
    """Take over a programme of a walk, its forces and bounds changed by up to a tenth."""
    program.count, program.equalities = seen.count, seen.equalities
    for i in range(program.x.shape[0]):
        program.gradient[i] = seen.gradient[i] * (0.9 + 0.2 * draw.random())
        for j in range(program.x.shape[0]):
            program.hessian[i, j] = seen.hessian[i, j]
    for row in range(seen.count):
        program.bound[row] = seen.bound[row] * (0.9 + 0.2 * draw.random())
        program.level[row] = seen.level[row]
        for i in range(program.x.shape[0]):
            program.rows[row, i] = seen.rows[row, i]


@numba.njit
def solve_made(
    draw: Any, kind: int, count: int, seen: Program, program: Program, found: Any
) -> None:
    """Solve programmes of a kind; count what is unsolved or relaxed, keep the worst residuals."""
    for _ in range(count):
        if kind == 4:
            disturb(draw, seen, program)
        else:
            make_cost(draw, program)
            make_rows(draw, kind, program)
        solve_or_relax(program)
        found[0] += 1
        found[1] += program.status != 0
        found[2] += program.relaxed > 0
        if program.status == 0:
            found[3] = max(found[3], program.violation)
            found[4] = max(found[4], program.stationarity)
            found[5] = max(found[5], program.complementarity)
            found[6] = max(found[6], program.iterations)


def campaign(count: int, seed: int, met: list[Program]) -> None:
    """Solve so many programmes, a line of each kind."""
    draw = np.random.default_rng(seed)
    for kind, name in enumerate(KINDS):
        program, found = Program.allocate(n=UNKNOWNS, m=ROWS), np.zeros(7)
        begin = time.process_time()
        share = count // len(KINDS)
        for k in range(len(met)):
            part = (k + 1) * share // len(met) - k * share // len(met)
            solve_made(draw, kind, part, met[k], program, found)
        spent = (time.process_time() - begin) / share * 1e6
        print(
            f"{name}: {found[0]:.0f} programmes, {found[1]:.0f} unsolved, {found[2]:.0f} with rows "
            f"given up; violation {found[3]:.1e}, stationarity {found[4]:.1e}, complementarity "
            f"{found[5]:.1e}; {found[6]:.0f} rows taken up at most; {spent:.2f} µs with making it",
            flush=True,
        )


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
    parser.add_argument("--campaign", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    programmes = asked(options.programmes)
    made = [filled(each) for each in programmes]
    if options.campaign:
        campaign(options.campaign, options.seed, made)
        return
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
