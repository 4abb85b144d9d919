"""Code that computes with several numbers at once computes what the kernel does."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from llvmlite import ir

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import (
    Program,
    Recording,
    inverse_above,
    larger,
    smaller,
)
from heelstrike.compiler.recordings.tape import Result, needed
from heelstrike.compiler.side_by_side import Shapes, runs
from heelstrike.compiler.straight_line import add_function, play, straight_line_code

WIDTH = 11
"""Numbers of each array: a vector of eight, one of two, and one alone."""


@kernel
def called(address: int, *arguments: Any) -> None:
    play(address, arguments)


def signs_in_turns(a: Any, b: Any, c: Any, out: Any) -> None:
    for i in range(0, WIDTH - 1, 2):
        out[i] = c[0] * a[i] - b[i] * a[i + 1]
        out[i + 1] = c[0] * a[i + 1] + b[i] * a[i]


def places_far_apart(a: Any, b: Any, c: Any, out: Any) -> None:
    for i in range(WIDTH):
        out[i] = a[(7 * i) % WIDTH] + b[WIDTH - 1 - i] * c[i // 4] - larger(a[i], -b[0])


def from_the_half_to_one(a: Any, b: Any, c: Any, out: Any) -> None:
    for i in range(8):
        out[i] = smaller(a[i] * b[i], c[3])
    for width in (4, 2, 1):
        for i in range(width):
            out[i] = out[i] + out[width + i]


def what_is_needed_twice(a: Any, b: Any, c: Any, out: Any) -> None:
    for i in range(WIDTH):
        out[i] = abs(a[i]) + 2.0
    for i in range(WIDTH):
        out[i] = out[i] / (out[0] + out[WIDTH - 1]) + inverse_above(b[i], c[1]) * out[i - 1]


def of_angles(a: Any, b: Any, c: Any, out: Any) -> None:
    for i in range(WIDTH):
        out[i] = math.sin(a[i]) * b[i] - math.cos(a[i])


def deep(a: Any, b: Any, c: Any, out: Any) -> None:
    for i in range(WIDTH):
        out[i] = a[i]
    for _ in range(600):
        for i in range(WIDTH):
            out[i] = out[i] * b[0] + c[1]


def different_things(a: Any, b: Any, c: Any, out: Any) -> None:
    for i in range(WIDTH):
        out[i] = (a[i] if i % 3 else 0.5) * (b[i] if i % 2 else c[i % 4])


@pytest.mark.parametrize(
    "function",
    [
        signs_in_turns,
        places_far_apart,
        from_the_half_to_one,
        what_is_needed_twice,
        different_things,
    ],
)
def test_it_computes_what_the_kernel_does(function: Callable[..., None]) -> None:
    check(function, function.__name__)


def test_all_is_read_before_anything_is_written() -> None:
    """What stands alone is read before a vector is written over it; arrays may be the same."""

    def over(a: Any, out: Any) -> None:
        first = a[0]
        for i in range(8):
            a[i] = 2.0 * a[i]
        out[8] = first + 1.0

    a, out = np.arange(1.0, 10.0), np.zeros(9)
    (address,) = straight_line_code(
        [Program(over, {"a": a, "out": out}, name="over", side_by_side=True)]
    )
    called(address, a, out)
    assert out[8] == 2.0
    both = np.arange(1.0, 10.0)
    called(address, both, both)
    assert both.tolist() == [*2.0 * np.arange(1.0, 9.0), 2.0]


@pytest.mark.parametrize("seed", range(12))
def test_whatever_trees_stand_side_by_side(seed: int) -> None:
    """Trees drawn at random, some of them the same for all entries."""

    def drawn(a: Any, b: Any, c: Any, out: Any) -> None:
        draw = np.random.default_rng(seed)
        known = [[a[i], b[i], c[i % 4]] for i in range(WIDTH)]
        for _ in range(8):
            alike = draw.random() < 0.7
            choice = draw.integers(0, 6, WIDTH)
            one, other = draw.integers(0, len(known[0]), (2, WIDTH))
            for i in range(WIDTH):
                place = 0 if alike else i
                x, y = known[i][one[place]], known[i - draw.integers(0, 2)][other[place]]
                ways = (x + y, x - y, x * y, larger(x, y), abs(x) - y, -x * 0.5 + y)
                known[i].append(ways[choice[place]])
        for i in range(WIDTH):
            out[i] = known[i][-1] + known[i][-2]

    check(drawn, f"drawn_{seed}")


def check(function: Callable[..., None], name: str) -> None:
    draw = np.random.default_rng(3)
    a, b, c, out = draw.standard_normal(WIDTH), draw.random(WIDTH), draw.random(4), np.zeros(WIDTH)
    given = {"a": a, "b": b, "c": c, "out": out}
    program = Program(function, given, name=f"beside_{name}", side_by_side=True)
    (address,) = straight_line_code([program])
    expected = np.zeros(WIDTH)
    function(a, b, c, expected)
    called(address, a, b, c, out)
    np.testing.assert_allclose(out, expected, rtol=1e-13, atol=1e-14)


def test_many_numbers_take_few_instructions() -> None:
    """Signs in turns are an addition and a subtraction of all; nothing is done one by one."""
    given = {name: np.zeros(WIDTH) for name in ("a", "b", "c", "out")}
    recording = Recording(Program(signs_in_turns, given, side_by_side=True))
    module = ir.Module()
    add_function(module, recording)
    text = str(module)
    operations = [line for line in text.splitlines() if any(f" {o} " in line for o in OPERATIONS)]
    values = needed(value for *_, value in recording.written())
    assert len([value for value in values if isinstance(value, Result)]) == 30
    assert len(operations) <= 10
    assert any("<8 x double>" in line for line in operations)


OPERATIONS = ("fadd contract", "fsub contract", "fmul contract")


def test_vectors_are_as_wide_as_trees_are_alike() -> None:
    given = {name: np.zeros(WIDTH) for name in ("a", "b", "c", "out")}
    recording = Recording(Program(signs_in_turns, given))
    assert [len(lanes) for *_, lanes in runs(list(recording.written()), Shapes())] == [8, 2]
