"""Two thousand random problems through every solver; 200 000 are in benchmarks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from contact_oracle import residual
from contact_problems import Problem, random_problem

from heelstrike.contact import ContactSolution, solve_contact

NUMBER = 2000
SOLVERS = ["lemke", "fischer_burmeister", "gauss_seidel"]


@dataclass(frozen=True)
class Campaign:
    problems: list[Problem]
    alone: dict[str, list[ContactSolution]]


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    problems = [random_problem(np.random.default_rng([2024, seed])) for seed in range(NUMBER)]
    alone = {
        solver: [
            solve_contact(p.delassus, p.free, p.friction, solver=solver, fallback=False)
            for p in problems
        ]
        for solver in SOLVERS
    }
    return Campaign(problems, alone)


@pytest.mark.parametrize(
    ("solver", "failures"), [("lemke", 1), ("fischer_burmeister", 2), ("gauss_seidel", 100)]
)
def test_alone(campaign: Campaign, solver: str, failures: int) -> None:
    """Lemke leaves 1 in 10 000, Fischer-Burmeister 1 in 1000, Gauss-Seidel 5 in 100."""
    assert sum(not s.certificate.valid for s in campaign.alone[solver]) <= failures


@pytest.mark.parametrize("solver", SOLVERS)
def test_fallbacks_leave_nothing_unsolved(campaign: Campaign, solver: str) -> None:
    for problem, first in zip(campaign.problems, campaign.alone[solver], strict=True):
        if not first.certificate.valid:
            solution = solve_contact(
                problem.delassus, problem.free, problem.friction, solver=solver
            )
            assert solution.certificate.valid
            assert solution.certificate.fallbacks >= 1
            assert solution.certificate.solver.value != solver


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_uncertified_success(campaign: Campaign, solver: str) -> None:
    for problem, solution in zip(campaign.problems, campaign.alone[solver], strict=True):
        worst = residual(problem.delassus, problem.free, problem.friction, solution.impulse.ravel())
        assert solution.certificate.valid == (worst <= 1e-9)


@pytest.mark.parametrize("solver", ["fischer_burmeister", "gauss_seidel"])
def test_solvers_agree_where_the_velocity_is_unique(campaign: Campaign, solver: str) -> None:
    """Same velocity, wrench and least-norm impulse from every solver.

    Coulomb friction may leave several solutions. Such a pair is its own proof: both meet the
    contact laws a hundred times more sharply than their velocities differ. It is seldom, and
    never happens without friction.
    """
    agreed = several = 0
    for problem, one, two in zip(
        campaign.problems, campaign.alone["lemke"], campaign.alone[solver], strict=True
    ):
        if not (one.certificate.valid and two.certificate.valid):
            continue
        first, second = one.impulse.ravel(), two.impulse.ravel()
        unit = np.abs(problem.free).max() + np.abs(problem.delassus) @ np.abs(first) + 1e-300
        difference = np.max(np.abs(one.velocity - two.velocity).ravel() / unit)
        # Wrenches in units of speed, so that light and heavy coordinates count alike.
        root = np.sqrt(np.diag(np.linalg.inv(problem.mass_matrix)))
        wrench = np.max(root * np.abs(problem.jacobian.T @ (first - second)))
        wrench /= max(np.max(root * (np.abs(problem.jacobian.T) @ np.abs(first))), 1e-300)
        weight = np.sqrt(np.diag(problem.delassus))
        split = np.max(weight * np.abs(first - second))
        split /= max(np.max(weight * np.abs(first)), 1e-300)
        if max(difference, wrench, split) > 1e-8:
            assert max(one.certificate.worst, two.certificate.worst) < 1e-2 * difference
            assert problem.friction.max() > 0.0
            several += 1
        else:
            agreed += 1
    assert agreed >= 0.85 * NUMBER
    assert several <= 0.1 * NUMBER
