"""Residuals of any impulse, on groups of every set, against their definitions written out again.

Kernels run as plain Python here: what they compute does not depend on how they are compiled.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact import SolveStatus
from heelstrike.contact.certificate import (
    Certificate,
    certify,
    general_weight,
    relative_speed,
    scale_beside,
    sign,
    velocity_error,
)
from heelstrike.contact.cone_certificate import MOST_STOPS
from heelstrike.contact.modes import Solver
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.solvers import certified_solve
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, ContactWorkspace, contact_problem

Floats = NDArray[np.float64]
EPSILON = 2.0**-53

plainly = uncompiled(certify)


@dataclass
class Case:
    """A problem and an impulse that need not be its solution."""

    delassus: Floats
    free: Floats
    impulse: Floats
    sets: list[int]
    """Of every group; half-lines and lines have no tangent here."""
    friction: list[float]
    bound: list[float]
    slope: list[float]
    floor: float = 0.0
    skewed: bool = False
    work: ContactWorkspace = field(default_factory=lambda: WORK)

    @property
    def first(self) -> list[int]:
        sizes = [1 if each in (HALF_LINE, LINE) else 2 for each in self.sets]
        return np.concatenate([[0], np.cumsum(sizes)]).tolist()

    def certified(self) -> tuple[float, ContactAnswer]:
        """What the kernel says."""
        count, size, work = len(self.sets), len(self.free), self.work
        problem = contact_problem(
            count, count=count, first=np.array(self.first), friction=np.array(self.friction),
            bound=np.array(self.bound), set=np.array(self.sets),
        )  # fmt: skip
        problem.delassus[:], problem.free[:] = np.nan, np.nan
        problem.delassus[:size, :size], problem.free[:size] = self.delassus, self.free
        work.scaling.slope[:count] = self.slope
        work.settings.floor, work.settings.skewed = self.floor, int(self.skewed)
        answer = ContactAnswer.allocate(capacity=count)
        answer.impulse[:size] = self.impulse
        return plainly(problem, work.settings, work.scaling, answer), answer


WORK = contact_workspace(4, ready=False, symmetric=False)


def exact_velocities(case: Case) -> Floats:
    impulse = [Fraction(each) for each in case.impulse.tolist()]
    return np.array(
        [
            float(sum((Fraction(g) * x for g, x in zip(row, impulse, strict=True)), Fraction(b)))
            for row, b in zip(case.delassus.tolist(), case.free.tolist(), strict=True)
        ]
    )


def weights(case: Case) -> Floats:
    """Of a symmetric matrix its diagonal; of others more, where entries are larger than that."""
    diagonal = np.maximum(np.diag(case.delassus), 0.0)
    if not case.skewed:
        return np.sqrt(diagonal)
    either = np.maximum(np.abs(case.delassus), np.abs(case.delassus.T))
    larger = either > np.sqrt(np.outer(diagonal, diagonal))
    return np.sqrt(np.maximum(diagonal, np.where(larger, either, 0.0).max(axis=1)))


def by_definition(case: Case) -> tuple[Floats, float, float, float]:
    """Residuals, effort and size of the data, and the velocity that counts as rest."""
    g, velocity = weights(case), exact_velocities(case)
    moved = g > 0.0
    beta = max(np.max(np.abs(case.free[moved]) / g[moved], initial=0.0), case.floor)
    effort = float(np.sum(g * np.abs(case.impulse))) / beta
    complementarity, cone, penetration = [0.0], [0.0], [0.0]

    def speed(row: int) -> float:
        return velocity[row] / (g[row] * beta) if moved[row] else float(np.sign(velocity[row]))

    for k, kind in enumerate(case.sets):
        n, end = case.first[k], case.first[k + 1]
        pressed = case.bound[k] if kind == INTERVAL else case.impulse[n]
        if kind != INTERVAL:
            force = pressed * g[n] / beta if moved[n] else float(np.sign(pressed))
            penetration.append(-speed(n))
            complementarity.append(min(speed(n), force))
            if force <= 0.0:
                (penetration if kind == LINE else cone).append(speed(n) if kind == LINE else -force)
        if end == n + 1:
            continue
        t, mu = n + 1, case.friction[k]
        unit = g[t] / beta
        rubs = case.impulse[t]
        if case.slope[k] != 0.0:
            edge = mu * pressed if case.slope[k] > 0.0 else -mu * pressed
            cone.append(abs(edge - rubs) * unit)
            continue
        cone.append((abs(rubs) - mu * pressed) * unit)
        slip = speed(t)
        if slip > 0.0:
            complementarity.append(min(slip, (mu * pressed + rubs) * unit))
        else:
            complementarity.append(min(-slip, (mu * pressed - rubs) * unit))
    found = np.array([max(complementarity), max(cone), max(penetration)])
    return found, effort, beta, 1e-10 * beta * (1.0 + effort)


def drawn(seed: int) -> Case:
    """Up to four groups of any set, some pressing, pulling, slipping or prescribed to slide."""
    draw = np.random.default_rng([88, seed])
    count = int(draw.integers(1, 5))
    sets = draw.choice([CONE, CONE, HALF_LINE, LINE, INTERVAL], count).tolist()
    size = sum(1 if each in (HALF_LINE, LINE) else 2 for each in sets)
    rows = draw.normal(size=(size, 5)) * 10.0 ** draw.uniform(-1.0, 1.0, (size, 1))
    slides = [each == CONE and draw.random() < 0.3 for each in sets]
    return Case(
        rows @ rows.T, draw.normal(size=size), draw.normal(size=size), sets,
        [float(draw.uniform(0.2, 1.5)) if s == CONE else float(s == INTERVAL) for s in sets],
        draw.uniform(0.1, 2.0, count).tolist(),
        [float(draw.choice([-1.0, 1.0])) if each else 0.0 for each in slides],
        floor=float(draw.choice([0.0, 0.0, 30.0])),
    )  # fmt: skip


@pytest.mark.parametrize("skewed", [False, True])
def test_residuals_are_what_their_definitions_say(skewed: bool) -> None:
    for seed in range(24):
        case = drawn(seed)
        if skewed:
            shape = case.delassus.shape
            bent = case.delassus * np.random.default_rng(seed).choice([0.0, 1.0, -3.0], shape)
            case = replace(case, delassus=bent, skewed=True)
            case.delassus[np.diag_indices(len(bent))] = np.abs(np.diag(bent))
            if not weights(case).all():
                continue
        worst, answer = case.certified()
        told, effort, beta, rest = by_definition(case)
        scaling, size = case.work.scaling, len(case.free)
        np.testing.assert_allclose(answer.residual, told, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(answer.velocity[:size], exact_velocities(case), atol=1e-12)
        np.testing.assert_allclose(scaling.root[:size], weights(case), rtol=1e-14)
        assert scaling.unit == pytest.approx(beta, rel=1e-14, abs=0.0)
        assert scaling.effort == pytest.approx(effort, rel=1e-12, abs=0.0)
        assert answer.rest == pytest.approx(rest, rel=1e-12, abs=0.0)
        rounding = (2.0 * len(case.sets) + 2.0) * EPSILON * (1.0 + effort)
        assert scaling.rounding == pytest.approx(rounding, rel=1e-12, abs=0.0)
        assert worst == pytest.approx(told.max() + rounding, rel=1e-9, abs=0.0)


def test_where_impulses_cancel_velocities_are_summed_with_their_errors() -> None:
    """Impulses of 1e7 that leave next to nothing: what is left is told to its last digits."""
    for seed in range(20):
        case, draw = drawn(seed), np.random.default_rng(seed)
        rows = draw.normal(size=(len(case.free), 2))
        if len(rows) < 3:
            continue
        case = replace(case, delassus=rows @ rows.T, floor=0.0)
        case.impulse += 1e7 * np.linalg.svd(rows)[0][:, 2]
        worst, answer = case.certified()
        velocity, size, g = exact_velocities(case), len(case.free), weights(case)
        np.testing.assert_allclose(answer.velocity[:size], velocity, rtol=1e-14)
        sums = np.abs(case.free) + np.abs(case.delassus) @ np.abs(case.impulse)
        beta = by_definition(case)[2]
        told = by_definition(case)[0]
        np.testing.assert_allclose(answer.residual, told, rtol=1e-6, atol=1e-12)
        scaling = case.work.scaling
        assert scaling.effort == pytest.approx(np.max(sums / (g * beta)), rel=1e-12, abs=0.0)
        terms = 2.0 * len(case.sets) + 1.0
        left = EPSILON * np.abs(velocity) + (2.0 * terms * EPSILON) ** 2 * sums
        assert scaling.rounding == pytest.approx(np.max(left / (g * beta)), rel=1e-9, abs=0.0)
        assert worst == pytest.approx(answer.residual.max() + scaling.rounding, rel=1e-12, abs=0.0)


def test_of_impulses_that_cancel_exactly_rounding_is_of_the_second_order() -> None:
    """Two rows that are one, pressed by 1e8 and −1e8: (2 · (2 n + 1) · 2⁻⁵³)² of what cancels."""
    case = Case(
        np.ones((2, 2)), np.zeros(2), np.array([1e8, -1e8]), [LINE, LINE], [0.0] * 2, [0.0] * 2,
        [0.0] * 2, floor=1.0,
    )  # fmt: skip
    worst, answer = case.certified()
    assert not answer.velocity.any()
    assert worst == pytest.approx((2.0 * 5.0 * EPSILON) ** 2 * 2e8, rel=1e-12, abs=0.0)


def one(free: float, impulse: float, kind: int = HALF_LINE, delassus: float = 0.5) -> Case:
    """One row."""
    return Case(
        np.array([[delassus]]), np.array([free]), np.array([impulse]), [kind], [0.0], [0.0], [0.0]
    )


def test_an_impulse_without_a_cause_or_that_is_no_number_is_never_certified() -> None:
    for case in (one(0.0, 1.0), one(-1.0, np.inf), one(np.nan, 0.0), one(-1.0, np.nan)):
        with np.errstate(invalid="ignore"):
            worst, answer = case.certified()
        assert not worst < np.inf
        assert answer.residual[2] == np.inf


def test_where_there_is_no_program_the_kernels_weigh(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same numbers, whether the list of programs ends before or has none."""
    none = np.zeros((2, MOST_STOPS + 1), np.int64)
    monkeypatch.setattr(certified_solve, "certificate_programs", lambda: none)
    work = contact_workspace(4, ready=False)
    assert len(work.scaling.programs) == 2
    for seed in range(6):
        worst, answer = replace(drawn(seed), work=work).certified()
        other, wanted = drawn(seed).certified()
        assert worst == other
        np.testing.assert_array_equal(answer.residual, wanted.residual)
        np.testing.assert_array_equal(answer.velocity, wanted.velocity)


