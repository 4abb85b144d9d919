"""What the solvers of contact in space are made of, each step by itself before an independent law.

The kernels run as plain Python: nothing is compiled for so small problems.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.spatial.certificate import certify_blocks, sum_blocks, weigh_blocks
from heelstrike.contact.spatial.certified_solve import block_workspace
from heelstrike.contact.spatial.cones import natural_map, project
from heelstrike.contact.spatial.fixed_point import GRADIENT_STEPS, guess_slips
from heelstrike.contact.spatial.gauss_seidel import solve_planar_point, solve_point, sweep
from heelstrike.contact.spatial.impossible import proof_of_none
from heelstrike.contact.spatial.iterates import look, note_best, return_to_best
from heelstrike.contact.spatial.modes import OPEN, SLIP, STICK
from heelstrike.contact.spatial.newton import (
    find_step,
    go,
    iterate_newton,
    name_modes,
    solve_general,
)
from heelstrike.contact.spatial.proximal import remember, tie
from heelstrike.contact.spatial.restarts import draw
from heelstrike.contact.spatial.scaling import give_impulses, scale_blocks, take_impulses
from heelstrike.contact.spatial.sticking import (
    FIRM,
    SHARE_OF_FRICTION,
    bring_inside,
    correct_modes,
    factorize,
    hold,
    list_sticking_rows,
    solve_factored,
    try_sticking,
)
from heelstrike.contact.spatial.workspace import (
    BlockProblem,
    BlockWorkspace,
    block_answer,
    block_problem,
)

FIRST = np.array([0, 3, 5, 6, 8, 9])
"""Rows of a point, a point in a plane, a stop, two rows of a loop, and dry friction."""
SETS = np.array([CONE, CONE, HALF_LINE, LINE, INTERVAL])
FRICTION = np.array([0.6, 0.4, 0.0, 0.0, 0.0])
ROWS, BLOCKS = 9, 5


def posed(seed: int, freedoms: int = 12) -> tuple[BlockProblem, BlockWorkspace]:
    """A problem of all kinds of blocks, and memory with the same in the units of the solvers."""
    rng = np.random.default_rng([41, seed])
    jacobian = rng.normal(size=(ROWS, freedoms)) * 10.0 ** rng.uniform(-1.0, 1.0, (ROWS, 1))
    problem = block_problem(
        BLOCKS, ROWS, count=BLOCKS, first=FIRST, set=SETS.copy(), friction=FRICTION.copy(),
        bound=np.array([0.0, 0.0, 0.0, 0.0, 0.3]), delassus=jacobian @ jacobian.T,
        free=rng.normal(size=ROWS),
    )  # fmt: skip
    work = block_workspace(BLOCKS, ROWS, ready=False)
    uncompiled(scale_blocks)(problem, work.settings, work.scaled)
    work.iterate.least = math.inf
    return problem, work


def nearest(kind: int, mu: float, bound: float, point: np.ndarray) -> np.ndarray:
    """The point of a set that is nearest to another."""
    if kind == LINE:
        return point
    if kind == HALF_LINE:
        return np.maximum(point, 0.0)
    if kind == INTERVAL:
        return np.clip(point, -bound, bound)
    across = np.linalg.norm(point[1:])
    if mu * across <= -point[0]:
        return np.zeros_like(point)
    if across <= mu * point[0]:
        return point
    pressed = (point[0] + mu * across) / (1.0 + mu * mu)
    return np.r_[pressed, mu * pressed * point[1:] / across]


def residuals(problem: BlockProblem, work: BlockWorkspace, x: np.ndarray) -> list[float]:
    """Natural map of each block, ‖λ − P(λ − ũ)‖, of impulses in the units of the solvers."""
    found = []
    u = work.scaled.matrix @ x + work.scaled.offset
    for block in range(BLOCKS):
        part = slice(FIRST[block], FIRST[block + 1])
        speed = u[part].copy()
        if SETS[block] == CONE:
            speed[0] += FRICTION[block] * np.linalg.norm(speed[1:])
        to = nearest(SETS[block], FRICTION[block], work.scaled.bound[block], x[part] - speed)
        found.append(float(np.linalg.norm(x[part] - to)))
    return found


# Units.


def test_the_units_are_those_of_the_documentation() -> None:
    """β = max |b_i| s_c with s_c = 1/√max diag W_cc; impulses count in β s_c, and come back.

    A normal velocity that opens, here that of the second point, counts a hundredth.
    """
    problem, work = posed(0)
    problem.free[[0, 3, 5]] = -0.1, 30.0, -0.2
    uncompiled(scale_blocks)(problem, work.settings, work.scaled)
    diagonal = np.diag(problem.delassus)
    s = np.array([1.0 / math.sqrt(max(diagonal[a:b])) for a, b in pairwise(FIRST)])
    rows = np.repeat(s, np.diff(FIRST))
    counted = np.abs(problem.free) * rows
    assert np.argmax(counted) == 3
    counted[3] *= 1e-2
    beta = np.max(counted)
    scaled = work.scaled
    assert scaled.unit == pytest.approx(beta)
    np.testing.assert_allclose(scaled.matrix, problem.delassus * np.outer(rows, rows), rtol=1e-14)
    np.testing.assert_allclose(scaled.offset, problem.free * rows / beta, rtol=1e-14)
    assert scaled.bound[4] == pytest.approx(0.3 / (beta * s[4]))
    impulse = np.random.default_rng(1).normal(size=ROWS)
    uncompiled(take_impulses)(problem, scaled, impulse, work.iterate)
    np.testing.assert_allclose(work.iterate.x, impulse / (beta * rows), rtol=1e-14)
    answer = block_answer(BLOCKS, ROWS)
    uncompiled(give_impulses)(problem, scaled, work.iterate.x, answer)
    np.testing.assert_allclose(answer.impulse, impulse, rtol=1e-14)


def test_what_is_far_from_the_ground_excuses_nothing() -> None:
    """A point that opens at 50 m/s beside one that does not: friction of the other off by 1e-8.

    The first needs no impulse and knows nothing of the second. What it adds to the size of the data
    is half of theirs, so that it changes nothing; and nothing counts in units of zero where all
    opens.
    """
    off = []
    for far in (0.0, 5e1):
        problem = block_problem(
            2, 6, count=2, first=np.array([0, 3, 6]), set=np.array([CONE, CONE]),
            friction=np.array([0.5, 0.5]), bound=np.zeros(2), delassus=np.eye(6),
            free=np.array([-1.0, 1.0, 0.0, far, 0.0, 0.0]),
        )  # fmt: skip
        work, answer = block_workspace(2, 6, ready=False), block_answer(2, 6)
        answer.impulse[:2] = 1.0, -0.5 - 1e-8
        off.append(uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer))
        assert work.scaled.unit == 1.0
    assert off[0] == pytest.approx(off[1], rel=1e-3)
    assert 4e-9 < off[0] < 1e-8
    problem.free[:2] = 1.0, 0.0
    answer.impulse[:] = 0.0
    assert uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer) < 1e-11


def test_data_below_the_floor_count_in_units_of_the_floor() -> None:
    """Free velocities that are rounding of what was there before are not enlarged to one."""
    problem, work = posed(1)
    work.settings.floor = 1e3
    uncompiled(weigh_blocks)(problem, work.settings, work.scaled)
    assert work.scaled.unit == 1e3
    answer = block_answer(BLOCKS, ROWS)  # no impulse at all
    uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer)
    beside = 1e3 * np.array(residuals_of_nothing(problem, 1e3))
    assert answer.residual == pytest.approx(np.max(beside) / 1e3)
    work.settings.floor = 0.0
    uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer)
    assert answer.residual > 10.0 * np.max(beside) / 1e3


def residuals_of_nothing(problem: BlockProblem, unit: float) -> list[float]:
    """Natural maps where no impulse acts, of data in a unit."""
    found = []
    for block in range(BLOCKS):
        part = slice(FIRST[block], FIRST[block + 1])
        scale = 1.0 / math.sqrt(max(np.diag(problem.delassus)[part]))
        speed = problem.free[part] * scale / unit
        if SETS[block] == CONE:
            speed[0] += FRICTION[block] * np.linalg.norm(speed[1:])
        bound = problem.bound[block] / (unit * scale)
        to = nearest(SETS[block], FRICTION[block], bound, -speed)
        found.append(float(np.linalg.norm(to)))
    return found


# Iterates.


def test_after_a_return_to_the_best_impulses_all_belongs_to_them() -> None:
    """Velocities and residual too, not those of the impulses that were given up."""
    problem, work = posed(2)
    rng = np.random.default_rng(3)
    iterate = work.iterate
    best = 0.1 * np.abs(rng.normal(size=ROWS))
    iterate.x[:] = best
    uncompiled(look)(problem, work.scaled, iterate)
    least = iterate.least
    iterate.x[:] = 50.0 * rng.normal(size=ROWS)
    uncompiled(look)(problem, work.scaled, iterate)
    assert iterate.worst > least == iterate.least
    uncompiled(return_to_best)(problem, work.scaled, iterate)
    assert np.array_equal(iterate.x, best)
    each = residuals(problem, work, best)
    wanted = work.scaled.matrix @ best + work.scaled.offset
    np.testing.assert_allclose(iterate.u, wanted, atol=1e-13)
    assert iterate.worst == pytest.approx(max(each)) == least
    assert iterate.square == pytest.approx(np.sum(np.square(each)))


def test_only_better_impulses_are_kept() -> None:
    problem, work = posed(3)
    iterate = work.iterate
    for worst, kept in ((0.5, 1.0), (0.7, 1.0), (0.2, 3.0), (0.2, 3.0)):
        iterate.worst, iterate.x[:] = worst, 1.0 + 2.0 * (worst < 0.5) + (worst > 0.5)
        uncompiled(note_best)(problem, iterate)
        assert np.all(iterate.best == kept)
    assert iterate.least == 0.2


def test_numbers_that_are_none_have_no_residual() -> None:
    problem, work = posed(3)
    work.iterate.x[4] = np.nan
    uncompiled(look)(problem, work.scaled, work.iterate)
    assert work.iterate.worst == work.iterate.square == math.inf


# Sets.


@pytest.mark.parametrize("kind", [CONE, HALF_LINE, LINE, INTERVAL])
def test_projections_are_nearest_and_natural_maps_the_way_to_them(kind: int) -> None:
    rng = np.random.default_rng([7, kind])
    mu, bound = (0.7 if kind == CONE else 0.0), (0.4 if kind == INTERVAL else 0.0)
    for _ in range(60):
        impulse, velocity = rng.normal(size=3), rng.normal(size=3)
        if kind != CONE:  # of one row, but that of a line of three
            impulse[1:] = 0.0
            velocity[1:] *= kind == LINE
        at = np.array(uncompiled(project)(kind, mu, bound, *impulse))
        np.testing.assert_allclose(at, nearest(kind, mu, bound, impulse), atol=1e-15)
        speed = velocity.copy()
        if kind == CONE:
            speed[0] += mu * np.linalg.norm(velocity[1:])
        away = impulse - nearest(kind, mu, bound, impulse - speed)
        if kind in (HALF_LINE, INTERVAL):
            away = away[:1]
        length = uncompiled(natural_map)(kind, mu, bound, tuple(impulse), tuple(velocity))
        assert length == pytest.approx(np.linalg.norm(away), abs=1e-15)


# One block at a time.


def obeys_coulomb(matrix: np.ndarray, mu: float, q: np.ndarray, x: np.ndarray) -> None:
    """Signorini's and Coulomb's conditions, each by itself."""
    u = matrix @ x + q
    size = 1.0 + np.abs(q).max()
    assert x[0] >= 0.0
    assert u[0] >= -1e-12 * size
    assert x[0] * u[0] == pytest.approx(0.0, abs=1e-10)
    limit, rubs = mu * x[0], np.linalg.norm(x[1:])
    assert rubs <= limit + 1e-12 * size
    slip = u[1:]
    if x[0] > 0.0 and np.linalg.norm(slip) > 1e-9 * size:
        assert rubs == pytest.approx(limit)
        assert x[1:] @ slip == pytest.approx(-rubs * np.linalg.norm(slip), abs=1e-9 * size)


@pytest.mark.parametrize("rows", [2, 3])
def test_a_point_alone_obeys_coulomb_s_law(rows: int) -> None:
    """It parts, sticks or slips, and all three of them come about."""
    solve = uncompiled(solve_planar_point if rows == 2 else solve_point)
    rng = np.random.default_rng([8, rows])
    seen = set()
    for _ in range(80):
        half = rng.normal(size=(rows, rows + 1))
        matrix = half @ half.T
        matrix /= np.diag(matrix).max()
        q = rng.normal(size=rows)
        mu = rng.uniform(0.0, 0.6)
        # Where normal and tangents are tied so strongly, that friction jams, is another matter.
        if mu * np.linalg.norm(matrix[0, 1:]) >= 0.9 * matrix[0, 0]:
            continue
        large = np.zeros((5, 5))
        large[1 : 1 + rows, 1 : 1 + rows] = matrix
        x = np.array(solve(large, 1, mu, (*q, 0.0)[:3]))
        assert np.all(x[rows:] == 0.0)
        obeys_coulomb(matrix, mu, q, x[:rows])
        slips = np.linalg.norm((matrix @ x[:rows] + q)[1:]) > 1e-9
        seen.add((x[0] > 0.0, bool(slips and x[0] > 0.0)))
    assert seen == {(False, False), (True, False), (True, True)}


@pytest.mark.parametrize("rows", [2, 3])
def test_a_point_without_friction_is_stopped_by_what_presses(rows: int) -> None:
    solve = uncompiled(solve_planar_point if rows == 2 else solve_point)
    matrix = np.diag([0.5, 1.0, 1.0])
    assert solve(matrix, 0, 0.0, (-1.0, 3.0, 0.0)) == pytest.approx((2.0, 0.0, 0.0))


@pytest.mark.parametrize("rows", [2, 3])
def test_a_point_that_jams_is_at_least_stopped(rows: int) -> None:
    """Ahead it moves along one line only, flatter than friction allows, and is driven up on it.

    With W = g gᵀ, g = (1, 2), friction 1 and the velocity (−1, 0) no impulse obeys Coulomb's law:
    what stops the point leaves a slip of 2, and with the friction against that, n (1 − 2) g, it
    would be pressed in. What remains is to stop it by what presses. In space it moves across too.
    """
    solve = uncompiled(solve_planar_point if rows == 2 else solve_point)
    g = np.array([1.0, 2.0, 0.0])
    matrix = np.outer(g, g) + np.diag([0.0, 0.0, 1.0])
    assert solve(matrix, 0, 1.0, (-1.0, 0.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0))


def test_sweeps_keep_the_velocities_of_the_impulses_and_come_nearer() -> None:
    problem, work = posed(4)
    iterate = work.iterate
    uncompiled(look)(problem, work.scaled, iterate)
    before = sum(residuals(problem, work, iterate.x))
    uncompiled(sweep)(problem, work.scaled, 25, work.tally, iterate)
    assert work.tally.iterations == 25
    wanted = work.scaled.matrix @ iterate.x + work.scaled.offset
    np.testing.assert_allclose(iterate.u, wanted, atol=1e-12)
    assert sum(residuals(problem, work, iterate.x)) < 0.2 * before


def test_a_sweep_leaves_what_no_impulse_moves() -> None:
    problem, work = posed(5)
    problem.delassus[5, :] = problem.delassus[:, 5] = 0.0
    uncompiled(scale_blocks)(problem, work.settings, work.scaled)
    work.iterate.x[5] = 0.25
    uncompiled(look)(problem, work.scaled, work.iterate)
    uncompiled(sweep)(problem, work.scaled, 3, work.tally, work.iterate)
    assert work.iterate.x[5] == 0.25
    assert work.iterate.u[5] == np.sign(problem.free[5])


# Newton's method.


def test_modes_are_named_by_what_presses() -> None:
    """Each block once in each of its modes, with p = λ − u."""
    problem, work = posed(6)
    iterate = work.iterate
    cases = [
        ([1.0, 0.5, 0.2, 1.0, 0.3, 1.0, 0.0, 0.0, 0.0], [STICK, STICK, STICK, STICK, STICK]),
        ([1.0, 0.5, 0.4, 1.0, -0.5, -1.0, 9.0, -9.0, 1e9], [SLIP, SLIP, OPEN, STICK, SLIP]),
        ([-1.0, 0.0, 0.0, -1.0, 0.3, -1.0, 0.0, 0.0, -1e9], [OPEN, OPEN, OPEN, STICK, SLIP]),
    ]
    for pressed, modes in cases:
        iterate.u[:] = np.random.default_rng(2).normal(size=ROWS)
        iterate.x[:] = iterate.u + pressed
        uncompiled(name_modes)(problem, work.scaled, iterate)
        assert iterate.mode.tolist() == modes
    problem.friction[:2] = 0.0  # without friction nothing sticks
    iterate.u[:], iterate.x[:] = 0.0, 1.0
    uncompiled(name_modes)(problem, work.scaled, iterate)
    assert iterate.mode[:2].tolist() == [SLIP, SLIP]


@pytest.mark.parametrize("seed", range(6))
def test_a_step_of_newton_solves_the_equations_of_its_modes(seed: int) -> None:
    """Those at the head of the module, of blocks that stick, slip and are open."""
    problem, work = posed(10 + seed)
    rng = np.random.default_rng(seed)
    iterate, newton, scaled = work.iterate, work.newton, work.scaled
    iterate.x[:] = rng.normal(size=ROWS)
    uncompiled(look)(problem, scaled, iterate)
    uncompiled(name_modes)(problem, scaled, iterate)
    iterate.mode[:2] = rng.permutation([STICK, SLIP]) if seed % 2 else [SLIP, SLIP]
    x, u = iterate.x.copy(), iterate.u.copy()
    assert uncompiled(find_step)(problem, scaled, 0.0, iterate, newton)
    step, moved = newton.step.copy(), newton.moved.copy()
    np.testing.assert_allclose(moved, scaled.matrix @ step, atol=1e-10)
    after, speed = x + step, u + moved
    for block in range(BLOCKS):
        a, b = FIRST[block], FIRST[block + 1]
        mode, mu = iterate.mode[block], FRICTION[block]
        if mode == OPEN:
            np.testing.assert_allclose(after[a:b], 0.0, atol=1e-12)
        elif mode == STICK:
            np.testing.assert_allclose(speed[a:b], 0.0, atol=1e-9)
        elif SETS[block] == INTERVAL:
            side = math.copysign(scaled.bound[block], x[a] - u[a])
            assert after[a] == pytest.approx(side)
        else:
            p = x[a + 1 : b] - u[a + 1 : b]
            length = np.linalg.norm(p)
            p /= length
            assert speed[a] == pytest.approx(0.0, abs=1e-9)
            assert p @ after[a + 1 : b] == pytest.approx(mu * after[a], abs=1e-9)
            if b - a == 3:
                s = np.array([-p[1], p[0]])
                kappa = min(mu * (x[a] - u[a]) / length, 1.0)
                z = s @ step[a + 1 : b]
                lacks = kappa * s @ moved[a + 1 : b] + (1.0 - kappa) * z + s @ x[a + 1 : b]
                assert lacks == pytest.approx(0.0, abs=1e-9)


def test_a_step_goes_as_far_as_the_residual_shrinks() -> None:
    """One that is eight times too long is halved three times, one that is right is taken whole."""
    problem, work = posed(21)
    problem.set[:] = LINE  # linear: one step of Newton's method solves it
    iterate, newton, scaled = work.iterate, work.newton, work.scaled
    solution = -np.linalg.solve(scaled.matrix, scaled.offset)
    for times in (1.0, 8.0):
        iterate.x[:] = 0.0
        uncompiled(look)(problem, scaled, iterate)
        newton.step[:] = times * solution
        newton.moved[:] = scaled.matrix @ newton.step
        assert uncompiled(go)(problem, scaled, iterate, newton)
        np.testing.assert_allclose(iterate.x, solution, rtol=1e-12)
        np.testing.assert_allclose(iterate.u, 0.0, atol=1e-12)
    newton.step[:] = -solution  # the wrong way
    iterate.x[:] = 0.0
    uncompiled(look)(problem, scaled, iterate)
    newton.moved[:] = scaled.matrix @ newton.step
    assert not uncompiled(go)(problem, scaled, iterate, newton)


def test_general_equations_are_solved_with_pivots() -> None:
    """A zero diagonal needs an exchange of rows; what has no solution says so."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        matrix = rng.normal(size=(6, 6))
        np.fill_diagonal(matrix, 0.0)
        right = rng.normal(size=6)
        wanted = np.linalg.solve(matrix, right)
        assert uncompiled(solve_general)(6, matrix, right)
        np.testing.assert_allclose(right, wanted, atol=1e-11)
    matrix = rng.normal(size=(3, 3))
    matrix[:, 2] = 0.0
    assert not uncompiled(solve_general)(3, matrix, np.ones(3))


