"""Guard words: what lies round the arrays that a controller is handed.

Compiled code looks at no index. Round every array that a controller gets lie words that are not a
number, of a kind that no computation makes: what is read there spoils the torques, which is seen;
what is written there is seen because the words change. The words next to its own arrays are looked
at after every call, all of them whenever the compiled loop comes back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.words import word_at
from heelstrike.robot.model import Integers

ZONE = 64
"""Guard words on either side of an array."""

NEAR = 4
"""Those that are looked at after every call."""

GUARD = 0x7FF8_4845_454C_5354
"""Their bits: a NaN that no computation makes."""

_ZONE = np.full(ZONE, GUARD, dtype=np.int64).tobytes()

_Some = TypeVar("_Some", bound=Bundle)


def guarded(array: NDArray[Any]) -> NDArray[Any]:
    """Copy an array of 64-bit numbers into one of the same shape with guard words round it."""
    words = np.full(array.size + 2 * ZONE, GUARD, dtype=np.int64)
    return _inside(words, ZONE, array)


def guarded_bundle(bundle: _Some) -> _Some:
    """Copy a bundle, each array with guard words round it."""
    return bundle.stored(lambda _, array: guarded(array))


def in_one_block(bundle: _Some) -> tuple[_Some, Integers, Integers]:
    """Copy a bundle into one block of words, with guard words round each array.

    Returns
    -------
    bundle : Bundle
        The copy.
    block : (n,) int
        Its words from the first to the last, with the guard words between its arrays.
    between : (k,) int
        Where in the block the guard words begin that are next to an array, `NEAR` at each place.
    """
    sizes = [array.size for _, array in bundle.storage()] or [0]
    ends = np.cumsum(np.add(sizes, ZONE))
    words = np.full(ends[-1] + ZONE, GUARD, dtype=np.int64)
    begins = iter((ends - sizes).tolist())
    between = [(end - ZONE, end - NEAR) for end in ends[:-1]]
    return (
        bundle.stored(lambda _, array: _inside(words, next(begins), array)),
        _words(words, ZONE, (words.size - 2 * ZONE,), words.dtype),
        np.array(between, dtype=np.int64).ravel(),
    )


def _inside(words: Integers, place: int, array: NDArray[Any]) -> NDArray[Any]:
    """Copy an array to a place among words."""
    inside = _words(words, place, array.shape, array.dtype)
    inside[...] = array
    return inside


def _words(words: Integers, place: int, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Return some of the words; a slice of none would lie at the beginning."""
    return np.ndarray(shape, dtype, words, place * words.itemsize)


def trespasses(name: str, array: NDArray[Any]) -> Iterator[str]:
    """Tell where a controller wrote round a guarded array, and mend it."""
    words: Any = array.base
    first = (array.ctypes.data - words.ctypes.data) // words.itemsize
    for begin, offset in ((first - ZONE, -ZONE), (first + array.size, array.size)):
        zone = words[begin : begin + ZONE]
        if zone.tobytes() != _ZONE:
            for place in np.flatnonzero(zone != GUARD).tolist():
                yield f"{name}{_index(place + offset, array)} of shape {array.shape}"
            zone[:] = GUARD


def _index(place: int, array: NDArray[Any]) -> list[int]:
    """Index of the word so many after the first of an array."""
    if array.ndim < 2 or not array.shape[1]:
        return [place]
    return [place // array.shape[1], place % array.shape[1]]


@dissolved_kernel
def intact(array: Any) -> bool:
    """Whether the guard words next to a guarded array, or block, are what they were."""
    size, changed = array.size, 0
    for i in range(NEAR):  # all of them at once, without a branch
        changed |= (word_at(array, size + i) ^ GUARD) | (word_at(array, i - NEAR) ^ GUARD)
    return changed == 0


@kernel
def intact_between(block: Integers, between: Integers) -> bool:
    """Whether the guard words next to the arrays within a block are what they were."""
    changed = 0
    for i in range(between.shape[0]):
        first = between[i]
        for k in range(NEAR):  # a constant number of words at once, where no index is negative
            changed |= word_at(block, first + k) ^ GUARD
    return changed == 0
