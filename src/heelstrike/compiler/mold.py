"""Bundles cast in a mold: like one that was laid out before, in one block, by one copy.

To lay a bundle out takes a look at every member of every part, a hundred times as long as to copy
what comes of it. Simulations begin with the same memory again and again: laid out once, it is cast
for each. Compiled code finds members by the tables of a cast; Python makes those that it is asked
for.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, address_of_array
from heelstrike.compiler.bundle_type import WORD_BYTES

_Some = TypeVar("_Some", bound=Bundle)


class _Shape(NamedTuple):
    """Where in the block a bundle lies, in bytes, and what it shares with the one laid out."""

    kind: type[Bundle]
    table: int
    cells: int
    cell_count: int
    arrays: dict[str, tuple[tuple[int, ...], np.dtype[Any], int]]
    parts: dict[str, _Shape]
    shared: dict[str, Any]


Layout = tuple[tuple[str, tuple[int, ...], np.dtype[Any]], ...]
"""Names, shapes and kinds of the arrays of a bundle."""


class Mold(Generic[_Some]):
    """What a bundle holds at this moment, to cast others that begin so.

    Its tables, its cells and the arrays that it can write to are each cast's own, and so is what it
    has the address of if that is memory of its own. Arrays that are read only, addresses of what
    is another's, and parts that are another's are shared.

    Parameters
    ----------
    laid_out : Bundle
        The bundle. Its arrays may share memory, and do so in a cast.
    """

    def __init__(self, laid_out: _Some) -> None:
        self._words: list[NDArray[np.int64]] = []
        self._size = 0
        self._begins: dict[int, tuple[Any, int]] = {}  # of what memory, and where it comes to lie
        self._addressed: list[tuple[_Shape, str, Any]] = []
        self._shape = self._of(laid_out)
        for shape, name, value in self._addressed:  # what is not there as yet is another's
            if not self._is_own(value):
                shape.shared[name] = value
            elif isinstance(value, Bundle):
                shape.parts[name] = self._of(value)
            else:
                shape.arrays[name] = value.shape, value.dtype, self._place(value)
        self._block = np.concatenate(self._words)
        self._pointers = np.array(list(self._lay_tables(self._shape)), dtype=np.int64)
        layout, places = written_to(_cast(self._shape, self._block, 0))
        places[:, 0] -= address_of_array(self._block)
        self._stored = layout, places

    @property
    def size(self) -> int:
        """Words that a cast takes up."""
        return self._block.size

    def cast(self, block: NDArray[np.int64] | None = None) -> _Some:
        """Return another bundle, as the one laid out was when the mold was made of it.

        Parameters
        ----------
        block : (size,) int64, optional
            Words that it is to lie in; by default memory of its own.

        Returns
        -------
        Bundle
            The cast.
        """
        if block is None:
            block = self._block.copy()
        else:
            block[:] = self._block
        begin = address_of_array(block)
        block[self._pointers] += begin
        made: _Some = _cast(self._shape, block, begin)
        made.__dict__["_stored"] = *self._stored, begin
        return made

    def _of(self, bundle: Bundle) -> _Shape:
        arrays, parts, addressed = {}, {}, []
        shared: dict[str, Any] = {"_extents": bundle.extents}
        for name, member in bundle.declared.items():
            if member.role == "cell":
                continue
            value = getattr(bundle, name)
            if member.role == "part" and not member.address:
                parts[name] = self._of(value)
            elif member.role == "array" and not member.address and value.flags.writeable:
                arrays[name] = value.shape, value.dtype, self._place(value)
            elif member.role == "part" or (member.role == "array" and value.flags.writeable):
                addressed.append((name, value))
            else:
                shared[name] = value
        table = WORD_BYTES * self._size
        self._append(bundle.table)
        cells = bundle.__dict__["_cells"]
        place = self._place(cells)
        shape = _Shape(type(bundle), table, place, cells.size, arrays, parts, shared)
        self._addressed += [(shape, name, value) for name, value in addressed]
        return shape

    def _is_own(self, value: Any) -> bool:
        """Whether an array, or one of a bundle, lies in memory that comes to lie in the block."""
        arrays = [values for _, values in value.storage()] if isinstance(value, Bundle) else [value]
        return any(id(_whole(each)) in self._begins for each in arrays)

    def _place(self, array: Any) -> int:
        """Return where in the block an array lies, which brings along all that it is a part of."""
        whole = _whole(array)
        if id(whole) not in self._begins:
            self._begins[id(whole)] = whole, WORD_BYTES * self._size
            self._append(whole)
        return self._begins[id(whole)][1] + address_of_array(array) - address_of_array(whole)

    def _append(self, array: NDArray[Any]) -> None:
        self._words.append(array.reshape(-1).view(np.int64))
        self._size += array.size

    def _lay_tables(self, shape: _Shape) -> Iterator[int]:
        """Write where members come to lie into the tables; yield where there are addresses."""
        begins = {name: begin for name, (_, _, begin) in shape.arrays.items()}
        begins |= {name: part.table for name, part in shape.parts.items()}
        place, cells = shape.table // WORD_BYTES, shape.cells
        for name, member in shape.kind.declared.items():
            if member.role == "cell":
                begins[name], cells = cells, cells + WORD_BYTES
            if name in begins:
                self._block[place] = begins[name]
                yield place
            place += 1 + len(member.shape)
        for part in shape.parts.values():
            yield from self._lay_tables(part)


def _whole(array: Any) -> Any:
    """Return the array that has the memory which an array is a view of."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array


def _cast(shape: _Shape, block: NDArray[np.int64], begin: int) -> Any:
    bundle = shape.kind.__new__(shape.kind)
    own = bundle.__dict__
    own.update(shape.shared)
    own["address"] = begin + shape.table
    own["_cells"] = np.ndarray(shape.cell_count, np.int64, block, shape.cells)
    own["_late"] = partial(_member, shape, block, begin)
    return bundle


def _member(shape: _Shape, block: NDArray[np.int64], begin: int, name: str) -> Any:
    """Make an array or a part of a cast, None if it has none of that name."""
    if name in shape.arrays:
        extents, numbers, place = shape.arrays[name]
        return np.ndarray(extents, numbers, block, place)
    return _cast(shape.parts[name], block, begin) if name in shape.parts else None


def written_to(bundle: Bundle) -> tuple[Layout, NDArray[np.int64]]:
    """Return the arrays behind a bundle that can be written to, and where they are.

    Returns
    -------
    layout : tuple
        Name, shape and kind of each: the same tuple for all casts of a mold.
    places : (n, 2) int
        Address of each, and its words.
    """
    stored = bundle.__dict__.get("_stored")
    if stored is not None:
        layout, offsets, begin = stored
        return layout, offsets + np.array((begin, 0))
    arrays = [(name, each) for name, each in bundle.storage() if each.flags.writeable]
    places = [(address_of_array(array), array.size) for _, array in arrays]
    made = tuple((name, array.shape, array.dtype) for name, array in arrays)
    return _LAYOUTS.setdefault(made, made), np.array(places, dtype=np.int64).reshape(-1, 2)


_LAYOUTS: dict[Layout, Layout] = {}
