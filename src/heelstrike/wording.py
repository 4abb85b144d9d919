"""Words that messages share: things counted, some of many, and what a misspelt name may mean."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence

LONGEST_GUESS = 40
"""Letters of a word that are looked at: a longer one is no misspelt name."""


def counted(number: int, one: str, many: str) -> str:
    """Count things in words: ``1 phase``, ``2 phases``."""
    return f"{number} {one if number == 1 else many}"


def some_of(items: Sequence[str], most: int, between: str = ", ") -> str:
    """Name the first of several things and count the others: ``a, b and 3 more``."""
    others = len(items) - most
    joined = " and" if between == ", " else f"{between}and"
    return between.join(items[:most]) + (f"{joined} {others} more" if others > 0 else "")


def meant(
    name: str, known: Iterable[str] | Mapping[str, str], words: str = " Did you mean {}?"
) -> str:
    """Guess which name somebody means who wrote another; nothing where none is near.

    Parameters
    ----------
    name : str
        What was written.
    known : iterable of str, or mapping to str
        The names that there are; of a mapping the guess is told as it has it, else in quotes.
    words : str
        How the guess is told.
    """
    near = difflib.get_close_matches(name[:LONGEST_GUESS], sorted(known), n=1)
    shown = known if isinstance(known, Mapping) else {each: repr(each) for each in near}
    return words.format(shown[near[0]]) if near else ""
