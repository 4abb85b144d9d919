"""Arrays as the words of memory in which they lie."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


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


copy_words: Any = intrinsic(_copy_words)
"""``copy_words(source, target)``: copy an array into another, as far as both of them go."""
