"""The sets of impulses: what is in them, what is nearest, and that all solvers obey them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from contact_oracle import solutions

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact import sets, solve_contact
from heelstrike.contact.certificate import certify
from heelstrike.contact.modes import FISCHER_BURMEISTER, GAUSS_SEIDEL, LEMKE, SOLVED
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, ContactProblem, Floats, contact_problem

projected, contains = (uncompiled(kernel) for kernel in (sets.projected, sets.contains))


def one(kind: int, friction: float = 0.5) -> ContactProblem:
    problem = contact_problem(1, count=1)
    problem.set[0], problem.bound[0] = kind, 0.7
    problem.friction[0] = {CONE: friction, INTERVAL: 1.0}.get(kind, 0.0)
    return problem


@pytest.mark.parametrize(
    ("kind", "impulse", "nearest"),
    [
        (CONE, (2.0, 0.9), (2.0, 0.9)),
        (CONE, (2.0, 1.5), (2.0, 1.0)),
        (CONE, (2.0, -1.5), (2.0, -1.0)),
        (CONE, (-2.0, 0.3), (0.0, 0.0)),
        (HALF_LINE, (2.0, 0.3), (2.0, 0.0)),
        (HALF_LINE, (-2.0, 0.0), (0.0, 0.0)),
        (LINE, (-2.0, 0.0), (-2.0, 0.0)),
        (LINE, (-2.0, 0.3), (-2.0, 0.0)),
        (INTERVAL, (0.7, 0.5), (0.7, 0.5)),
        (INTERVAL, (0.0, 0.9), (0.7, 0.7)),
        (INTERVAL, (5.0, -0.9), (0.7, -0.7)),
    ],
)
def test_projection(kind: int, impulse: tuple[float, float], nearest: tuple[float, float]) -> None:
    problem = one(kind)
    assert projected(problem, 0, *impulse) == nearest
    assert contains(problem, 0, *impulse) == (impulse == nearest)
    assert contains(problem, 0, *nearest)


def with_line(seed: int) -> ContactProblem:
    """Two contacts with friction, then a line between a third and a stop."""
    draw = np.random.default_rng([17, seed])
    root = draw.standard_normal((8, 9))
    root[[5, 7]] = 0.0
    return contact_problem(
        4,
        count=4,
        delassus=root @ root.T,
        free=root @ draw.standard_normal(9),
        friction=np.array([0.6, 0.3, 0.0, 0.0]),
        set=np.array([CONE, CONE, LINE, HALF_LINE]),
    )


def solved(problem: ContactProblem, solver: int) -> Floats:
    work, answer = contact_workspace(4), ContactAnswer.allocate(capacity=4)
    work.settings.corrections = 0
    assert solve_contact_kernel(np.array([solver]), problem, work, answer) == SOLVED
    return answer.impulse


@pytest.mark.parametrize("solver", [LEMKE, FISCHER_BURMEISTER, GAUSS_SEIDEL])
def test_a_line_holds_both_ways(solver: int) -> None:
    """Without its row, which its impulse keeps at rest, the problem is one of three contacts."""
    pulls = 0
    for seed in range(40):
        problem = with_line(seed)
        G, b, line = problem.delassus, problem.free, 4
        others = [0, 1, 2, 3, 6, 7]
        without = G - np.outer(G[:, line], G[line]) / G[line, line]
        rest = b - G[:, line] * b[line] / G[line, line]
        expected = solve_contact(
            without[np.ix_(others, others)], rest[others], np.array([0.6, 0.3, 0.0])
        )
        impulse = solved(problem, solver)
        scale = np.abs(impulse).max()
        assert abs(G[line] @ impulse + b[line]) <= 1e-9 * np.abs(b).max()
        np.testing.assert_allclose(impulse[others], expected.impulse.ravel(), atol=1e-7 * scale)
        pulls += impulse[line] < -1e-3 * scale
    assert pulls >= 10


@pytest.mark.parametrize("solver", [LEMKE, FISCHER_BURMEISTER, GAUSS_SEIDEL])
def test_a_group_without_a_tangent_has_one_row(solver: int) -> None:
    """Empty tangents change nothing: the same impulses without them, but for rounding of sums."""
    kept = [0, 1, 2, 3, 4, 6]
    for seed in range(20):
        whole = with_line(seed)
        short = contact_problem(
            4, count=4, first=np.array([0, 2, 4, 5, 6]), friction=whole.friction, set=whole.set
        )
        short.delassus[:6, :6] = whole.delassus[np.ix_(kept, kept)]
        short.free[:6] = whole.free[kept]
        short.delassus[6:], short.free[6:] = np.nan, np.nan  # nobody looks there
        expected, found = solved(whole, solver)[kept], solved(short, solver)
        np.testing.assert_allclose(found[:6], expected, atol=1e-12 * np.abs(expected).max())
        assert not found[6:].any()


@pytest.mark.parametrize("push", [-0.5, 0.5])
def test_a_line_that_gives_way_is_not_certified(push: float) -> None:
    work, answer = contact_workspace(1), ContactAnswer.allocate(capacity=1)
    problem = one(LINE)
    problem.delassus[0, 0] = 1.0
    problem.free[0] = -1.0
    answer.impulse[0] = 1.0 + push
    assert certify(problem, work.settings, work.scaling, answer) == pytest.approx(0.5)
    answer.impulse[0] = 1.0
    assert certify(problem, work.settings, work.scaling, answer) < 1e-14


@pytest.mark.parametrize("solver", [LEMKE, FISCHER_BURMEISTER, GAUSS_SEIDEL])
@pytest.mark.parametrize(
    ("speed", "impulse"), [(0.1, -0.2), (-0.1, 0.2), (4.0, -3.0), (-4.0, 3.0), (0.0, 0.0)]
)
def test_dry_friction_by_hand(solver: int, speed: float, impulse: float) -> None:
    """Up to 3 N s of a joint that 1 N s makes 0.5 rad/s faster, beside a contact.

    What is in the normal row of an interval does not matter.
    """
    problem = contact_problem(
        4, count=2, friction=np.array([0.5, 1.0, 0.0, 0.0]), set=np.array([CONE, INTERVAL, 0, 0])
    )
    problem.delassus[[0, 1, 3], [0, 1, 3]] = 0.5
    problem.delassus[2, :4] = problem.free[2] = 8.0
    problem.free[[0, 1, 3]] = [-1.0, 0.0, speed]
    problem.bound[1] = 3.0
    np.testing.assert_allclose(solved(problem, solver)[[0, 1, 3]], [2.0, 0.0, impulse], atol=1e-12)


def dry(seed: int, slack: int) -> ContactProblem:
    """Contact, dry joint, contact, dry joint; their rows depend on each other if `slack` < 6."""
    draw = np.random.default_rng([19, seed])
    root = draw.standard_normal((8, slack))
    root[[2, 6]] = 0.0
    return contact_problem(
        4,
        count=4,
        delassus=root @ root.T,
        free=root @ draw.standard_normal(slack),
        friction=np.array([0.6, 1.0, 0.3, 1.0]),
        bound=np.array([0.0, 0.5, 0.0, 1.5]) * draw.uniform(0.1, 1.0, 4),
        set=np.array([CONE, INTERVAL, CONE, INTERVAL]),
    )


@cache
def enumerated(seed: int, slack: int) -> list[Floats]:
    problem = dry(seed, slack)
    return solutions(problem.delassus, problem.free, problem.friction, problem.bound)


@pytest.mark.parametrize("solver", [LEMKE, FISCHER_BURMEISTER, GAUSS_SEIDEL])
@pytest.mark.parametrize("slack", [7, 4])
def test_intervals_against_enumeration(solver: int, slack: int) -> None:
    """Certified answers are among the solutions that brute force finds; most do get certified."""
    compared = moves = 0
    for seed in range(12):
        problem = dry(seed, slack)
        found, unit = enumerated(seed, slack), np.abs(problem.free).max()
        work, answer = contact_workspace(4), ContactAnswer.allocate(capacity=4)
        work.settings.corrections = 0
        if solve_contact_kernel(np.array([solver]), problem, work, answer) != SOLVED:
            continue
        rows = [0, 1, 3, 4, 5, 7]
        velocity = answer.velocity[rows]
        assert min(np.abs(velocity - w[rows]).max() for w in found) <= 1e-6 * unit
        assert np.all(np.abs(answer.impulse[[3, 7]]) <= problem.bound[[1, 3]])
        moves += int(np.sum(np.abs(velocity[[2, 5]]) > 1e-6 * unit))
        compared += 1
    assert compared >= 9
    assert moves >= 3


@pytest.mark.parametrize(
    ("impulse", "residual"), [(-3.0, 0.0), (-2.0, 0.25), (-4.0, 0.25), (3.0, 0.5)]
)
def test_certificate_of_an_interval(impulse: float, residual: float) -> None:
    """It moves at 4 rad/s, 2 after 4 N s against it: only all 3 N s there are will do."""
    work, answer = contact_workspace(1), ContactAnswer.allocate(capacity=1)
    problem = one(INTERVAL)
    problem.bound[0] = 3.0
    problem.delassus[1, 1], problem.free[1] = 0.5, 4.0
    answer.impulse[:] = [9.0, impulse]
    certify(problem, work.settings, work.scaling, answer)
    # In units of 8 N s, which would stop it if there were as many.
    assert answer.residual.max() == pytest.approx(residual * (0.5 if residual < 0.5 else 1.5))