def test_nothing_asks_for_nothing() -> None:
    worst, answer = one(0.0, 0.0).certified()
    assert answer.residual.tolist() == [0.0, 0.0, 0.0]
    assert worst == pytest.approx(4.0 * EPSILON, abs=0.0)
    assert answer.rest == 0.0


@pytest.mark.parametrize(
    ("free", "impulse", "residuals"),
    [(-1.0, 0.0, [0, 0, 1]), (1.0, 2.0, [1, 0, 0]), (1.0, -2.0, [0, 1, 0]), (1.0, 0.0, [0, 0, 0])],
)
def test_what_nothing_moves_counts_fully(
    free: float, impulse: float, residuals: list[float]
) -> None:
    """A row of zeros: its velocity stays what it is, and any impulse on it is one too many."""
    case = Case(
        np.diag([0.0, 0.5]), np.array([1e-3 * free, -1.0]), np.array([impulse, 2.0]),
        [HALF_LINE, HALF_LINE], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    )  # fmt: skip
    _, answer = case.certified()
    assert answer.residual.tolist() == residuals


def test_friction_that_moves_nothing_counts_in_units_of_what_presses() -> None:
    """λ_t is set against μ λ_n, by the unit of λ_n over μ; without either, against itself."""
    assert uncompiled(scale_beside)(3.0, 0.1, 0.2, 0.5) == 6.0
    for normal, friction in ((0.0, 0.5), (3.0, 0.0)):
        # Room of −0.6 and 1.0 to both edges: |λ_t| is 0.8, half of their difference; μ λ_n is 0.2.
        assert uncompiled(scale_beside)(normal, -0.6, 1.0, friction) == pytest.approx(1.0)
        assert uncompiled(scale_beside)(normal, 1.0, -0.6, friction) == pytest.approx(1.0)
        assert uncompiled(scale_beside)(normal, 0.4, 0.6, friction) == pytest.approx(1.0 / 0.6)
        assert uncompiled(scale_beside)(normal, 0.0, 0.0, friction) == 0.0
    delassus = np.diag([0.5, 0.0])
    case = Case(delassus, np.array([-1.0, 0.0]), np.array([2.0, 1.2]), [CONE], [0.5], [0.0], [0.0])
    # λ_n counts in units of 2 N s, the friction in units of 0.5 · 2: an excess of 0.2.
    assert case.certified()[1].residual.tolist() == pytest.approx([0.0, 0.2, 0.0])


