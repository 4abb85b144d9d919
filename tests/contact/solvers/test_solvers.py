"""One contract for every contact solver: same problems, same answers, same honesty."""

from __future__ import annotations

import numpy as np
import pytest
from contact_oracle import residual, solutions
from contact_problems import Problem, random_problem
from hypothesis import given
from hypothesis import strategies as st

from heelstrike.contact import ContactMode, ContactSolution, Solver, SolveStatus, solve_contact

SOLVERS = ["lemke", "fischer_burmeister", "gauss_seidel"]
MODES = ContactMode


def alone(problem: Problem, solver: str) -> ContactSolution:
    return solve_contact(
        problem.delassus, problem.free, problem.friction, solver=solver, fallback=False
    )


def rigid_body(points: np.ndarray, mass: float = 2.0, inertia: float = 0.05) -> np.ndarray:
    """Contact Jacobian times the inverse root of the mass matrix; points relative to the centre."""
    rows = []
    for x, z in points:
        rows.append([0.0, 1.0, -x])
        rows.append([1.0, 0.0, z])
    return np.array(rows) / np.sqrt([mass, mass, inertia])


@pytest.mark.parametrize("solver", SOLVERS)
class TestClosedForms:
    """A block of 2 kg: G = 1/m, so everything is known on paper."""

    def solve(self, solver: str, normal: float, tangent: float, friction: float) -> ContactSolution:
        return solve_contact(0.5 * np.eye(2), [normal, tangent], friction, solver=solver)

    def test_separating_contact_feels_nothing(self, solver: str) -> None:
        solution = self.solve(solver, 0.1, 0.3, 0.5)
        assert solution.impulse.tolist() == [[0.0, 0.0]]
        assert solution.mode == (MODES.OPEN,)

    def test_sticks_when_friction_suffices(self, solver: str) -> None:
        solution = self.solve(solver, -1.0, 0.4, 0.5)
        np.testing.assert_allclose(solution.impulse, [[2.0, -0.8]], rtol=1e-14)
        assert solution.mode == (MODES.STICK,)

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_slips_when_it_does_not(self, solver: str, side: float) -> None:
        solution = self.solve(solver, -1.0, side * 0.8, 0.5)
        np.testing.assert_allclose(solution.impulse, [[2.0, -side]], rtol=1e-14)
        np.testing.assert_allclose(solution.velocity, [[0.0, side * 0.3]], atol=1e-15)
        assert solution.mode == (MODES.SLIP_FORWARD if side > 0 else MODES.SLIP_BACKWARD,)

    @pytest.mark.parametrize("offset", [-1e-6, 1e-6])
    def test_friction_limit_is_sharp(self, solver: str, offset: float) -> None:
        solution = self.solve(solver, -1.0, 0.5 * (1.0 + offset), 0.5)
        assert solution.mode == (MODES.STICK if offset < 0 else MODES.SLIP_FORWARD,)

    def test_without_friction_nothing_tangential(self, solver: str) -> None:
        solution = self.solve(solver, -1.0, 0.3, 0.0)
        np.testing.assert_allclose(solution.impulse, [[2.0, 0.0]], rtol=1e-14)
        assert solution.mode == (MODES.SLIP_FORWARD,)

    def test_at_rest_and_untouched(self, solver: str) -> None:
        solution = self.solve(solver, 0.0, 0.0, 0.5)
        assert solution.certificate.valid
        assert solution.impulse.tolist() == [[0.0, 0.0]]


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_contacts(solver: str) -> None:
    solution = solve_contact(np.zeros((0, 0)), np.zeros(0), np.zeros(0), solver=solver)
    assert solution.impulse.shape == (0, 2)
    assert solution.certificate.valid