# Sticking.


def test_the_factor_of_a_positive_matrix_solves_it() -> None:
    rng = np.random.default_rng(6)
    half = rng.normal(size=(6, 8))
    matrix = half @ half.T
    lower, right = matrix.copy(), rng.normal(size=6)
    wanted = np.linalg.solve(matrix, right)
    assert uncompiled(factorize)(6, lower)
    factor = np.tril(lower, -1) + np.diag(1.0 / np.diag(lower))
    np.testing.assert_allclose(factor.T @ factor, matrix, atol=1e-12)
    uncompiled(solve_factored)(6, lower, right)
    np.testing.assert_allclose(right, wanted, atol=1e-10)
    assert not uncompiled(factorize)(2, np.array([[1.0, 2.0], [2.0, 1.0]]))


def test_rows_that_stick_are_listed() -> None:
    """Not those of what is open or slides; with a point that slips there is no such list."""
    problem, work = posed(7)
    mode, listed = work.iterate.mode, uncompiled(list_sticking_rows)
    mode[:] = [STICK, OPEN, STICK, STICK, SLIP]
    size = listed(problem, work.scaled, mode, work.newton)
    assert work.newton.row[:size].tolist() == [0, 1, 2, 5, 6, 7]
    mode[1] = SLIP
    assert listed(problem, work.scaled, mode, work.newton) < 0
    mode[1] = OPEN
    problem.friction[0] = 0.0  # it cannot stick
    assert listed(problem, work.scaled, mode, work.newton) < 0


