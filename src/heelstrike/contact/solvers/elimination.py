"""Small symmetric systems as straight-line code: one program for each size, for all robots."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import Program, inverse_above
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.robot.model import Floats

LARGEST = 10
"""Unknowns of the largest system with a program; its length grows with the cube of their number."""

POOR_PIVOT = 1e-7
"""Pivots that keep more than this of their diagonal can be divided by, if need be."""


@kernel
def eliminate(matrix: Floats, x: Floats, pivot: Floats) -> None:
    """Replace x by a solution of a symmetric system, A = L D Lᵀ.

    Where a pivot is less than poor its unknown stays zero, and its column of L empty.

    Parameters
    ----------
    matrix : (n (n + 1) / 2,) float
        Lower half of A, then of L with 1/D on the diagonal, row by row.
    x : (n,) float
        Right side, then solution.
    pivot : (n,) float
        Receives D.
    """
    size = x.shape[0]
    for i in range(size):
        row = i * (i + 1) // 2
        for j in range(i):
            column = j * (j + 1) // 2
            # Until the row is finished, its entries still carry their D.
            for k in range(j):
                matrix[row + j] = matrix[row + j] - matrix[row + k] * matrix[column + k]
        pivot[i] = matrix[row + i]
        for j in range(i):
            ratio = matrix[row + j] * matrix[j * (j + 1) // 2 + j]
            pivot[i] = pivot[i] - ratio * matrix[row + j]
            x[i] = x[i] - ratio * x[j]
            matrix[row + j] = ratio
        matrix[row + i] = inverse_above(pivot[i], POOR_PIVOT * matrix[row + i])
    for i in range(size):
        x[i] = x[i] * matrix[i * (i + 1) // 2 + i]
    for i in range(size - 1, -1, -1):
        for j in range(i):
            x[j] = x[j] - matrix[i * (i + 1) // 2 + j] * x[i]


@lru_cache(maxsize=1)
def elimination_programs() -> NDArray[np.int64]:
    """Addresses of the programs by size, (LARGEST + 1,); zero where there is none.

    Read-only: all workspaces share them.
    """
    programs = np.zeros(LARGEST + 1, dtype=np.int64)
    programs[1:] = _programs()
    programs.flags.writeable = False
    return programs


def _programs() -> tuple[int, ...]:
    return straight_line_code(
        [
            Program(
                eliminate,
                {
                    "matrix": np.zeros(size * (size + 1) // 2),
                    "x": np.zeros(size),
                    "pivot": np.zeros(size),
                },
                name=f"eliminate_{size}",
            )
            for size in range(1, LARGEST + 1)
        ]
    )
