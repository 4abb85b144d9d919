"""A kernel reaches little more than it uses, as its source and annotations say."""

from __future__ import annotations

from collections import Counter
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

NOT_YET: dict[str, int] = {
    "sim.compliant.corners": 1,
    "sim.compliant.dynamics": 14,
    "sim.compliant.method": 13,
    "sim.contacts.brakes": 2,
    "sim.contacts.candidates": 5,
    "sim.contacts.geometry": 5,
    "sim.contacts.latches": 3,
    "sim.controller.asking": 4,
    "sim.controller.motors": 2,
    "sim.controller.stance_clock": 2,
    "sim.event_driven.bridge": 1,
    "sim.event_driven.method": 1,  # every method prepares with the same arguments
    "sim.event_driven.moving": 1,
    "sim.event_driven.smooth.candidates": 1,
    "sim.event_driven.smooth.corners": 1,
    "sim.event_driven.smooth.faces": 4,
    "sim.event_driven.smooth.watch": 2,
    "sim.linearized.time_step": 2,
    "sim.record.recording": 7,
    "sim.spatial.candidates": 1,
    "sim.spatial.controlled": 2,  # the frame asks in space as in the plane
    "sim.spatial.method": 4,
    "sim.time_stepping.corners": 1,
    "sim.time_stepping.method": 16,
}
"""How many kernels of each module reach more than twice what they use; none may be added."""


def reaches_too_far(each: Kernel) -> bool:
    return reach_of(each) > max(FEW, 2 * use_of(each))


def test_a_kernel_reaches_little_more_than_it_uses() -> None:
    """Nested bundles count as what is in them; what a kernel calls uses it, too."""
    found: Counter[str] = Counter()
    for package in (heelstrike.dynamics, heelstrike.contact, heelstrike.sim):
        for each in kernels_of(package):
            module = each.py_func.__module__.removeprefix("heelstrike.")
            found[module] += reaches_too_far(each)
    assert {module: count for module, count in found.items() if count} == NOT_YET


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