def test_what_is_held_is_held_by_the_shortest_impulses() -> None:
    """Of a singular matrix too: those of the pseudoinverse."""
    _, work = posed(8, freedoms=4)
    newton, scaled = work.newton, work.scaled
    row = np.array([0, 1, 2, 5, 6])
    newton.row[:5], newton.extra[:5] = row, FIRM
    half = np.random.default_rng(9).normal(size=(ROWS, 3))
    scaled.matrix[:] = half @ half.T
    scaled.matrix[:] /= np.diag(scaled.matrix).max()
    x = np.zeros(ROWS)
    scaled.offset[:] = scaled.matrix @ np.random.default_rng(10).normal(size=ROWS)
    newton.moved[:] = 0.0
    newton.moved[3] = 7.0  # of a row that is not held
    assert uncompiled(hold)(ROWS, 5, scaled, newton, x)
    wanted = -np.linalg.pinv(scaled.matrix[np.ix_(row, row)], rcond=1e-9) @ scaled.offset[row]
    np.testing.assert_allclose(x[row], wanted, atol=1e-6)
    np.testing.assert_allclose((scaled.matrix @ x + scaled.offset)[row], 0.0, atol=1e-12)
    assert not np.any(x[[3, 4, 7, 8]])


def test_friction_leaves_a_load_to_what_can_bear_it() -> None:
    """A stop and dry friction hold the same joint; then the friction holds it alone."""
    problem = block_problem(
        2, 2, count=2, first=np.array([0, 1, 2]), set=np.array([HALF_LINE, INTERVAL]),
        bound=np.array([0.0, 1e-3]), delassus=np.ones((2, 2)), free=np.full(2, -0.1),
    )  # fmt: skip
    work = block_workspace(2, 2, ready=False)
    uncompiled(scale_blocks)(problem, work.settings, work.scaled)
    iterate = work.iterate
    iterate.mode[:2] = STICK
    assert uncompiled(try_sticking)(problem, work.scaled, iterate, work.newton)
    assert iterate.mode[:2].tolist() == [STICK, STICK]
    assert iterate.x[1] == pytest.approx(SHARE_OF_FRICTION * iterate.x[0], rel=1e-6)
    assert iterate.x[1] < work.scaled.bound[1] < 0.5
    problem.bound[1] = 1.0
    uncompiled(scale_blocks)(problem, work.settings, work.scaled)
    iterate.mode[:2] = [OPEN, STICK]
    assert uncompiled(try_sticking)(problem, work.scaled, iterate, work.newton)
    np.testing.assert_allclose(iterate.x[:2], [0.0, 1.0], atol=1e-9)


