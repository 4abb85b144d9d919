"""Derivatives of what a tape computes, recorded on the same tape.

Every value carries its derivatives by the chosen entries along, those that are not zero by its
structure (forward accumulation: A. Griewank, A. Walther, *Evaluating derivatives*, 2008, chapter
3). What the values and their derivatives have in common is on the tape once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from heelstrike.compiler.recordings.tape import (
    Entry,
    Operation,
    Result,
    Symbols,
    Value,
    cosine,
    inverse_above,
    needed,
    sine,
)

_PARTIAL: dict[Operation, Callable[..., tuple[Any, ...]]] = {
    Operation.ADD: lambda _, *__: (1.0, 1.0),
    Operation.SUBTRACT: lambda _, *__: (1.0, -1.0),
    Operation.MULTIPLY: lambda _, one, other: (other, one),
    Operation.DIVIDE: lambda ratio, _, below: (1.0 / below, -ratio / below),
    Operation.NEGATE: lambda _, __: (-1.0,),
    Operation.SINE: lambda _, angle: (cosine(angle),),
    Operation.COSINE: lambda _, angle: (-sine(angle),),
    Operation.ROOT: lambda root, _: (0.5 / root,),
    Operation.MAGNITUDE: lambda magnitude, value: (value / magnitude,),
    Operation.LARGER: lambda _, one, other: _shares(one - other),
    Operation.SMALLER: lambda _, one, other: _shares(other - one),
    Operation.INVERT_ABOVE: lambda inverse, *_: (-inverse * inverse, 0.0),
}
"""Derivatives of a result by its operands, of the result and of these."""


def _shares(difference: Any) -> tuple[Any, Any]:
    """What one of two numbers changes with each, by how clearly the first is chosen."""
    first = inverse_above(difference, 0.0) * difference
    return first, 1.0 - first


def tangents(values: Symbols, by: Sequence[Any]) -> Symbols:
    """Return the derivatives of values by entries of their tape.

    Parameters
    ----------
    values : (m,) array
        Values of a tape, or numbers.
    by : sequence of k
        Entries of the tape. What is a number has no derivative by it.

    Returns
    -------
    (m, k) array
        Values of the tape, or numbers.
    """
    seeds = {entry: {k: 1.0} for k, entry in enumerate(by) if isinstance(entry, Entry)}
    known: dict[Value, dict[int, Any]] = {}
    for value in needed(values):
        known[value] = seeds.get(value, {}) if isinstance(value, Entry) else _carried(value, known)
    found = np.zeros((len(values), len(by)), dtype=object)
    for row, value in enumerate(values):
        for column, slope in known.get(value, {}).items() if isinstance(value, Value) else ():
            found[row, column] = slope
    return found


def _carried(result: Result, known: dict[Value, dict[int, Any]]) -> dict[int, Any]:
    """Derivatives of a result, from those of its operands."""
    total: dict[int, Any] = {}
    partial = _PARTIAL[result.operation](result, *result.operands)
    for operand, slope in zip(result.operands, partial, strict=True):
        for k, change in known[operand].items() if isinstance(operand, Value) else ():
            total[k] = total.get(k, 0.0) + slope * change
    return total
