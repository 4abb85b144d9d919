"""Errors across a walk: what is left of them if being early or late is no error.

A walk that no clock drives stays early or late by as much as it is: of a return with the derivative
M that leads from the rate u of the walk to its rate u⁺, M u = u⁺. Errors that differ by a multiple
of u are one, and M maps classes of them to classes,

    T = Q⁺ᵀ M Q,    columns of Q orthonormal and orthogonal to u,

whose eigenvalues are those of M but for that one. Where samples or steps of the integration fall
otherwise in every return, M u is known to be u⁺ but badly measured; T does not need it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from heelstrike.analysis.stability.returns import Disturbed
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

NEUTRAL = 1e-6
"""What of an error that is still there, and of its effects on others, is nothing."""

STAYS = 0.5
"""A walk of which less than this part of being early is left in the end is driven by a clock."""


@dataclass(frozen=True, eq=False)
class Across:
    """Returns of errors, without those that are none."""

    kept: tuple[int, ...]
    inert: tuple[int, ...]
    """kept, inert: Coordinates on which something hangs, and the rest."""
    matrices: tuple[Floats, ...]
    across: tuple[Floats, ...]
    """matrices, across: Tuple of float arrays. Derivatives of the returns in the coordinates that
    are kept; the same across the walk, or as they are where being early by less than a sample does
    not stay."""
    bases: tuple[Floats, ...]
    """Tuple of (n, m) float. What the errors across the walk are in these coordinates, at the
    beginnings of the returns and the end of the last."""
    along: float | None
    """What stays of being early, by a whole number of samples; None of a walk that a clock
    drives."""

    @classmethod
    def of(
        cls, found: list[Disturbed], early: float, of_robot: int, *, smooth: bool,
        in_step: bool = False,
    ) -> Across:  # fmt: skip
        """Look at returns whose first so many coordinates are the robot's.

        `early` is what is left of being early: all of it, or less if a clock drives the walk.
        Disturbances that are `smooth`, less than what moves in a sample, tell by themselves what is
        remembered of being early by as little, and whether that stays. Of a walk that is known to
        be kept `in_step` with its samples it does not.
        """
        kept, inert = _with_consequence([each.matrix for each in found], of_robot)
        square = np.ix_(kept, kept)
        matrices = tuple(each.matrix[square] for each in found)
        same = tuple(np.eye(len(kept)) for _ in range(len(found) + 1))
        if not abs(early - 1.0) <= STAYS:
            return cls(tuple(kept), tuple(inert), matrices, matrices, same, None)
        if in_step:
            return cls(tuple(kept), tuple(inert), matrices, matrices, same, early)
        ways = [each[kept] for each in (found[0].begins, *(each.ends for each in found))]
        if smooth:
            m = sum(i < of_robot for i in kept)
            remembered = _remembered(np.mean(matrices, axis=0), np.mean(ways[:-1], axis=0)[:m])
            ways = [np.concatenate((each[:m], remembered)) for each in ways]
            if not _carried_on(matrices, ways):
                return cls(tuple(kept), tuple(inert), matrices, matrices, same, early)
        bases = _alike([null_space(way[None, :]) for way in ways])
        across = [bases[k + 1].T @ each @ bases[k] for k, each in enumerate(matrices)]
        return cls(tuple(kept), tuple(inert), matrices, tuple(across), tuple(bases), early)

    def largest(self, without: int | None = None) -> float:
        """Largest multiplier of a return, one of them left out."""
        chosen = [each for k, each in enumerate(self.across) if k != without]
        values = np.linalg.eigvals(np.mean(chosen, axis=0))
        return float(np.abs(values).max(initial=0.0))

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """All, largest first."""
        values = np.linalg.eigvals(np.mean(self.across, axis=0)).astype(np.complex128)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def slowest(self) -> Floats:
        """The error that shrinks least, in the coordinates that are kept."""
        values, vectors = np.linalg.eig(np.mean(self.across, axis=0))
        return np.abs(self.bases[0] @ vectors[:, int(np.argmax(np.abs(values)))])


def _carried_on(matrices: tuple[Floats, ...], ways: list[Floats]) -> bool:
    """Tell whether being early by less than a sample stays: M u = u⁺, near enough.

    A walk that keeps step with the calls of its controller loses it; to so small errors the calls
    are a clock.
    """
    return all(
        float(np.linalg.norm(matrix @ ways[k] - ways[k + 1])) <= STAYS * np.linalg.norm(ways[k + 1])
        for k, matrix in enumerate(matrices)
    )


def _remembered(matrix: Floats, rate: Floats) -> Floats:
    """What the memory of a walk is like that is early: what a return makes itself of."""
    m = len(rate)
    lasts = np.eye(len(matrix) - m) - matrix[m:, m:]
    return np.asarray(np.linalg.lstsq(lasts, matrix[m:, :m] @ rate, rcond=1e-9)[0])


def _alike(bases: list[Floats]) -> list[Floats]:
    """Turn bases of spaces that are nearly the same so that they are nearly the first."""
    turned = []
    for basis in bases:
        left, _, right = np.linalg.svd(basis.T @ bases[0])
        turned.append(basis @ left @ right)
    return turned


def _with_consequence(matrices: list[Floats], of_robot: int) -> tuple[list[int], list[int]]:
    """Tell coordinates on which something hangs from those that nothing but they themselves feel.

    The latter's own multipliers are one, of what stays, and zero, of what is written again.
    """
    kept = list(range(len(matrices[0])))
    while True:
        alone = [
            i
            for i in kept
            if i >= of_robot
            and all(_is_alone(matrix[kept, i], kept.index(i)) for matrix in matrices)
        ]
        if not alone:
            return kept, sorted(set(range(len(matrices[0]))) - set(kept))
        kept = [i for i in kept if i not in alone]


def _is_alone(column: Floats, place: int) -> bool:
    own, others = column[place], np.delete(column, place)
    stays = min(abs(own), abs(own - 1.0)) <= NEUTRAL
    return bool(stays and np.abs(others).max(initial=0.0) <= NEUTRAL)
