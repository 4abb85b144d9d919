"""Rows that hold a robot, solved: the elimination itself, against matrices and pseudo-inverses.

Kernels run as plain Python here.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from heelstrike.compiler.compilation import uncompiled
from heelstrike.dynamics import held as its

Floats = NDArray[np.float64]
FREE = its.FREE


def held_by(rows: Any, target: Any = None) -> Any:
    """Rows in a bundle with room for two more, all of whose scratch is 77."""
    rows = np.array(rows, dtype=float)
    count, size = rows.shape
    held = SimpleNamespace(
        count=count, rows=np.full((count + 2, size), 77.0), solved=np.full((count + 2, size), 77.0),
        target=np.zeros(count + 2), mix=np.full((count + 2, count + 2), 77.0),
        coordinate=np.full(count + 2, 77), row=np.full(size, 77),
        loops=SimpleNamespace(bias=np.zeros(0), jacobian=np.zeros((0, size))),
    )  # fmt: skip
    held.rows[:count] = rows
    if target is not None:
        held.target[:count] = target
    return held


def solved(rows: Any, preferred: tuple[int, ...] = (), target: Any = None) -> tuple[int, Any]:
    held = held_by(rows, target)
    rank = uncompiled(its.solve_rows)(np.array(preferred, dtype=int), held)
    return int(rank), held


DRAW = np.random.default_rng(12)
CASES: list[tuple[Any, tuple[int, ...]]] = [
    (DRAW.normal(size=(3, 5)), ()), (DRAW.normal(size=(3, 5)), (4, 1)),
    (DRAW.normal(size=(4, 4)), ()),
    (DRAW.normal(size=(5, 2)) @ DRAW.normal(size=(2, 6)), (0, 1, 2)),
    (DRAW.normal(size=(4, 1)) @ DRAW.normal(size=(1, 3)), ()),
    ([[1.0, 0.0, 0.7, 0.2], [0.0, -1.0, 0.3, 0.5], [2.0, 1.0, 0.4, -0.6]], (0, 1)),
    ([[-1.0, 2.0, 0.7, 0.2], [3.0, 1.0, 0.3, 0.5], [1.0, 1.0, -1.0, 4.0]], (0, 1, 2)),
    ([[-1.0, 2.0, 0.7], [3.0, -1.0, 0.3], [2.0, 1.0, 1.0], [1.0, 3.0, 1.7]], (0, 1)),
    ([[0.0, 0.5, 1.0], [0.0, 1.0, 2.0]], (0,)), (np.zeros((2, 3)), ()),
]  # fmt: skip


@pytest.mark.parametrize("case", range(len(CASES)))
def test_rows_are_solved_for_as_many_coordinates_as_their_rank(case: int) -> None:
    """E C = R, a unit at every dependent coordinate; what says nothing new is orthonormal."""
    rows, preferred = CASES[case]
    rank, held = solved(rows, preferred)
    C = held.rows[: held.count]
    E, R = held.mix[: held.count, : held.count], held.solved[: held.count]
    assert rank == np.linalg.matrix_rank(C)
    np.testing.assert_allclose(E @ C, R, atol=1e-12)
    depends = [i for i in range(held.count) if held.coordinate[i] != FREE]
    assert len(depends) == rank
    for i in depends:
        j = held.coordinate[i]
        assert held.row[j] == i
        np.testing.assert_array_equal(R[:, j], np.eye(held.count)[:, i])
    assert np.sum(held.row != FREE) == rank
    unfelt = E[[i for i in range(held.count) if i not in depends]]
    np.testing.assert_allclose(unfelt @ unfelt.T, np.eye(held.count - rank), atol=1e-12)
    np.testing.assert_allclose(unfelt @ C, 0.0, atol=1e-12)
    assert not R[[i for i in range(held.count) if i not in depends]].any()
    # Coordinates that are preferred come first, as far as the rows have them.
    wanted = np.linalg.matrix_rank(C[:, list(preferred)]) if preferred else 0
    assert sum(held.row[j] != FREE for j in preferred) >= wanted
    assert np.all(held.mix[held.count :] == 77.0)


def test_units_of_preferred_coordinates_are_taken_as_they_are() -> None:
    """Either sign of them, each row for one; others are left to the search."""
    held = held_by([[0.5, -1.0, 2.0, 1.0], [1.0, 3.0, 0.1, 0.2], [4.0, 5.0, 6.0, 1.0]])
    uncompiled(its.begin_solving)(held)
    assert np.all(held.row == FREE)
    assert held.coordinate[:3].tolist() == [FREE] * 3
    assert uncompiled(its.solve_unit_rows)(np.array([2, 1, 0]), held) == 1
    assert held.coordinate[:3].tolist() == [1, FREE, FREE]
    assert held.row.tolist() == [FREE, 0, FREE, FREE]
    # x₁ = … of the first row, −1 times it, three of it taken out of the second, five of the third.
    np.testing.assert_allclose(held.solved[0], [-0.5, 1.0, -2.0, -1.0])
    np.testing.assert_allclose(held.solved[1], [2.5, 0.0, 6.1, 3.2])
    np.testing.assert_allclose(held.solved[2], [6.5, 0.0, 16.0, 6.0])
    expected = [[-1.0, 0.0, 0.0], [3.0, 1.0, 0.0], [5.0, 0.0, 1.0]]
    np.testing.assert_allclose(held.mix[:3, :3], expected)
    uncompiled(its.solve_row)(1, 3, held)
    assert (held.coordinate[1], held.row[3]) == (3, 1)
    np.testing.assert_allclose(held.solved[1], np.array([2.5, 0.0, 6.1, 3.2]) / 3.2)
    np.testing.assert_allclose(held.mix[1, :3], [3.0 / 3.2, 1.0 / 3.2, 0.0])
    np.testing.assert_allclose(held.solved[[0, 2], 3], 0.0)


def test_the_largest_entry_of_a_coordinate_is_in_a_row_that_is_not_solved() -> None:
    held = held_by([[3.0, 0.0], [-2.0, 0.0], [1.0, 0.0]])
    uncompiled(its.begin_solving)(held)
    largest = uncompiled(its.largest_left)
    assert largest(0, held) == (3.0, 0)
    held.coordinate[0] = 1
    assert largest(0, held) == (2.0, 1)
    assert largest(1, held) == (0.0, FREE)


@pytest.mark.parametrize("case", range(8))
def test_rates_are_completed_and_forces_left_and_shared(case: int) -> None:
    """x_d = E t − R x_i; Nᵀ f of the others; shortest λ with Cᵀ λ = f − (what motors supply)."""
    rows, preferred = CASES[case]
    draw = np.random.default_rng(case)
    C = np.array(rows, dtype=float)
    count, size = C.shape
    goal = C @ draw.normal(size=size)
    _, held = solved(C, preferred, goal)
    x = draw.normal(size=size)
    given = x.copy()
    uncompiled(its.complete)(held, x)
    np.testing.assert_allclose(C @ x, goal, atol=1e-10)
    independent = held.row == FREE
    np.testing.assert_array_equal(x[independent], given[independent])
    force, rest = draw.normal(size=size), np.full(size, 9.0)
    uncompiled(its.find_left)(force, held, rest)
    assert not rest[~independent].any()
    null = np.eye(size)[:, independent]
    for column in null.T:  # of velocities that the rows let happen: no work of theirs
        uncompiled(its.complete)(held_zero(held), column)
    np.testing.assert_allclose(rest[independent], null.T @ force, atol=1e-10)
    exerted = np.full(count + 2, 9.0)
    uncompiled(its.forces_of_rows)(force, held, exerted)
    np.testing.assert_allclose(C.T @ exerted[:count], force - rest, atol=1e-10)
    shortest = np.linalg.pinv(C.T, rcond=1e-10) @ (force - rest)
    np.testing.assert_allclose(exerted[:count], shortest, atol=1e-10)
    assert np.all(exerted[count:] == 9.0)


def held_zero(held: Any) -> Any:
    """The same rows at rest."""
    return SimpleNamespace(**{**vars(held), "target": np.zeros(len(held.target))})


@pytest.mark.parametrize("case", range(8))
def test_rates_change_least_in_the_metric_of_the_masses(case: int) -> None:
    """x − x₀ = A⁻¹ Cᵀ λ with the shortest λ, C x = t."""
    rows, preferred = CASES[case]
    draw = np.random.default_rng(case)
    C = np.array(rows, dtype=float)
    count, size = C.shape
    half = draw.normal(size=(size, size + 2))
    response = np.linalg.solve(half @ half.T, C.T).T
    goal = C @ draw.normal(size=size)
    _, held = solved(C, preferred, goal)
    reaction = SimpleNamespace(
        response=np.full((count + 2, size), 77.0), force=np.full(count + 2, 77.0),
        delassus=np.full((count + 2, count + 2), 77.0),
    )  # fmt: skip
    reaction.response[:count] = response
    x = draw.normal(size=size)
    before = x.copy()
    uncompiled(its.change_least)(held, reaction, x)
    exerted = np.linalg.pinv(C @ response.T, rcond=1e-10) @ (goal - C @ before)
    np.testing.assert_allclose(x, before + response.T @ exerted, atol=1e-9)
    shortest = np.linalg.pinv(C.T, rcond=1e-10) @ (C.T @ exerted)
    np.testing.assert_allclose(reaction.force[:count], shortest, atol=1e-9)


def test_rows_of_one_s_own_and_of_loops_follow_those_before() -> None:
    held = held_by([[1.0, 2.0, 3.0]])
    held.target[:] = 9.0
    uncompiled(its.add_row)(np.array([4.0, 5.0, 6.0]), held)
    assert held.count == 2
    assert held.rows[1].tolist() == [4.0, 5.0, 6.0]
    assert held.target.tolist() == [9.0, 0.0, 9.0]
    held = held_by([[1.0, 2.0, 3.0]])
    held.target[:] = 9.0
    asked: list[Any] = []

    def find(model: Any, q: Any, v: Any, work: Any, loops: Any) -> None:
        asked.append((q, v))
        loops.jacobian[:] = [[7.0, 8.0, 9.0], [10.0, 11.0, 12.0]]

    add = uncompiled(its.add_loops, replace={its.find_rows: find})
    model = SimpleNamespace(nv=3)
    add(model, "q", "v", None, held)
    assert (held.count, asked) == (1, [])
    held.loops = SimpleNamespace(bias=np.array([0.3, 0.4]), jacobian=np.zeros((2, 3)))
    add(model, "q", "v", None, held)
    assert (held.count, asked) == (3, [("q", "v")])
    assert held.rows[1:3].tolist() == [[7.0, 8.0, 9.0], [10.0, 11.0, 12.0]]
    assert held.target.tolist() == [9.0, 0.0, 0.0]
    uncompiled(its.keep_loops)(1, held)
    assert held.target.tolist() == [9.0, -0.3, -0.4]


@pytest.mark.parametrize("components", [2, 3])
def test_rows_of_a_place_are_those_of_the_joints_on_the_way_to_it(components: int) -> None:
    held = held_by(np.zeros((1, 4)))
    held.target[:] = 9.0
    model = SimpleNamespace(nv=4, parent=np.array([-1, 0, 0, 1]))
    motion = np.arange(12.0).reshape(4, 3)
    work = SimpleNamespace(motion=motion, bias_acceleration=np.array([[9.0], [9.0], [9.0], [0.7]]))
    replace: dict[Any, Any] = {
        its.place_of: lambda _, position: position,
        its.velocity_at: lambda m, j, place: (m[j, 1] + place, m[j, 2] - place),
        its.bias_at: lambda _, link, place: (0.5 * link, place),
    }  # fmt: skip
    held.rows = np.full((5, 4), 77.0)
    held.target = np.full(5, 9.0)
    uncompiled(its.add_place, replace=replace)(model, work, 3, 0.25, components, held)
    assert held.count == 1 + components
    expected = np.zeros((3, 4))
    for j in (0, 1, 3):
        expected[:, j] = motion[j, 1] + 0.25, motion[j, 2] - 0.25, motion[j, 0]
    np.testing.assert_allclose(held.rows[1 : 1 + components], expected[:components])
    assert held.target[1 : 1 + components].tolist() == [0.0] * components
    assert held.target[0] == held.target[1 + components] == 9.0
    uncompiled(its.keep_place, replace=replace)(work, 3, 0.25, components, 1, held)
    found = [-1.5, -0.25, -0.7 if components == 3 else 9.0]
    assert held.target[1:4].tolist() == found
