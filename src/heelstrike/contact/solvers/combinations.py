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
from heelstrike.contact.workspace import Combinations, Integers, Tally

FEW = 5
"""Contacts up to which all combinations are tried: 4^5 are a thousand."""

MOST = 8000
"""Combinations of many contacts that are tried before giving up, if there are up to eight; of more
contacts fewer, so that the work is the same: each is an elimination."""

CHOICES = SLIP_BACKWARD + 1

GOLDEN = 0.6180339887498949


@kernel
def begin_combinations(
    count: int, best: Integers, residual: float, combinations: Combinations
) -> None:
    """Begin with the modes of the best candidate so far, (count,), and its residual."""
    combinations.place = 0
    combinations.tried = 0
    combinations.starts = 0
    combinations.least = residual
    for contact in range(count):
        combinations.base[contact] = best[contact]


@kernel
def next_combination(
    count: int, tangent: Integers, tally: Tally, combinations: Combinations, mode: Integers
) -> bool:
    """Write the next combination to ``mode``; return whether there is one.

    ``tangent`` is -1 where a contact has no friction.
    """
    number = combinations.place
    combinations.place += 1
    if count > FEW:
        if combinations.tried >= most_of(count):
            return False
        if number >= CHOICES * CHOICES * count * (count // 2 + 1):
            start_elsewhere(count, combinations)
            number = 0
            combinations.place = 1
        change_two(count, number, tangent, combinations.base, mode)
        combinations.tried += 1
        number = 0
    else:
        for contact in range(count):
            choices = CHOICES if tangent[contact] >= 0 else STICK + 1
            mode[contact] = OPEN + number % choices
            number //= choices
    tally.iterations += 1
    return number == 0


@kernel
def most_of(count: int) -> int:
    """How many combinations of so many contacts are tried."""
    return MOST * 8**3 // max(count, 8) ** 3


@kernel
def note_residual(count: int, residual: float, mode: Integers, combinations: Combinations) -> None:
    """Go on from the combination under trial if its residual is the least since the start."""
    if count > FEW and residual < combinations.least:
        combinations.least = residual
        combinations.place = 0
        for contact in range(count):
            combinations.base[contact] = mode[contact]


@kernel
def start_elsewhere(count: int, combinations: Combinations) -> None:
    """Go on from modes that have nothing to do with those before."""
    combinations.starts += 1
    combinations.least = math.inf
    for contact in range(count):
        share = (GOLDEN * combinations.starts * (contact + 1)) % 1.0
        combinations.base[contact] = int(CHOICES * share)


@kernel
def change_two(count: int, number: int, tangent: Integers, base: Integers, mode: Integers) -> None:
    """Write the base with the modes of two contacts changed, or of one where they are the same.

    The two are neighbours at first, then further apart.
    """
    changes = CHOICES * CHOICES
    first = number // changes % count
    second = (first + number // (changes * count)) % count
    for contact in range(count):
        mode[contact] = base[contact]
    mode[second] = number % changes // CHOICES
    mode[first] = number % CHOICES
    for contact in range(count):
        if tangent[contact] < 0:
            mode[contact] = min(mode[contact], STICK)