def test_modes_are_corrected_one_by_one() -> None:
    problem, work = posed(9)
    iterate, bound = work.iterate, work.scaled.bound[4]
    correct = uncompiled(correct_modes)
    iterate.mode[:] = [STICK, OPEN, STICK, STICK, STICK]
    iterate.x[:], iterate.u[:] = 0.5 * bound, 0.0
    assert correct(problem, work.scaled, iterate) == 0
    iterate.x[0] = iterate.x[5] = iterate.x[6] = -1.0  # point and stop pull, and a loop may
    iterate.u[3] = -1.0  # sinks
    iterate.x[8] = -1.1 * bound
    assert correct(problem, work.scaled, iterate) == 4
    assert iterate.mode.tolist() == [OPEN, STICK, OPEN, STICK, SLIP]
    iterate.u[8] = 1.0  # it slides against its friction, as it is to
    assert correct(problem, work.scaled, iterate) == 0
    iterate.u[8] = -1e-12  # along it by rounding
    assert correct(problem, work.scaled, iterate) == 0
    iterate.u[8] = -1.0  # along it
    assert correct(problem, work.scaled, iterate) == 1
    assert iterate.mode[4] == STICK


def test_impulses_are_brought_inside() -> None:
    """Those within the narrower cones stay, the others go 1.8 times the way to them."""
    problem, work = posed(12)
    x = np.random.default_rng(12).normal(size=ROWS)
    x[:3] = [1.0, 0.3, 0.3]
    before = x.copy()
    uncompiled(bring_inside)(problem, work.scaled, x)
    assert np.array_equal(x[:3], before[:3])
    for block in range(1, BLOCKS):
        part = slice(FIRST[block], FIRST[block + 1])
        bound = work.scaled.bound[block]
        to = nearest(SETS[block], 0.95 * FRICTION[block], bound, before[part])
        np.testing.assert_allclose(x[part], before[part] + 1.8 * (to - before[part]), atol=1e-14)


