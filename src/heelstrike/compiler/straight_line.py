"""Kernels of one robot as straight-line machine code.

A tree of links never changes while it moves. So kernels are run once over a tape
(:mod:`heelstrike.compiler.recordings`), which leaves their arithmetic without a loop, an index or a
product with zero; LLVM makes a function of that. It reads the robot's numbers from its model, so
that robots share it that differ in numbers only.

The function computes what the kernel computes, to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.fingerprint import fingerprint
from heelstrike.compiler.machine_code import addresses
from heelstrike.compiler.recordings.recording import CONSTANT, Program, Recording
from heelstrike.compiler.recordings.tape import Entry, Operation, Result, Symbols, Value, needed
from heelstrike.compiler.recordings.trigonometry import sine_and_cosine
from heelstrike.compiler.side_by_side import ANGLES, Shapes, Vectors, runs

_DOUBLE = ir.DoubleType()
_DOUBLE_BYTES = 8
_WORD = ir.IntType(64)
_POINTER = _WORD.as_pointer()
_ANGLES_AT_ONCE = 8
_FAR = 20
"""After so many results more, what stands in memory is read again from there: registers are few."""


def straight_line_code(
    programs: Sequence[Program], known: Mapping[str, Symbols] | None = None
) -> tuple[int, ...]:
    """Return the addresses of the straight-line code of some programs, for :func:`play`.

    Parameters
    ----------
    programs : sequence of Program
        What a program leaves in a bundle is known to those after it.
    known : mapping of str to array
        Arrays of numbers, ``argument.member``, that are the same always.
    """
    known = dict(known or {})

    @cache
    def recordings() -> list[Recording]:
        made, seen = [], dict(known)
        for program in programs:
            made.append(Recording(program, seen))
            seen |= made[-1].left()
        return made

    def write() -> ir.Module:
        module = ir.Module("straight_line")
        for recording in recordings():
            add_function(module, recording)
        return module

    described = [repr([(name, array.tolist()) for name, array in known.items()]).encode()]
    described += [program.description() for program in programs]
    made_of = fingerprint(
        Recording, Program, add_function, *(program.kernel for program in programs)
    )
    names = [program.name for program in programs]
    return addresses(names, b"\0".join(described), made_of, write)


def add_function(module: ir.Module, recording: Recording) -> None:
    """Write a recording down as a function of an LLVM module, under the program's name.

    Its parameters are the addresses of the arguments: the table of a bundle, the data of an array.
    """
    parameters = [_POINTER] * len(recording.program.arguments)
    kind = ir.FunctionType(ir.VoidType(), parameters)
    function = ir.Function(module, kind, recording.program.name)
    function.attributes.add("nounwind")
    writer = _SideBySide if recording.program.side_by_side else _Writer
    writer(ir.IRBuilder(function.append_basic_block()), recording).write()


class _Writer:
    """Writes one recording down."""

    def __init__(self, builder: ir.IRBuilder, recording: Recording) -> None:
        self.builder = builder
        self.recording = recording
        self._arrays: dict[str, Any] = {}
        self._values: dict[Value, Any] = {}
        self._unchanging = builder.module.add_metadata([])
        self._stored: dict[Value, tuple[str, int]] = {}
        self._since: dict[Value, int] = {}
        self._count = 0
        self._read_arrays: set[str] = set()
        self._unread: set[Entry] = set()
        self._unknown: dict[str, Any] = {}

    def write(self) -> None:
        results = self._needed()
        early, late = self._stores()
        self._angles(results)
        for value in results:
            number = self._emitted(value)
            self._count += 1
            self._since[value] = self._count
            for name, index in early.get(value, ()):
                if "." not in name and self._unread:
                    late.append((name, index, value))
                    continue
                self.builder.store(number, self._slot(name, index))
                self._stored[value] = name, index
        stores = [(self._emitted(value), name, index) for name, index, value in late]
        # All that is read has been read: nothing is overwritten too early.
        for number, name, index in stores:
            self.builder.store(number, self._slot(name, index))
        self.builder.ret_void()

    def _needed(self) -> list[Result]:
        """Results on which something hangs that is written, in order."""
        found = needed(value for *_, value in self.recording.written())
        entries = [value for value in found if isinstance(value, Entry)]
        self._read_arrays = {entry.array for entry in entries}
        self._unread = {entry for entry in entries if "." not in entry.array}
        return [value for value in found if isinstance(value, Result)]

    def _stores(self) -> tuple[dict[Value, list[tuple[str, int]]], list[tuple[str, int, Any]]]:
        """What is stored as soon as it is there, and what when all has been read.

        Nothing of an array is stored early of which something is read. Arrays that are arguments
        themselves may be the same: they are stored when all of these have been read.
        """
        early: dict[Value, list[tuple[str, int]]] = {}
        late = []
        for name, index, value in self.recording.written():
            at_once = isinstance(value, Result) and name not in self._read_arrays
            if at_once and not self.recording.program.side_by_side:
                early.setdefault(value, []).append((name, index))
            else:
                late.append((name, index, value))
        return early, late

    def _emitted(self, value: Any) -> Any:
        if not isinstance(value, Entry | Result):
            return ir.Constant(_DOUBLE, float(value))
        if value not in self._values:
            self._values[value] = (
                self._read(value) if isinstance(value, Entry) else self._computed(value)
            )
        elif value in self._stored and self._count - self._since[value] > _FAR:
            self._values[value] = self._read_again(*self._stored[value])
            self._since[value] = self._count
        return self._values[value]

    def _computed(self, result: Result) -> Any:
        return self.operate(result.operation, [self._emitted(each) for each in result.operands])

    def _read_again(self, name: str, index: int) -> Any:
        """Read what has been stored, through an address of which the compiler knows nothing.

        Otherwise it would know the number, and keep it in a register, or another place.
        """
        if name not in self._unknown:
            known = self._arrays[name]
            same = ir.InlineAsm(ir.FunctionType(known.type, [known.type]), "", "=r,0")
            self._unknown[name] = self.builder.call(same, [known])
        place = [ir.Constant(_WORD, index)]
        return self.builder.load(self.builder.gep(self._unknown[name], place, inbounds=True))

    def _read(self, entry: Entry) -> Any:
        self._unread.discard(entry)
        number = self.builder.load(self._slot(entry.array, entry.index))
        if entry.array.startswith(CONSTANT + "."):
            number.set_metadata("invariant.load", self._unchanging)
        return number

    def number(self, value: Any) -> Any:
        """Return a number."""
        return self._emitted(value)

    def read_beside(self, first: Entry, width: int) -> Any:
        """Read so many numbers of an array at once."""
        kind = ir.VectorType(_DOUBLE, width).as_pointer()
        slot = self.builder.bitcast(self._slot(first.array, first.index), kind)
        vector = self.builder.load(slot, align=_DOUBLE_BYTES)
        if first.array.startswith(CONSTANT + "."):
            vector.set_metadata("invariant.load", self._unchanging)
        return vector

    def operate(self, operation: Operation, values: Sequence[Any]) -> Any:
        """Emit an operation on numbers, or on vectors of them."""
        builder, kind = self.builder, values[0].type
        # A product and a sum may be fused, which rounds once instead of twice.
        match operation:
            case Operation.ADD:
                return builder.fadd(*values, flags=("contract",))
            case Operation.SUBTRACT:
                return builder.fsub(*values, flags=("contract",))
            case Operation.MULTIPLY:
                return builder.fmul(*values, flags=("contract",))
            case Operation.DIVIDE:
                return builder.fdiv(*values)
            case Operation.NEGATE:
                return builder.fneg(*values)
            case Operation.ROOT | Operation.MAGNITUDE:
                name = "llvm.sqrt" if operation is Operation.ROOT else "llvm.fabs"
                return builder.call(self._function(name, kind), values)
            case Operation.LARGER | Operation.SMALLER:
                sign = ">" if operation is Operation.LARGER else "<"
                return builder.select(builder.fcmp_ordered(sign, *values), *values)
            case Operation.INVERT_ABOVE:
                inverse = builder.fdiv(_filled(kind, 1.0), values[0])
                return builder.select(
                    builder.fcmp_ordered(">", *values), inverse, _filled(kind, 0.0)
                )
        raise ValueError(f"{operation} belongs to the angles")

    def _function(self, name: str, kind: Any) -> Any:
        """Return a function of LLVM that takes and gives numbers, or vectors of them."""
        module = self.builder.module
        name += "." + (f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64")
        known = module.globals.get(name)
        return known or ir.Function(module, ir.FunctionType(kind, [kind]), name)

    def _slot(self, name: str, index: int) -> Any:
        """Return the address of an entry of an array."""
        builder = self.builder
        if name not in self._arrays:
            holder, _, member = name.partition(".")
            arguments = self.recording.program.arguments
            word = builder.function.args[list(arguments).index(holder)]
            if member:
                place = arguments[holder].compiled_type().places[member]
                slot = builder.gep(word, [ir.Constant(_WORD, place)])
                address = builder.load(slot)
                address.set_metadata("invariant.load", self._unchanging)
                word = builder.inttoptr(address, _POINTER)
            self._arrays[name] = builder.bitcast(word, _DOUBLE.as_pointer())
        return builder.gep(self._arrays[name], [ir.Constant(_WORD, index)], inbounds=True)

    def _angles(self, results: list[Result]) -> None:
        """Sines and cosines, of many angles at once; no angle depends on another's."""
        waiting = [v for v in results if v.operation in ANGLES]
        angles = list(dict.fromkeys(value.operands[0] for value in waiting))
        found: dict[Any, Any] = {}
        for begin in range(0, len(angles), _ANGLES_AT_ONCE):
            group = angles[begin : begin + _ANGLES_AT_ONCE]
            vector: Any = ir.Constant(ir.VectorType(_DOUBLE, _ANGLES_AT_ONCE), None)
            for lane, angle in enumerate(group):
                vector = self.builder.insert_element(vector, self._emitted(angle), _lane(lane))
            both = sine_and_cosine(self.builder, vector)
            for lane, angle in enumerate(group):
                for operation, values in zip((Operation.SINE, Operation.COSINE), both, strict=True):
                    element = self.builder.extract_element(values, _lane(lane))
                    found[operation, angle] = element
        for value in waiting:
            self._values[value] = found[value.operation, value.operands[0]]


