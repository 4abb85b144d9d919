"""A kernel reaches little more than it uses, as its source and annotations say."""

from __future__ import annotations

from typing import NamedTuple

import pytest
from written_arguments import (
    kernels_of,
    leaves_of,
    reach_of,
    touched_by,
    use_of,
    writes_of,
    written_by,
)

import heelstrike.contact
import heelstrike.dynamics
import heelstrike.sim
from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.compilation import Kernel, kernel
from heelstrike.robot.model import Floats

FEW = 40
"""Arrays and numbers that any kernel may reach: three bundles of a purpose each."""

ANY_METHOD = "the frame hands every method the same"

EXCEPTIONS = {
    "sim.time_stepping.method.prepare": ANY_METHOD,
    "sim.time_stepping.method.move": ANY_METHOD,
    "sim.compliant.method.begin": ANY_METHOD,
    "sim.compliant.method.prepare": ANY_METHOD,
    "sim.compliant.method.decide": ANY_METHOD,
    "sim.compliant.method.report": ANY_METHOD,
    "sim.event_driven.method.prepare": ANY_METHOD,
    "sim.spatial.method.prepare": ANY_METHOD,
    "sim.spatial.method.move": ANY_METHOD,
    "sim.contacts.candidates.note_answer": "one call for whoever writes a method",
}
"""Kernels that reach more than twice what they use, and why: at most ten."""


def reaches_too_far(each: Kernel) -> bool:
    return reach_of(each) > max(FEW, 2 * use_of(each))


def test_a_kernel_reaches_little_more_than_it_uses() -> None:
    """Nested bundles count as what is in them; what a kernel calls uses it, too."""
    found = {
        f"{each.py_func.__module__}.{each.__name__}".removeprefix("heelstrike.")
        for package in (heelstrike.dynamics, heelstrike.contact, heelstrike.sim)
        for each in kernels_of(package)
        if reaches_too_far(each)
    }
    assert found == set(EXCEPTIONS)
    assert len(EXCEPTIONS) <= 10


class Inner(Bundle):
    first: Floats = array(2)
    second: Floats = array(2)


class Outer(Bundle):
    inner: Inner = part(Inner)
    count: int = cell(int)
    others: Floats = array(2)


@kernel
def add_first(inner: Inner) -> float:
    return inner.first[0] + inner.first[1]


@kernel
def add_first_of(outer: Outer, scale: float) -> float:
    inner, others = outer.inner, outer.others
    outer.count += 1
    return scale * add_first(inner) + others.shape[0]


class Both(NamedTuple):
    inner: Inner
    outer: Outer


@kernel
def count_both(both: Both) -> float:
    both.outer.count += 1
    return add_first(both.inner)


@kernel
def make_both(inner: Inner, outer: Outer) -> float:
    both = Both(inner, outer)
    return count_both(both)


@kernel
def hand_over(outer: Outer, ask: object) -> float:
    return ask(outer)  # type: ignore[operator, no-any-return]


def test_what_a_kernel_uses_is_found_through_names_and_calls() -> None:
    assert touched_by(add_first) == {("inner", "first")}
    assert touched_by(add_first_of) == {
        ("outer", "inner", "first"), ("outer", "others"), ("outer", "count"), ("scale",),
    }  # fmt: skip


def test_a_tuple_stands_for_each_of_what_it_is_made_of() -> None:
    assert touched_by(make_both) == {("inner", "first"), ("outer", "count")}
    assert writes_of(make_both) == {("outer", "count")}
    assert written_by(make_both) == {"outer"}


@pytest.mark.parametrize(
    ("each", "reach", "use"), [(add_first, 2, 1), (add_first_of, 5, 4), (hand_over, 5, 5)]
)
def test_nested_bundles_count_as_what_is_in_them(each: Kernel, reach: int, use: int) -> None:
    """Of what nobody can read, as a function that is handed over, all is used."""
    assert leaves_of(Outer) == 4
    assert (reach_of(each), use_of(each)) == (reach, use)