# Other ways.


def test_a_tie_vanishes_where_the_impulses_stay() -> None:
    """(W + τ) λ + b − τ λ = W λ + b; and a tie of no strength is the problem itself."""
    problem, work = posed(13)
    scaled, anchor = work.scaled, work.anchor
    matrix, offset = scaled.matrix.copy(), scaled.offset.copy()
    x = np.random.default_rng(13).normal(size=ROWS)
    uncompiled(remember)(ROWS, scaled, anchor)
    uncompiled(tie)(ROWS, 0.5, x, anchor, scaled)
    np.testing.assert_allclose(np.diag(scaled.matrix - matrix), 0.5, atol=1e-12)
    wanted = matrix @ x + offset
    np.testing.assert_allclose(scaled.matrix @ x + scaled.offset, wanted, atol=1e-12)
    uncompiled(tie)(ROWS, 0.0, x, anchor, scaled)
    assert np.array_equal(scaled.matrix, matrix)
    assert np.array_equal(scaled.offset, offset)
    assert problem.count == BLOCKS


def test_other_beginnings_differ_lie_in_the_cones_and_are_always_the_same() -> None:
    problem, work = posed(14)
    starts = []
    for start in (0, 1, 2, 3, 4, 0):
        uncompiled(draw)(problem, start, work.iterate.x)
        starts.append(work.iterate.x.copy())
        x = starts[-1]
        assert np.abs(x).max() <= 2.0 ** (start % 4)
        assert np.linalg.norm(x[1:3]) <= FRICTION[0] * x[0]
        assert abs(x[4]) <= FRICTION[1] * x[3]
    assert np.array_equal(starts[0], starts[5])
    assert len({tuple(each) for each in starts}) == 5
    assert max(np.abs(each).max() for each in starts) > 2.0