class _SideBySide(_Writer):
    """Writes one recording down that does the same with many numbers."""

    def __init__(self, builder: ir.IRBuilder, recording: Recording) -> None:
        super().__init__(builder, recording)
        self._shapes = Shapes()
        self._vectors = Vectors(self, self._shapes)

    def write(self) -> None:
        """Read all that is read before anything is written.

        What is left in scratch tells which numbers are alike, as much as what is written.
        """
        self._angles(self._needed())
        unread = self.recording.program.leaves_unread
        found = []
        changed = sorted(self.recording.changed(), key=lambda each: unread(each[0]))
        for array, index, lanes in runs(changed, self._shapes):
            beside = self._vectors.vector(lanes) if len(lanes) > 1 else lanes[0]
            if not unread(array):
                found.append((array, index, beside))
        found = [(array, index, self._read_or_made(each)) for array, index, each in found]
        for array, index, value in found:
            slot = self._slot(array, index)
            if isinstance(value.type, ir.VectorType):
                slot = self.builder.bitcast(slot, value.type.as_pointer())
            self.builder.store(value, slot, align=_DOUBLE_BYTES)
        self.builder.ret_void()

    def _read_or_made(self, value: Any) -> Any:
        """Return a vector, or the number that a value of the tape is."""
        return self._emitted(value) if isinstance(value, Value | float | int) else value

    def _computed(self, result: Result) -> Any:
        """Emit all that it is made of, one after the other: trees may be deep."""
        waiting = [result]
        while waiting:
            value = waiting[-1]
            beside = self._vectors.lane(value)
            operands = [each for each in value.operands if isinstance(each, Result)]
            missing = [each for each in operands if each not in self._values]
            if beside is None and missing:
                waiting.append(missing[0])
                continue
            waiting.pop()
            if value not in self._values:
                self._values[value] = super()._computed(value) if beside is None else beside
        return self._values[result]


