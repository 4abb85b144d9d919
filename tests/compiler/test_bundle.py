"""Bundles: the same members in compiled code as in Python."""

from __future__ import annotations

import copy
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import types

from heelstrike.compiler import private_numba
from heelstrike.compiler.bundle import Bundle, array, cell, extent, number, part
from heelstrike.compiler.compilation import kernel, loop_for, numba_in_use


class Inner(Bundle):
    values: np.ndarray = array("n")


class Outer(Bundle):
    count: int = number(int)
    scale: float = number(float)
    turns: int = cell(int)
    row: np.ndarray = array("columns + 1")
    rows: int = extent()
    columns: int = extent()
    matrix: np.ndarray = array("rows", "columns")
    cube: np.ndarray = array("rows", 3, "2 rows")
    labels: np.ndarray = array(2, of=int)
    angle: float = cell(float)
    inner: Inner = part(Inner)


@kernel
def everything(bundle: Outer, result: np.ndarray) -> int:
    result[0] = bundle.count
    result[1] = bundle.scale
    result[2] = bundle.row[-1]
    result[3] = bundle.matrix[1, 2]
    result[4] = bundle.cube[1, 0, 3]
    result[5] = bundle.labels[1]
    result[6] = bundle.inner.values[0]
    result[7] = bundle.matrix[1].sum()
    bundle.inner.values[0] += 1.0
    bundle.cube[1, :, 0] = 7.0
    bundle.turns += 2
    bundle.angle = 0.5 * bundle.turns
    return bundle.rows * bundle.cube.size


def make() -> Outer:
    return Outer(
        count=-3,
        scale=0.1,
        row=np.arange(4.0),
        matrix=np.arange(6.0).reshape(2, 3),
        cube=np.arange(24.0).reshape(2, 3, 4),
        labels=np.array([5, -6]),
        angle=-8.0,
        inner=Inner(values=np.array([11.0])),
    )


def test_members_read_and_written_in_compiled_code() -> None:
    bundle, result = make(), np.zeros(8)
    assert everything(bundle, result) == 2 * 24
    assert result.tolist() == [-3.0, 0.1, 3.0, 5.0, 15.0, -6.0, 11.0, 12.0]
    assert bundle.inner.values[0] == 12.0
    assert np.all(bundle.cube[1, :, 0] == 7.0)
    assert (bundle.turns, bundle.angle) == (2, 1.0)
    bundle.turns = 5
    everything(bundle, result)
    assert (bundle.turns, bundle.angle) == (7, 3.5)


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))])
def test_a_copy_has_arrays_of_its_own(clone) -> None:
    bundle, result = make(), np.zeros(8)
    everything(bundle, result)  # the original has its table by now
    other = clone(bundle)
    everything(other, result)
    assert bundle.inner.values[0] == 12.0
    assert other.inner.values[0] == 13.0
    assert (bundle.turns, other.turns) == (2, 4)


@pytest.mark.parametrize("row", [np.arange(8.0)[::2], np.arange(4, dtype=np.float32)])
def test_an_array_that_compiled_code_would_misread_is_refused(row: np.ndarray) -> None:
    members = make().members() | {"row": row}
    with pytest.raises(TypeError, match="C-contiguous"):
        everything(Outer(**members), np.zeros(8))