@pytest.mark.parametrize("solver", SOLVERS)
def test_flat_foot_shares_its_friction_equally(solver: str) -> None:
    """Two vertices of one foot: the normal forces are unique, equal friction is least norm."""
    root = rigid_body(np.array([[-0.1, -0.3], [0.1, -0.3]]))
    solution = solve_contact(root @ root.T, [-1.0, 0.2, -0.9, 0.2], 0.75, solver=solver)
    assert solution.certificate.valid
    assert solution.mode == (MODES.STICK, MODES.STICK)
    assert solution.impulse[0, 1] == pytest.approx(solution.impulse[1, 1], rel=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_flat_foot_near_its_edge_splits_unequally(solver: str) -> None:
    """Where equal friction would leave one vertex's cone, it takes its limit and no more."""
    root = rigid_body(np.array([[-0.1, -0.3], [0.1, -0.3]]))
    target = np.array([1.0, 0.3, 0.02, 0.0])  # nearly all weight behind; 0.15 each is too much
    friction = 0.5
    solution = solve_contact(root @ root.T, -root @ root.T @ target, friction, solver=solver)
    assert solution.certificate.valid
    np.testing.assert_allclose(solution.impulse[:, 0], target[::2], rtol=1e-10)
    np.testing.assert_allclose(solution.impulse[:, 1], [0.29, 0.01], rtol=1e-10)


@pytest.mark.parametrize("solver", SOLVERS)
def test_three_collinear_vertices_share_the_load(solver: str) -> None:
    """Normal forces are not unique either; all vertices take part, as least norm demands."""
    root = rigid_body(np.array([[-0.1, -0.3], [0.0, -0.3], [0.1, -0.3]]))
    G = root @ root.T
    solution = solve_contact(G, [-1.0, 0.0] * 3, 0.5, solver=solver)
    np.testing.assert_allclose(solution.impulse[:, 0], 2.0 / 3.0, rtol=1e-12)
    shortest = np.linalg.lstsq(G, np.array([1.0, 0.0] * 3), rcond=1e-12)[0]
    np.testing.assert_allclose(solution.impulse.ravel(), shortest, atol=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_same_vertex_twice_is_shared(solver: str) -> None:
    root = rigid_body(np.array([[0.05, -0.3], [0.05, -0.3]]))
    solution = solve_contact(root @ root.T, [-1.0, 3.0, -1.0, 3.0], 0.3, solver=solver)
    assert solution.certificate.valid
    np.testing.assert_allclose(solution.impulse[0], solution.impulse[1], rtol=1e-12)
    assert solution.mode == (MODES.SLIP_FORWARD, MODES.SLIP_FORWARD)


@pytest.mark.parametrize("solver", SOLVERS)
def test_joint_stop_beside_a_foot(solver: str) -> None:
    """A stop is a contact without friction whose tangential row and column are zero."""
    G = np.zeros((4, 4))
    G[:3, :3] = [[1.0, 0.2, 0.3], [0.2, 1.0, -0.1], [0.3, -0.1, 2.0]]
    solution = solve_contact(G, [-1.0, 0.1, -0.5, 0.0], [0.8, 0.0], solver=solver)
    assert solution.certificate.valid
    assert solution.impulse[1, 1] == 0.0
    assert solution.impulse[1, 0] > 0.0
    assert (
        residual(
            G, np.array([-1.0, 0.1, -0.5, 0.0]), np.array([0.8, 0.0]), solution.impulse.ravel()
        )
        < 1e-14
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("contacts", [1, 2])
def test_against_enumeration(solver: str, contacts: int) -> None:
    """Whatever a solver certifies is among the solutions that brute force finds."""
    compared = 0
    for seed in range(25):
        problem = random_problem(np.random.default_rng([contacts, seed]), contacts)
        if "ill-scaled" in problem.kind:
            continue  # the linear programs of the oracle are not accurate enough
        solution = alone(problem, solver)
        if not solution.certificate.valid:
            continue  # counted in the random campaign
        candidates = solutions(problem.delassus, problem.free, problem.friction)
        assert candidates, f"seed {seed}: solved, but enumeration finds no solution"
        unit = np.abs(problem.free).max() or 1.0
        distance = min(np.abs(solution.velocity.ravel() - w).max() for w in candidates)
        assert distance <= 1e-6 * unit, f"seed {seed}: not a solution"
        compared += 1
    assert compared >= 10


@given(
    seed=st.integers(0, 2**32 - 1),
    solver=st.sampled_from(SOLVERS),
    impulse_unit=st.floats(1e-6, 1e6),
    velocity_unit=st.floats(1e-6, 1e6),
)
def test_units_do_not_matter(
    seed: int, solver: str, impulse_unit: float, velocity_unit: float
) -> None:
    """Other units of mass and time scale the answer and change nothing else."""
    problem = random_problem(np.random.default_rng(seed), 3)
    first = alone(problem, solver)
    factor = velocity_unit / impulse_unit
    second = solve_contact(
        factor * problem.delassus,
        velocity_unit * problem.free,
        problem.friction,
        solver=solver,
        fallback=False,
    )
    if not (first.certificate.valid and second.certificate.valid):
        return
    difference = np.abs(second.velocity / velocity_unit - first.velocity).max()
    unit = np.abs(problem.free).max() + np.abs(problem.delassus @ first.impulse.ravel()).max()
    # Where several solutions exist rounding may decide between them: both must then be exact.
    if difference > 1e-8 * unit:
        scaled = second.impulse.ravel() / impulse_unit
        assert residual(problem.delassus, problem.free, problem.friction, scaled) < 1e-9
    else:
        assert difference <= 1e-8 * unit


@given(seed=st.integers(0, 2**32 - 1), solver=st.sampled_from(SOLVERS))
def test_certificate_is_honest(seed: int, solver: str) -> None:
    """What is certified satisfies the contact laws as the oracle states them, and conversely."""
    problem = random_problem(np.random.default_rng(seed))
    solution = alone(problem, solver)
    certificate = solution.certificate
    impulse = solution.impulse.ravel()
    assert np.all(np.isfinite(impulse))
    worst = residual(problem.delassus, problem.free, problem.friction, impulse)
    reported = max(certificate.complementarity, certificate.cone, certificate.non_penetration)
    # A few operations of the oracle and of the certificate are rounded, too.
    assert abs(reported - worst) <= certificate.rounding + 1e-14 * (1.0 + worst)
    assert certificate.valid == (reported + certificate.rounding <= 1e-9)
    velocity = problem.delassus @ impulse + problem.free
    size = np.abs(problem.delassus) @ np.abs(impulse) + np.abs(problem.free)
    assert np.all(np.abs(solution.velocity.ravel() - velocity) <= 1e-14 * size)


@given(seed=st.integers(0, 2**32 - 1))
def test_contacts_dissipate(seed: int) -> None:
    """The work of the impulses on the mean velocity is never positive (restitution zero)."""
    problem = random_problem(np.random.default_rng(seed))
    solution = solve_contact(problem.delassus, problem.free, problem.friction)
    assert solution.certificate.valid
    impulse = solution.impulse.ravel()
    work = 0.5 * impulse @ (problem.free + solution.velocity.ravel())
    speed = np.abs(problem.free) + np.abs(problem.free).max()
    assert work <= 1e-9 * np.abs(impulse) @ speed  # as sharp as the certificate


def test_modes_tell_the_velocity() -> None:
    seen = set()
    for seed in range(60):
        problem = random_problem(np.random.default_rng([11, seed]))
        solution = solve_contact(problem.delassus, problem.free, problem.friction)
        size = (
            np.abs(problem.delassus) @ np.abs(solution.impulse.ravel())
            + np.abs(problem.free)
            + np.abs(problem.free).max()
        ).reshape(-1, 2)
        for mode, w, unit in zip(solution.mode, solution.velocity, size, strict=True):
            seen.add(mode)
            assert (mode is MODES.OPEN) == (w[0] > 1e-10 * unit[0])
            if mode is MODES.STICK:
                assert abs(w[1]) <= 1e-10 * unit[1]
            if mode in (MODES.SLIP_FORWARD, MODES.SLIP_BACKWARD):
                assert (w[1] > 0) == (mode is MODES.SLIP_FORWARD)
    assert len(seen) == 4


@pytest.mark.parametrize("solver", SOLVERS)
def test_sixty_four_contacts(solver: str) -> None:
    """A centipede on the ground: far more vertices than degrees of freedom."""
    x = np.linspace(-1.0, 1.0, 64)
    root = rigid_body(np.column_stack([x, np.full(64, -0.2)]), mass=10.0, inertia=3.0)
    free = root @ np.array([0.3, -1.0, 0.1])
    solution = solve_contact(root @ root.T, free, 0.6, solver=solver, fallback=False)
    assert solution.certificate.valid
    assert solution.certificate.status is SolveStatus.SOLVED
    assert solution.certificate.solver is Solver(solver)
