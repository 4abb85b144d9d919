"""Sine and cosine of many angles at once, as LLVM instructions.

The quadrant is taken off by a multiple of π/2 in parts (Cody and Waite 1980), exact through fused
multiply-add; or, on processors without it, through parts so short that their multiples are exact,
with the rounding of the differences made good (Knuth 1969). The rest, within ±π/4, goes through the
polynomials of the Freely Distributable Math Library (fdlibm, Sun Microsystems 1993, ``k_sin.c`` and
``k_cos.c``). Errors stay within two units in the last place for angles up to a million radians.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir

from heelstrike.compiler.machine_code import can_fuse

_PARTS = tuple(
    map(float.fromhex, ("0x1.921fb54442d18p+0", "0x1.1a62633145c07p-54", "-0x1.f1976b7ed8fbcp-110"))
)
"""π/2 in three parts, to 160 bits."""

_SHORT_PARTS = tuple(
    map(
        float.fromhex,
        ("0x1.921fb544p+0", "0x1.0b4611a6p-34", "0x1.3198a2e0p-69", "0x1.b839a252049c1p-104"),
    )
)
"""π/2 in parts of 33 bits and a rest: a million times one of them is a double."""

_ROUNDER = 1.5 * 2.0**52
"""Added to a double, it pushes all bits below one out and the integer into the low bits."""

_SINE = (
    1.58969099521155010221e-10,
    -2.50507602534068634195e-08,
    2.75573137070700676789e-06,
    -1.98412698298579493134e-04,
    8.33333333332248946124e-03,
    -1.66666666666666324348e-01,
)
_COSINE = (
    -1.13596475577881948265e-11,
    2.08757232129817482790e-09,
    -2.75573143513906633035e-07,
    2.48015872894767294178e-05,
    -1.38888888888741095749e-03,
    4.16666666666666019037e-02,
)


def sine_and_cosine(builder: ir.IRBuilder, angle: Any) -> tuple[Any, Any]:
    """Emit sine and cosine of a vector of doubles."""
    lanes = angle.type.count
    integers = ir.VectorType(ir.IntType(64), lanes)

    def constant(value: float) -> Any:
        return ir.Constant(angle.type, [value] * lanes)

    def whole(value: int) -> Any:
        return ir.Constant(integers, [value] * lanes)

    def fma(a: Any, b: Any, c: Any) -> Any:
        if not can_fuse():
            return builder.fadd(builder.fmul(a, b), c)
        name = f"llvm.fma.v{lanes}f64"
        kind = ir.FunctionType(angle.type, [angle.type] * 3)
        fused = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
        return builder.call(fused, (a, b, c))

    shifted = fma(angle, constant(2.0 / math.pi), constant(_ROUNDER))
    quadrant = builder.bitcast(shifted, integers)
    turns = builder.fsub(shifted, constant(_ROUNDER))
    rest = angle
    if can_fuse():
        for part in _PARTS:
            rest = fma(turns, constant(-part), rest)
    else:
        *exact, last = (builder.fmul(turns, constant(part)) for part in _SHORT_PARTS)
        lost = builder.fneg(last)
        for part in exact:
            rest, rounding = _difference(builder, rest, part)
            lost = builder.fadd(lost, rounding)
        rest = builder.fadd(rest, lost)

    square = builder.fmul(rest, rest)
    sine = constant(_SINE[0])
    for coefficient in _SINE[1:]:
        sine = fma(sine, square, constant(coefficient))
    sine = fma(builder.fmul(sine, square), rest, rest)
    cosine = constant(_COSINE[0])
    for coefficient in _COSINE[1:]:
        cosine = fma(cosine, square, constant(coefficient))
    half = fma(square, constant(-0.5), constant(1.0))
    cosine = fma(builder.fmul(square, square), cosine, half)

    odd = builder.icmp_signed("!=", builder.and_(quadrant, whole(1)), whole(0))
    # Bit 1 of the quadrant, moved to the sign: sine changes it in quadrants 2, 3, cosine in 1, 2.
    sine_sign = builder.shl(builder.and_(quadrant, whole(2)), whole(62))
    next_quadrant = builder.add(quadrant, whole(1))
    cosine_sign = builder.shl(builder.and_(next_quadrant, whole(2)), whole(62))

    def signed(value: Any, sign: Any) -> Any:
        return builder.bitcast(builder.xor(builder.bitcast(value, integers), sign), angle.type)

    return (
        signed(builder.select(odd, cosine, sine), sine_sign),
        signed(builder.select(odd, sine, cosine), cosine_sign),
    )


def _difference(builder: ir.IRBuilder, a: Any, b: Any) -> tuple[Any, Any]:
    """Emit a - b, rounded, and what the rounding has lost."""
    rounded = builder.fsub(a, b)
    virtual = builder.fsub(rounded, a)
    lost = builder.fsub(builder.fsub(a, builder.fsub(rounded, virtual)), builder.fadd(b, virtual))
    return rounded, lost
