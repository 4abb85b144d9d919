"""Of equations that leave unknowns open: the shortest solution, whatever the order of pivots."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import nnls

from heelstrike.compiler.compilation import uncompiled
from heelstrike.dynamics.dense import (
    raise_to_zero,
    shorten,
    solve_to_rank,
    substitute,
    triangulate,
)

SIZE, RANK = 7, 4


def equations(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Consistent equations of less than full rank, and their right-hand side."""
    draw = np.random.default_rng(seed)
    matrix = draw.normal(size=(SIZE, RANK)) @ draw.normal(size=(RANK, SIZE))
    return matrix, matrix @ draw.uniform(0.5, 2.0, size=SIZE)


def shortest(matrix: np.ndarray, right: np.ndarray, presses: bool = False) -> np.ndarray:
    system, unknown = np.column_stack((matrix, right)), np.zeros(SIZE)
    column, none = np.zeros(SIZE, dtype=np.int64), np.zeros(SIZE)
    rank = uncompiled(solve_to_rank)(SIZE, system, column, unknown)
    assert rank == RANK
    uncompiled(shorten)(0, SIZE, rank, np.ones(SIZE), none, column, system, unknown)
    if presses:
        every = np.ones(SIZE, dtype=np.int64)
        uncompiled(raise_to_zero)(0, SIZE, rank, every, system, unknown)
    return unknown


@pytest.mark.parametrize("seed", range(5))
def test_the_shortest_solution_is_that_of_the_pseudoinverse(seed: int) -> None:
    matrix, right = equations(seed)
    np.testing.assert_allclose(
        shortest(matrix, right), np.linalg.pinv(matrix) @ right, rtol=0.0, atol=1e-10
    )


def test_the_shortest_solution_without_negative_unknowns() -> None:
    """What keeps it from being shorter are unknowns at zero, and they push (Kuhn and Tucker)."""
    held = 0
    for seed in range(20):
        matrix, right = equations(seed)
        found = shortest(matrix, right, presses=True)
        assert np.all(found >= 0.0)
        np.testing.assert_allclose(matrix @ found, right, rtol=0.0, atol=1e-9)
        free = null_space(matrix)
        at_zero = np.flatnonzero(found < 1e-9)
        _, left = nnls(free[at_zero].T, free.T @ found) if len(at_zero) else (0, free.T @ found)
        assert np.max(np.abs(left)) < 1e-9
        held += len(at_zero)
    assert held > 0


def test_lengths_count_what_forces_bring_along() -> None:
    """Two unknowns of which only the sum is known, one with three times as much across it."""
    system, unknown = np.array([[1.0, 1.0, 11.0], [1.0, 1.0, 11.0]]), np.zeros(2)
    column = np.zeros(2, dtype=np.int64)
    rank = uncompiled(solve_to_rank)(2, system, column, unknown)
    ratio = np.array([3.0, 0.0])
    uncompiled(shorten)(0, 2, rank, np.ones(2), ratio, column, system, unknown)
    np.testing.assert_allclose(unknown, [1.0, 10.0], rtol=1e-12)


@pytest.mark.parametrize("complete", [False, True])
def test_factors_make_the_matrix_again(complete: bool) -> None:
    """U above, L beneath; rows or columns where the exchanges have brought them."""
    matrix = np.random.default_rng(3).normal(size=(SIZE, SIZE))
    matrix[0, 0] = 0.0
    factors, order = matrix.copy(), np.zeros(SIZE, dtype=np.int64)
    assert uncompiled(triangulate)(SIZE, SIZE, complete, factors, order) == SIZE
    lower, upper = np.tril(factors, -1) + np.eye(SIZE), np.triu(factors)
    assert np.abs(lower).max() <= 1.0
    if complete:
        assert sorted(order) == list(range(SIZE))
        made = (lower @ upper)[:, np.argsort(order)]
        rows = [int(np.argmin(np.abs(made - row).max(axis=1))) for row in matrix]
        np.testing.assert_allclose(made[rows], matrix, rtol=0.0, atol=1e-13)
        return
    exchanged = matrix.copy()
    for k, other in enumerate(order):
        exchanged[[k, other]] = exchanged[[other, k]]
    np.testing.assert_allclose(lower @ upper, exchanged, rtol=0.0, atol=1e-13)
    x = matrix @ np.arange(1.0, SIZE + 1.0)
    uncompiled(substitute)(SIZE, factors, order, x)
    np.testing.assert_allclose(x, np.arange(1.0, SIZE + 1.0), rtol=0.0, atol=1e-11)


def test_what_is_no_number_stays_none() -> None:
    """A step that went wrong is seen by its answer."""
    factors, order, x = np.full((2, 2), np.nan), np.zeros(2, dtype=np.int64), np.ones(2)
    uncompiled(triangulate)(2, 2, False, factors, order)
    assert list(order) == [0, 1]
    uncompiled(substitute)(2, factors, order, x)
    assert np.all(np.isnan(x))
