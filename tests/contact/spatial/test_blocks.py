"""Points, stops, dry friction, loops and planar points in one problem.

Problems are made from a solution: impulses in their sets, often on the edge, and velocities that
go with them; the free term follows. So all of them can be solved, by these or other impulses.
"""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.spatial.certified_solve import block_workspace, solve_block_problem
from heelstrike.contact.spatial.modes import OPEN, SLIP, SOLVED, STICK
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    block_answer,
    block_problem,
)

Long = np.longdouble


def pair_of(
    rng: np.random.Generator, kind: int, size: int, mu: float, bound: float
) -> tuple[np.ndarray, np.ndarray]:
    """An impulse in its set, and a velocity that goes with it."""
    impulse, velocity = np.zeros(size), np.zeros(size)
    if kind == LINE:
        return rng.normal(size=size), velocity
    if kind == HALF_LINE:
        (impulse if rng.random() < 0.5 else velocity)[0] = rng.uniform(0.1, 2.0)
        return impulse, velocity
    if kind == INTERVAL:
        if rng.random() < 0.5:
            return np.array([rng.uniform(-bound, bound)]), velocity
        side = rng.choice([-1.0, 1.0])
        return np.array([side * bound]), np.array([-side * rng.uniform(0.1, 1.0)])
    what = rng.integers(3)
    direction = rng.normal(size=size - 1)
    direction /= np.linalg.norm(direction)
    if what == OPEN:
        velocity[0] = rng.uniform(0.1, 1.0)
        velocity[1:] = rng.normal(size=size - 1)
        return impulse, velocity
    impulse[0] = rng.uniform(0.1, 2.0)
    share = 1.0 if what == SLIP else rng.uniform(0.0, 1.0)
    impulse[1:] = share * mu * impulse[0] * direction
    if what == SLIP:
        velocity[1:] = -rng.uniform(0.1, 1.0) * direction
    return impulse, velocity


