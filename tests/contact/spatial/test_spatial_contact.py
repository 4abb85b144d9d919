"""``solve_contact(..., dimension=3)`` before a judge with sixty digits, and beside the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from contact_oracle import residual as planar_residual
from contact_problems import Problem, random_problem
from spatial_oracle import natural_map
from spatial_problems import SpatialProblem, random_spatial_problem

import heelstrike as hs
from heelstrike.contact import SpatialContactMode, SpatialContactSolution, SpatialStatus
from heelstrike.contact.spatial.modes import SpatialSolver
from heelstrike.errors import ContactProblemError

NUMBER = 400


@dataclass(frozen=True)
class Campaign:
    problems: list[SpatialProblem]
    solutions: list[SpatialContactSolution]


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    problems = [
        random_spatial_problem(np.random.default_rng([2029, seed])) for seed in range(NUMBER)
    ]
    solutions = [hs.solve_contact(p.delassus, p.free, p.friction, dimension=3) for p in problems]
    return Campaign(problems, solutions)


def test_random_problems_are_solved(campaign: Campaign) -> None:
    """All have a solution by construction; 1 in 1000 may be missed (issue: at least 99.9 %)."""
    unsolved = sum(not s.certificate.valid for s in campaign.solutions)
    assert unsolved <= 1


def test_no_certificate_is_false(campaign: Campaign) -> None:
    """The judge never finds more than what the certificate says, rounding included."""
    for problem, solution in zip(campaign.problems, campaign.solutions, strict=True):
        judged = natural_map(
            problem.delassus, problem.free, problem.friction, solution.impulse.ravel()
        )
        assert judged <= solution.certificate.worst
        if solution.certificate.valid:
            assert judged <= solution.certificate.tolerance


def test_velocity_error_bounds_a_perturbation(campaign: Campaign) -> None:
    """Projected impulses solve a problem whose free velocity differs by no more than is said."""
    for problem, solution in zip(campaign.problems[:60], campaign.solutions[:60], strict=True):
        count = problem.count
        blocks = problem.delassus.reshape(count, 3, count, 3)
        weight = [1.0 / np.sqrt(max(np.diag(blocks[k, :, k]))) for k in range(count)]
        impulse, velocity = solution.impulse, solution.velocity
        exact = np.zeros((count, 3))
        wanted = np.zeros((count, 3))
        for k, mu in enumerate(problem.friction):
            scale = weight[k] ** 2
            u = velocity[k] + [mu * np.hypot(*velocity[k, 1:]), 0.0, 0.0]
            point = impulse[k] / scale - u
            n, across = point[0], np.hypot(*point[1:])
            if mu * across <= -n:
                nearest = np.zeros(3)
            elif across <= mu * n:
                nearest = point
            else:
                n = (n + mu * across) / (1.0 + mu**2)
                nearest = np.r_[n, mu * n * point[1:] / across]
            exact[k] = nearest * scale
            moved = u + nearest - impulse[k] / scale
            wanted[k] = np.r_[moved[0] - mu * np.hypot(*moved[1:]), moved[1:]]
        free = wanted.ravel() - problem.delassus @ exact.ravel()
        difference = np.abs(free - problem.free).reshape(count, 3)
        slack = 1e-12 * np.abs(problem.delassus) @ np.abs(exact.ravel())
        assert np.all(difference <= solution.certificate.velocity_error + slack.reshape(count, 3))


def embedded(planar: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and free term of a planar problem in space, where nothing moves across."""
    count = planar.count
    matrix = np.zeros((3 * count, 3 * count))
    free = np.zeros(3 * count)
    in_plane = [3 * k + i for k in range(count) for i in range(2)]
    across = [3 * k + 2 for k in range(count)]
    matrix[np.ix_(in_plane, in_plane)] = planar.delassus
    matrix[np.ix_(across, across)] = planar.delassus[1::2, 1::2]
    free[in_plane] = planar.free
    return matrix, free


