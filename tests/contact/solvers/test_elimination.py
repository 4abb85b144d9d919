"""Small symmetric systems by straight-line code, and sticking contacts with and without it."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from heelstrike.compiler.straight_line import play
from heelstrike.contact.modes import SOLVED, STICK
from heelstrike.contact.problem import solve_contact_kernel, solver_order
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.elimination import (
    LARGEST,
    POOR_PIVOT,
    eliminate,
    elimination_programs,
)
from heelstrike.contact.workspace import ContactAnswer, contact_problem
from heelstrike.robot.model import Floats


@njit
def run(address: int, matrix: Floats, x: Floats, pivot: Floats) -> None:
    play(address, (matrix, x, pivot))


def lower_half(matrix: Floats) -> Floats:
    return np.array([matrix[i, j] for i in range(len(matrix)) for j in range(i + 1)])


@pytest.mark.parametrize("size", range(1, LARGEST + 1))
@pytest.mark.parametrize("rank", [1, 3, LARGEST])
def test_the_program_does_what_the_kernel_does(size: int, rank: int) -> None:
    """And both solve A x = b, singular systems too if they can be solved."""
    rng = np.random.default_rng([size, rank])
    for _ in range(20):
        factor = rng.standard_normal((size, rank))
        matrix = factor @ factor.T
        if rank == LARGEST:
            matrix += np.eye(size)
        wanted = matrix @ rng.standard_normal(size)
        program = elimination_programs()[size]
        for solve in (eliminate, lambda *given, at=program: run(at, *given)):
            x, pivot = wanted.copy(), np.zeros(size)
            solve(lower_half(matrix), x, pivot)
            assert np.sum(pivot > POOR_PIVOT * np.diag(matrix)) == min(size, rank)
            # Independent rows of a random matrix may nearly depend on each other.
            np.testing.assert_allclose(matrix @ x, wanted, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("freedom", range(1, 9))
def test_sticking_contacts_are_solved_alike_with_and_without_programs(freedom: int) -> None:
    """Up to four contacts of a body with fewer degrees of freedom than rows, or with more."""
    rng = np.random.default_rng(freedom)
    shortcuts = 0
    for _ in range(40):
        count = int(rng.integers(1, 5))
        rows = rng.standard_normal((2 * count, freedom))
        delassus = rows @ rows.T
        impulse = np.ravel([[1.0 + rng.random(), 0.2 * rng.standard_normal()]] * count)
        free = -delassus @ impulse
        answers = []
        for programs in (elimination_programs(), np.zeros(1, np.int64)):
            work = contact_workspace(count)
            work = work.replaced(sticking=work.sticking.replaced(programs=programs))
            problem = contact_problem(
                count, count=count, delassus=delassus, free=free, friction=np.full(count, 3.0)
            )
            answer = ContactAnswer.allocate(capacity=count, mode=np.full(count, STICK, np.int64))
            assert solve_contact_kernel(solver_order("lemke"), problem, work, answer) == SOLVED
            answers.append((answer.impulse, work.tally.shortcuts))
        (found, quick), (other, slow) = answers
        assert quick == slow
        shortcuts += int(quick)
        scale = np.abs(found).max()
        np.testing.assert_allclose(rows.T @ found, rows.T @ other, atol=1e-8 * scale)
        np.testing.assert_allclose(found, other, atol=1e-6 * scale)
    assert shortcuts >= 20
