"""The certificate of a few contacts with friction, as straight-line code.

One program for each number of contacts, for all robots. It says what
:mod:`heelstrike.contact.certificate` says by loops.
"""

from __future__ import annotations

from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import Program, inverse_above, larger
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.contact.workspace import Floats

MOST_CONES = 5
"""Contacts of the largest problem with a program; its length grows with the square of their
number."""

UNIT, EFFORT, LEAST, FASTEST = range(4)
"""What the programs measure with: the size of the data, the effort in its own unit, the least of
the diagonal, and the largest ``|velocity| / g``."""


@kernel
def smaller(one: float, other: float) -> float:
    """The smaller of two numbers."""
    return -larger(-one, -other)


@kernel
def certify_cones(
    delassus: Floats, free: Floats, friction: Floats, impulse: Floats, root: Floats,
    velocity: Floats, residual: Floats, size: Floats,
) -> None:  # fmt: skip
    """Weights of rows, what impulses make of their velocities, and residuals.

    Of use where every row is moved by something, where rounding is not to be seen, and where all
    are numbers: otherwise the effort is none.

    Parameters
    ----------
    delassus : (2 n, 2 n) float
        Symmetric: its columns are read as rows.
    free, impulse : (2 n,) float
    friction : (n,) float
    root : (2 n,) float
        Receives ``g = sqrt(diag G)``.
    velocity : (2 n,) float
        Receives ``G impulse + free``.
    residual : (3,) float
        Receives complementarity, cone and non-penetration, in units of the data.
    size : (4,) float
        In: the floor in the place of the size of the data. Receives all four.
    """
    rows = root.shape[0]
    for i in range(rows):
        root[i] = sqrt(delassus[i, i])
        velocity[i] = free[i]
    for j in range(rows):
        for i in range(rows):
            velocity[i] += delassus[j, i] * impulse[j]
    unit, effort, least, fastest = size[UNIT], 0.0, delassus[0, 0], 0.0
    for i in range(rows):
        unit = larger(abs(free[i]) / root[i], unit)
        least = smaller(delassus[i, i], least)
        effort += root[i] * abs(impulse[i]) + (velocity[i] - velocity[i])
    inverse = inverse_above(unit, 0.0)
    complementarity, cone, penetration = 0.0, 0.0, 0.0
    for contact in range(friction.shape[0]):
        normal = 2 * contact
        tangent = normal + 1
        speed = velocity[normal] / root[normal]
        slip = velocity[tangent] / root[tangent]
        fastest = larger(abs(speed), larger(abs(slip), fastest))
        force = impulse[normal] * (root[normal] * inverse)
        limit, scale = friction[contact] * impulse[normal], root[tangent] * inverse
        upper, lower = (limit - impulse[tangent]) * scale, (limit + impulse[tangent]) * scale
        speed, slip = speed * inverse, slip * inverse
        penetration = larger(-speed, penetration)
        complementarity = larger(smaller(speed, force), complementarity)
        complementarity = larger(smaller(slip, lower), complementarity)
        complementarity = larger(smaller(-slip, upper), complementarity)
        cone = larger(-force, larger(-smaller(upper, lower), cone))
    residual[0] = complementarity
    residual[1] = cone
    residual[2] = penetration
    size[UNIT] = unit
    size[EFFORT] = effort
    size[LEAST] = least
    size[FASTEST] = fastest


@lru_cache(maxsize=1)
def cone_certificates() -> NDArray[np.int64]:
    """Addresses of the programs by the number of contacts, (MOST_CONES + 1,); the first is zero.

    Read-only: all workspaces share them.
    """
    programs = np.zeros(MOST_CONES + 1, dtype=np.int64)
    programs[1:] = straight_line_code(
        [
            Program(
                certify_cones,
                {
                    "delassus": np.zeros((2 * count, 2 * count)),
                    "free": np.zeros(2 * count),
                    "friction": np.zeros(count),
                    **{name: np.zeros(2 * count) for name in ("impulse", "root", "velocity")},
                    "residual": np.zeros(3),
                    "size": np.zeros(4),
                },
                name=f"certify_{count}_cones",
                side_by_side=True,
            )
            for count in range(1, MOST_CONES + 1)
        ]
    )
    programs.flags.writeable = False
    return programs
