"""Feet that stand: impulses of few contacts that all stick, as straight-line code.

Vertices of one flat foot share their tangential row. There are programs for one foot and for two,
flat or points, and for each number of joint stops beside them, for all robots.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.recordings.recording import Program, smaller
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.contact.cone_certificate import MOST_STOPS, has_stops
from heelstrike.contact.modes import STICK
from heelstrike.contact.solvers.elimination import eliminate
from heelstrike.contact.workspace import PROGRAM_ROWS, ContactProblem, Floats, Integers

MOST_STANDING = 4
"""Contacts that programs are for."""

CODES = 2**MOST_STANDING
"""Ways in which up to so many contacts share rows: 1 for one contact, and with each contact more
twice that, and one if its tangent is shared with the contact before."""

PROGRAMS = (0b1, 0b10, 0b11, 0b1101)
"""Codes that have programs: one point foot and two, one flat foot and two."""

MOST_EQUATIONS = PROGRAM_ROWS - 2
"""Equations of the largest program: vertices of two flat feet share a tangent each."""

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
    held: Floats, matrix: Floats, x: Floats, pivot: Floats, margin: Floats, impulse: Floats,
) -> None:  # fmt: skip
    """Impulses that leave rows no velocity, ``G impulse = -free``, in equal shares.

    Parameters
    ----------
    source, equation, sharers : (k,), (2 n,), (k,) int
        Of the contacts, as in :class:`Sharing`.
    delassus : (PROGRAM_ROWS, PROGRAM_ROWS) float
    free : (2 n + stops,) float
    held : (stops,) float
        1 for the stops whose rows shall have no velocity, 0 for those without impulse.
    matrix, x, pivot : (m (m + 1) / 2,), (m,), (m,) float
        Receive what :func:`~heelstrike.contact.solvers.elimination.eliminate` makes of them. The
        equations of the stops are the first: where they hold straight legs, it is plain which
        contacts depend on others.
    margin : (1,) float
        Receives the least that a pivot has above what makes it good.
    impulse : (2 n + stops,) float
        Receives the impulses.
    """
    stops, rows, size = held.shape[0], equation.shape[0], x.shape[0]
    for i in range(size):
        row = rows + i if i < stops else source[i - stops]
        diagonal = i * (i + 1) // 2 + i
        x[i] = -free[row]
        for j in range(i + 1):
            entry = delassus[row, rows + j if j < stops else source[j - stops]]
            matrix[diagonal - i + j] = held[j] * entry if j < stops else entry
        if i < stops:
            x[i] = held[i] * x[i]
            for j in range(i):
                matrix[diagonal - i + j] = held[i] * matrix[diagonal - i + j]
            matrix[diagonal] = matrix[diagonal] + (1.0 - held[i])
        pivot[i] = matrix[diagonal]
    margin[0] = least_margin(matrix, x, pivot)
    for row in range(rows):
        place = equation[row]
        impulse[row] = x[stops + place] * (1.0 / sharers[place])
    for stop in range(stops):
        impulse[rows + stop] = x[stop]


@kernel
def least_margin(matrix: Floats, x: Floats, pivot: Floats) -> float:
    """Solve by elimination; return the least that a pivot has above what makes it good."""
    size = x.shape[0]
    good = [EARLY_PIVOT * pivot[i] for i in range(size)]
    eliminate(matrix, x, pivot)
    least = pivot[0] - good[0]
    for i in range(1, size):
        least = smaller(pivot[i] - good[i], least)
    return least


@dissolved_kernel
def code_of(cones: int, problem: ContactProblem, mode: Integers) -> int:
    """Code of a problem whose contacts all stick, and rub; zero of others.

    They are the first of it, and stops come after them.
    """
    delassus = problem.delassus
    others, least = 0, problem.friction[0]
    for contact in range(cones):
        others |= mode[contact] ^ STICK
        least = min(least, problem.friction[contact])
    if others != 0 or not least > 0.0:
        return 0
    code = 1
    for neighbour in range(cones - 1):
        one, other = 2 * neighbour + 1, 2 * neighbour + 3
        both = delassus[one, one] + delassus[other, other]
        apart = abs(both - 2.0 * delassus[other, one])
        code = 2 * code + int(apart <= SHARED_ROW * both)
    return code


@lru_cache(maxsize=1)
def standing_programs() -> NDArray[np.int64]:
    """Addresses of the programs by code and number of stops; zero where there is none.

    Read-only: all workspaces share them.
    """
    numbers = [
        (code, stops)
        for code in PROGRAMS
        for stops in range(MOST_STOPS + 1)
        if stops == 0 or has_stops(code.bit_length(), stops)
    ]
    programs = np.zeros((CODES, MOST_STOPS + 1), dtype=np.int64)
    programs[tuple(np.transpose(numbers))] = straight_line_code([_program(*n) for n in numbers])
    programs.flags.writeable = False
    return programs


def _program(code: int, stops: int) -> Program:
    shared = sharing(code)
    size, rows = len(shared.source) + stops, len(shared.equation) + stops
    return Program(
        solve_standing,
        {
            **shared._asdict(),
            "delassus": np.zeros((PROGRAM_ROWS, PROGRAM_ROWS)),
            "free": np.zeros(rows),
            "held": np.zeros(stops),
            "matrix": np.zeros(size * (size + 1) // 2),
            "x": np.zeros(size),
            "pivot": np.zeros(size),
            "margin": np.zeros(1),
            "impulse": np.zeros(rows),
        },
        name=f"stand_{code}_and_{stops}",
    )
