"""What goes on as it did, step by step: rows, shares, names and eliminations, by hand and by numpy.

Kernels run as plain Python here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import (
    OPEN,
    SLIDING_FORWARD,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    STICK,
)
from heelstrike.contact.sets import CONE, HALF_LINE, LINE
from heelstrike.contact.solvers import known_modes as km
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, ContactProblem, contact_problem

Floats = NDArray[np.float64]


def posed(
    delassus: Any, free: Any, friction: list[float], sets: list[int] | None = None,
) -> ContactProblem:  # fmt: skip
    """A problem of cones, half-lines and lines, the latter of one row."""
    kinds = sets or [CONE] * len(friction)
    sizes = [1 if each in (HALF_LINE, LINE) else 2 for each in kinds]
    problem = contact_problem(
        len(kinds), count=len(kinds), first=np.concatenate([[0], np.cumsum(sizes)]),
        friction=np.array(friction), set=np.array(kinds),
    )  # fmt: skip
    size = sum(sizes)
    problem.delassus[:], problem.free[:] = np.nan, np.nan
    problem.delassus[:size, :size], problem.free[:size] = delassus, free
    return problem


def rows_for(count: int) -> Any:
    rows = contact_workspace(count, ready=False, symmetric=False).sticking
    rows.equation[:], rows.row[:], rows.sharers[:], rows.edge[:] = 77, 77, 77.0, 77.0
    rows.pulled[:] = 7
    return rows


SOLE = np.array([[0.0, 1.0, 0.3], [1.0, 0.0, -0.5], [0.0, 1.0, -0.4], [1.0, 0.0, -0.5]])
"""Rows, normal before tangent, of two points of one sole: their tangents are one."""


def listed(mode: list[int], first_try: bool = True, **given: Any) -> tuple[int, bool, Any]:
    draw = np.random.default_rng(1)
    jacobian = np.vstack((SOLE, draw.normal(size=(4, 3))))
    problem = posed(jacobian @ jacobian.T, np.zeros(8), [0.5] * 4, **given)
    rows = rows_for(4)
    size, slips = uncompiled(km.list_equations)(first_try, problem, np.array(mode), rows)
    return size, slips, rows


def test_rows_of_what_is_closed_are_listed_and_tangents_of_a_sole_shared() -> None:
    size, slips, rows = listed([STICK] * 4)
    assert (size, slips) == (7, False)
    assert rows.row[:7].tolist() == [0, 1, 2, 4, 5, 6, 7]
    assert rows.equation[:8].tolist() == [0, 1, 2, 1, 3, 4, 5, 6]
    assert rows.sharers[:7].tolist() == [1.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    assert rows.edge[:7].tolist() == [0.0] * 7
    assert rows.pulled[:4].tolist() == [0] * 4
    size, slips, rows = listed([STICK, OPEN, OPEN, STICK], first_try=False)
    assert (size, slips) == (4, False)
    assert rows.row[:4].tolist() == [0, 1, 6, 7]
    assert rows.equation[:8].tolist() == [0, 1, -1, -1, -1, -1, 2, 3]
    assert rows.pulled[:4].tolist() == [7] * 4
    size, slips, rows = listed([SLIP_FORWARD, STICK, SLIP_BACKWARD, OPEN])
    assert (size, slips) == (4, True)
    assert rows.row[:4].tolist() == [0, 2, 3, 4]
    assert rows.edge[:4].tolist() == [-0.5, 0.0, 0.0, 0.5]
    assert rows.equation[:8].tolist() == [0, -1, 1, 2, 3, -1, -1, -1]
    assert listed([STICK, SLIDING_FORWARD, STICK, STICK])[:2] == (-1, False)
    assert listed([SLIP_FORWARD, STICK, STICK, SLIDING_FORWARD])[:2] == (-1, True)


def test_lines_are_listed_even_if_open_and_nothing_rubs_without_friction() -> None:
    matrix = np.eye(4)
    problem = posed(matrix, np.zeros(4), [0.0, 0.0, 0.0], [LINE, CONE, HALF_LINE])
    rows = rows_for(3)
    size, slips = uncompiled(km.list_equations)(
        True, problem, np.array([OPEN, SLIP_FORWARD, OPEN]), rows
    )
    assert (size, slips) == (2, False)
    assert rows.row[:2].tolist() == [0, 1]
    assert rows.equation[:4].tolist() == [0, 1, -1, -1]
    edge = uncompiled(km.edge_of)
    assert [edge(mode, 0.4) for mode in range(4)] == [0.0, 0.0, -0.4, 0.4]


def test_what_slips_is_solved_with_its_friction() -> None:
    """(G_n + G_t r) x = −b; a pivot below a hundredth of its diagonal gives up."""
    draw = np.random.default_rng(3)
    jacobian = draw.normal(size=(8, 9))
    problem = posed(jacobian @ jacobian.T, draw.normal(size=8), [0.3] * 4)
    rows = rows_for(4)
    mode = np.array([SLIP_FORWARD, STICK, OPEN, SLIP_BACKWARD])
    size, _ = uncompiled(km.list_equations)(True, problem, mode, rows)
    assert uncompiled(km.solve_slipping)(size, problem, rows) == size == 4
    source, edge = rows.row[:4], rows.edge[:4]
    matrix = problem.delassus[np.ix_(source, source)].copy()
    for j in range(4):
        if edge[j] != 0.0:
            matrix[:, j] += edge[j] * problem.delassus[source, source[j] + 1]
    np.testing.assert_allclose(matrix @ rows.x[:4], -problem.free[source], rtol=1e-10)
    for pivot, rank in ((0.011, 2), (0.009, -1), (-0.1, -1)):
        # The second pivot is that part of the diagonal.
        problem = posed([[1.0, 0.0], [0.0, 1.0]], [1.0, 1.0], [0.5, 0.5], [HALF_LINE, HALF_LINE])
        off = np.sqrt(1.0 - pivot)
        problem.delassus[0, 1] = problem.delassus[1, 0] = off
        rows = rows_for(2)
        uncompiled(km.list_equations)(True, problem, np.array([STICK, STICK]), rows)
        assert uncompiled(km.solve_slipping)(2, problem, rows) == rank


@pytest.mark.parametrize("dependent", [0, 1, 2, 3])
def test_sticking_rows_are_solved_with_the_least_norm(dependent: int) -> None:
    """Rows of lower rank than their number: numpy's pseudo-inverse, shared rows weighing double."""
    draw = np.random.default_rng([5, dependent])
    for _ in range(8):
        basis = draw.normal(size=(7 - dependent, 9))
        jacobian = np.vstack((basis, draw.normal(size=(dependent, 7 - dependent)) @ basis))
        jacobian = jacobian[draw.permutation(7)]
        matrix = jacobian @ jacobian.T
        free = matrix @ draw.normal(size=7)
        problem = posed(matrix, free, [0.0] * 7, [LINE] * 7)
        rows = rows_for(7)
        size, _ = uncompiled(km.list_equations)(True, problem, np.full(7, STICK), rows)
        rows.sharers[[1, 4]] = 2.0, 3.0
        weight = np.sqrt(rows.sharers[:7])
        assert uncompiled(km.solve_equations)(size, problem, rows) == 7 - dependent
        scaled = weight[:, None] * matrix * weight
        expected = weight * (np.linalg.pinv(scaled, rcond=1e-10) @ (-weight * free))
        np.testing.assert_allclose(rows.x[:7], expected, atol=1e-8 * np.abs(expected).max())


