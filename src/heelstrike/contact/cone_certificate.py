"""The certificate of a few contacts with friction, as straight-line code.

One program for each number of contacts, for all robots. It says what
:mod:`heelstrike.contact.certificate` says by loops.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import Program, inverse_above, larger, smaller
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.contact.workspace import Floats

MOST_CONES = 5
"""Contacts of the largest problem with a program; its length grows with the square of their
number."""

UNIT, EFFORT, LEAST, FASTEST = range(4)
"""What the programs measure with: the size of the data, the effort in its own unit, the least of
the diagonal, and the largest ``|velocity| / g``."""

SIZES, EFFORTS, DIAGONAL, SPEEDS, PENETRATION, CONE, COMPLEMENTARITY = range(7)
"""What is gathered from the rows."""


@kernel
def gather(tree: Floats, combine: Callable[[float, float], float]) -> None:
    """Combine numbers two by two, half of them with the other half, until one is left.

    Machine code combines several at once.

    Parameters
    ----------
    tree : (2 m,) float
        The last m are the numbers, m a power of two. Those from ``w`` to ``2 w`` receive what has
        been made of them when w are left.
    combine : callable
    """
    width = tree.shape[0] // 4
    while width >= 1:
        for i in range(width):
            tree[width + i] = combine(tree[2 * width + i], tree[3 * width + i])
        width //= 2


@kernel
def plus(one: float, other: float) -> float:
    """Sum of two numbers."""
    return one + other


@kernel
def certify_cones(
    delassus: Floats, free: Floats, friction: Floats, impulse: Floats, root: Floats,
    velocity: Floats, residual: Floats, size: Floats, tree: Floats,
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
    tree : (7, 2 m) float
        Scratch; m is at least 2 n, and a power of two.
    """
    rows, leaf = root.shape[0], tree.shape[1] // 2
    tree[:, leaf:] = 0.0
    tree[DIAGONAL, leaf:] = delassus[0, 0]
    for i in range(rows):
        root[i] = sqrt(delassus[i, i])
        velocity[i] = free[i]
    for j in range(rows):
        for i in range(rows):
            velocity[i] += delassus[j, i] * impulse[j]
    for i in range(rows):
        tree[SIZES, leaf + i] = abs(free[i]) / root[i]
        # What is no number, or infinite, makes the effort none.
        limit = friction[i // 2] * impulse[i - i % 2]
        nothing = (velocity[i] - velocity[i]) + (limit - limit)
        tree[EFFORTS, leaf + i] = root[i] * abs(impulse[i]) + nothing
        tree[DIAGONAL, leaf + i] = delassus[i, i]
    gather(tree[SIZES], larger)
    gather(tree[EFFORTS], plus)
    gather(tree[DIAGONAL], smaller)
    unit = larger(tree[SIZES, 1], size[UNIT])
    inverse = inverse_above(unit, 0.0)
    for i in range(rows):
        speed = velocity[i] / root[i]
        scale = root[i] * inverse
        # A normal impulse lacks itself to zero, and nothing holds it on the other side.
        normal = i - i % 2
        limit = friction[i // 2] * impulse[normal]
        lower = impulse[i] if i == normal else limit + impulse[i]
        upper = 0.0 if i == normal else limit - impulse[i]
        lower, upper = lower * scale, upper * scale
        tree[SPEEDS, leaf + i] = abs(speed)
        speed = speed * inverse
        tree[PENETRATION, leaf + i] = -speed
        tree[CONE, leaf + i] = -smaller(lower, upper)
        slip = larger(smaller(speed, lower), smaller(-speed, upper))
        tree[COMPLEMENTARITY, leaf + i] = slip
    for kind in range(SPEEDS, COMPLEMENTARITY + 1):
        gather(tree[kind], larger)
    residual[0] = larger(tree[COMPLEMENTARITY, 1], 0.0)
    residual[1] = larger(tree[CONE, 1], 0.0)
    residual[2] = larger(tree[PENETRATION, 2], 0.0)  # the largest of even rows, the normals
    size[UNIT] = unit
    size[EFFORT] = tree[EFFORTS, 1]
    size[LEAST] = tree[DIAGONAL, 1]
    size[FASTEST] = tree[SPEEDS, 1]


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
                    "tree": np.zeros((7, 4 << (2 * count - 1).bit_length() >> 1)),
                },
                name=f"certify_{count}_cones",
                scratch=("tree",),
                side_by_side=True,
            )
            for count in range(1, MOST_CONES + 1)
        ]
    )
    programs.flags.writeable = False
    return programs
