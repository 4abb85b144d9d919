"""Riccati equations of walks: what errors cost in all steps to come."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats

PERIODS = 400
SETTLED = 1e-10
"""Steps until gains are those of all further ones, to this part of the largest cost."""


def over_all_steps(jump: Floats, sweep: Callable[[Floats], tuple[Floats, Floats]]) -> Floats:
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
        "no regulator stabilises this walk: its motors do not control all of its errors. "
        "Design another gait"
    )
