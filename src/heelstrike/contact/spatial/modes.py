"""The closed sets of contact in space: contact modes, ways to solve, and how a solve can end.

Kernels use the plain integers; people use the enums, whose members have the same values.
"""

from __future__ import annotations

import enum

from heelstrike.contact.modes import Coded

OPEN, STICK, SLIP = range(3)

LAST_MODES, NEWTON, GAUSS_SEIDEL, REGULARISED, PROXIMAL, RESTARTS, FIXED_POINT = range(7)

SOLVED, NOT_FOUND, IMPOSSIBLE = range(3)


class SpatialContactMode(enum.IntEnum):
    """What a contact in space does, told by the velocity after the solve.

    ``OPEN`` separates, ``STICK`` touches without slipping, ``SLIP`` touches and slips; where to is
    told by the velocity.
    """

    OPEN = OPEN
    STICK = STICK
    SLIP = SLIP


class SpatialSolver(Coded):
    """The ways to solve a contact problem in space, in the order in which they are tried.

    ``LAST_MODES``
        The modes of the solve before, or all sticking: one linear system.
    ``NEWTON``
        Newton's method on the modes, with a line search.
    ``GAUSS_SEIDEL``
        Sweeps of exact solutions of one contact after the other, then Newton's method.
    ``REGULARISED``
        The same, with small numbers added to the diagonal of Newton's matrix.
    ``PROXIMAL``
        Problems with a larger diagonal, one after the other, whose answers tend to one of this.
    ``RESTARTS``
        Newton's method from other impulses.
    ``FIXED_POINT``
        Convex problems with guessed slip speeds, each nearer to those of the answer before.
    """

    LAST_MODES = "last_modes"
    NEWTON = "newton"
    GAUSS_SEIDEL = "gauss_seidel"
    REGULARISED = "regularised"
    PROXIMAL = "proximal"
    RESTARTS = "restarts"
    FIXED_POINT = "fixed_point"


class SpatialStatus(enum.IntEnum):
    """How a solve in space ended."""

    SOLVED = SOLVED
    NOT_FOUND = NOT_FOUND
    IMPOSSIBLE = IMPOSSIBLE

    @property
    def text(self) -> str:
        """Return the status in a person's words."""
        return _STATUS_TEXTS[self]


_STATUS_TEXTS = {
    SpatialStatus.SOLVED: "solved, and the residual confirms it",
    SpatialStatus.NOT_FOUND: (
        "no solution was found, nor a proof that there is none; the answer is the one of the "
        "smallest residual"
    ),
    SpatialStatus.IMPOSSIBLE: (
        "there is no solution: no impulses can keep all contacts from penetrating"
    ),
}