# Certificates.


def test_velocities_are_summed_without_rounding() -> None:
    """Impulses of 1e13 that nearly cancel: what is left is known to the last digits."""
    one = np.ones((3, 3))
    problem = block_problem(
        1, 3, count=1, first=np.array([0, 3]), set=np.array([LINE]), delassus=one,
        free=np.array([0.1, 0.2, 0.3]),
    )  # fmt: skip
    work = block_workspace(1, 3, ready=False)
    uncompiled(weigh_blocks)(problem, work.settings, work.scaled)
    answer = block_answer(1, 3, impulse=np.array([1e13, 1.0 / 3.0, -1e13]))
    left = uncompiled(sum_blocks)(problem, work.scaled, answer)
    np.testing.assert_allclose(answer.velocity, problem.free + 1.0 / 3.0, rtol=1e-15)
    assert 0.0 < left < 1e-14


def test_what_no_impulse_moves_counts_fully() -> None:
    """A block without mobility that sinks is not certified, however small its speed is."""
    problem = block_problem(
        1, 3, count=1, first=np.array([0, 3]), set=np.array([CONE]), friction=np.array([0.5]),
        free=np.array([-1e-9, 0.0, 0.0]),
    )  # fmt: skip
    work = block_workspace(1, 3, ready=False)
    answer = block_answer(1, 3)
    uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer)
    assert answer.residual == pytest.approx(1.0)
    problem.free[0] = 1e-9  # it parts
    uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer)
    assert answer.residual == 0.0
    answer.impulse[1] = np.nan
    assert uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer) == math.inf