def _filled(kind: Any, number: float) -> ir.Constant:
    """Return a number, or a vector of it."""
    many = isinstance(kind, ir.VectorType)
    return ir.Constant(kind, [number] * kind.count if many else number)


def _lane(lane: int) -> ir.Constant:
    return ir.Constant(ir.IntType(32), lane)


def _play(context: Any, address: Any, arguments: Any) -> Any:
    del context
    if any(isinstance(kind, types.Array) and kind.layout != "C" for kind in arguments):
        raise TypeError("straight-line code reads C-contiguous arrays only")
    signature = types.void(address, arguments)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        places = []
        for place, kind in enumerate(signature.args[1]):
            value = builder.extract_value(values[1], place)
            if isinstance(kind, types.Array):
                value = context.make_array(kind)(context, builder, value).data
            places.append(builder.bitcast(value, _POINTER))
        function = ir.FunctionType(ir.VoidType(), [_POINTER] * len(places))
        builder.call(builder.inttoptr(values[0], function.as_pointer()), places)
        return context.get_dummy_value()

    return signature, generate


@kernel
def is_code(address: int) -> bool:
    """Whether there is straight-line code at an address; there is none at zero."""
    return address != 0


play: Any = intrinsic(_play)
"""``play(address, arguments)`` calls machine code of :func:`add_function` from a kernel."""
