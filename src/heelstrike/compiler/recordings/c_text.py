"""Recordings of kernels as a page of C99, for compilers that know nothing of this package.

The numbers of the model stand in tables at the head of the page. How an entry of an array is
reached is said in one place (:meth:`_Function.entry`): memory of another layout, such as many
robots interleaved, is another way to say it and no other kernel.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from heelstrike.compiler.recordings.recording import CONSTANT, Recording
from heelstrike.compiler.recordings.tape import Entry, Operation, Result, Value

_WRITTEN = {
    Operation.ADD: "{} + {}",
    Operation.SUBTRACT: "{} - {}",
    Operation.MULTIPLY: "{} * {}",
    Operation.DIVIDE: "{} / {}",
    Operation.NEGATE: "-{}",
    Operation.SINE: "sin({})",
    Operation.COSINE: "cos({})",
    Operation.ROOT: "sqrt({})",
    Operation.MAGNITUDE: "fabs({})",
    Operation.LARGER: "{0} > {1} ? {0} : {1}",
    Operation.SMALLER: "{0} < {1} ? {0} : {1}",
    Operation.INVERT_ABOVE: "{0} > {1} ? 1.0 / {0} : 0.0",
}


def c_text(recordings: Sequence[Recording], words: Sequence[str], *, prefix: str, head: str) -> str:
    """Write recordings down as functions of C.

    Parameters
    ----------
    recordings : sequence of Recording
        Their arrays of floats, but for the model's and scratch, are the functions' parameters.
    words : sequence of str
        What stands above each of them.
    prefix : str
        What all names begin with.
    head : str
        What stands at the head of the page.

    Returns
    -------
    str
        A page of C99 that needs ``math.h`` only.

    Raises
    ------
    ValueError
        If a kernel reads scratch that it has not written.
    """
    functions = [_Function(recording, prefix) for recording in recordings]
    tables: dict[str, str] = {}
    for function in functions:
        tables |= function.tables()
    parts = [_comment(head), "#include <math.h>", "\n".join(tables.values())]
    for function, said in zip(functions, words, strict=True):
        parts.append(f"{_comment(said)}\n{function.text()}")
    return "\n\n".join(parts) + "\n"


class _Function:
    """One recording, and the names of what is in it."""

    def __init__(self, recording: Recording, prefix: str) -> None:
        self.recording = recording
        self.prefix = prefix
        self.written = list(recording.written())
        self.names: dict[Value, str] = {}
        needed = [value for *_, value in self.written if isinstance(value, Value)]
        self.needed = set(needed)
        while needed:
            value = needed.pop()
            operands = value.operands if isinstance(value, Result) else ()
            new = {each for each in operands if isinstance(each, Value)} - self.needed
            self.needed |= new
            needed += new
        for value in recording.tape.values:
            if value in self.needed and not _is_constant(value):
                self.names[value] = f"t{len(self.names)}"

    def tables(self) -> dict[str, str]:
        """Tables of the model's numbers that are read, by name."""
        found = {}
        model = self.recording.program.arguments[CONSTANT]
        for entry in self._entries():
            if _is_constant(entry):
                member = entry.array.partition(".")[2]
                values = np.ravel(getattr(model, member))
                numbers = textwrap.fill(", ".join(map(_number, values)), 96)
                name = f"static const double {self.prefix}_{member}[{values.size}]"
                found[member] = f"{name} = {{\n{textwrap.indent(numbers, '    ')}\n}};"
        return found

    def text(self) -> str:
        """Return the whole function."""
        changed = {name for name, _, _ in self.written}
        parameters = [
            f"{'' if name in changed else 'const '}double {name.replace('.', '_')}[{array.size}]"
            for name, array in self.recording.arrays.items()
            if not self._is_hidden(name)
        ]
        lines = [f"void {self.prefix}_{self.recording.program.name}(\n    "]
        lines[0] += ",\n    ".join(parameters) + ")\n{"
        used = changed | {entry.array for entry in self._entries()}
        for name in self.recording.arrays:
            if name not in used and not self._is_hidden(name):
                lines.append(f"    (void){name.replace('.', '_')};")  # of an argument that is idle
        # All is read before anything is written: parameters may be the same array.
        for value, name in self.names.items():
            lines.append(f"    const double {name} = {self._expression(value)};")
        for name, index, value in self.written:
            lines.append(f"    {self.entry(name, index)} = {self._name(value)};")
        return "\n".join([*lines, "}"])

    def entry(self, array: str, index: int) -> str:
        """Return how an entry of an array is reached."""
        holder, _, member = array.partition(".")
        name = f"{self.prefix}_{member}" if holder == CONSTANT else array.replace(".", "_")
        return f"{name}[{index}]"

    def _is_hidden(self, name: str) -> bool:
        return name in self.recording.program.scratch or name.split(".")[0] == CONSTANT

    def _entries(self) -> Iterator[Entry]:
        for value in self.recording.tape.values:
            if isinstance(value, Entry) and value in self.needed:
                if value.array in self.recording.program.scratch:
                    raise ValueError(f"{self.recording.program.name} reads {value.array} too early")
                yield value

    def _expression(self, value: Any) -> str:
        if isinstance(value, Result):
            return _WRITTEN[value.operation].format(*map(self._name, value.operands))
        return self.entry(value.array, value.index)

    def _name(self, value: Any) -> str:
        if not isinstance(value, Value):
            return f"({_number(value)})"
        return self.names.get(value) or self._expression(value)


def _is_constant(value: Value) -> bool:
    return isinstance(value, Entry) and value.array.startswith(f"{CONSTANT}.")


def _number(value: Any) -> str:
    return repr(float(value))


def _comment(text: str) -> str:
    text = text.strip().replace("*/", "* /").replace("/*", "/ *")  # names are anybody's
    lines = text.splitlines()
    return "\n".join(["/* " + lines[0], *(f" * {line}".rstrip() for line in lines[1:])]) + " */"