def test_modes_of_an_answer_are_those_of_its_velocities() -> None:
    problem, work = posed(15)
    problem.delassus[:] = np.eye(ROWS)
    answer = block_answer(BLOCKS, ROWS)
    for velocity, modes in (
        ([1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.5], [OPEN, SLIP, OPEN, STICK, SLIP]),
        ([0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0], [SLIP, STICK, STICK, STICK, STICK]),
        ([0.0, 0.0, 0.0, 1.0, 1.0, -1.0, 1.0, 1.0, -1.0], [STICK, OPEN, STICK, STICK, SLIP]),
    ):
        problem.free[:] = velocity
        uncompiled(certify_blocks)(problem, work.settings, work.scaled, answer)
        assert answer.mode.tolist() == modes


def test_weights_prove_that_no_impulse_helps() -> None:
    """y ≥ 0 with W y = 0 and y·b < 0, of walls that close on a body of two weights."""
    rows = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [-2.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    delassus = rows @ rows.T
    free = np.array([-1.0, 0.3, 0.0, 0.5, 0.0, 0.0])
    weights = proof_of_none(delassus, free)
    assert weights is not None
    y = np.zeros(6)
    y[[0, 3]] = weights
    assert np.all(weights >= 0.0)
    assert np.sum(weights) == pytest.approx(1.0)
    np.testing.assert_allclose(delassus @ y, 0.0, atol=1e-9)
    assert y @ free < 0.0
    free[3] = 4.0  # that wall leaves faster than the other one comes
    assert proof_of_none(delassus, free) is None
    assert proof_of_none(delassus, np.zeros(6)) is None
    assert proof_of_none(np.zeros((0, 0)), np.zeros(0)) is None


def test_guessed_slip_speeds_come_to_those_of_the_answer() -> None:
    """Without Newton's method between the guesses; each guess counts the steps that it takes."""
    problem, work = posed(3)
    work.settings.effort = 80 * GRADIENT_STEPS
    work.iterate.x[:] = 0.0
    uncompiled(look)(problem, work.scaled, work.iterate)
    before = work.iterate.least
    alone = uncompiled(guess_slips, {iterate_newton: lambda *_: None})
    alone(
        problem, work.settings, work.scaled, work.tally, work.iterate, work.newton, work.anchor
    )  # fmt: skip
    assert work.iterate.least < 1e-5 * before
    assert work.tally.iterations <= work.settings.effort
    assert work.tally.iterations % GRADIENT_STEPS == 0
