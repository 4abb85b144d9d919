"""Combinations of contact modes, one after the other: the last resort.

Lemke's method ends in a ray although there is a solution where internal forces work against the
free velocity, and iterations may wander. Of few contacts all combinations can be tried. Of many,
those that differ at one contact or two from the best so far, again and again until none is better;
then the same from another start.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.modes import OPEN, SLIP_BACKWARD, STICK
from heelstrike.contact.workspace import (
    BASE_MODE,
    ITERATIONS,
    PROGRESS,
    TANGENT,
    TRIAL_MODE,
    ContactWorkspace,
    Integers,
)

FEW = 5
"""Contacts up to which all combinations are tried: 4^5 are a thousand."""

MOST = 8000
"""Combinations of many contacts that are tried before giving up."""

CHOICES = SLIP_BACKWARD + 1

# Places in ``PROGRESS``.
PLACE = 0  # number of the next combination, or of the next change of the base
TRIED = 1  # combinations tried
LEAST = 2  # residual of the base
STARTS = 3  # how many bases were started from

GOLDEN = 0.6180339887498949


@kernel
def begin_combinations(count: int, best: Integers, residual: float, work: ContactWorkspace) -> None:
    """Begin with the modes of the best candidate so far, (count,), and its residual."""
    progress = work.vectors[PROGRESS]
    progress[PLACE] = 0.0
    progress[TRIED] = 0.0
    progress[LEAST] = residual
    progress[STARTS] = 0.0
    for contact in range(count):
        work.labels[BASE_MODE, contact] = best[contact]


@kernel
def next_combination(count: int, work: ContactWorkspace) -> bool:
    """Write the next combination to ``TRIAL_MODE``; return whether there is one."""
    progress = work.vectors[PROGRESS]
    if count <= FEW:
        return every_combination(count, work)
    if progress[TRIED] >= MOST:
        return False
    if progress[PLACE] >= CHOICES * CHOICES * count * (count // 2 + 1):
        start_elsewhere(count, work)
    change_two(count, int(progress[PLACE]), work)
    progress[PLACE] += 1.0
    progress[TRIED] += 1.0
    work.counters[ITERATIONS] += 1
    return True


@kernel
def note_residual(count: int, residual: float, work: ContactWorkspace) -> None:
    """Go on from the combination under trial if its residual is the least since the start."""
    progress = work.vectors[PROGRESS]
    if count > FEW and residual < progress[LEAST]:
        progress[LEAST] = residual
        progress[PLACE] = 0.0
        for contact in range(count):
            work.labels[BASE_MODE, contact] = work.labels[TRIAL_MODE, contact]


@kernel
def every_combination(count: int, work: ContactWorkspace) -> bool:
    """Write the combination of number ``PLACE``, or return that there are no more."""
    progress = work.vectors[PROGRESS]
    rest = int(progress[PLACE])
    for contact in range(count):
        choices = CHOICES if work.labels[TANGENT, contact] >= 0 else STICK + 1
        work.labels[TRIAL_MODE, contact] = OPEN + rest % choices
        rest //= choices
    progress[PLACE] += 1.0
    work.counters[ITERATIONS] += 1
    return rest == 0


@kernel
def start_elsewhere(count: int, work: ContactWorkspace) -> None:
    """Go on from modes that have nothing to do with those before."""
    progress = work.vectors[PROGRESS]
    progress[STARTS] += 1.0
    progress[PLACE] = 0.0
    progress[LEAST] = math.inf
    for contact in range(count):
        share = (GOLDEN * progress[STARTS] * (contact + 1)) % 1.0
        work.labels[BASE_MODE, contact] = int(CHOICES * share)


@kernel
def change_two(count: int, number: int, work: ContactWorkspace) -> None:
    """Write the base with the modes of two contacts changed, or of one where they are the same.

    The two are neighbours at first, then further apart.
    """
    mode = work.labels[TRIAL_MODE]
    changes = CHOICES * CHOICES
    first = number // changes % count
    second = (first + number // (changes * count)) % count
    for contact in range(count):
        mode[contact] = work.labels[BASE_MODE, contact]
    mode[second] = number % changes // CHOICES
    mode[first] = number % CHOICES
    for contact in range(count):
        if work.labels[TANGENT, contact] < 0:
            mode[contact] = min(mode[contact], STICK)
