"""What is made of an object once is kept as long as the object lives, and no longer."""

from __future__ import annotations

import gc
import weakref

from heelstrike.once_each import once_each


class Thing:
    """Something that can be referred to weakly."""


def test_made_once_each_and_let_go() -> None:
    calls: list[int] = []

    @once_each
    def made_of(thing: Thing) -> list[int]:
        """Say what it is made of."""
        calls.append(id(thing))
        return [len(calls)]

    one, other = Thing(), Thing()
    assert made_of(one) is made_of(one)
    assert made_of(other) is not made_of(one)
    assert len(calls) == 2
    assert made_of.__doc__ == "Say what it is made of."
    gone = weakref.ref(one)
    del one
    gc.collect()
    assert gone() is None
