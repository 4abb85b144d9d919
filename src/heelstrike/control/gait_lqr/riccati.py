"""Riccati equations of walks: what errors cost in all steps to come."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats

PERIODS = 400
SETTLED = 1e-10
"""Steps until gains are those of all further ones, to this part of the largest cost."""


Kept = TypeVar("Kept")


def swept_back(
    moves: Sequence[tuple[Floats, Floats]], prices: Sequence[Floats], value: Floats
) -> tuple[Floats, Floats]:
    """Go back over intervals: the cost of errors at the beginning, and gains (intervals, nu, n).

    Parameters
    ----------
    moves : sequence of ((n, n) float, (n, nu) float)
        What each interval makes of errors at its beginning and of torques that are held over it.
    prices : sequence of (n + nu, n + nu) float
        What errors at its beginning and torques cost meanwhile.
    value : (n, n) float
        Cost xᵀ V x of errors at the end.
    """
    found = []
    for (A, B), price in zip(reversed(moves), reversed(prices), strict=True):
        nx = len(A)
        answered = B.T @ value @ A + price[nx:, :nx]
        gain = np.linalg.solve(price[nx:, nx:] + B.T @ value @ B, answered)
        left, chosen = A - B @ gain, np.vstack([np.eye(nx), -gain])
        value = chosen.T @ price @ chosen + left.T @ value @ left
        found.append(gain)
    return value, np.array(found[::-1])


def over_all_steps(jump: Floats, sweep: Callable[[Floats], tuple[Floats, Kept]]) -> Kept:
    """Go back from step to step until costs repeat, and return what is kept of such a step.

    Parameters
    ----------
    jump : (n, n) float
        Errors at the beginning of a step by those at the end of the one before.
    sweep : callable
        Takes the cost xᵀ V x of errors at the end of a step; returns that of errors at its
        beginning, and what is kept of those between.

    Raises
    ------
    ControllerError
        If they never do: the motors do not reach enough.
    """
    value, before = np.zeros_like(jump), np.inf
    for _ in range(PERIODS):
        value, kept = sweep(jump.T @ value @ jump)
        size = np.abs(value).max()
        if not np.isfinite(size):
            break
        if abs(size - before) <= SETTLED * size:
            return kept
        before = size
    raise ControllerError(
        "no regulator stabilises this: the motors do not control all errors. Design another gait "
        "or motion"
    )
