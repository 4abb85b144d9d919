"""Words of memory beyond what arrays own."""

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
