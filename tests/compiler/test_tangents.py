"""Derivatives that are recorded on a tape are those of what the tape computes."""

from __future__ import annotations

import math
from math import cos, sin, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import (
    Program,
    Recording,
    inverse_above,
    larger,
    smaller,
)
from heelstrike.compiler.recordings.tangents import tangents
from heelstrike.compiler.recordings.tape import Entry, Operation, Result, Tape, Value

Floats = NDArray[np.float64]

PLAYED = {
    Operation.ADD: lambda a, b: a + b,
    Operation.SUBTRACT: lambda a, b: a - b,
    Operation.MULTIPLY: lambda a, b: a * b,
    Operation.DIVIDE: lambda a, b: a / b,
    Operation.NEGATE: lambda a: -a,
    Operation.SINE: math.sin,
    Operation.COSINE: math.cos,
    Operation.ROOT: math.sqrt,
    Operation.MAGNITUDE: abs,
    Operation.LARGER: max,
    Operation.SMALLER: min,
    Operation.INVERT_ABOVE: lambda a, b: 1.0 / a if a > b else 0.0,
}


def number(value: Any, given: dict[str, Floats]) -> float:
    """What a value of a tape comes to."""
    if not isinstance(value, Value):
        return float(value)
    if isinstance(value, Entry):
        return float(given[value.array].flat[value.index])
    operands = (number(each, given) for each in value.operands)  # type: ignore[attr-defined]
    return float(PLAYED[value.operation](*operands))  # type: ignore[attr-defined]


@kernel
def everything(x: Floats, y: Floats, result: Floats) -> None:
    """All operations that a tape knows."""
    result[0] = sin(x[0] * y[0]) / (2.0 + cos(x[1]))
    result[1] = -x[0] + y[0] * y[0] - 3.0
    result[2] = inverse_above(x[1], 0.5) * y[1]
    result[3] = 7.0
    result[4] = sqrt(x[1]) * abs(y[1]) + abs(y[0])
    result[5] = larger(x[0] * y[0], x[1]) + larger(y[1], 2.0 * x[0]) + larger(x[0], 0.0)
    result[5] = result[5] + smaller(x[0] * y[0], x[1]) * smaller(y[1], 2.0 * x[0])


def test_every_operation_has_its_derivative() -> None:
    """Against central differences of the same kernel; what is no value has none."""
    x, y = np.array([0.3, 0.8]), np.array([1.7, -0.4])
    given = {"x": x, "y": y, "result": np.zeros(6)}
    program = Program(
        everything, {**given, "slopes": np.zeros((6, 4))},
        derivatives={"slopes": ("result", ("x", "y"))},
    )  # fmt: skip
    recording = Recording(program)
    done = {each.operation for each in recording.tape.values if isinstance(each, Result)}
    assert done == set(Operation)
    recorded = recording.arrays["slopes"]
    found = np.array([[number(each, given) for each in row] for row in recorded])
    columns = []
    for each in 1e-6 * np.eye(4):
        ends = []
        for side in (1.0, -1.0):
            result = np.zeros(6)
            everything(x + side * each[:2], y + side * each[2:], result)
            ends.append(result)
        columns.append((ends[0] - ends[1]) / 2e-6)
    np.testing.assert_allclose(found, np.transpose(columns), atol=1e-9)
    assert recorded[1, 1] == 0.0  # known to be nothing
    assert not np.any(recorded[3])


def test_what_is_a_number_has_no_derivative() -> None:
    tape = Tape()
    (x,) = tape.array("x", (1,))
    found = tangents(np.array([x * x, 2.0], dtype=object), [x, 1.0])
    assert number(found[0, 0], {"x": np.array([3.0])}) == pytest.approx(6.0)
    assert found[0, 1] == found[1, 0] == found[1, 1] == 0.0
