"""What a certificate weighs rows by, and the velocities of an impulse, as straight-line code.

One program for each even number of rows, for all robots.
"""

from __future__ import annotations

from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import Program, larger
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.contact.workspace import Floats

MOST_ROWS = 10
"""Rows of the largest problem with a program; its length grows with the square of their number.

Matrices are laid out for whole contacts of two rows, so that an odd number never fills one.
"""


@kernel
def weigh_rows(
    delassus: Floats, free: Floats, impulse: Floats, root: Floats, velocity: Floats, size: Floats
) -> None:
    """Weights of rows, what impulses make of their velocities, and the sizes of both.

    Parameters
    ----------
    delassus : (n, n) float
        Symmetric: its columns are read as rows.
    free, impulse : (n,) float
    root : (n,) float
        Receives ``g = sqrt(diag G)``.
    velocity : (n,) float
        Receives ``G impulse + free``.
    size : (3,) float
        Receives the largest ``|free| / g``, ``g |impulse|``, summed, and the least of the diagonal:
        the first is of use where that is more than zero.
    """
    rows = root.shape[0]
    for i in range(rows):
        root[i] = sqrt(delassus[i, i])
        velocity[i] = free[i]
    for j in range(rows):
        for i in range(rows):
            velocity[i] += delassus[j, i] * impulse[j]
    most, effort, least = 0.0, 0.0, delassus[0, 0]
    for i in range(rows):
        most = larger(abs(free[i]) / root[i], most)
        least = -larger(-delassus[i, i], -least)
        effort += root[i] * abs(impulse[i])
    size[0] = most
    size[1] = effort
    size[2] = least


@lru_cache(maxsize=1)
def weighing_programs() -> NDArray[np.int64]:
    """Addresses of the programs by the number of rows, (MOST_ROWS + 1,).

    There is none for zero rows, nor for an odd number. Read-only: all workspaces share them.
    """
    programs = np.zeros(MOST_ROWS + 1, dtype=np.int64)
    programs[2::2] = straight_line_code(
        [
            Program(
                weigh_rows,
                {
                    "delassus": np.zeros((rows, rows)),
                    **{name: np.zeros(rows) for name in ("free", "impulse", "root", "velocity")},
                    "size": np.zeros(3),
                },
                name=f"weigh_{rows}",
                side_by_side=True,
            )
            for rows in range(2, MOST_ROWS + 1, 2)
        ]
    )
    programs.flags.writeable = False
    return programs