def test_a_stop_with_an_empty_tangent_does_not_excuse_the_contacts_after_it() -> None:
    """Its second row is zero, whatever friction stands there; the cone behind it is 0.2 beyond."""
    G = np.diag([0.5, 0.0, 0.5, 0.5])
    case = Case(
        G, np.array([-1.0, 0.0, -1.0, 0.6]), np.array([2.0, 0.0, 2.0, -1.2]), [HALF_LINE, CONE],
        [0.0, 0.5], [0.0, 0.0], [0.0, 0.0],
    )  # fmt: skip
    count, work = 2, case.work
    problem = contact_problem(
        count, count=count, friction=np.array(case.friction), set=np.array(case.sets),
        delassus=G, free=case.free,
    )  # fmt: skip
    work.scaling.slope[:2], work.settings.floor, work.settings.skewed = 0.0, 0.0, 0
    answer = ContactAnswer.allocate(capacity=count, impulse=case.impulse)
    plainly(problem, work.settings, work.scaling, answer)
    assert answer.residual.tolist() == pytest.approx([0.0, 0.1, 0.0])


def test_signs_and_speeds() -> None:
    assert [uncompiled(sign)(each) for each in (-2.0, 0.0, 0.3)] == [-1.0, 0.0, 1.0]
    assert uncompiled(relative_speed)(3.0, 2.0, 4.0) == 6.0
    assert uncompiled(relative_speed)(-3.0, 0.0, 4.0) == -1.0


