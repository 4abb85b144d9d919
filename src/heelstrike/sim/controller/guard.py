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
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import dissolved_kernel
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Contacts

ZONE = 64
"""Guard words on either side of an array."""

NEAR = 4
"""Those that are looked at after every call."""

GUARD = 0x7FF8_4845_454C_5354
"""Their bits: a NaN that no computation makes."""

_ZONE = np.full(ZONE, GUARD, dtype=np.int64).tobytes()

_Some = TypeVar("_Some", bound=Bundle)


def guarded(values: ArrayLike) -> Floats:
    """Copy numbers into an array of the same shape with guard words round it."""
    array = np.asarray(values, dtype=np.float64)
    block = np.full(array.size + 2 * ZONE, GUARD, dtype=np.int64)
    # A slice of no words would lie at the beginning.
    inside: Floats = np.ndarray(array.shape, np.float64, block, ZONE * block.itemsize)
    inside[...] = array
    return inside


def guarded_bundle(bundle: _Some) -> _Some:
    """Copy a bundle of arrays of floats, each with guard words round it."""
    return type(bundle)(**{name: guarded(array) for name, array in bundle.members().items()})


def trespasses(name: str, array: Floats) -> Iterator[str]:
    """Tell where a controller wrote round a guarded array, and mend it."""
    words: Any = array.base
    if words[:ZONE].tobytes() == _ZONE and words[ZONE + array.size :].tobytes() == _ZONE:
        return
    for place in np.flatnonzero(words != GUARD).tolist():
        if not ZONE <= place < ZONE + array.size:
            yield f"{name}{_index(place - ZONE, array)} of shape {array.shape}"
    words[:ZONE] = GUARD
    words[ZONE + array.size :] = GUARD


def _index(place: int, array: Floats) -> list[int]:
    """Index of the word so many after the first of an array."""
    if array.ndim < 2 or not array.shape[1]:
        return [place]
    return [place // array.shape[1], place % array.shape[1]]


def _word_at(context: Any, array: Any, place: Any) -> Any:
    del context, place
    signature = types.int64(array, types.int64)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, values[0]).data
        words = builder.bitcast(data, ir.IntType(64).as_pointer())
        return builder.load(builder.gep(words, [values[1]]))

    return signature, generate


word_at: Any = intrinsic(_word_at)
"""``word_at(array, place)``: bits of the word so many after the first, inside the array or not."""


@dissolved_kernel
def intact(array: Floats) -> bool:
    """Whether the guard words next to a guarded array are what they were."""
    size = array.size
    for i in range(NEAR):
        if word_at(array, size + i) != GUARD or word_at(array, -1 - i) != GUARD:
            return False
    return True


@dissolved_kernel
def imprint(q: Floats, v: Floats, contacts: Contacts) -> int:
    """Sum of the bits of state and contacts: another number when one of them has changed."""
    total = 0
    for i in range(q.size):
        total += word_at(q, i)
    for i in range(v.size):
        total += word_at(v, i)
    for i in range(contacts.gap.size):
        total += word_at(contacts.gap, i)
        for k in range(2):
            total += word_at(contacts.position, 2 * i + k)
            total += word_at(contacts.normal, 2 * i + k)
            total += word_at(contacts.force, 2 * i + k)
    return total
