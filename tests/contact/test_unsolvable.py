"""Problems without a solution, and data at the edge of floating point."""

from __future__ import annotations

import numpy as np
import pytest
from contact_problems import random_problem
from hypothesis import given
from hypothesis import strategies as st

from heelstrike.contact import ContactSolution, SolveStatus, solve_contact

SOLVERS = ["lemke", "fischer_burmeister", "gauss_seidel"]


def check_failure(solution: ContactSolution) -> None:
    assert not solution.certificate.valid
    assert solution.certificate.status is not SolveStatus.SOLVED
    assert solution.certificate.worst > 1e-9
    assert np.all(np.isfinite(solution.impulse))


@pytest.mark.parametrize("solver", SOLVERS)
def test_immovable_contact_asked_to_move(solver: str) -> None:
    solution = solve_contact(np.zeros((2, 2)), [-1.0, 0.0], 0.5, solver=solver)
    check_failure(solution)
    assert solution.certificate.status is SolveStatus.RAY
    assert "no solution exists along this ray" in solution.certificate.status.text


@pytest.mark.parametrize("solver", SOLVERS)
def test_two_opposed_stops_that_both_want_to_open(solver: str) -> None:
    """A coordinate between two walls that close in: whatever impulse, one of them is violated."""
    G = np.zeros((4, 4))
    G[::2, ::2] = [[1.0, -1.0], [-1.0, 1.0]]
    solution = solve_contact(G, [-1.0, 0.0, -1.0, 0.0], 0.0, solver=solver)
    check_failure(solution)
    assert solution.certificate.status is SolveStatus.RAY


def test_the_same_walls_with_room_between() -> None:
    G = np.zeros((4, 4))
    G[::2, ::2] = [[1.0, -1.0], [-1.0, 1.0]]
    solution = solve_contact(G, [-1.0, 0.0, 1.5, 0.0], 0.0)
    assert solution.certificate.valid
    np.testing.assert_allclose(solution.impulse[:, 0], [1.0, 0.0])


def test_wedge_pushed_apart() -> None:
    """A body jammed between two steep walls that are driven into it."""
    tilt = 1.2
    normals = np.array([[np.sin(tilt), np.cos(tilt)], [-np.sin(tilt), np.cos(tilt)]])
    tangents = np.array([[np.cos(tilt), -np.sin(tilt)], [np.cos(tilt), np.sin(tilt)]])
    J = np.empty((4, 2))
    J[::2], J[1::2] = normals, tangents
    free = np.array([-1.0, 0.0, -1.0, 0.0])
    loose = solve_contact(J @ J.T, free, 0.1)
    assert loose.certificate.valid  # it slips up and out
    jammed = solve_contact(J @ J.T, free, 3.0)
    check_failure(jammed)
    # The last digits of sin and cos decide whether 1e16 N s would push the walls apart.
    assert jammed.certificate.status is SolveStatus.UNDECIDABLE
    assert "no impulse gives" in jammed.certificate.status.text


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("size", [1e-300, 1e-150, 1e150, 1e300])
def test_extreme_numbers_stay_finite(solver: str, size: float) -> None:
    for G, b in ((np.eye(2), [-size, 0.0]), (size * np.eye(2), [-1.0, 0.3])):
        solution = solve_contact(G, b, 0.5, solver=solver)
        assert np.all(np.isfinite(solution.impulse))
        if solution.certificate.valid:
            np.testing.assert_allclose(
                G @ solution.impulse.ravel() + b,
                [0.0, 0.3 * (b[1] > 0) * 0],
                atol=1e-9 * max(1.0, abs(b[0])),
            )


def test_impulse_that_overflows_is_not_reported() -> None:
    solution = solve_contact(1e-200 * np.eye(2), [-1e200, 0.0], 0.5)
    check_failure(solution)


@given(
    seed=st.integers(0, 2**32 - 1),
    solver=st.sampled_from(SOLVERS),
    noise=st.sampled_from([1e-12, 1e-6, 1e-2, 1.0]),
)
def test_any_free_velocity_ends_in_an_honest_status(seed: int, solver: str, noise: float) -> None:
    """Free velocities that no robot could have: solved or not, never a wrong claim."""
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    free = problem.free + noise * np.abs(problem.free).max() * rng.standard_normal(
        problem.free.size
    )
    solution = solve_contact(problem.delassus, free, problem.friction, solver=solver)
    assert np.all(np.isfinite(solution.impulse))
    assert np.all(np.isfinite(solution.velocity))
    solved = solution.certificate.status is SolveStatus.SOLVED
    assert solved == (solution.certificate.worst <= 1e-9)
