"""Words of memory: those in which arrays lie, and those in which values can be kept."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from heelstrike.compiler.compilation import kernel


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

_MAGNITUDE = 2**63 - 1
"""All bits of a number but its sign."""


def bits_of(number: float) -> int:
    """Return the bits of a number."""
    return int(np.float64(number).view(np.int64))


@kernel
def stay_below(limit: int, numbers: Any) -> bool:
    """Whether no number of an array is larger, either way, than the one with the bits `limit`.

    Bits of positive numbers have the order of the numbers, so that several can be compared at once
    without a branch. What is no number is larger than any.
    """
    beyond = 0
    for i in range(numbers.shape[0]):
        beyond |= limit - (word_at(numbers, i) & _MAGNITUDE)
    return beyond >= 0


def _word_from(context: Any, address: Any) -> Any:
    del context, address

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del context, signature
        return builder.load(builder.inttoptr(values[0], ir.IntType(64).as_pointer()))

    return types.int64(types.int64), generate


word_from: Any = intrinsic(_word_from)
"""``word_from(address)``: bits of the word at an address."""


def _copy_words(context: Any, source: Any, target: Any) -> Any:
    del context
    signature = types.void(source, target)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pairs = zip(signature.args, values, strict=True)
        found = [context.make_array(kind)(context, builder, value) for kind, value in pairs]
        byte = ir.IntType(8).as_pointer()
        copy = builder.module.declare_intrinsic("llvm.memcpy", [byte, byte, ir.IntType(64)])
        ends = [builder.bitcast(array.data, byte) for array in reversed(found)]
        few = builder.icmp_signed("<", found[0].nitems, found[1].nitems)
        count = builder.select(few, found[0].nitems, found[1].nitems)
        size = builder.mul(count, found[0].itemsize)
        builder.call(copy, [*ends, size, ir.Constant(ir.IntType(1), 0)])
        return context.get_dummy_value()

    return signature, generate


def _copy_between(context: Any, source: Any, target: Any, count: Any) -> Any:
    del context, source, target, count

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del signature
        byte = ir.IntType(8).as_pointer()
        copy = builder.module.declare_intrinsic("llvm.memcpy", [byte, byte, ir.IntType(64)])
        source, target = (builder.inttoptr(value, byte) for value in values[:2])
        size = builder.mul(values[2], ir.Constant(ir.IntType(64), 8))
        builder.call(copy, [target, source, size, ir.Constant(ir.IntType(1), 0)])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


copy_between: Any = intrinsic(_copy_between)
"""``copy_between(source, target, count)``: copy so many words from an address to another."""

VALUE = 4
"""Words that the value of a compiled function takes up, and more."""


def _keep_value(context: Any, value: Any, words: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        value, words = values
        if context.get_abi_sizeof(value.type) > 8 * VALUE:
            raise NotImplementedError(f"{signature.args[0]} is longer than {VALUE} words")
        builder.store(value, _pointer(context, builder, signature.args[1], words, value.type))
        return context.get_dummy_value()

    return types.void(value, words), generate


keep_value: Any = intrinsic(_keep_value)
"""``keep_value(value, words)``: keep a value in words of memory, for :func:`kept_value`."""


@cache
def kept_value(kind: Any) -> Any:
    """Return an intrinsic that returns the value of a type that is kept in words of memory.

    To hand a function to compiled code takes twenty times as long as to call it: Numba looks for
    its addresses in Python. Kept, it is found by them.
    """

    def define(context: Any, words: Any) -> Any:
        del context

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            found = context.get_value_type(signature.return_type)
            return builder.load(_pointer(context, builder, signature.args[0], values[0], found))

        return kind(words), generate

    return intrinsic(define)


def _pointer(context: Any, builder: Any, array: Any, value: Any, kind: Any) -> Any:
    data = context.make_array(array)(context, builder, value).data
    return builder.bitcast(data, kind.as_pointer())


copy_words: Any = intrinsic(_copy_words)
"""``copy_words(source, target)``: copy an array into another, as far as both of them go."""
