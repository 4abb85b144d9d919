"""What is made of an object once, and kept as long as the object lives."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TypeVar
from weakref import WeakKeyDictionary

Key = TypeVar("Key")
Value = TypeVar("Value")


def once_each(function: Callable[[Key], Value]) -> Callable[[Key], Value]:
    """Let a function be called once for each object, and its results be kept.

    Parameters
    ----------
    function : callable
        Takes one object. What it returns must not hold that object.

    Returns
    -------
    callable
        The same, quicker from the second call on.
    """
    known: WeakKeyDictionary[Key, Value] = WeakKeyDictionary()

    @functools.wraps(function)
    def kept(key: Key) -> Value:
        if key not in known:
            known[key] = function(key)
        return known[key]

    return kept
