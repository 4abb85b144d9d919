"""Equations of sticking contacts and of Newton's method, and what rounding hides of a foot."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.sets import CONE, INTERVAL
from heelstrike.contact.spatial.certified_solve import block_workspace, solve_block_problem
from heelstrike.contact.spatial.modes import SLIP, SOLVED, STICK
from heelstrike.contact.spatial.newton import solve_general
from heelstrike.contact.spatial.sticking import factorize, solve_factored
from heelstrike.contact.spatial.workspace import BlockAnswer, block_answer, block_problem

CORNERS = np.array([[0.1, 0.03], [0.1, -0.03], [-0.05, 0.03], [-0.05, -0.03]])
"""Of a foot below a body (m)."""


@pytest.mark.parametrize("size", [1, 2, 3, 8, 33])
def test_factor_from_the_last_row_solves_as_numpy_does(size: int) -> None:
    """A = Lᵀ L of a matrix of condition up to 1e4; solutions to that times the rounding."""
    rng = np.random.default_rng([41, size])
    turn, _ = np.linalg.qr(rng.normal(size=(size, size)))
    matrix = turn @ np.diag(np.geomspace(1e-2, 1e2, size)) @ turn.T
    right = rng.normal(size=size)
    factor, solution = np.full((size + 2, size + 2), np.nan), right.copy()
    factor[:size, :size] = np.tril(matrix)
    assert uncompiled(factorize)(size, factor)
    uncompiled(solve_factored)(size, factor, solution)
    expected = np.linalg.solve(matrix, right)
    assert np.allclose(solution, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())
    lower = np.tril(factor[:size, :size])
    lower[np.diag_indices(size)] = 1.0 / np.diag(lower)
    assert np.allclose(lower.T @ lower, matrix, rtol=0.0, atol=1e-13 * 1e2)


def test_factor_refuses_what_is_not_positive() -> None:
    """One eigenvalue below zero, met last."""
    matrix = np.array([[0.5, 1.0], [1.0, 1.0]])
    assert not uncompiled(factorize)(2, matrix)


def stand(off: float) -> tuple[int, int, BlockAnswer, float]:
    """A body of unit mass and inertia on a flat foot, and a joint that slides against dry friction.

    One corner falls by `off` of the data more slowly than a rigid foot can. Returns how the solve
    ended, its iterations, the answer, and the size of the data.
    """
    arms = np.column_stack([CORNERS, np.full(4, -0.5)])
    jacobian = np.zeros((13, 7))
    for corner, arm in enumerate(arms):
        for row, axis in enumerate(np.eye(3)[[2, 0, 1]]):
            jacobian[3 * corner + row, :6] = np.concatenate([axis, np.cross(arm, axis)])
    jacobian[12, 6] = 1.0
    free = jacobian @ np.array([0.01, 0.0, -1.0, 0.0, 0.0, 0.0, 0.3])
    delassus = jacobian @ jacobian.T
    size = np.abs(free / np.sqrt(np.repeat([np.diag(delassus)[:3].max(), 1.0], [12, 1]))).max()
    free[0] += off * size
    problem = block_problem(
        5, 13, count=5, first=np.array([0, 3, 6, 9, 12, 13]), bound=np.full(5, 0.1),
        set=np.array([CONE, CONE, CONE, CONE, INTERVAL]), friction=np.full(5, 0.8),
        delassus=delassus, free=free,
    )  # fmt: skip
    work, answer = block_workspace(5, 13), block_answer(5, 13)
    answer.mode[:] = [STICK, STICK, STICK, STICK, SLIP]
    answer.impulse[12] = -0.1
    status = solve_block_problem(problem, work, answer)
    return status, work.tally.iterations, answer, float(size)


def test_rounding_of_gaps_is_not_searched() -> None:
    """Corners that contradict each other by 1e-11 of the data stick at the first attempt.

    No motion of the body meets four gaps of which one is off: the nearest leaves a quarter of that
    at each. The joint is slowed by its bound, 0.3 - 0.1 m/s.
    """
    status, iterations, answer, size = stand(1e-11)
    assert status == SOLVED
    assert iterations == 1
    left = np.abs(answer.velocity[:12:3]) / size
    assert np.allclose(left, 0.25e-11, rtol=0.1, atol=0.0)
    assert np.isclose(answer.velocity[12], 0.2, rtol=0.0, atol=1e-15)
    assert answer.impulse[12] == -0.1


def test_what_is_off_by_more_is_looked_at() -> None:
    """At 1e-9 of the data there is an answer in which a corner opens, and it is found."""
    status, iterations, answer, size = stand(1e-9)
    assert status == SOLVED
    assert iterations > 1
    assert answer.residual < 1e-12
    assert np.isclose(answer.velocity[:12:3].max(), 1e-9 * size, rtol=1e-3)


@pytest.mark.parametrize(("left", "sticks"), [(0.8e-10, True), (1.25e-10, False)])
def test_where_rounding_of_gaps_ends(left: float, sticks: bool) -> None:
    """What is left of a corner, a quarter of what it is off by, is searched from 1e-10 on."""
    status, iterations, answer, size = stand(4.0 * left)
    assert status == SOLVED
    assert (iterations == 1) is sticks
    if sticks:
        assert np.allclose(np.abs(answer.velocity[:12:3]) / size, left, rtol=0.1, atol=0.0)
    else:
        assert answer.residual < 1e-12


@pytest.mark.parametrize("size", [1, 2, 3, 8, 33])
def test_elimination_solves_as_numpy_does(size: int) -> None:
    """Zeros on the diagonal, so that rows must be exchanged."""
    rng = np.random.default_rng([43, size])
    matrix = rng.normal(size=(size, size))
    if size > 1:
        np.fill_diagonal(matrix, 0.0)
    right = rng.normal(size=size)
    system, solution = np.full((size + 2, size + 2), np.nan), right.copy()
    system[:size, :size] = matrix
    assert uncompiled(solve_general)(size, system, solution)
    expected = np.linalg.solve(matrix, right)
    limit = 1e-14 * np.linalg.cond(matrix) * np.abs(expected).max()
    assert np.allclose(solution, expected, rtol=0.0, atol=limit)


def test_elimination_refuses_what_is_singular() -> None:
    """A column of zeros."""
    assert not uncompiled(solve_general)(2, np.array([[1.0, 0.0], [2.0, 0.0]]), np.ones(2))
