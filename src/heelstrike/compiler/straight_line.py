"""Kernels of one robot as straight-line machine code.

A tree of links never changes while it moves. So kernels are run once over a tape
(:mod:`heelstrike.compiler.tape`), which leaves their arithmetic without a loop, an index or a
product with zero; LLVM makes a function of that. It reads the robot's numbers from its model, so
that robots share it that differ in numbers only.

The function computes what the kernel computes, to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import uncompiled
from heelstrike.compiler.tape import (
    ADD,
    COSINE,
    DIVIDE,
    INVERT_ABOVE,
    MULTIPLY,
    NEGATE,
    READ,
    SINE,
    SUBTRACT,
    Symbols,
    Tape,
    Value,
    cosine,
    inverse_above,
    sine,
)
from heelstrike.compiler.trigonometry import sine_and_cosine

CONSTANT = "model"
"""The argument that never changes. Where its numbers are 0, 1 or -1, they are so in every robot
that shares the code."""

_RECORDED = {"sin": sine, "cos": cosine, "inverse_above": inverse_above}
"""What takes the place of functions that kernels call."""

_DOUBLE = ir.DoubleType()
_WORD = ir.IntType(64)
_POINTER = _WORD.as_pointer()
_ANGLES_AT_ONCE = 8


class Recording:
    """What a kernel does to its arguments.

    Parameters
    ----------
    kernel : kernel
        It may branch on integers, and on numbers of the model where they are 0, 1 or -1.
    arguments : mapping of str to Bundle or array
        Its arguments in order, with their true shapes.
    scratch : sequence of str
        Arrays, ``argument`` or ``argument.member``, whose contents nobody reads afterwards.
    known : mapping of str to array
        Arrays of which some entries are known numbers, for example from an earlier recording.
    """

    def __init__(
        self,
        kernel: Callable[..., None],
        arguments: Mapping[str, Any],
        *,
        scratch: tuple[str, ...] = (),
        known: Mapping[str, Symbols] | None = None,
    ) -> None:
        self.name = kernel.__name__
        self.arguments = dict(arguments)
        self.tape = Tape()
        self.arrays: dict[str, Symbols] = {}
        operands: list[Any] = []
        for name, argument in arguments.items():
            if isinstance(argument, Bundle):
                members = {
                    member: self._symbols(f"{name}.{member}", value, known or {})
                    if _is_floats(value)
                    else value
                    for member, value in argument.members().items()
                }
                operands.append(type(argument)(**members))
            elif _is_floats(argument):
                operands.append(self._symbols(name, argument, known or {}))
            else:
                operands.append(argument)
        uncompiled(kernel, replace=_RECORDED)(*operands)
        self._scratch = scratch

    def _symbols(self, name: str, value: Any, known: Mapping[str, Symbols]) -> Symbols:
        array = self.tape.array(name, value.shape)
        if name.split(".")[0] == CONSTANT:
            structural = _structural(value)
            array[structural] = value[structural].astype(float)
        elif name in known:
            for index, entry in enumerate(known[name].flat):
                if not isinstance(entry, Value):
                    array.flat[index] = entry
        self.arrays[name] = array
        return array

    def written(self) -> Iterator[tuple[str, int, Any]]:
        """Array, index and value of every entry that the kernel writes."""
        for name, array in self.arrays.items():
            if name in self._scratch or name.split(".")[0] == CONSTANT:
                continue
            for index, entry in enumerate(array.flat):
                unchanged = isinstance(entry, Value) and (
                    self.tape.operations[entry.place] == (READ, name, index)
                )
                if not unchanged:
                    yield name, index, entry


def description(kernel: Callable[..., None], arguments: Mapping[str, Any]) -> bytes:
    """What a recording of a kernel depends on besides its source."""
    parts = [kernel.__name__]
    for name, argument in arguments.items():
        members = argument.members() if isinstance(argument, Bundle) else {"": argument}
        for member, value in members.items():
            parts.append(f"{name}.{member}")
            if not _is_floats(value):
                parts.append(repr(np.asarray(value).tolist()))
            elif name == CONSTANT:
                parts.append(repr(np.where(_structural(value), value, 2.0).tolist()))
            else:
                parts.append(repr(value.shape))
    return "\0".join(parts).encode()


def _structural(value: Any) -> Any:
    return (value == 0.0) | (np.abs(value) == 1.0)


def _is_floats(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == np.float64


def add_function(module: ir.Module, recording: Recording) -> None:
    """Write a recording down as a function of an LLVM module, under the kernel's name.

    Its parameters are the addresses of the arguments: the table of a bundle, the data of an array.
    """
    parameters = [_POINTER] * len(recording.arguments)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), parameters), recording.name)
    function.attributes.add("nounwind")
    writer = _Writer(ir.IRBuilder(function.append_basic_block()), recording)
    writer.write()


class _Writer:
    """Writes one recording down."""

    def __init__(self, builder: ir.IRBuilder, recording: Recording) -> None:
        self.builder = builder
        self.recording = recording
        self._arrays: dict[str, Any] = {}
        self._values: dict[int, Any] = {}
        self._unchanging = builder.module.add_metadata([])

    def write(self) -> None:
        self._angles()
        operations = self.recording.tape.operations
        for place, operation in enumerate(operations):
            if operation[0] != READ:
                self._value(place)
        stores = [
            (self._value(entry.place if isinstance(entry, Value) else float(entry)), name, index)
            for name, index, entry in self.recording.written()
        ]
        # All that is read has been read: nothing is overwritten too early.
        for value, name, index in stores:
            self.builder.store(value, self._slot(name, index))
        self.builder.ret_void()

    def _value(self, operand: int | float) -> Any:
        if isinstance(operand, float):
            return ir.Constant(_DOUBLE, operand)
        if operand not in self._values:
            self._values[operand] = self._emit(*self.recording.tape.operations[operand])
        return self._values[operand]

    def _emit(self, operation: int, *operands: Any) -> Any:
        builder = self.builder
        if operation == READ:
            value = builder.load(self._slot(*operands))
            if operands[0].startswith(CONSTANT + "."):
                value.set_metadata("invariant.load", self._unchanging)
            return value
        values = [self._value(operand) for operand in operands]
        if operation == NEGATE:
            return builder.fneg(*values)
        if operation == DIVIDE:
            return builder.fdiv(*values)
        if operation == INVERT_ABOVE:
            value, least = values
            inverse = builder.fdiv(ir.Constant(_DOUBLE, 1.0), value)
            above = builder.fcmp_ordered(">", value, least)
            return builder.select(above, inverse, ir.Constant(_DOUBLE, 0.0))
        # A product and a sum may be fused, which rounds once instead of twice.
        emit = {ADD: builder.fadd, SUBTRACT: builder.fsub, MULTIPLY: builder.fmul}[operation]
        return emit(*values, flags=("contract",))

    def _slot(self, name: str, index: int) -> Any:
        """Return the address of an entry of an array."""
        builder = self.builder
        if name not in self._arrays:
            holder, _, member = name.partition(".")
            places = list(self.recording.arguments)
            word = builder.function.args[places.index(holder)]
            if member:
                kind = self.recording.arguments[holder]._numba_type_
                slot = builder.gep(word, [ir.Constant(_WORD, kind.place(member))])
                address = builder.load(slot)
                address.set_metadata("invariant.load", self._unchanging)
                word = builder.inttoptr(address, _POINTER)
            self._arrays[name] = builder.bitcast(word, _DOUBLE.as_pointer())
        return builder.gep(self._arrays[name], [ir.Constant(_WORD, index)], inbounds=True)

    def _angles(self) -> None:
        """Sines and cosines, of many angles at once; no angle depends on another's."""
        operations = self.recording.tape.operations
        angles = list(dict.fromkeys(op[1] for op in operations if op[0] in (SINE, COSINE)))
        results: dict[Any, Any] = {}
        for begin in range(0, len(angles), _ANGLES_AT_ONCE):
            group = angles[begin : begin + _ANGLES_AT_ONCE]
            vector: Any = ir.Constant(ir.VectorType(_DOUBLE, _ANGLES_AT_ONCE), None)
            for lane, angle in enumerate(group):
                vector = self.builder.insert_element(vector, self._value(angle), _lane(lane))
            both = sine_and_cosine(self.builder, vector)
            for lane, angle in enumerate(group):
                for function, values in zip((SINE, COSINE), both, strict=True):
                    results[function, angle] = self.builder.extract_element(values, _lane(lane))
        for place, operation in enumerate(operations):
            if operation[:2] in results:
                self._values[place] = results[operation[:2]]


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


play: Any = intrinsic(_play)
"""``play(address, arguments)`` calls machine code of :func:`add_function` from a kernel."""
