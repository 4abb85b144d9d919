"""Linear complementarity problems: enumeration, classical examples, failures."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heelstrike.contact import LcpSolution, SolveStatus, solve_lcp
from heelstrike.errors import ContactProblemError

SOLVERS = ["lemke", "fischer_burmeister", "gauss_seidel"]


def enumerate_lcp(M: np.ndarray, q: np.ndarray) -> list[np.ndarray]:
    """All basic solutions of a problem whose principal submatrices are regular."""
    n = q.size
    found = []
    for basic in itertools.product((False, True), repeat=n):
        support = np.flatnonzero(basic)
        z = np.zeros(n)
        if support.size:
            z[support] = np.linalg.solve(M[np.ix_(support, support)], -q[support])
        if z.min() >= -1e-10 and (M @ z + q).min() >= -1e-10:
            found.append(z)
    return found


def check(M: np.ndarray, q: np.ndarray, solution: LcpSolution) -> None:
    assert solution.certificate.valid
    scale = 1.0 + np.abs(M) @ np.abs(solution.z) + np.abs(q)
    assert np.all(solution.z >= 0.0)
    assert np.all(solution.w >= -1e-8 * scale)
    np.testing.assert_allclose(solution.w, M @ solution.z + q, atol=1e-12 * scale.max())
    assert np.all(np.minimum(solution.w, solution.z) <= 1e-8 * scale)


@pytest.mark.parametrize("solver", SOLVERS)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 6))
def test_positive_definite_problems_have_the_one_solution(
    solver: str, seed: int, size: int
) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((size, size))
    M = root @ root.T + 0.1 * np.eye(size)
    q = rng.standard_normal(size)
    solution = solve_lcp(M, q, solver=solver, fallback=False)
    check(M, q, solution)
    (expected,) = enumerate_lcp(M, q)
    np.testing.assert_allclose(solution.z, expected, atol=1e-9 * (1.0 + expected.max()))


@pytest.mark.parametrize("solver", ["lemke", "fischer_burmeister"])
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 8))
def test_monotone_problems_need_no_symmetry(solver: str, seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((size, max(size // 2, 1)))
    skew = rng.standard_normal((size, size))
    M = root @ root.T + skew - skew.T
    z = np.maximum(rng.standard_normal(size), 0.0)
    w = np.where(z > 0.0, 0.0, np.maximum(rng.standard_normal(size), 0.0))
    solution = solve_lcp(M, w - M @ z, solver=solver)
    check(M, w - M @ z, solution)


def test_problem_on_which_lemke_without_a_rule_cycles() -> None:
    """Kostreva's example (Math. Program. 16, 1979): ties everywhere."""
    M = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 2.0], [2.0, 0.0, 1.0]])
    q = -np.ones(3)
    solution = solve_lcp(M, q, fallback=False)
    np.testing.assert_allclose(solution.z, 1.0 / 3.0, rtol=1e-12)


@pytest.mark.parametrize("size", [2, 5, 10, 14])
def test_murty_problem(size: int) -> None:
    """Murty's problem: 2^n pivots for some rules, one solution (0, ..., 0, 1)."""
    M = np.tril(2.0 * np.ones((size, size)), -1).T + np.eye(size)
    solution = solve_lcp(M, -np.ones(size), fallback=False)
    np.testing.assert_allclose(solution.z, np.eye(size)[-1], atol=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_infeasible_problem(solver: str) -> None:
    M = np.array([[1.0, -1.0], [-1.0, 1.0]])
    solution = solve_lcp(M, [-1.0, -1.0], solver=solver)
    assert solution.certificate.status is SolveStatus.RAY
    assert not solution.certificate.valid
    assert np.all(np.isfinite(solution.z))


def test_zero_diagonal() -> None:
    """A saddle problem, whose diagonal is zero: a linear program by its optimality conditions."""
    M = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [1.0, 1.0, 0.0]])
    q = np.array([1.0, 2.0, -3.0])  # minimise x + 2 y subject to x + y >= 3
    solution = solve_lcp(M, q)
    check(M, q, solution)
    np.testing.assert_allclose(solution.z, [3.0, 0.0, 1.0], atol=1e-12)


def test_trivial_problems() -> None:
    assert solve_lcp(np.zeros((0, 0)), np.zeros(0)).certificate.valid
    solution = solve_lcp(-np.eye(2), [1.0, 0.0])
    assert solution.z.tolist() == [0.0, 0.0]
    assert solution.certificate.valid


@pytest.mark.parametrize(
    ("M", "q", "message"),
    [
        (np.eye(2), [1.0], r"M has shape \(2, 2\) and q has shape \(1,\)"),
        (np.eye(2), [1.0, np.nan], r"q\[1\] is nan"),
        ([["a"]], [1.0], "M must be numbers"),
    ],
)
def test_malformed(M: object, q: object, message: str) -> None:
    with pytest.raises(ContactProblemError, match=message):
        solve_lcp(M, q)  # type: ignore[arg-type]
