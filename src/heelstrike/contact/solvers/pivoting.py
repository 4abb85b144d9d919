"""Lemke's way of choosing what to pivot."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import ITERATION_LIMIT, RAY, SOLVED
from heelstrike.contact.workspace import Dictionary, Floats, Integers, Tally
from heelstrike.dynamics.dense import pivot

SURE_PIVOT = 10.0
"""Pivots larger than so many ties are no rounding."""


@kernel
def precedes(
    first: int, second: int, column: int, pairs: int, tie: float, place: Integers, tableau: Floats
) -> bool:
    """Return whether row ``first`` leaves before row ``second`` although their ratios tie.

    Every constant of the original problem is thought of as perturbed, the k-th by epsilon to
    the k. The coefficient of that perturbation in a row is minus its entry in the column of w_k,
    or one if the row holds w_k itself.
    """
    first_size = -tableau[first, column]
    second_size = -tableau[second, column]
    for k in range(pairs):
        where = place[k]
        if where >= 0:
            first_part = 1.0 if where == first else 0.0
            second_part = 1.0 if where == second else 0.0
        else:
            first_part = -tableau[first, -where]
            second_part = -tableau[second, -where]
        difference = first_part * second_size - second_part * first_size
        if abs(difference) > tie * first_size * second_size:
            return difference < 0.0
    return first < second


@kernel
def pivot_to_solution(pairs: int, tie: float, tally: Tally, dictionary: Dictionary) -> int:
    """Run Lemke's pivots on a complementarity problem; return how they ended.

    Find ``w = M z + q >= 0``, ``z >= 0``, ``w @ z = 0``. Column 0 of the dictionary holds q,
    columns 1 ... ``pairs`` hold M and the last one the covering vector, all positive. Ties in the
    ratio test are broken lexicographically (Cottle, Pang and Stone, The Linear Complementarity
    Problem, section 4.9). Variables are numbered w_0 ..., z_0 ..., artificial; in the end
    ``place`` tells which are basic (their row) and which are zero (minus their column).

    The entries should be of order one: closer than ``tie`` is equal, and pivots smaller than
    ten times that are rounding.
    """
    row_label, column_label = dictionary.row_label, dictionary.column_label
    tableau, place = dictionary.tableau, dictionary.place
    artificial = 2 * pairs
    column = pairs + 1
    row = pairs
    best = 0.0
    for i in range(pairs):
        row_label[i] = i
        place[i] = i
        column_label[i + 1] = pairs + i
        place[pairs + i] = -(i + 1)
        # The largest deficit in terms of the covering vector. Of equal ones the later row has the
        # smaller perturbation, so the larger deficit.
        if tableau[i, 0] < 0.0:
            deficit = -tableau[i, 0] / tableau[i, column]
            if deficit >= best * (1.0 - tie):
                best = deficit
                row = i
    column_label[column] = artificial
    place[artificial] = -column
    if row == pairs:
        return SOLVED
    for _ in range(20 * pairs + 50):
        tally.iterations += 1
        entering = column_label[column]
        leaving = row_label[row]
        pivot(pairs, pairs + 2, row, column, tableau)
        row_label[row] = entering
        place[entering] = row
        column_label[column] = leaving
        place[leaving] = -column
        if leaving == artificial:
            return SOLVED
        column = -place[leaving + pairs if leaving < pairs else leaving - pairs]
        row = pairs
        best = 0.0
        for i in range(pairs):
            size = -tableau[i, column]
            if size > SURE_PIVOT * tie:
                ratio = max(tableau[i, 0], 0.0) / size
                slack = tie * (1.0 + best)
                if (
                    row == pairs
                    or ratio < best - slack
                    or (
                        ratio <= best + slack
                        and row_label[row] != artificial
                        and (
                            row_label[i] == artificial
                            or precedes(i, row, column, pairs, tie, place, tableau)
                        )
                    )
                ):
                    row = i
                    best = ratio
        if row == pairs:
            return RAY
    return ITERATION_LIMIT