def test_rows_that_nearly_depend_are_tried_last_or_given_up() -> None:
    """A pivot of 1e-5 of its diagonal is taken in the end, one of 1e-9 is not."""
    for pivot, rank in ((1e-5, 2), (1e-9, -1), (0.0, 1)):
        off = np.sqrt(1.0 - pivot)
        problem = posed([[1.0, off], [off, 1.0]], [-1.0, -1.0], [0.0, 0.0], [LINE, LINE])
        rows = rows_for(2)
        uncompiled(km.list_equations)(True, problem, np.full(2, STICK), rows)
        assert uncompiled(km.solve_equations)(2, problem, rows) == rank
        if rank > 0:
            x = 1.0 / (1.0 + off)
            np.testing.assert_allclose(rows.x[:2], [x, x], rtol=1e-6)


def test_an_equation_changes_places_with_the_last() -> None:
    rows = rows_for(2)
    rows.row[:4], rows.sharers[:4] = [0, 1, 2, 3], [1.0, 2.0, 3.0, 4.0]
    rows.equation[:4] = [2, 0, 1, 1]
    uncompiled(km.list_last)(1, 3, 4, rows)
    assert rows.row[:4].tolist() == [0, 2, 1, 3]
    assert rows.sharers[:4].tolist() == [1.0, 3.0, 2.0, 4.0]
    assert rows.equation[:4].tolist() == [1, 0, 2, 2]