def test_weights_of_any_matrix_bound_its_entries() -> None:
    """|M_ij| ≤ √(w_i w_j), with the diagonal where that does."""
    matrix = np.array([[4.0, 3.0, 0.0], [-9.0, 9.0, 6.0], [7.0, 6.0, 4.0]])
    found = [uncompiled(general_weight)(3, row, matrix) for row in range(3)]
    # √(4 · 9) = 6 < 9 and √(4 · 4) < 7 of the first row; √(9 · 4) = 6 bounds the other entry.
    assert found == [9.0, 9.0, 7.0]
    assert uncompiled(general_weight)(2, 0, np.array([[-1.0, 0.0], [2.0, 3.0]])) == 2.0
    assert uncompiled(general_weight)(1, 0, np.array([[-1.0]])) == 1.0


def test_how_far_velocities_may_be_off() -> None:
    """r (1 + Σ (2 + μ g_t / g_n)) in units of each row's velocity; no lever where nothing moves."""
    scaling = WORK.scaling
    scaling.root[:4], scaling.unit = [2.0, 3.0, 0.0, 5.0], 0.7
    found = velocity_error(0.1, np.array([0.4, 0.9]), scaling)
    moved = 0.1 * (1.0 + (2.0 + 0.4 * 3.0 / 2.0) + 2.0)
    np.testing.assert_allclose(found, moved * 0.7 * np.array([[2.0, 3.0], [0.0, 5.0]]), rtol=1e-14)
    none = velocity_error(1.0, np.array([0.4, 0.9]), scaling)
    assert none.shape == (2, 2)
    assert np.isposinf(none).all()
    assert np.isfinite(velocity_error(0.999, np.array([0.4, 0.9]), scaling)).all()


def test_a_certificate_is_valid_if_it_ended_well_and_within_its_tolerance() -> None:
    good = Certificate(
        status=SolveStatus.SOLVED, solver=Solver.LEMKE, iterations=3, fallbacks=1,
        complementarity=2e-10, cone=5e-10, non_penetration=3e-10, rounding=1e-10,
        tolerance=6.5e-10, velocity_error=np.zeros((1, 2)),
    )  # fmt: skip
    assert good.worst == pytest.approx(6e-10)
    assert good.valid
    assert replace(good, tolerance=good.worst).valid
    assert not replace(good, tolerance=5.5e-10).valid
    assert not replace(good, status=SolveStatus.RAY).valid
    for name in ("complementarity", "non_penetration"):
        assert replace(good, **{name: 9e-10}).worst == pytest.approx(1e-9)
    assert "complementarity 2.0e-10, cone 5.0e-10, non-penetration 3.0e-10" in str(good)
    assert "3 iterations, 1 fallbacks" in str(good)
