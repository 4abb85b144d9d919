"""A tape of the arithmetic that a kernel does: each operation once, in order.

Run over values of a tape in place of numbers, a kernel leaves there what it computes. Zeros and
ones are folded away as it goes, and an operation that was done before is not done again.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE, SINE, COSINE, READ, INVERT_ABOVE = range(9)

Symbols = NDArray[Any]


class Value:
    """A number that is known when the tape is played."""

    __slots__ = ("place", "tape")

    def __init__(self, tape: Tape, place: int) -> None:
        self.tape = tape
        self.place = place

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.tape.record(ADD, self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.tape.record(SUBTRACT, self, other)

    def __rsub__(self, other: Any) -> Any:
        return -self if _is(other, 0.0) else self.tape.record(SUBTRACT, other, self)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return 0.0
        if _is(other, 1.0):
            return self
        if _is(other, -1.0):
            return -self
        return self.tape.record(MULTIPLY, self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self.tape.record(DIVIDE, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.tape.record(DIVIDE, other, self)

    def __neg__(self) -> Any:
        return self.tape.record(NEGATE, self)


class Tape:
    """Operations as ``(operation, operand, operand)``.

    An operand is the place of an earlier operation, or a float. The operands of ``READ`` are the
    name of an array and the index into it, counted through.
    """

    def __init__(self) -> None:
        self.operations: list[tuple[Any, ...]] = []
        self._places: dict[tuple[Any, ...], int] = {}  # by the kinds of operands, too: 1 == 1.0

    def record(self, operation: int, *operands: Any) -> Value:
        """Return the value of an operation, new or done before."""
        entry = (operation, *(_operand(operand) for operand in operands))
        if operation in (ADD, MULTIPLY) and repr(entry[2]) < repr(entry[1]):
            entry = (operation, entry[2], entry[1])  # the same sum, whichever term comes first
        return self._value(entry)

    def read(self, name: str, index: int) -> Value:
        """Return the value of one entry of an array."""
        return self._value((READ, name, index))

    def array(self, name: str, shape: tuple[int, ...]) -> Symbols:
        """Return the values of an array."""
        result = np.empty(shape, dtype=object)
        for index in range(result.size):
            result.flat[index] = self.read(name, index)
        return result

    def _value(self, entry: tuple[Any, ...]) -> Value:
        key = (*entry, *map(type, entry))
        place = self._places.setdefault(key, len(self.operations))
        if place == len(self.operations):
            self.operations.append(entry)
        return Value(self, place)


def sine(value: Any) -> Any:
    """Sine of a number or of a value of a tape."""
    return value.tape.record(SINE, value) if isinstance(value, Value) else math.sin(value)


def cosine(value: Any) -> Any:
    """Cosine of a number or of a value of a tape."""
    return value.tape.record(COSINE, value) if isinstance(value, Value) else math.cos(value)


def inverse_above(value: Any, least: Any) -> Any:
    """Inverse of a number or of a value of a tape if it is more than `least`, or else zero."""
    if isinstance(value, Value):
        return value.tape.record(INVERT_ABOVE, value, least)
    return 1.0 / value if value > least else 0.0


def _is(value: Any, number: float) -> bool:
    """Whether a value is known already, and is this number."""
    return not isinstance(value, Value) and value == number


def _operand(value: Any) -> int | float:
    return value.place if isinstance(value, Value) else float(value)
