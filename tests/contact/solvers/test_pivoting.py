"""Which row leaves where several might: the order that keeps Lemke from going in circles."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.solvers.pivoting import precedes

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
