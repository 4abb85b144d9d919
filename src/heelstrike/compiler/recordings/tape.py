"""A tape of the arithmetic that a kernel does: a graph of values, each made once, in order.

Run over values of a tape in place of numbers, a kernel leaves there what it computes. Zeros and
ones are folded away as it goes, and an operation that was done before is not done again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Symbols = NDArray[Any]


class Operation(Enum):
    """What is done to one or two operands."""

    ADD = "+"
    SUBTRACT = "-"
    MULTIPLY = "*"
    DIVIDE = "/"
    NEGATE = "negate"
    SINE = "sin"
    COSINE = "cos"
    ROOT = "square root"
    MAGNITUDE = "magnitude"
    LARGER = "the larger of both"
    SMALLER = "the smaller of both"
    INVERT_ABOVE = "inverse of the first if it is more than the second, or else zero"


COMMUTATIVE = (Operation.ADD, Operation.MULTIPLY)


@dataclass(frozen=True, eq=False, slots=True)
class Value:
    """A number that is known when the tape is played; `place` is where it stands on the tape."""

    tape: Tape = field(repr=False)
    place: int

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.tape.record(Operation.ADD, self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self.tape.record(Operation.SUBTRACT, self, other)

    def __rsub__(self, other: Any) -> Any:
        return -self if _is(other, 0.0) else self.tape.record(Operation.SUBTRACT, other, self)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return 0.0
        if _is(other, 1.0):
            return self
        if _is(other, -1.0):
            return -self
        return self.tape.record(Operation.MULTIPLY, self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self.tape.record(Operation.DIVIDE, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.tape.record(Operation.DIVIDE, other, self)

    def __neg__(self) -> Any:
        return self.tape.record(Operation.NEGATE, self)

    def __abs__(self) -> Any:
        return self.tape.record(Operation.MAGNITUDE, self)


@dataclass(frozen=True, eq=False, slots=True)
class Entry(Value):
    """What stands in an array when the tape begins; `index` counts its entries through."""

    array: str
    index: int


@dataclass(frozen=True, eq=False, slots=True)
class Result(Value):
    """What an operation makes of its operands: values, and numbers known already."""

    operation: Operation
    operands: tuple[Value | float, ...]


class Tape:
    """Values in the order in which they were made; operands stand before their results."""

    def __init__(self) -> None:
        self.values: list[Entry | Result] = []
        self._known: dict[tuple[Any, ...], Entry | Result] = {}

    def record(self, operation: Operation, *operands: Any) -> Result:
        """Return the result of an operation, new or done before."""
        known = [value if isinstance(value, Value) else float(value) for value in operands]
        if operation in COMMUTATIVE:  # the same sum, whichever term comes first
            known.sort(key=_name)
        return self._only(Result, (operation, *map(_name, known)), operation, tuple(known))

    def array(self, name: str, shape: tuple[int, ...]) -> Symbols:
        """Return the entries of an array."""
        result = np.empty(shape, dtype=object)
        for index in range(result.size):
            result.flat[index] = self._only(Entry, (name, index), name, index)
        return result

    def _only(self, kind: Any, key: tuple[Any, ...], *content: Any) -> Any:
        if key not in self._known:
            self._known[key] = kind(self, len(self.values), *content)
            self.values.append(self._known[key])
        return self._known[key]


def needed(values: Iterable[Any]) -> list[Any]:
    """Values on which some hang, and themselves, operands before their results."""
    waiting = [value for value in values if isinstance(value, Value)]
    found = set(waiting)
    while waiting:
        value = waiting.pop()
        operands = value.operands if isinstance(value, Result) else ()
        new = {each for each in operands if isinstance(each, Value)} - found
        found |= new
        waiting += new
    return sorted(found, key=lambda value: value.place)


def sine(value: Any) -> Any:
    """Sine of a number or of a value of a tape."""
    return value.tape.record(Operation.SINE, value) if _waits(value) else math.sin(value)


def cosine(value: Any) -> Any:
    """Cosine of a number or of a value of a tape."""
    return value.tape.record(Operation.COSINE, value) if _waits(value) else math.cos(value)


def root(value: Any) -> Any:
    """Square root of a number or of a value of a tape."""
    return value.tape.record(Operation.ROOT, value) if _waits(value) else math.sqrt(value)


def larger(one: Any, other: Any) -> Any:
    """The larger of two numbers or values of a tape; the second where the first is none."""
    recorded = _record(Operation.LARGER, one, other)
    return (one if one > other else other) if recorded is None else recorded


def smaller(one: Any, other: Any) -> Any:
    """The smaller of two numbers or values of a tape; the second where the first is none."""
    recorded = _record(Operation.SMALLER, one, other)
    return (one if one < other else other) if recorded is None else recorded


def _record(operation: Operation, *operands: Any) -> Any:
    """Record an operation on the tape of one of its operands, or return None if none has any."""
    for value in operands:
        if _waits(value):
            return value.tape.record(operation, *operands)
    return None


def inverse_above(value: Any, least: Any) -> Any:
    """Inverse of a number or of a value of a tape if it is more than `least`, or else zero."""
    if _waits(value):
        return value.tape.record(Operation.INVERT_ABOVE, value, least)
    return 1.0 / value if value > least else 0.0


def _waits(value: Any) -> bool:
    return isinstance(value, Value)


def _is(value: Any, number: float) -> bool:
    """Whether a value is known already, and is this number."""
    return not isinstance(value, Value) and value == number


def _name(operand: Value | float) -> str:
    """Its place, or the digits of a number, which has a point or an exponent."""
    return repr(operand.place if isinstance(operand, Value) else operand)