def test_a_direction_is_taken_out_in_the_norm_of_the_impulses() -> None:
    direction, sharers = np.array([1.0, -2.0, 0.5, 9.0]), np.array([1.0, 2.0, 3.0, 9.0])
    vector = np.array([0.7, 0.2, -1.0, 5.0])
    uncompiled(km.remove_part)(3, direction, sharers, vector)
    assert vector[3] == 5.0
    assert np.sum(direction[:3] / sharers[:3] * vector[:3]) == pytest.approx(0.0, abs=1e-15)
    left = (np.array([0.7, 0.2, -1.0]) - vector[:3]) / direction[:3]
    np.testing.assert_allclose(left, left[0])


def test_a_shared_solution_is_dealt_out_in_equal_parts() -> None:
    rows = rows_for(2)
    rows.equation[:4] = [0, 1, -1, 1]
    rows.sharers[:2], rows.x[:2] = [1.0, 2.0], [3.0, 5.0]
    share = uncompiled(km.share_of)
    assert [share(row, rows) for row in range(4)] == [3.0, 2.5, 0.0, 2.5]


def shared(
    normal: list[float], friction: float, mode: list[int], *, alone: bool = True,
    sets: list[int] | None = None,
) -> tuple[int, list[float], list[int], list[int]]:  # fmt: skip
    """Deal out normal impulses and one friction among points with μ = 0.5."""
    kinds = sets or [CONE] * len(normal)
    size = sum(1 if each in (HALF_LINE, LINE) else 2 for each in kinds)
    problem = posed(np.eye(size), np.zeros(size), [0.5 * (k == CONE) for k in kinds], kinds)
    rows, place = rows_for(len(normal)), len(normal)
    sharers = 0
    for contact, value in enumerate(normal):
        row = int(problem.first[contact])
        rows.equation[row], rows.x[contact] = contact, value
        rows.sharers[contact] = 1.0
        if kinds[contact] == CONE:
            sticks = mode[contact] == STICK
            rows.equation[row + 1] = place if sticks else -1
            sharers += sticks
    rows.x[place], rows.sharers[place] = friction, float(max(sharers, 1))
    rows.pulled[:] = 0
    answer = ContactAnswer.allocate(capacity=len(normal), mode=np.array(mode))
    found = uncompiled(km.share_impulses)(problem, alone, rows, answer)
    return found, answer.impulse[:size].tolist(), answer.mode.tolist(), rows.pulled.tolist()


def test_impulses_within_their_cones_are_written_as_they_are() -> None:
    assert shared([1.0, 2.0], 0.8, [STICK, STICK])[:2] == (0, [1.0, 0.4, 2.0, 0.4])
    assert shared([1.0, 2.0], -1.0, [STICK, STICK])[:2] == (0, [1.0, -0.5, 2.0, -0.5])
    slips = shared([1.0, 2.0], 0.3, [STICK, SLIP_FORWARD])
    assert slips[:2] == (0, [1.0, 0.3, 2.0, -1.0])
    assert shared([1.0, 2.0], 0.3, [SLIP_BACKWARD, STICK])[1] == [1.0, 0.5, 2.0, 0.3]
    assert shared([-1.0, 2.0], 0.0, [STICK, STICK], sets=[LINE, LINE])[:2] == (0, [-1.0, 2.0])


def test_what_pulls_opens_by_more_than_rounding_of_the_largest() -> None:
    found, _, mode, pulled = shared([-1e-3, 2.0], 0.0, [STICK, STICK])
    assert (found, mode, pulled) == (1, [OPEN, STICK], [1, 0])
    found, _, mode, pulled = shared([-1.0, -2.0], 0.0, [STICK, STICK])
    assert (found, mode, pulled) == (2, [OPEN, OPEN], [1, 1])
    found, impulse, mode, pulled = shared([-1.9e-11, 2.0], 0.0, [STICK, STICK])
    assert (found, impulse, mode, pulled) == (0, [0.0, 0.0, 2.0, 0.0], [STICK, STICK], [0, 0])
    assert shared([-2.1e-11, 2.0], 0.0, [STICK, STICK])[0] == 1
    found, impulse, mode, _ = shared([-1.0, -2.0], 0.0, [STICK, STICK], sets=[LINE, HALF_LINE])
    assert (found, mode) == (1, [STICK, OPEN])
    found, impulse, _, _ = shared([-1.9e-11, 2.0], 0.0, [STICK, STICK], sets=[HALF_LINE, LINE])
    assert (found, impulse) == (0, [0.0, 2.0])


