"""The closed sets of the contact problem: contact modes, solvers, and how a solve can end.

Kernels use the plain integers; people use the enums, whose members have the same values.
"""

from __future__ import annotations

import enum
from typing import Self

OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD, SLIDING_FORWARD, SLIDING_BACKWARD = range(6)

LEMKE, FISCHER_BURMEISTER, GAUSS_SEIDEL, WARM_START, COMBINATIONS = range(5)

SOLVED, RAY, ITERATION_LIMIT, UNCERTIFIED, UNDECIDABLE = range(5)


class ContactMode(enum.IntEnum):
    """What a contact does, told by the velocity after the solve.

    ``OPEN`` separates; ``STICK`` touches without slipping; ``SLIP_FORWARD`` touches and slips
    along the positive tangent, ``SLIP_BACKWARD`` along the negative one.

    The two ``SLIDING`` modes are not found but prescribed, by a caller that solves for
    accelerations: the contact already slides with a velocity that is not zero, so its friction
    stays on that edge of the cone whatever the tangential acceleration.
    """

    OPEN = OPEN
    STICK = STICK
    SLIP_FORWARD = SLIP_FORWARD
    SLIP_BACKWARD = SLIP_BACKWARD
    SLIDING_FORWARD = SLIDING_FORWARD
    SLIDING_BACKWARD = SLIDING_BACKWARD


class Coded(enum.Enum):
    """Members that kernels know by their places in the list of them."""

    @property
    def code(self) -> int:
        """Return the integer by which kernels know this one."""
        return list(type(self)).index(self)

    @classmethod
    def from_code(cls, code: int) -> Self:
        """Return the one that kernels know by this integer.

        Parameters
        ----------
        code : int
            The integer.

        Returns
        -------
        Coded
            The member.
        """
        return list(cls)[int(code)]


class Solver(Coded):
    """The ways to solve a contact problem; the values are the names that options accept.

    Kernels know them by their places in this list.

    The last two cannot be asked for: ``WARM_START`` stands for modes that were guessed right, and
    ``COMBINATIONS`` is the last resort after the others.
    """

    LEMKE = "lemke"
    FISCHER_BURMEISTER = "fischer_burmeister"
    GAUSS_SEIDEL = "gauss_seidel"
    WARM_START = "warm_start"
    COMBINATIONS = "combinations"


class SolveStatus(enum.IntEnum):
    """How a solve ended."""

    SOLVED = SOLVED
    RAY = RAY
    ITERATION_LIMIT = ITERATION_LIMIT
    UNCERTIFIED = UNCERTIFIED
    UNDECIDABLE = UNDECIDABLE

    @property
    def text(self) -> str:
        """Return the status in a person's words."""
        return _STATUS_TEXTS[self]


_STATUS_TEXTS = {
    SolveStatus.SOLVED: "solved, and the residuals confirm it",
    SolveStatus.RAY: (
        "no solution exists along this ray: the pivots left the feasible set without a solution; "
        "the contacts are probably asked for velocities that no impulse can give"
    ),
    SolveStatus.ITERATION_LIMIT: "the iteration limit was reached before a solution",
    SolveStatus.UNCERTIFIED: "the solver stopped, but the residuals do not confirm its answer",
    SolveStatus.UNDECIDABLE: (
        "undecidable in this precision: either no impulse gives the contacts the velocities they "
        "are asked for, or it is so large that rounding it changes them by more than the tolerance"
    ),
}
