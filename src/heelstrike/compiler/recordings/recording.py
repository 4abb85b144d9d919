"""What a kernel does to its arguments, recorded on a tape."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import kernel, uncompiled
from heelstrike.compiler.recordings import tape
from heelstrike.compiler.recordings.tangents import tangents
from heelstrike.compiler.recordings.tape import Entry, Symbols, Tape, Value
from heelstrike.field_texts import dataclass

CONSTANT = "model"
"""The argument that never changes. Where its numbers are 0, 1 or -1, they are so in every robot
that shares the code."""


@kernel
def inverse_above(value: float, least: float) -> float:
    """Inverse of a number if it is more than `least`, or else zero."""
    return 1.0 / value if value > least else 0.0


@kernel
def larger(one: float, other: float) -> float:
    """The larger of two numbers; the second where the first is none."""
    return one if one > other else other


@kernel
def smaller(one: float, other: float) -> float:
    """The smaller of two numbers; the second where the first is none."""
    return one if one < other else other


_RECORDED = {
    math.sin: tape.sine, math.cos: tape.cosine, math.sqrt: tape.root,
    inverse_above: tape.inverse_above, larger: tape.larger, smaller: tape.smaller,
}  # fmt: skip
"""What takes the place of functions that kernels call; no other function may be asked for a
number that is not known yet."""


@dataclass(frozen=True)
class Program:
    """A kernel and the arguments to record it with."""

    kernel: Callable[..., Any]
    """The kernel. It may branch on integers, and on numbers of the model where they are 0, 1 or
    -1."""
    arguments: Mapping[str, Any]
    """Its arguments in order, bundles and arrays, with their true shapes. Arrays may be the same,
    those in bundles may not."""
    scratch: tuple[str, ...] = ()
    """Arrays, ``argument`` or ``argument.member``, and bundles whose contents nobody reads
    afterwards."""
    name: str = ""
    """Name of the function that is made of it; else the kernel's."""
    side_by_side: bool = False
    """Whether it does the same with many numbers that stand side by side, so that machine code does
    it with several at once. Of others it is made so that each result is out of the way soon."""
    derivatives: Mapping[str, tuple[str, tuple[str, ...]]] = field(default_factory=dict)
    """Arrays of arguments that the kernel does not take and that receive derivatives, (m, k): each
    with the array that the kernel has written, of m numbers, and those of k numbers by which."""

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.kernel.__name__)

    def structural(self, name: str, value: Any) -> Any:
        """Tell which numbers of an array of the model are so in all robots that share the code."""
        by = {each for _, entries in self.derivatives.values() for each in entries}
        return np.zeros(value.shape, dtype=bool) if name in by else is_structural(value)

    def description(self) -> bytes:
        """What its recording depends on besides the source of its kernel."""
        parts = [self.name, *self.scratch, repr(sorted(self.derivatives.items()))]
        parts.append(repr(self.side_by_side))
        for name, value in self._members():
            parts.append(name)
            if isinstance(value, Bundle):  # it does not take part
                continue
            if not _is_floats(value):
                parts.append(repr(np.asarray(value).tolist()))
            elif name.split(".")[0] == CONSTANT:
                parts.append(repr(np.where(self.structural(name, value), value, 2.0).tolist()))
            else:
                parts.append(repr(value.shape))
        return "\0".join(parts).encode()

    def leaves_unread(self, name: str) -> bool:
        """Whether nobody reads an array afterwards."""
        return name in self.scratch or name.split(".")[0] in self.scratch

    def _members(self) -> Iterator[tuple[str, Any]]:
        for name, argument in self.arguments.items():
            if isinstance(argument, Bundle):
                for member, value in argument.members().items():
                    yield f"{name}.{member}", value
            else:
                yield name, argument


class Recording:
    """What the kernel of a program does to its arguments.

    Parameters
    ----------
    program : Program
        The kernel and its arguments.
    known : mapping of str to array
        Arrays of which some entries are known numbers, for example from an earlier recording.

    Attributes
    ----------
    tape : Tape
        The operations.
    arrays : dict of str to array
        What the kernel leaves in its arrays.

    Raises
    ------
    TypeError
        If a bundle has cells that others read.
    """

    def __init__(self, program: Program, known: Mapping[str, Symbols] | None = None) -> None:
        self.program = program
        self.tape = Tape()
        self.arrays: dict[str, Symbols] = {}
        operands: list[Any] = []
        receiving = {name.split(".")[0] for name in program.derivatives}
        for name, argument in program.arguments.items():
            if name in receiving:
                continue
            if isinstance(argument, Bundle):
                cells = any(member.role == "cell" for member in argument.declared.values())
                if cells and not program.leaves_unread(name):
                    raise TypeError(f"{name} has cells, which a recording would take for constants")
                members = {
                    member: self._symbols(f"{name}.{member}", value, known or {})
                    for member, value in argument.members().items()
                }
                operands.append(type(argument)(**members))
            else:
                operands.append(self._symbols(name, argument, known or {}))
        began = {name: array.copy() for name, array in self.arrays.items()}
        uncompiled(program.kernel, replace=_RECORDED)(*operands)
        for name, (of, by) in program.derivatives.items():
            entries = np.concatenate([began[each].ravel() for each in by])
            self.arrays[name] = tangents(self.arrays[of].ravel(), list(entries))

    def _symbols(self, name: str, value: Any, known: Mapping[str, Symbols]) -> Any:
        if not _is_floats(value):
            return value
        array = self.tape.array(name, value.shape)
        if name.split(".")[0] == CONSTANT:
            structural = self.program.structural(name, value)
            array[structural] = value[structural].astype(float)
        elif name in known:
            for index, entry in enumerate(known[name].astype(object).flat):
                if not isinstance(entry, Value):
                    array.flat[index] = entry
        self.arrays[name] = array
        return array

    def written(self) -> Iterator[tuple[str, int, Any]]:
        """Array, index and value of every entry that the kernel writes for others to read."""
        return (each for each in self.changed() if not self.program.leaves_unread(each[0]))

    def changed(self) -> Iterator[tuple[str, int, Any]]:
        """The same of all that it writes, whether somebody reads it or not."""
        for name, array in self.arrays.items():
            if name.split(".")[0] == CONSTANT:
                continue
            for index, entry in enumerate(array.flat):
                unchanged = isinstance(entry, Entry) and (entry.array, entry.index) == (name, index)
                if not unchanged:
                    yield name, index, entry

    def left(self) -> dict[str, Symbols]:
        """What it leaves in its bundles: in places it is the same number always."""
        return {
            name: array
            for name, array in self.arrays.items()
            if "." in name
            and name.split(".")[0] != CONSTANT
            and not self.program.leaves_unread(name)
        }


def is_structural(value: Any) -> Any:
    """Tell which numbers of the model code is made for: zeros, and ones of either sign."""
    return (value == 0.0) | (np.abs(value) == 1.0)


def _is_floats(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == np.float64