def test_friction_that_one_cannot_hold_is_held_by_others_as_far_as_they_reach() -> None:
    """Of 1.2 in equal parts 0.4 each, the first holds 0.1 and the second 0.5 at most, …"""
    found, impulse, _, _ = shared([0.2, 1.0, 4.0], 1.2, [STICK] * 3)
    assert (found, impulse[1::2]) == (0, pytest.approx([0.1, 0.5, 0.6]))
    found, impulse, _, _ = shared([0.2, 1.0, 4.0], -1.2, [STICK] * 3)
    assert impulse[1::2] == pytest.approx([-0.1, -0.5, -0.6])
    assert shared([0.2, 1.0, 4.0], 1.2, [STICK] * 3, alone=False)[0] == -1
    assert shared([0.2, 1.0, 0.4], 0.9, [STICK] * 3)[0] == -1  # 0.8 is all there is
    found, impulse, _, _ = shared([0.2, 1.0, 0.4], 0.8 - 1e-12, [STICK] * 3)
    assert (found, impulse[1::2]) == (0, pytest.approx([0.1, 0.5, 0.2]))


def named(
    velocity: list[float], mode: list[int], pulled: int = 0, sets: list[int] | None = None,
    friction: float = 0.5,
) -> tuple[int, list[int]]:  # fmt: skip
    """Names of two contacts where 0.1 m/s are rest of each row of weight 2, data of 3 m/s."""
    kinds = sets or [CONE, CONE]
    size = sum(1 if each in (HALF_LINE, LINE) else 2 for each in kinds)
    problem = posed(np.eye(size), np.zeros(size), [friction * (k == CONE) for k in kinds], kinds)
    scaling = contact_workspace(2, ready=False, symmetric=False).scaling
    scaling.root[:], scaling.unit = 2.0, 3.0
    answer = ContactAnswer.allocate(capacity=2, mode=np.array(mode), rest=0.05)
    answer.velocity[:size] = velocity
    found = uncompiled(km.name_by_velocity)(problem, np.full(2, pulled), scaling, answer)
    return found, answer.mode.tolist()


def test_contacts_are_named_by_what_they_do() -> None:
    rests = [0.0, 0.0, 0.1, 0.1]
    assert named(rests, [STICK, STICK]) == (0, [STICK, STICK])
    assert named([0.11, 9.0, 0.0, 0.0], [OPEN, STICK]) == (0, [OPEN, STICK])
    assert named([0.11, 0.0, 0.0, 0.0], [STICK, STICK])[0] == -1  # it parts
    assert named([0.0, 0.11, 0.0, -0.11], [SLIP_FORWARD, SLIP_BACKWARD]) == (
        0, [SLIP_FORWARD, SLIP_BACKWARD]
    )  # fmt: skip
    assert named([0.0, 0.11, 0.0, 0.0], [STICK, STICK])[0] == -1
    assert named([0.0, 0.11, 0.0, 0.0], [SLIP_BACKWARD, STICK])[0] == -1
    assert named([0.0, 0.11, 0.0, 0.0], [STICK, STICK], friction=0.0) == (0, [SLIP_FORWARD, STICK])
    assert named(rests, [SLIP_FORWARD, SLIP_BACKWARD]) == (2, [STICK, STICK])
    assert named(rests, [OPEN, STICK]) == (1, [STICK, STICK])
    assert named([0.2, 0.2], [STICK, STICK], sets=[LINE, LINE]) == (0, [STICK, STICK])
    assert named([0.2, 0.2], [OPEN, OPEN], sets=[LINE, LINE]) == (0, [STICK, STICK])


def test_what_would_pull_need_not_be_admitted_if_it_moves() -> None:
    """By more than 1e-13 of the data, 6 m/s; towards the ground by no more than 1e-11."""
    for velocity, pressed in ((0.0, 1), (5e-13, 1), (7e-13, 0), (-7e-13, 0), (-5e-11, 0),
                              (-7e-11, 1), (-5e-13, 1)):  # fmt: skip
        assert named([velocity, 0.0, 0.0, 0.0], [OPEN, STICK], pulled=1)[0] == pressed
        assert named([velocity, 0.0, 0.0, 0.0], [OPEN, STICK], pulled=0)[0] == 1


def test_slips_are_taken_back_of_what_is_closed() -> None:
    problem = posed(np.eye(8), np.zeros(8), [0.5] * 4)
    mode = np.array([OPEN, SLIP_FORWARD, STICK, SLIP_BACKWARD])
    uncompiled(km.take_back_slips)(problem, mode)
    assert mode.tolist() == [OPEN, STICK, STICK, STICK]
