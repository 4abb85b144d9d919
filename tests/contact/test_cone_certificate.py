"""Certificates by programs say what certificates by loops say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from heelstrike.contact import solve_contact
from heelstrike.contact.certificate import certify, certify_at_once, cones_of
from heelstrike.contact.cone_certificate import FASTEST, LEAST, MOST_CONES, MOST_STOPS, has_stops
from heelstrike.contact.sets import CONE, HALF_LINE
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import (
    PROGRAM_ROWS,
    ContactAnswer,
    ContactProblem,
    ContactWorkspace,
    contact_problem,
)

CANCELS = 3
"""Of what a certificate writes, the first are differences: worst, velocities, residuals."""


def random_problem(draw: Any, cones: int, stops: int, room: int) -> ContactProblem:
    """Contacts of a body, and joint stops, in memory for some rows."""
    rows = 2 * cones + stops
    jacobian = draw.standard_normal((rows, rows + 2))
    problem = contact_problem(cones + stops, count=cones + stops, room=room)
    problem.first[cones:] = np.arange(2 * cones, rows + 1)
    problem.set[:cones], problem.set[cones:] = CONE, HALF_LINE
    problem.friction[:cones] = draw.uniform(0.1, 1.0, cones)
    problem.delassus[:] = np.nan  # what nobody may read
    problem.delassus[:rows, :rows] = jacobian @ jacobian.T
    problem.free[:rows] = draw.standard_normal(rows)
    return problem


def small_problem(delassus: Any, free: Any, **given: Any) -> ContactProblem:
    """Contacts in the room that programs read."""
    rows = len(free)
    matrix = np.zeros((PROGRAM_ROWS, PROGRAM_ROWS))
    matrix[:rows, :rows] = delassus
    sizes = {"count": rows // 2, "room": PROGRAM_ROWS}
    return contact_problem(rows // 2, delassus=matrix, free=np.array(free), **sizes, **given)


def certified(work: ContactWorkspace, problem: ContactProblem, impulse: Any) -> tuple[Any, ...]:
    """What a certificate writes."""
    rows = int(problem.first[problem.count])
    answer = ContactAnswer.allocate(capacity=len(problem.set))
    answer.impulse[:rows] = impulse
    worst = certify(problem, work.settings, work.scaling, answer)
    scaling = work.scaling
    return (
        worst, answer.velocity[:rows], answer.residual, answer.rest, scaling.root[:rows],
        scaling.unit, scaling.effort, scaling.rounding,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("cones", "stops", "room"),
    [
        (cones, stops, room)
        for room in (PROGRAM_ROWS, 20)
        for cones in range(1, MOST_CONES + 1)
        for stops in range(MOST_STOPS + 1)
        if 2 * cones + stops <= room
    ],
)
@pytest.mark.parametrize(
    "change", [lambda p, w: None, lambda p, w: setattr(w.settings, "floor", 9)]
)
def test_it_says_what_loops_say(
    cones: int, stops: int, room: int, change: Callable[[Any, Any], None]
) -> None:
    """In memory of that size; loops say it where there is more, or too many take part."""
    draw = np.random.default_rng([cones, stops, room])
    for _ in range(5):
        problem = random_problem(draw, cones, stops, room)
        rows = 2 * cones + stops
        impulse = draw.standard_normal(rows) * 10.0 ** draw.integers(-2, 6)
        said = []
        for symmetric in (True, False):
            work = contact_workspace(cones + stops, symmetric=symmetric)
            change(problem, work)
            said.append(certified(work, problem, impulse))
            known = cones_of(problem, work.settings, work.scaling)
            has_program = stops == 0 or has_stops(cones, stops)
            assert known == (cones if symmetric and room == PROGRAM_ROWS and has_program else 0)
        size = float(np.abs(impulse).max()) * 10.0
        for place, (one, other) in enumerate(zip(*said, strict=True)):
            # What is left of sums that cancel is as exact as their terms, all else as it is itself.
            left = 1e-13 * size if place < CANCELS else 0.0
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=left)


@pytest.mark.parametrize(("cones", "stops"), [(1, 0), (2, 6), (4, 3)])
def test_what_programs_measure_besides(cones: int, stops: int) -> None:
    """The fastest of contacts and of the stops that are held, either way; the least diagonal."""
    draw = np.random.default_rng([7, cones, stops])
    for _ in range(30):
        problem = random_problem(draw, cones, stops, PROGRAM_ROWS)
        rows = 2 * cones + stops
        work = contact_workspace(cones + stops)
        answer = ContactAnswer.allocate(capacity=cones + stops)
        answer.impulse[:rows] = draw.standard_normal(rows)
        held = (draw.random(stops) < 0.5).astype(float)
        work.scaling.held[:stops] = held
        certify_at_once(cones, problem, work.settings, work.scaling, answer)
        diagonal = np.diag(problem.delassus)[:rows]
        speed = np.abs(answer.velocity[:rows]) / np.sqrt(diagonal)
        counted = np.concatenate([np.ones(2 * cones), held]) > 0.0
        size = work.scaling.size
        assert size[FASTEST] == pytest.approx(speed[counted].max(), rel=1e-14)
        assert size[LEAST] == diagonal.min()


def test_rows_that_nothing_moves_are_left_to_loops() -> None:
    work = contact_workspace(1)
    problem = small_problem(np.diag([2.0, 0.0]), [-1.0, 0.0])
    answer = ContactAnswer.allocate(capacity=1, impulse=np.array([0.5, 0.0]))
    assert certify_at_once(1, problem, work.settings, work.scaling, answer) == np.inf
    assert certify(problem, work.settings, work.scaling, answer) < 1e-14
    assert work.scaling.unit == pytest.approx(np.sqrt(0.5), rel=1e-15)


@pytest.mark.parametrize("name", ["delassus", "free", "impulse"])
@pytest.mark.parametrize("row", [0, 1])
def test_no_number_is_not_certified(name: str, row: int) -> None:
    problem = small_problem(np.eye(2), [-1.0, 0.0])
    answer = ContactAnswer.allocate(capacity=1, impulse=np.array([1.0, 0.0]))
    work = contact_workspace(1)
    assert certify(problem, work.settings, work.scaling, answer) < 1e-14
    getattr(answer if name == "impulse" else problem, name)[row] = np.nan
    assert not certify(problem, work.settings, work.scaling, answer) <= 1.0
    assert answer.residual[2] == np.inf


def test_a_matrix_that_is_not_quite_symmetric_is_taken_as_it_is() -> None:
    """Rows times impulses, not columns: its certificate is of the data that were given."""
    matrix = np.array([[1.0, 0.3], [0.3 * (1.0 + 2e-8), 1.0]])
    solution = solve_contact(matrix, [-1.0, 0.1], 0.9)
    impulse, velocity = solution.impulse.ravel(), solution.velocity.ravel()
    np.testing.assert_allclose(velocity, matrix @ impulse + [-1.0, 0.1], atol=1e-15)


def test_what_slides_as_prescribed_does_not_excuse_the_contacts_after_it() -> None:
    problem = small_problem(np.eye(4), [-1.0, 0.0] * 2, friction=np.full(2, 0.5))
    answer = ContactAnswer.allocate(capacity=2, impulse=np.array([1.0, -0.5, 1.0, 0.9]))
    work = contact_workspace(2)
    work.scaling.slope[0] = -0.5
    certify(problem, work.settings, work.scaling, answer)
    assert answer.residual[1] == pytest.approx(0.4, rel=1e-12)