def test_the_plane_embedded_in_space() -> None:
    """With no speed across, a planar problem has the same answers in space.

    Velocities agree to 1e-12 of the data; where they do not, Coulomb's law allows several, and the
    planar judge accepts the one that was found in space. That is so of 1 in 8 here.
    """
    several = unsolved = 0
    for seed in range(150):
        planar = random_problem(np.random.default_rng([77, seed]))
        solution = hs.solve_contact(*embedded(planar), planar.friction, dimension=3)
        flat = hs.solve_contact(planar.delassus, planar.free, planar.friction)
        assert flat.certificate.valid
        if not solution.certificate.valid:
            unsolved += 1
            continue
        root = np.sqrt(np.diag(planar.delassus))
        root = np.where(root > 0.0, root, np.inf)
        size = np.max(np.abs(planar.free) / root)
        scale = np.max(np.abs(solution.impulse), initial=0.0)
        assert np.max(np.abs(solution.impulse[:, 2])) <= 1e-9 * scale
        apart = (solution.velocity[:, :2] - flat.velocity).ravel() / root
        if np.max(np.abs(apart)) > 1e-12 * size:
            several += 1
            impulse = solution.impulse[:, :2].ravel()
            judged = planar_residual(planar.delassus, planar.free, planar.friction, impulse)
            assert judged <= 1e-9
    assert several <= 25
    assert unsolved <= 1


def test_slip_opposes_friction() -> None:
    """One point: the friction on the edge of the cone is against the velocity."""
    solution = hs.solve_contact(0.5 * np.eye(3), [-1.0, 3.0, 4.0], 0.5, dimension=3)
    n, s, t = solution.impulse[0]
    assert solution.mode == (SpatialContactMode.SLIP,)
    assert n == pytest.approx(2.0)
    assert (s, t) == (pytest.approx(-0.6), pytest.approx(-0.8))
    assert solution.velocity[0] == pytest.approx([0.0, 2.7, 3.6], abs=1e-14)


def test_what_sticks_has_the_least_norm() -> None:
    """Two points at one place share what one of them needs.

    What moves nothing is known to rounding over 1e-8, what is added to the diagonal.
    """
    one = 0.5 * np.eye(3)
    solution = hs.solve_contact(np.block([[one, one], [one, one]]), [-1.0, 0.2, 0.1] * 2, 0.5,
                                dimension=3)  # fmt: skip
    assert solution.certificate.solver is SpatialSolver.LAST_MODES
    assert solution.impulse[0] == pytest.approx([1.0, -0.2, -0.1], abs=1e-7)
    assert solution.impulse[1] == pytest.approx(solution.impulse[0], abs=1e-7)


def test_without_friction_nothing_acts_across() -> None:
    solution = hs.solve_contact(np.eye(3), [-1.0, 3.0, 4.0], 0.0, dimension=3)
    assert solution.impulse[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)


def test_walls_that_close_have_no_solution() -> None:
    """Two opposite walls come nearer: no impulse helps, and that is proved."""
    rows = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [-1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    solution = hs.solve_contact(rows @ rows.T, [-1.0, 0, 0, -1.0, 0, 0], 0.5, dimension=3)
    assert solution.certificate.status is SpatialStatus.IMPOSSIBLE
    assert not solution.certificate.valid
    assert "no solution" in str(solution.certificate)


def test_nothing_moves_what_stands_still() -> None:
    solution = hs.solve_contact(np.eye(6), np.zeros(6), 0.5, dimension=3)
    assert solution.certificate.valid
    assert not np.any(solution.impulse)


def test_no_contacts() -> None:
    solution = hs.solve_contact(np.zeros((0, 0)), [], 0.5, dimension=3)
    assert solution.certificate.valid
    assert solution.impulse.shape == (0, 3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((np.eye(4), np.zeros(4), 0.5), "three"),
        ((np.eye(2), np.zeros(3), 0.5), r"\(3, 3\)"),
        ((np.eye(3), [np.nan, 0.0, 0.0], 0.5), "finite"),
        ((np.eye(3), np.zeros(3), -0.5), "negative"),
    ],
)
def test_wrong_data_are_refused_in_words(arguments: tuple, words: str) -> None:
    with pytest.raises(ContactProblemError, match=words):
        hs.solve_contact(*arguments, dimension=3)


def test_other_dimensions_are_refused() -> None:
    with pytest.raises(ContactProblemError, match="dimension is 2 or 3"):
        hs.solve_contact(np.eye(4), np.zeros(4), 0.5, dimension=4)  # type: ignore[call-overload]


def test_what_only_guessed_slip_speeds_solved_is_solved() -> None:
    """Newton's method ends near four slipping contacts and a fifth, where there is no solution."""
    problem = random_spatial_problem(np.random.default_rng([0, 9806]))
    given = problem.delassus, problem.free, problem.friction
    solution = hs.solve_contact(*given, dimension=3)
    assert solution.certificate.valid
    assert natural_map(*given, solution.impulse.ravel()) <= 1e-9