def made_problem(seed: int) -> BlockProblem:
    """A problem of one to ten blocks of all kinds, of any rank from half to full."""
    rng = np.random.default_rng([31, seed])
    count = int(rng.integers(1, 11))
    kinds, sizes = [], []
    for _ in range(count):
        kind = int(rng.choice([CONE, CONE, CONE, HALF_LINE, LINE, INTERVAL]))
        kinds.append(kind)
        sizes.append(int(rng.integers(2, 4)) if kind == CONE else
                     int(rng.integers(1, 4)) if kind == LINE else 1)  # fmt: skip
    first = np.concatenate([[0], np.cumsum(sizes)])
    rows = int(first[-1])
    friction = np.where(np.array(kinds) == CONE, rng.uniform(0.1, 1.0, count), 0.0)
    bound = rng.uniform(0.1, 1.0, count)
    freedoms = int(rng.integers(max(1, rows // 2), rows + 3))
    jacobian = rng.normal(size=(rows, freedoms)) * 10.0 ** rng.uniform(-1.0, 1.0, freedoms)
    delassus = jacobian @ jacobian.T
    pairs = [
        pair_of(rng, kind, size, mu, width)
        for kind, size, mu, width in zip(kinds, sizes, friction, bound, strict=True)
    ]
    impulse = np.concatenate([pair[0] for pair in pairs])
    velocity = np.concatenate([pair[1] for pair in pairs])
    return block_problem(
        count, rows, count=count, first=first, set=np.array(kinds), friction=friction,
        bound=bound, delassus=delassus, free=velocity - delassus @ impulse,
    )  # fmt: skip


def opens(problem: BlockProblem, block: int, row: int) -> bool:
    """Whether a row is the normal one of what opens."""
    one_sided = problem.set[block] in (CONE, HALF_LINE) and row == problem.first[block]
    return bool(one_sided and problem.free[row] > 0.0)


def judged(problem: BlockProblem, impulse: np.ndarray) -> float:
    """Natural map in extended precision, written a second time: by distances, block by block."""
    w = problem.delassus.astype(Long)
    u = w @ impulse.astype(Long) + problem.free.astype(Long)
    weight = []
    for block in range(problem.count):
        part = slice(problem.first[block], problem.first[block + 1])
        weight.append(1 / np.sqrt(np.max(np.diag(w)[part])))
    beta = max(
        abs(Long(problem.free[row]))
        * weight[block]
        * (Long("1e-2") if opens(problem, block, row) else 1)
        for block in range(problem.count)
        for row in range(problem.first[block], problem.first[block + 1])
    )
    worst = Long(0)
    for block in range(problem.count):
        part = slice(problem.first[block], problem.first[block + 1])
        lam = impulse[part].astype(Long) / (beta * weight[block])
        speed = u[part] * weight[block] / beta
        kind, mu = problem.set[block], Long(problem.friction[block])
        bound = Long(problem.bound[block]) / (beta * weight[block])
        if kind == CONE:
            speed = speed.copy()
            speed[0] += mu * np.sqrt(np.sum(speed[1:] ** 2))
        point = lam - speed
        if kind == LINE:
            nearest = point
        elif kind == HALF_LINE:
            nearest = np.maximum(point, 0)
        elif kind == INTERVAL:
            nearest = np.clip(point, -bound, bound)
        else:
            across = np.sqrt(np.sum(point[1:] ** 2))
            if mu * across <= -point[0]:
                nearest = 0 * point
            elif across <= mu * point[0]:
                nearest = point
            else:
                normal = (point[0] + mu * across) / (1 + mu**2)
                nearest = np.concatenate([[normal], mu * normal * point[1:] / across])
        worst = max(worst, np.sqrt(np.sum((lam - nearest) ** 2)))
    return float(worst)


def solved(problem: BlockProblem) -> tuple[int, BlockAnswer]:
    count, rows = problem.count, int(problem.first[problem.count])
    work = block_workspace(count, rows)
    answer = block_answer(count, rows, mode=np.full(count, STICK))
    return solve_block_problem(problem, work, answer), answer


def test_blocks_of_all_kinds_are_solved_together() -> None:
    unsolved = 0
    for seed in range(300):
        problem = made_problem(seed)
        status, answer = solved(problem)
        if status != SOLVED:
            unsolved += 1
            continue
        assert judged(problem, answer.impulse) <= 1e-9
    assert unsolved <= 1


def test_the_next_solve_begins_where_the_last_one_ended() -> None:
    """Modes and impulses of an answer solve the same problem again at once."""
    for seed in range(60):
        problem = made_problem(seed)
        count, rows = problem.count, int(problem.first[problem.count])
        status, answer = solved(problem)
        if status != SOLVED:
            continue
        work = block_workspace(count, rows)
        assert solve_block_problem(problem, work, answer) == SOLVED
        assert work.tally.iterations <= 4


def test_effort_is_capped() -> None:
    """A problem without a solution costs no more than it may."""
    rows = np.array([[1.0], [0.0], [0.0], [-1.0], [0.0], [0.0]])
    problem = block_problem(
        2, 6, count=2, first=np.array([0, 3, 6]), set=np.array([CONE, CONE]),
        friction=np.array([0.5, 0.5]), delassus=rows @ rows.T,
        free=np.array([-1.0, 0.0, 0.0, -1.0, 0.0, 0.0]),
    )  # fmt: skip
    work = block_workspace(2, 6)
    work.settings.effort = 100
    answer = block_answer(2, 6, mode=np.full(2, STICK))
    assert solve_block_problem(problem, work, answer) != SOLVED
    # A way that has begun ends with its sweeps.
    assert work.tally.iterations <= 100 + 3 * 30
    assert work.tally.failures == 1
    assert work.tally.last_fallbacks == 6
    assert answer.residual == pytest.approx(1.0, abs=0.6)
