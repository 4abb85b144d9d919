"""Certificates by programs say what certificates by loops say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from heelstrike.contact import solve_contact
from heelstrike.contact.certificate import certify, certify_at_once, has_program
from heelstrike.contact.cone_certificate import MOST_CONES
from heelstrike.contact.sets import CONE, HALF_LINE
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import (
    ContactAnswer,
    ContactProblem,
    ContactWorkspace,
    contact_problem,
)

CANCELS = 3
"""Of what a certificate writes, the first are differences: worst, velocities, residuals."""


def random_problem(draw: Any, contacts: int, room: int, stop: bool) -> ContactProblem:
    """Contacts of a body, in memory for some more; the last may be a stop."""
    rows = 2 * contacts - stop
    jacobian = draw.standard_normal((rows, rows + 2))
    problem = contact_problem(
        contacts + room, count=contacts, friction=draw.uniform(0.1, 1.0, contacts + room)
    )
    problem.set[:] = CONE
    if stop:
        problem.first[contacts] = rows
        problem.set[contacts - 1], problem.friction[contacts - 1] = HALF_LINE, 0.0
    problem.delassus[:] = np.nan  # what nobody may read
    problem.delassus[:rows, :rows] = jacobian @ jacobian.T
    problem.free[:rows] = draw.standard_normal(rows)
    return problem


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


@pytest.mark.parametrize("room", [0, 3])
@pytest.mark.parametrize("stop", [False, True])
@pytest.mark.parametrize("contacts", range(1, MOST_CONES + 2))
@pytest.mark.parametrize(
    "change", [lambda p, w: None, lambda p, w: setattr(w.settings, "floor", 9)]
)
def test_it_says_what_loops_say(
    contacts: int, stop: bool, room: int, change: Callable[[Any, Any], None]
) -> None:
    """In memory of that size; loops say it where there is more, a stop of one row, or too many."""
    draw = np.random.default_rng([contacts, stop, room])
    for _ in range(5):
        problem = random_problem(draw, contacts, room, stop)
        rows = int(problem.first[contacts])
        impulse = draw.standard_normal(rows) * 10.0 ** draw.integers(-2, 6)
        said = []
        for symmetric in (True, False):
            work = contact_workspace(contacts + room, symmetric=symmetric)
            change(problem, work)
            said.append(certified(work, problem, impulse))
            at_once = has_program(problem, work.settings, work.scaling)
            assert at_once == (symmetric and contacts <= MOST_CONES and room == 0 and not stop)
        size = float(np.abs(impulse).max()) * 10.0
        for place, (one, other) in enumerate(zip(*said, strict=True)):
            # What is left of sums that cancel is as exact as their terms, all else as it is itself.
            left = 1e-13 * size if place < CANCELS else 0.0
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=left)


def test_rows_that_nothing_moves_are_left_to_loops() -> None:
    work = contact_workspace(1)
    problem = contact_problem(1, count=1, delassus=np.diag([2.0, 0.0]), free=np.array([-1.0, 0.0]))
    answer = ContactAnswer.allocate(capacity=1, impulse=np.array([0.5, 0.0]))
    assert certify_at_once(problem, work.settings, work.scaling, answer) == np.inf
    assert certify(problem, work.settings, work.scaling, answer) < 1e-14
    assert work.scaling.unit == pytest.approx(np.sqrt(0.5), rel=1e-15)


@pytest.mark.parametrize("name", ["delassus", "free", "impulse"])
@pytest.mark.parametrize("row", [0, 1])
def test_no_number_is_not_certified(name: str, row: int) -> None:
    problem = contact_problem(1, count=1, delassus=np.eye(2), free=np.array([-1.0, 0.0]))
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
    problem = contact_problem(
        2, count=2, delassus=np.eye(4), free=np.array([-1.0, 0.0] * 2), friction=np.full(2, 0.5)
    )
    answer = ContactAnswer.allocate(capacity=2, impulse=np.array([1.0, -0.5, 1.0, 0.9]))
    work = contact_workspace(2)
    work.scaling.slope[0] = -0.5
    certify(problem, work.settings, work.scaling, answer)
    assert answer.residual[1] == pytest.approx(0.4, rel=1e-12)