def test_threads_that_ask_at_once_get_one_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled code holds the address: a second table in the place of the first would free it."""
    barrier, make_table = threading.Barrier(2), Bundle._new_table

    def together(bundle: Bundle) -> np.ndarray:
        barrier.wait(10.0)
        return make_table(bundle)

    monkeypatch.setattr(Bundle, "_new_table", together)
    bundle = Inner(values=np.arange(3.0))
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda _: bundle.table, range(2))
    assert first is second is bundle.table
    assert bundle.address == first.ctypes.data


def test_what_bundles_share_is_not_copied() -> None:
    """Addresses of machine code are read-only; a copy may be from before they were known."""
    shared = np.arange(3.0)
    shared.flags.writeable = False
    bundle, other = Inner(values=shared), Inner(values=np.zeros(3))
    bundle.become(other)
    assert shared.tolist() == [0.0, 1.0, 2.0]
    other.become(bundle)
    assert other.values.tolist() == [0.0, 1.0, 2.0]


def test_allocation_follows_the_declaration() -> None:
    bundle = Outer.allocate(rows=2, columns=5, n=1, count=4, matrix=np.ones((2, 5)), turns=3)
    shapes = {name: values.shape for name, values in bundle.storage()}
    assert shapes == {
        "cells": (2,), "row": (6,), "matrix": (2, 5), "cube": (2, 3, 4), "labels": (2,),
        "inner.values": (1,),
    }  # fmt: skip
    assert bundle.labels.dtype == np.int64
    assert (bundle.count, bundle.scale, bundle.turns, bundle.angle) == (4, 0.0, 3, 0.0)


def test_extents_of_a_robot_may_be_more_than_a_bundle_has() -> None:
    """Those that are named apart have an array, or are slips of the pen."""

    class Sized(Bundle):
        nv: int = number(int)
        inner: Inner = part(Inner)

    sized = Sized.allocate({"n": 3, "nv": 2, "nu": 5})
    assert (sized.nv, sized.inner.values.shape, sized.inner.extents) == (2, (3,), {"n": 3})
    with pytest.raises(TypeError, match="Sized has no nu, neither member nor extent"):
        Sized.allocate(n=3, nu=5)
    with pytest.raises(TypeError, match="Inner: the extent 'n' is not given"):
        Sized.allocate(nv=2)
    with pytest.raises(TypeError, match="Inner: the extent n is a whole number"):
        Inner.allocate(n=2.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"matrix": np.zeros((2, 4))}, r"Outer.matrix has shape \(2, 4\) .*columns = 3"),
        ({"cube": np.zeros((2, 3, 5))}, r"Outer.cube has shape .*rows = 2"),
        ({"labels": np.zeros(3, dtype=np.int64)}, r"Outer.labels has shape \(3,\)"),
        ({"row": np.zeros((4, 1))}, r"Outer.row has shape \(4, 1\)"),
        ({"inner": 3.0}, "Outer.inner is a Inner"),
        ({"other": 3.0}, "Outer has no other"),
    ],
)
def test_members_that_do_not_fit_are_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(TypeError, match=words):
        Outer(**make().members() | change)


def test_what_is_missing_is_named() -> None:
    members = make().members()
    del members["inner"]
    with pytest.raises(TypeError, match="Outer is made with inner, which is missing"):
        Outer(**members)


def test_only_cells_can_be_set() -> None:
    bundle = make()
    for name in ("count", "row", "rwo"):
        with pytest.raises(AttributeError, match=f"Outer.{name} is no cell"):
            setattr(bundle, name, 1)


def test_contents_put_back_are_the_bundle_as_it_was() -> None:
    bundle, result = make(), np.zeros(8)
    before = bundle.contents()
    everything(bundle, result)
    after = bundle.contents()
    bundle.fill(before)
    assert (bundle.turns, bundle.inner.values[0]) == (0, 11.0)
    everything(bundle, result)
    assert all(np.array_equal(after[name], now) for name, now in bundle.contents().items())
    for spoilt in (before | {"row": np.zeros(3)}, {"cells": before["cells"]}):
        with pytest.raises(ValueError, match="missing, or of another shape"):
            bundle.fill(spoilt)


class Whole(Bundle):
    own: np.ndarray = array("n")
    inner: Inner = part(Inner, flat=True)
    other: Inner = part(Inner)


def test_a_flat_part_is_stored_under_the_names_of_its_own_members() -> None:
    whole = Whole.allocate(n=2)
    whole.inner.values[:] = [1.0, 2.0]
    assert [name for name, _ in whole.storage()] == ["own", "values", "other.values"]
    again = Whole.allocate(n=2)
    again.fill(whole.contents())
    assert again.inner.values.tolist() == [1.0, 2.0]
    copied = whole.stored(lambda name, array: array + (name == "values"))
    assert copied.inner.values.tolist() == [2.0, 3.0]


@pytest.mark.parametrize(
    "name", ["table", "address", "members", "storage", "contents", "fill", "become", "dtype"]
)
def test_members_are_not_called_like_what_every_bundle_has(name: str) -> None:
    for member in (array(2), cell(int), number(float), extent()):
        with pytest.raises(TypeError, match=f"Some.{name}: every bundle has .* by the name"):
            type("Some", (Bundle,), {name: member})


def test_a_class_keeps_its_type_however_many_there_are() -> None:
    """Were it made again, machine code for it would be looked for again at every call."""

    def made(name: str) -> type[Bundle]:
        return type(name, (Bundle,), {"size": number(float)})

    first = made("First")
    kind = first.compiled_type()
    for k in range(300):
        made(f"Other{k}").compiled_type()
    assert first.compiled_type() is kind


class Chain(Bundle):
    links: int = extent()
    mode: int = number(int)
    angle: np.ndarray = array("links")
    loose: np.ndarray = array("2 ends + 1")


class Yard(Bundle):
    chain: Chain = part(Chain)
    ends: int = cell(int)  # a cell of the name of an extent is no extent


def test_code_may_take_extents_and_numbers_for_granted(monkeypatch: pytest.MonkeyPatch) -> None:
    def describe(yard):  # type: ignore[no-untyped-def]
        chain = yard.chain
        return 1000 * yard.ends + 100 * chain.mode + 10 * chain.links + chain.loose.shape[0]

    chain = Chain(mode=2, angle=np.zeros(3), loose=np.zeros(5))
    yard = Yard(chain=chain)
    yard.ends = 4
    signature = types.int64(Yard.compiled_type())
    usual = loop_for(signature, describe)
    assert usual(yard) == 4000 + 200 + 30 + 5
    if not isinstance(numba_in_use(), private_numba.PrivateNumba):
        pytest.skip("by its documented names Numba has no unfinished code")
    # What Numba has made of it is there: only constants are put in.
    monkeypatch.delattr(private_numba._UnfinishedLowering, "run_pass")
    fixed = loop_for(signature, describe, (("links", 7), ("mode", 9), ("ends", 1), ("strange", 1)))
    more = loop_for(signature, describe, (("ends", 8),))
    assert fixed(yard) == 4000 + 900 + 70 + 3  # made for others than this one
    assert more(yard) == 4000 + 200 + 30 + 17  # 2 ends + 1
