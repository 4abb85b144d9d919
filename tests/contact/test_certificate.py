"""Certificates that cannot certify themselves: wrong answers of every kind, and what must be said.

A block of 2 kg has G = 1/m = 0.5 in both directions. Its free velocity of −1 m/s is the only datum,
so that the size of the data is β = 1/√0.5, velocities count in m/s and impulses in units of 2 N s.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import pytest
from contact_oracle import effort, exact_velocity, residual
from contact_problems import hard_problem, random_problem
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from heelstrike.contact import ContactSolution, SolveStatus, solve_contact
from heelstrike.contact.certificate import certify, velocity_error
from heelstrike.contact.sets import CONE, LINE
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, contact_problem

SOLVERS = ["lemke", "fischer_burmeister", "gauss_seidel"]
BLOCK = 0.5 * np.eye(2)
WALLS = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.diag([1.0, 0.0]))


@dataclass(frozen=True)
class Verdict:
    complementarity: float
    cone: float
    non_penetration: float
    worst: float
    rounding: float
    velocity: np.ndarray
    velocity_error: np.ndarray


def verdict(
    delassus: object,
    free: object,
    friction: object,
    impulse: object,
    *,
    slope: float = 0.0,
    floor: float = 0.0,
    skewed: bool = False,
    sets: object = None,
) -> Verdict:
    G, b, x = (np.array(values, dtype=float) for values in (delassus, free, impulse))
    mu = np.array(friction, dtype=float)
    work = contact_workspace(mu.size)
    work.scaling.slope[: mu.size] = slope
    work.settings.floor = floor
    work.settings.skewed = skewed
    problem = contact_problem(mu.size, count=mu.size, delassus=G, free=b, friction=mu)
    problem.set[:] = CONE if sets is None else sets
    answer = ContactAnswer.allocate(capacity=mu.size, impulse=x)
    worst = certify(problem, work.settings, work.scaling, answer)
    error = velocity_error(worst, mu, work.scaling)
    return Verdict(*answer.residual, worst, work.scaling.rounding, answer.velocity, error)


class TestWrongAnswers:
    """Each by hand."""

    def test_the_right_answer(self) -> None:
        right = verdict(BLOCK, [-1.0, 0.2], [0.5], [2.0, -0.4])
        assert right.worst == right.rounding < 1e-14
        assert right.complementarity == right.cone == right.non_penetration == 0.0

    def test_nothing_done(self) -> None:
        assert verdict(BLOCK, [-1.0, 0.0], [0.5], [0.0, 0.0]).non_penetration == pytest.approx(1.0)

    def test_pushed_too_little(self) -> None:
        wrong = verdict(BLOCK, [-1.0, 0.0], [0.5], [1.9, 0.0])
        assert wrong.non_penetration == pytest.approx(0.05)
        assert wrong.complementarity == wrong.cone == 0.0

    def test_pushed_away(self) -> None:
        wrong = verdict(BLOCK, [-1.0, 0.0], [0.5], [2.2, 0.0])
        assert wrong.complementarity == pytest.approx(0.1)
        assert wrong.cone == wrong.non_penetration == 0.0

    def test_the_ground_pulls(self) -> None:
        wrong = verdict(BLOCK, [1.0, 0.0], [0.5], [-2.0, 0.0])
        assert wrong.cone == pytest.approx(1.0)

    @pytest.mark.parametrize(
        ("free", "impulse", "speed"),
        [(3.0, -2.0, 2.0), (3.0, -7.0, -0.5), (-3.0, 2.0, -2.0), (-3.0, 7.0, 0.5), (3.0, 0.0, 3.0)],
    )
    def test_a_loop_that_parts_or_closes_whether_pulled_or_pushed(
        self, free: float, impulse: float, speed: float
    ) -> None:
        """w = 0.5 p + b has to vanish whatever the sign of p; velocities count in 3 m/s."""
        said = verdict(BLOCK, [free, 0.0], [0.0], [impulse, 0.0], sets=[LINE])
        np.testing.assert_allclose(said.velocity[0], speed)
        missed = max(said.complementarity, said.non_penetration)
        assert missed == pytest.approx(min(abs(speed), 3.0) / 3.0, rel=1e-12)
        assert said.cone == 0.0

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_more_friction_than_the_cone_holds(self, side: float) -> None:
        """0.5 · 2 N s are to be had, 1.2 are taken: an excess of 0.2 N s in units of 2 N s."""
        wrong = verdict(BLOCK, [-1.0, side * 0.6], [0.5], [2.0, -side * 1.2])
        assert wrong.cone == pytest.approx(0.1)
        assert wrong.complementarity == wrong.non_penetration == 0.0

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_slips_although_the_cone_could_hold_it(self, side: float) -> None:
        """Slip of 0.1 m/s goes on, 0.2 N s of friction are left: the smaller of 0.1 and 0.1."""
        wrong = verdict(BLOCK, [-1.0, side * 0.5], [0.5], [2.0, -side * 0.8])
        assert wrong.complementarity == pytest.approx(0.1)
        assert wrong.cone == 0.0

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_friction_drives_instead_of_holding(self, side: float) -> None:
        wrong = verdict(BLOCK, [-1.0, side * 0.1], [0.5], [2.0, side * 1.0])
        assert wrong.complementarity == pytest.approx(0.6)

    def test_friction_without_a_coefficient(self) -> None:
        assert verdict(BLOCK, [-1.0, 0.0], [0.0], [2.0, 0.4]).cone == pytest.approx(0.2)

    def test_friction_without_a_normal_impulse(self) -> None:
        assert verdict(BLOCK, [1.0, 0.0], [0.5], [0.0, 0.4]).cone == pytest.approx(0.2)

    def test_prescribed_friction_on_the_wrong_edge(self) -> None:
        """Slides forward, so friction is −μ λ_n = −1 N s; +1 is 2 N s off."""
        right = verdict(BLOCK, [-1.0, 0.3], [0.5], [2.0, -1.0], slope=-0.5)
        assert right.cone == right.complementarity == 0.0
        wrong = verdict(BLOCK, [-1.0, 0.3], [0.5], [2.0, 1.0], slope=-0.5)
        assert wrong.cone == pytest.approx(1.0)

    @pytest.mark.parametrize("impulse", [[np.nan, 0.0], [2.0, np.nan], [np.inf, 0.0], [1e308, 0]])
    def test_numbers_that_are_none(self, impulse: list[float]) -> None:
        assert not verdict(4.0 * BLOCK, [-1.0, 0.0], [0.5], impulse).worst <= 1e-9

    def test_what_cannot_move_must_not_be_asked_to(self) -> None:
        assert verdict(np.zeros((2, 2)), [-1e-12, 0.0], [0.5], [0.0, 0.0]).non_penetration == 1.0
        assert verdict(np.zeros((2, 2)), [1e-12, 0.0], [0.5], [0.0, 0.0]).worst < 1e-15
        assert verdict(np.zeros((2, 2)), [1.0, 0.0], [0.5], [1e-9, 0.0]).complementarity == 1.0

    def test_friction_of_what_cannot_slide(self) -> None:
        """A row without inverse mass: friction there must be in the cone all the same."""
        G = np.diag([0.5, 0.0])
        assert verdict(G, [-1.0, 0.0], [0.5], [2.0, 0.9]).worst < 1e-14
        assert verdict(G, [-1.0, 0.0], [0.5], [2.0, 1.2]).cone == pytest.approx(0.2)

    def test_impulses_without_any_cause(self) -> None:
        assert verdict(BLOCK, [0.0, 0.0], [0.5], [1e-30, 0.0]).worst == np.inf
        assert verdict(BLOCK, [0.0, 0.0], [0.5], [0.0, 0.0]).worst < 1e-14

    def test_floor(self) -> None:
        """With a floor of 1e-3 √kg m/s, rows count in units of √0.5 · 1e-3 m/s."""
        unit = np.sqrt(0.5) * 1e-3
        assert verdict(BLOCK, [-1e-6, 0.0], [0.5], [0.0, 0.0]).non_penetration == pytest.approx(1.0)
        wrong = verdict(BLOCK, [-1e-6, 0.0], [0.5], [0.0, 0.0], floor=1e-3)
        assert wrong.non_penetration == pytest.approx(1e-6 / unit)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", range(4))
def test_data_that_are_no_numbers_are_never_certified(bad: float, place: int) -> None:
    """A contact that leaves needs no impulse, and yet nothing is known of it."""
    data = [BLOCK.copy(), np.array([1.0, 0.0]), np.array([0.5]), np.zeros(2)]
    data[place].flat[0] = bad
    assert not verdict(*data).worst <= 1e-9


def without_friction(M: ArrayLike, q: list[float], solver: str) -> ContactSolution:
    """Solve w = M z + q, 0 ≤ w ⟂ z ≥ 0: contacts without friction, in their normal rows."""
    normal = np.array([1.0, 0.0])
    return solve_contact(np.kron(M, np.diag(normal)), np.kron(q, normal), 0.0, solver=solver)


class TestGeneralMatrices:
    """Of a general complementarity problem the diagonal may say little."""

    def test_a_tiny_diagonal_makes_no_large_unit(self) -> None:
        """By its diagonal the second row would count in units of 1e-10, its datum as 5e9."""
        for diagonal in (1e-20, 1e-30, 0.0):
            M = [[1.0, -1.0], [-1.0, diagonal]]
            for solver in SOLVERS:
                assert not without_friction(M, [-1.0, 0.5], solver).certificate.valid

    def test_weight_is_the_largest_entry_that_the_diagonal_does_not_explain(self) -> None:
        """w = (−3, 0), and both rows weigh 4: β = 3/2, so that the first misses by one unit."""
        M = np.kron([[1.0, 4.0], [0.0, 1.0]], np.diag([1.0, 0.0]))
        wrong = verdict(M, [-3.0, 0.0, 0.0, 0.0], [0.0, 0.0], np.zeros(4), skewed=True)
        assert wrong.non_penetration == pytest.approx(1.0)
        wrong = verdict(M, [-3.0, 0.0, 6.0, 0.0], [0.0, 0.0], np.zeros(4), skewed=True)
        assert wrong.non_penetration == pytest.approx(0.5)

    def test_numbers_whose_products_overflow(self) -> None:
        M = [[1e305, -1e305], [-1e305, 1e305]]
        for solver in SOLVERS:
            assert not without_friction(M, [-1.0, -1.0], solver).certificate.valid


@pytest.mark.parametrize("mass", [1e-300, 1e-150, 1.0, 1e150, 1e300])
@pytest.mark.parametrize("speed", [1e-320, 1e-150, 1.0, 1e150, 1e300])
def test_units_as_small_or_large_as_numbers_go(mass: float, speed: float) -> None:
    """The impulse that stops a mass, unless it cannot be written down."""
    solution = solve_contact(np.eye(2) / mass, [-speed, 0.0], 0.5)
    with np.errstate(over="ignore"):
        impulse = mass * speed
    if 1e-290 < impulse < 1e290:
        assert solution.certificate.valid
        assert solution.impulse[0, 0] == pytest.approx(impulse)
    elif not impulse < np.inf:
        assert solution.certificate.status is SolveStatus.UNDECIDABLE


def test_floor_of_a_solve() -> None:
    """Two walls that close in at 1e-12 m/s: no impulse helps, and nobody minds below 1e-3 m/s."""
    free = [-1e-12, 0.0, -1e-12, 0.0]
    assert not solve_contact(WALLS, free, 0.0).certificate.valid
    solution = solve_contact(WALLS, free, 0.0, floor=1e-2)
    assert solution.certificate.valid
    assert solution.certificate.non_penetration == pytest.approx(1e-10, rel=1e-6)
    assert not solve_contact(WALLS, [-1e-2, 0.0, -1e-2, 0.0], 0.0, floor=1e-2).certificate.valid


class TestHugeImpulses:
    """Two walls that face each other: equal impulses of any size cancel."""

    @pytest.mark.parametrize("size", [1.0, 1e5, 1e10, 1e15, 1e18])
    def test_do_not_prove_themselves(self, size: float) -> None:
        """One wall still closes in at 0.2 m/s, however hard both push."""
        wrong = verdict(WALLS, [-1.0, 0, -0.2, 0], [0.0, 0.0], [size, 0.0, size, 0.0])
        assert wrong.non_penetration == pytest.approx(1.0)

    @pytest.mark.parametrize("size", [1e9, 1e12, 1e15])
    def test_are_summed_without_rounding(self, size: float) -> None:
        """A velocity of 1 m/s left over from 1e15 is still seen, and known to 1e-12."""
        right = verdict(WALLS, [-1.0, 0, 1.0, 0], [0.0, 0.0], [size + 1.0, 0.0, size, 0.0])
        assert right.non_penetration == right.cone == right.complementarity == 0.0
        assert right.rounding < 1e-12
        assert right.velocity.tolist() == [0.0, 0.0, 0.0, 0.0]


def test_friction_at_the_edge_of_a_huge_cone() -> None:
    """0.3 · 1 000 001 996 N s is no number: what it is rounded to misses the cone by 2.3e-8 N s."""
    corner = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    force = 1000001996.0
    impulse = [force, 0.3 * force, force - 1.0, 0.3 * force]
    found = verdict(corner @ corner.T, [-1.0, 0.0, 1.0, 0.0], [0.3, 0.5], impulse)
    excess = float(Fraction(0.3 * force) - Fraction(0.3) * Fraction(force))
    assert excess > 1e-8
    assert found.cone == pytest.approx(excess, rel=1e-6)


def test_without_a_solution_nothing_is_certified() -> None:
    J = np.array([[0.3, -1.0], [0.3, 2.0], [0.0, 0.1], [-0.5, 0.3]])
    for solver in SOLVERS:
        for fallback in (True, False):
            solution = solve_contact(
                J @ J.T, [-0.1, 1, -0.1, -0.5], [0, 1], solver=solver, fallback=fallback
            )
            assert not solution.certificate.valid
            assert solution.certificate.worst > 0.01
    assert (
        "undecidable"
        in solve_contact(J @ J.T, [-0.1, 1, -0.1, -0.5], [0, 1]).certificate.status.text
    )


def test_linear_complementarity_without_a_solution() -> None:
    """w₁ + w₂ = −1 whatever z is."""
    M = np.array([[1.0, -1.0], [-1.0, 1.0]])
    for solver in SOLVERS:
        assert not without_friction(M, [-1.0, 0.0], solver).certificate.valid


def test_what_rounding_decides_is_called_undecidable() -> None:
    """Two walls whose distance grows by 1e-14 of what each is pushed: 1e14 N s would do.

    Written down to sixteen digits such impulses leave a hundredth of the velocity open.
    """
    G = np.zeros((4, 4))
    G[::2, ::2] = [[1.0, -1.0 + 1e-14], [-1.0 + 1e-14, 1.0]]
    solution = solve_contact(G, [-1.0, 0.0, -1.0 / 3.0, 0.0], 0.0)
    if not solution.certificate.valid:
        assert solution.certificate.status is SolveStatus.UNDECIDABLE
    exact = residual(G, np.array([-1.0, 0, -1.0 / 3.0, 0]), np.zeros(2), solution.impulse.ravel())
    assert solution.certificate.valid == (exact <= 1e-9)


@given(seed=st.integers(0, 2**32 - 1), stretch=st.integers(0, 2**32 - 1))
def test_rescaled_rows_are_the_same_problem(seed: int, stretch: int) -> None:
    """Other units for each row, by powers of two: the same residuals to the last digits."""
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    impulse = solve_contact(problem.delassus, problem.free, problem.friction).impulse.ravel()
    impulse = impulse + 1e-3 * np.abs(impulse).max() * rng.standard_normal(impulse.size)
    scale = 2.0 ** np.random.default_rng(stretch).integers(-12, 13, impulse.size)
    friction = problem.friction * scale[::2] / scale[1::2]
    one = verdict(problem.delassus, problem.free, problem.friction, impulse)
    two = verdict(
        scale[:, None] * problem.delassus * scale, scale * problem.free, friction, impulse / scale
    )
    for name in ("complementarity", "cone", "non_penetration"):
        assert getattr(two, name) == pytest.approx(getattr(one, name), rel=1e-9, abs=1e-13)


def test_friction_moves_by_its_lever() -> None:
    """A push too weak by a tenth, G = diag(1/2, 2), friction 0.8: by hand.

    The residual is r = 0.1. The normal velocity moves by r, both impulses by r, and the friction by
    mu g_t / g_n = 0.8 · 2 times that as the normal impulse moves: 4.6 r in all, in units of
    beta g = 1 m/s along the normal and 2 m/s along the tangent.
    """
    said = verdict(np.diag([0.5, 2.0]), [-1.0, 0.0], [0.8], [1.8, 0.0])
    assert said.worst == pytest.approx(0.1, rel=1e-9)
    np.testing.assert_allclose(said.velocity_error, [[0.46, 0.92]], rtol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), noise=st.sampled_from([1e-10, 1e-6, 1e-2]))
def test_the_velocity_error_is_what_it_takes_to_make_the_answer_exact(
    seed: int, noise: float
) -> None:
    """Build the exactly solved problem that the certificate speaks of, and look how far it is."""
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    G, b, mu = problem.delassus, problem.free, problem.friction
    impulse = solve_contact(G, b, mu).impulse.ravel()
    impulse = impulse * (1.0 + noise * rng.standard_normal(impulse.size))
    said = verdict(G, b, mu, impulse)
    root = np.sqrt(np.diag(G))
    beta = np.max(np.abs(b[root > 0]) / root[root > 0], initial=0.0)
    velocity = exact_velocity(G, b, impulse)
    small = said.worst * beta
    exact, moved = impulse.copy(), velocity.copy()
    for k in range(mu.size):
        n, t = 2 * k, 2 * k + 1
        if impulse[n] * root[n] <= small:
            exact[n] = exact[t] = 0.0
            moved[n] = max(velocity[n], 0.0)
            continue
        moved[n] = 0.0
        limit = mu[k] * exact[n]
        exact[t] = np.clip(impulse[t], -limit, limit)
        if abs(velocity[t]) <= small * root[t]:
            moved[t] = 0.0
        else:
            exact[t] = -limit * np.sign(velocity[t])
    needed = exact_velocity(G, b - moved, exact)  # what the free velocity must move by
    assert np.all(np.abs(needed) <= said.velocity_error.ravel() * (1.0 + 1e-9) + 1e-300)


@given(seed=st.integers(0, 2**32 - 1), solver=st.sampled_from(SOLVERS))
def test_hard_problems_are_certified_if_and_only_if_they_are_solved(seed: int, solver: str) -> None:
    problem, planted = hard_problem(np.random.default_rng(seed))
    solution = solve_contact(problem.delassus, problem.free, problem.friction, solver=solver)
    certificate = solution.certificate
    worst = residual(problem.delassus, problem.free, problem.friction, solution.impulse.ravel())
    assert certificate.valid == (certificate.worst <= 1e-9)
    assert worst <= 1e-9 if certificate.valid else worst > 0.99e-9
    assert certificate.valid == (certificate.status is SolveStatus.SOLVED)
    if np.all(np.isfinite(planted)) and not certificate.valid:
        assert certificate.status is SolveStatus.UNDECIDABLE
        assert effort(problem.delassus, problem.free, planted) > 1e5


def test_tolerance_and_floor_must_make_sense() -> None:
    from heelstrike.errors import ContactProblemError

    for options in ({"tolerance": 0.0}, {"tolerance": np.inf}, {"floor": -1.0}, {"floor": np.nan}):
        with pytest.raises(ContactProblemError, match=next(iter(options))):
            solve_contact(BLOCK, [-1.0, 0.0], 0.5, **options)
