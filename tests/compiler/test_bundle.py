"""Bundles: the same members in compiled code as in Python."""

from __future__ import annotations

import copy
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import kernel


class Inner(Bundle):
    values: np.ndarray


class Outer(Bundle):
    count: int
    scale: float
    row: np.ndarray
    matrix: np.ndarray
    cube: np.ndarray
    labels: np.ndarray
    inner: Inner


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
    return bundle.matrix.shape[0] * bundle.cube.size


def make() -> Outer:
    return Outer(
        count=-3,
        scale=0.1,
        row=np.arange(4.0),
        matrix=np.arange(6.0).reshape(2, 3),
        cube=np.arange(24.0).reshape(2, 3, 4),
        labels=np.array([5, -6]),
        inner=Inner(np.array([11.0])),
    )


def test_members_read_and_written_in_compiled_code() -> None:
    bundle, result = make(), np.zeros(8)
    assert everything(bundle, result) == 2 * 24
    assert result.tolist() == [-3.0, 0.1, 3.0, 5.0, 15.0, -6.0, 11.0, 12.0]
    assert bundle.inner.values[0] == 12.0
    assert np.all(bundle.cube[1, :, 0] == 7.0)


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))])
def test_a_copy_has_arrays_of_its_own(clone) -> None:
    bundle, result = make(), np.zeros(8)
    everything(bundle, result)  # the original has its table by now
    other = clone(bundle)
    everything(other, result)
    assert bundle.inner.values[0] == 12.0
    assert other.inner.values[0] == 13.0


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
    bundle = Inner(np.arange(3.0))
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda _: bundle.table, range(2))
    assert first is second is bundle.table
    assert bundle.address == first.ctypes.data


def test_what_bundles_share_is_not_copied() -> None:
    """Addresses of machine code are read-only; a copy may be from before they were known."""
    shared = np.arange(3.0)
    shared.flags.writeable = False
    bundle, other = Inner(shared), Inner(np.zeros(3))
    bundle.become(other)
    assert shared.tolist() == [0.0, 1.0, 2.0]
    other.become(bundle)
    assert other.values.tolist() == [0.0, 1.0, 2.0]
