"""Which row leaves where several might: the order that keeps Lemke from going in circles."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import RAY, SOLVED
from heelstrike.contact.solvers.pivoting import pivot_to_solution, precedes
from heelstrike.contact.workspace import Dictionary, Tally

COLUMN = 3  # that enters


def first_leaves(
    entering: tuple[float, float], place: list[int], others: list[list[float]]
) -> tuple[bool, bool]:
    """Whether row 0 leaves before row 1, and row 1 before row 0."""
    tableau = np.zeros((2, 5))
    tableau[:, COLUMN] = entering
    tableau[:, 1 : 1 + len(others[0])] = others
    order = np.array(place)
    ask = uncompiled(precedes)
    return (
        ask(0, 1, COLUMN, len(place), 1e-12, order, tableau),
        ask(1, 0, COLUMN, len(place), 1e-12, order, tableau),
    )


@pytest.mark.parametrize(
    ("place", "row"),
    [([0, 1], 1), ([1, 0], 0)],
    ids=["row 0 holds the first variable", "row 1 holds it"],
)
def test_the_row_without_the_first_perturbation_leaves(place: list[int], row: int) -> None:
    """Its ratio is disturbed by ε², the other one's by +ε."""
    found = first_leaves((-1.0, -2.0), place, [[0.0, 0.0], [0.0, 0.0]])
    assert found == ((True, False) if row == 0 else (False, True))


def test_of_variables_outside_the_ratio_of_the_coefficients_decides() -> None:
    """Variable 0 is in column 1: its share in the rows is −0.5/1 and −0.5/2."""
    found = first_leaves((-1.0, -2.0), [-1, 0], [[0.5, 0.0], [0.5, 0.0]])
    assert found == (True, False)
    found = first_leaves((-1.0, -2.0), [-1, 0], [[0.5, 0.0], [1.5, 0.0]])
    assert found == (False, True)


def test_equal_shares_leave_it_to_the_next() -> None:
    found = first_leaves((-1.0, -2.0), [-1, 0], [[0.5, 0.0], [1.0, 0.0]])
    assert found == (False, True)  # row 0 holds variable 1


def test_rows_that_are_alike_leave_in_order() -> None:
    assert first_leaves((-1.0, -1.0), [-1, -2], [[0.5, 0.2], [0.5, 0.2]]) == (True, False)


# The pivots, against whole numbers that are perturbed a little.

EPSILON = Fraction(1, 1000)
"""Perturbation of the first row, its square of the second, …: no ratios tie."""


def lemke(matrix: Any, free: Any, cover: Any) -> tuple[list[int], bool, int]:
    """Which variables are basic in the end, whether it ends, after how many pivots: textbook Lemke.

    Variables w are numbered first, then z, then the artificial one.
    """
    size = len(free)
    table = [
        [Fraction(int(free[i])) + EPSILON ** (i + 1), *(Fraction(int(m)) for m in matrix[i]),
         Fraction(int(cover[i]))]
        for i in range(size)
    ]  # fmt: skip
    basic, outside = list(range(size)), [*range(size, 2 * size), 2 * size]
    ratios = {i: -table[i][0] / table[i][-1] for i in range(size) if table[i][0] < 0}
    if not ratios:
        return basic, True, 0
    row, column, count = max(ratios, key=lambda i: ratios[i]), size, 0
    while True:
        count += 1
        entry = table[row][column + 1]
        own = [-each / entry for each in table[row]]
        own[column + 1] = 1 / entry
        for i in range(size):
            if i != row:
                part = table[i][column + 1]
                table[i] = [
                    part * own[k] + (0 if k == column + 1 else each)
                    for k, each in enumerate(table[i])
                ]
        table[row] = own
        basic[row], outside[column] = outside[column], basic[row]
        leaves = outside[column]
        if leaves == 2 * size:
            return sorted(basic), True, count
        column = outside.index(leaves + size if leaves < size else leaves - size)
        falls = {
            i: table[i][0] / -table[i][column + 1] for i in range(size) if table[i][column + 1] < 0
        }
        if not falls:
            return sorted(basic), False, count
        row = min(falls, key=lambda i: falls[i])


@pytest.mark.parametrize("kind", ["definite", "singular", "any"])
def test_pivots_are_those_of_a_perturbed_problem_in_whole_numbers(kind: str) -> None:
    """Small whole numbers, in which nearly every ratio ties."""
    draw, solved, rays, same = np.random.default_rng([6, len(kind)]), 0, 0, 0
    for _ in range(60):
        size = int(draw.integers(1, 5))
        if kind == "any":
            matrix = draw.integers(-1, 2, (size, size))
        else:
            half = draw.integers(-1, 2, (size, size + 1 if kind == "definite" else 2))
            matrix = half @ half.T
        free, cover = draw.integers(-2, 2, size), draw.integers(1, 3, size)
        basic, ends, count = lemke(matrix, free, cover)
        dictionary = Dictionary.allocate(pairs=size)
        table = dictionary.tableau
        table[:, 0], table[:, 1 : size + 1], table[:, size + 1] = free, matrix, cover
        tally = Tally.allocate()
        status = uncompiled(pivot_to_solution)(size, 1e-9, tally, dictionary)
        assert status == (SOLVED if ends else RAY)
        place = dictionary.place
        # The artificial variable leaves before others whose ratio ties with its own: sooner.
        assert tally.iterations <= count
        if tally.iterations == count:
            same += 1
            assert np.flatnonzero(place >= 0).tolist() == basic
        solved, rays = solved + ends, rays + (not ends)
        for variable in np.flatnonzero(place >= 0):
            assert count == 0 or dictionary.row_label[place[variable]] == variable
        for variable in np.flatnonzero(place < 0):
            assert dictionary.column_label[-place[variable]] == variable
        if ends:
            z = np.array([table[place[size + i], 0] if place[size + i] >= 0 else 0.0
                          for i in range(size)])  # fmt: skip
            w = matrix @ z + free
            assert np.minimum(w, z) == pytest.approx(np.zeros(size), abs=1e-9)
    assert same >= 57
    assert solved >= 10
    assert rays >= 5 or kind == "definite"
