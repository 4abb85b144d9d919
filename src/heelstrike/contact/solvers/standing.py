"""Feet that stand: impulses of few contacts that all stick, as straight-line code.

Vertices of one flat foot share their tangential row. There is a program for each way in which up to
four neighbours, two feet at the most, share them, for all robots.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.recordings.recording import Program, smaller
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.contact.modes import STICK
from heelstrike.contact.solvers.elimination import eliminate
from heelstrike.contact.workspace import ContactProblem, Floats, Integers

MOST_STANDING = 4
"""Contacts that programs are for."""

CODES = 2**MOST_STANDING
"""Ways in which up to so many contacts share rows: 1 for one contact, and with each contact more
twice that, and one if its tangent is shared with the contact before."""

SHARED_ROW = 1e-14
"""Two rows are one if the inverse mass along their difference is less than this, relative."""

EARLY_PIVOT = 1e-2
"""Pivots that keep more than this of their diagonal are good."""


class Sharing(NamedTuple):
    """Which rows of some contacts that stick make which equations."""

    source: NDArray[np.int64]
    """Row of each equation."""
    equation: NDArray[np.int64]
    """Equation of each row."""
    sharers: NDArray[np.int64]
    """How many rows share each equation."""


def sharing(code: int) -> Sharing:
    """Return how rows are shared by a code."""
    shared = [digit == "1" for digit in f"{code:b}"]
    shared[0] = False
    source: list[int] = []
    equation: list[int] = []
    for contact, is_shared in enumerate(shared):
        equation.append(len(source))
        source.append(2 * contact)
        if is_shared:
            equation.append(equation[-2])
        else:
            equation.append(len(source))
            source.append(2 * contact + 1)
    return Sharing(np.array(source), np.array(equation), np.bincount(equation))


@kernel
def solve_standing(
    source: Integers, equation: Integers, sharers: Integers, delassus: Floats, free: Floats,
    matrix: Floats, x: Floats, pivot: Floats, margin: Floats, impulse: Floats,
) -> None:  # fmt: skip
    """Impulses that leave rows no velocity, ``G impulse = -free``, in equal shares.

    Parameters
    ----------
    source, equation, sharers : (m,), (2 n,), (m,) int
        As in :class:`Sharing`.
    delassus, free : (2 n, 2 n), (2 n,) float
    matrix, x, pivot : (m (m + 1) / 2,), (m,), (m,) float
        Receive what :func:`~heelstrike.contact.solvers.elimination.eliminate` makes of them.
    margin : (1,) float
        Receives the least that a pivot has above what makes it good.
    impulse : (2 n,) float
        Receives the impulses.
    """
    size = source.shape[0]
    for i in range(size):
        x[i] = -free[source[i]]
        for j in range(i + 1):
            matrix[i * (i + 1) // 2 + j] = delassus[source[i], source[j]]
    eliminate(matrix, x, pivot)
    margin[0] = pivot[0] - EARLY_PIVOT * delassus[0, 0]
    for i in range(1, size):
        diagonal = delassus[source[i], source[i]]
        margin[0] = smaller(pivot[i] - EARLY_PIVOT * diagonal, margin[0])
    for row in range(equation.shape[0]):
        place = equation[row]
        impulse[row] = x[place] * (1.0 / sharers[place])


@dissolved_kernel
def code_of(problem: ContactProblem, mode: Integers) -> int:
    """Code of a problem whose contacts all stick and fill their matrix; zero of others."""
    delassus, count = problem.delassus, problem.count
    if not 0 < count <= MOST_STANDING or delassus.shape[1] != 2 * count:
        return 0
    others, least = 0, problem.friction[0]
    for contact in range(count):
        others |= problem.set[contact] | (mode[contact] ^ STICK)  # the set of cones is zero
        least = min(least, problem.friction[contact])
    if others != 0 or not least > 0.0:
        return 0
    code = 1
    for neighbour in range(count - 1):
        one, other = 2 * neighbour + 1, 2 * neighbour + 3
        both = delassus[one, one] + delassus[other, other]
        apart = abs(both - 2.0 * delassus[other, one])
        code = 2 * code + int(apart <= SHARED_ROW * both)
    return code


@lru_cache(maxsize=1)
def standing_programs() -> NDArray[np.int64]:
    """Addresses of the programs by code, (CODES,); zero where there is none.

    Read-only: all workspaces share them.
    """
    codes = [code for code in range(1, CODES) if _is_of_two_feet(code)]
    programs = np.zeros(CODES, dtype=np.int64)
    programs[codes] = straight_line_code([_program(code) for code in codes])
    programs.flags.writeable = False
    return programs


def _is_of_two_feet(code: int) -> bool:
    """Whether there is a program: for one contact, or feet of two."""
    return code in (1, 2, 3) or (code >= 8 and code & 2 == 0)


def _program(code: int) -> Program:
    shared = sharing(code)
    size, rows = len(shared.source), len(shared.equation)
    return Program(
        solve_standing,
        {
            **shared._asdict(),
            "delassus": np.zeros((rows, rows)),
            "free": np.zeros(rows),
            "matrix": np.zeros(size * (size + 1) // 2),
            "x": np.zeros(size),
            "pivot": np.zeros(size),
            "margin": np.zeros(1),
            "impulse": np.zeros(rows),
        },
        name=f"stand_{code}",
    )
