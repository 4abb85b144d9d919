"""Straight-line code that computes with several numbers at once.

What a recording writes side by side is made of like trees of operations, so that one instruction
does the same for many numbers: whole trees are laid over each other, from what is written down to
what is read (S. Larsen, S. Amarasinghe, *Exploiting superword level parallelism with multimedia
instruction sets*, 2000). The tape tells which trees are alike, where a compiler has to guess.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from llvmlite import ir

from heelstrike.compiler.recordings.tape import COMMUTATIVE, Entry, Operation, Result, Value

_DOUBLE = ir.DoubleType()
_PLACE = ir.IntType(32)
MOST_LANES = 8
"""Numbers in the widest vector."""

SUMS = (Operation.ADD, Operation.SUBTRACT)
ANGLES = (Operation.SINE, Operation.COSINE)
"""SUMS, ANGLES: An instruction and its twin; what is computed of all angles before all else."""

Lanes = tuple[Any, ...]
"""Values of a tape and numbers, one for each lane of a vector."""


class Shapes:
    """Which values of a tape are made alike: by the same operations of entries of the same arrays.

    Values with the same shape differ in the indices of these entries, and in signs.
    """

    def __init__(self) -> None:
        self._known: dict[Any, int] = {}
        self._names: dict[Any, int] = {}

    def of(self, value: Any) -> int:
        """Return the number of a shape."""
        waiting = [value]
        while waiting:  # trees may be deep
            each = waiting[-1]
            operands = each.operands if isinstance(each, Result) else ()
            missing = [operand for operand in operands if operand not in self._known]
            if missing:
                waiting += missing
                continue
            self._known[waiting.pop()] = self._named(each)
        return self._known[value]

    def _named(self, value: Any) -> int:
        if isinstance(value, Result) and value.operation is Operation.NEGATE:
            return self._known[value.operands[0]]
        return self._names.setdefault(self._name(value), len(self._names))

    def _name(self, value: Any) -> Any:
        if isinstance(value, Entry):
            return value.array
        if not isinstance(value, Result):
            return float(value)
        operands = [self._known[each] for each in value.operands]
        if value.operation in SUMS or value.operation in COMMUTATIVE:
            operands.sort()
        return "sum" if value.operation in SUMS else value.operation, *operands


def runs(
    written: Sequence[tuple[str, int, Any]], shapes: Shapes
) -> Iterator[tuple[str, int, Lanes]]:
    """Divide what is written into vectors: array, first index, and one value for each lane.

    A vector is as wide as trees are alike, or alike in turns of two.
    """
    place = 0
    while place < len(written):
        array, index, _ = written[place]
        width = MOST_LANES
        while width > 1:
            group = written[place : place + width]
            beside = all(each[:2] == (array, index + k) for k, each in enumerate(group))
            if len(group) == width and beside and _are_alike([each[2] for each in group], shapes):
                break
            width //= 2
        yield array, index, tuple(each[2] for each in written[place : place + width])
        place += width


def _are_alike(values: Sequence[Any], shapes: Shapes) -> bool:
    if not all(isinstance(value, Value) for value in values):
        return False
    if len(values) == 2:
        return shapes.of(values[0]) == shapes.of(values[1])
    return all(len({shapes.of(value) for value in values[k::2]}) == 1 for k in range(2))


class Vectors:
    """Vectors of values of one recording: trees of operations laid over each other.

    Parameters
    ----------
    writer : writer of one recording
        Emits single values, operations and addresses.
    shapes : Shapes
    """

    def __init__(self, writer: Any, shapes: Shapes) -> None:
        self.writer = writer
        self.shapes = shapes
        self._vectors: dict[Lanes, Any] = {}
        self._home: dict[Value, tuple[Any, int]] = {}

    def vector(self, lanes: Lanes) -> Any:
        """Return the vector of some values."""
        waiting = [lanes]
        while waiting:  # trees may be deep
            missing = [each for each in self._parts(waiting[-1]) if each not in self._vectors]
            if missing:
                waiting.append(missing[0])
                continue
            found = waiting.pop()
            if found not in self._vectors:
                self._vectors[found] = self._made(found)
        return self._vectors[lanes]

    def lane(self, value: Value) -> Any:
        """Return a number from the vector that it is in, or None if it is in none."""
        if value not in self._home:
            return None
        vector, lane = self._home[value]
        return self.writer.builder.extract_element(vector, ir.Constant(_PLACE, lane))

    def _made(self, lanes: Lanes) -> Any:
        if len(set(lanes)) == 1:
            return self._spread(lanes)
        if not any(isinstance(value, Value) for value in lanes):
            return ir.Constant(ir.VectorType(_DOUBLE, len(lanes)), [float(x) for x in lanes])
        if self._are_at_home(lanes):
            vector = self._home[lanes[0]][0]
            return self._shuffled(vector, vector, [self._home[value][1] for value in lanes])
        if self._are_entries(lanes):
            return self._read(lanes)
        if self._are_alike(lanes):
            return self._computed(lanes)
        return self._in_turns(lanes) if self._turns(lanes) else self._gathered(lanes)

    def _parts(self, lanes: Lanes) -> list[Lanes]:
        """Vectors from which that of some values is made."""
        if lanes in self._vectors or len(set(lanes)) == 1 or self._are_at_home(lanes):
            return []
        if self._are_entries(lanes):
            return [] if self._are_near(lanes) else self._turns(lanes)
        if self._are_alike(lanes):
            return self._operands(lanes)
        return self._turns(lanes)

    def _are_at_home(self, lanes: Lanes) -> bool:
        """Whether all are in one vector already."""
        homes = {id(self._home[value][0]) if value in self._home else None for value in lanes}
        return len(homes) == 1 and None not in homes

    def _are_entries(self, lanes: Lanes) -> bool:
        """Whether all are entries of one array."""
        kinds = {value.array if isinstance(value, Entry) else None for value in lanes}
        return len(kinds) == 1 and None not in kinds

    def _are_near(self, lanes: Lanes) -> bool:
        """Whether all from the first to the last of some entries of an array are few."""
        places = [value.index for value in lanes]
        return max(places) - min(places) < 2 * len(lanes)

    def _are_alike(self, lanes: Lanes) -> bool:
        """Whether one instruction computes all, or one and its twin."""
        kinds = {self._kind(value) for value in lanes}
        results = all(isinstance(value, Result) for value in lanes)
        return len(kinds) == 1 and results and lanes[0].operation not in ANGLES

    def _kind(self, value: Any) -> Any:
        """What has to be the same of values that one instruction computes, or one and its twin."""
        operation = getattr(value, "operation", None)
        return self.shapes.of(value), "sum" if operation in SUMS else operation

    def _computed(self, lanes: Lanes) -> Any:
        """Apply the operation of all lanes to the vectors of their operands."""
        differences = [value for value in lanes if value.operation is Operation.SUBTRACT]
        leader = (differences or lanes)[0]
        vectors = [self.vector(each) for each in self._operands(lanes)]
        vector = self.writer.operate(leader.operation, vectors)
        if 0 < len(differences) < len(lanes) and leader.operation in SUMS:
            total = self.writer.operate(Operation.ADD, vectors)
            order = [
                lane if value.operation is Operation.SUBTRACT else lane + len(lanes)
                for lane, value in enumerate(lanes)
            ]
            vector = self._shuffled(vector, total, order)
        for lane, value in enumerate(lanes):
            self._home.setdefault(value, (vector, lane))
        return vector

    def _operands(self, lanes: Lanes) -> list[Lanes]:
        """Operands of all lanes: the first of each, and so on."""
        differences = [value for value in lanes if value.operation is Operation.SUBTRACT]
        leader = (differences or lanes)[0]
        return list(zip(*(self._ordered(value, leader) for value in lanes), strict=True))

    def _ordered(self, value: Result, leader: Result) -> list[Any]:
        """Operands in the order of those of another lane."""
        if value.operation not in COMMUTATIVE:
            return list(value.operands)
        one, other = value.operands
        a, b = leader.operands
        if self.shapes.of(a) != self.shapes.of(b):
            swapped = self.shapes.of(one) != self.shapes.of(a)
        else:
            swapped = other is a or one is b
        return [other, one] if swapped else [one, other]

    def _read(self, lanes: Lanes) -> Any:
        """Read entries of an array, at once with what is between them if that is little."""
        if not self._are_near(lanes):
            return self._in_turns(lanes) if self._turns(lanes) else self._gathered(lanes)
        places = [value.index for value in lanes]
        begin = min(places)
        vector = self.writer.read_beside(lanes[places.index(begin)], max(places) - begin + 1)
        return self._shuffled(vector, vector, [place - begin for place in places])

    def _in_turns(self, lanes: Lanes) -> Any:
        """Lay vectors of every second lane, or of both halves, into each other."""
        half, parts = len(lanes) // 2, self._turns(lanes)
        one, other = (self.vector(part) for part in parts)
        order = list(range(len(lanes)))
        if parts[0] == lanes[0::2]:
            order = [lane // 2 + half * (lane % 2) for lane in order]
        return self._shuffled(one, other, order)

    def _turns(self, lanes: Lanes) -> list[Lanes]:
        """Every second lane and the others, or both halves, if they are more alike than all."""
        half = len(lanes) // 2
        if half < 2 or len(lanes) % 2 == 1:
            return []
        turns, halves = [lanes[0::2], lanes[1::2]], [lanes[:half], lanes[half:]]
        return turns if self._kinds(turns) <= min(2, self._kinds(halves)) else halves

    def _kinds(self, parts: list[Lanes]) -> int:
        return sum(len({self._kind(value) for value in part}) for part in parts)

    def _gathered(self, lanes: Lanes) -> Any:
        vector: Any = ir.Constant(ir.VectorType(_DOUBLE, len(lanes)), ir.Undefined)
        for lane, value in enumerate(lanes):
            number = self.writer.number(value)
            place = ir.Constant(_PLACE, lane)
            vector = self.writer.builder.insert_element(vector, number, place)
        return vector

    def _spread(self, lanes: Lanes) -> Any:
        kind = ir.VectorType(_DOUBLE, len(lanes))
        if not isinstance(lanes[0], Value):
            return ir.Constant(kind, [float(lanes[0])] * len(lanes))
        nothing = ir.Constant(kind, ir.Undefined)
        number = self.writer.number(lanes[0])
        vector = self.writer.builder.insert_element(nothing, number, ir.Constant(_PLACE, 0))
        return self._shuffled(vector, vector, [0] * len(lanes))

    def _shuffled(self, one: Any, other: Any, places: list[int]) -> Any:
        if one is other and places == list(range(one.type.count)):
            return one
        mask = ir.Constant(ir.VectorType(_PLACE, len(places)), places)
        return self.writer.builder.shuffle_vector(one, other, mask)
