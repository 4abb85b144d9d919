"""Bundles: arrays and numbers by name, which kernels receive by address.

A kernel needs some hundred arrays. Passed by value, as Numba passes a tuple, each of them is a
handful of arguments at every call: slow to compile and slow to call. A bundle is one argument, the
address of a table with the places and shapes of its arrays, and ``bundle.name`` reads the same in
compiled code as in Python.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any, dataclass_transform

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    register_model,
    unbox,
)
from numba.np.arrayobj import populate_array

_WORD = ir.IntType(64)
_BYTES = 8


@dataclass_transform(frozen_default=True, eq_default=False)
class Bundle:
    """Base class of bundles; a subclass lists its members like a dataclass.

    A member is a C-contiguous array of 64-bit numbers, a number, or another bundle. A bundle never
    lets go of its arrays, so that its table stays good; what is in the arrays may change.

    Raises
    ------
    TypeError
        When it is handed to a kernel with a member of another kind.

    Examples
    --------
    >>> class Rod(Bundle):
    ...     mass: float
    ...     end: np.ndarray
    >>> @numba.njit
    ... def moment(rod):
    ...     return rod.mass * rod.end[0]
    >>> moment(Rod(2.0, np.array([0.5, 0.0])))
    1.0
    """

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False)(cls)

    @cached_property
    def _numba_type_(self) -> BundleType:
        """Its type to Numba, which looks for it under this name."""
        members = ((name, _member_type(value)) for name, value in self.members().items())
        return _bundle_type(type(self).__name__, tuple(members))

    @property
    def table(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """One word for every number and bundle, and address and shape of every array."""
        # Of two threads that ask at once both get the same one, which lives as long as the bundle.
        made: np.ndarray[Any, np.dtype[np.int64]] | None = self.__dict__.get("_table")
        return self.__dict__.setdefault("_table", self._new_table()) if made is None else made

    def _new_table(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        words: list[int] = []
        for value in self.members().values():
            if isinstance(value, np.ndarray):
                words += [value.__array_interface__["data"][0], *value.shape]
            elif isinstance(value, Bundle):
                words.append(value.address)
            elif isinstance(value, float):
                words.append(int(np.float64(value).view(np.int64)))
            else:
                words.append(int(value))
        return np.array(words, dtype=np.int64)

    @cached_property
    def address(self) -> int:
        """Where its table is."""
        return int(self.table.ctypes.data)

    def __getstate__(self) -> dict[str, Any]:
        """Members only: a copy has a table of its own."""
        return self.members()

    @cached_property
    def arrays(self) -> tuple[np.ndarray[Any, Any], ...]:
        """Its arrays and those of the bundles in it."""
        found: list[np.ndarray[Any, Any]] = []
        for value in self.members().values():
            if isinstance(value, np.ndarray):
                found.append(value)
            elif isinstance(value, Bundle):
                found += value.arrays
        return tuple(found)

    def become(self, other: Bundle) -> None:
        """Copy what is in the arrays of a bundle of the same kind and shapes.

        Read-only arrays are not the bundle's own but shared with others, and stay what they are.
        """
        for mine, its in zip(self.arrays, other.arrays, strict=True):
            if mine.flags.writeable:
                mine[...] = its

    def members(self) -> dict[str, Any]:
        """Members by name, in their order."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]


def _member_type(value: Any) -> Any:
    if isinstance(value, Bundle):
        return value._numba_type_
    if isinstance(value, np.ndarray):
        if not (value.flags.c_contiguous and value.dtype in (np.float64, np.int64)):
            raise TypeError(
                f"a bundle holds C-contiguous arrays of 64-bit numbers, not {value.dtype}"
            )
        return _array_type(value.dtype.char, value.ndim)
    return types.float64 if isinstance(value, float) else types.int64


@lru_cache
def _array_type(dtype: str, ndim: int) -> Any:
    """Type of an array; Numba takes long to make one, and simulations make many bundles."""
    return types.Array(numba.from_dtype(np.dtype(dtype)), ndim, "C")


class BundleType(types.Type):
    """Type of a bundle: its members and theirs."""

    def __init__(self, name: str, members: tuple[tuple[str, Any], ...]) -> None:
        self.members = dict(members)
        described = ", ".join(f"{member}: {kind}" for member, kind in members)
        # The name goes into every symbol of the machine code: short, but never that of another.
        super().__init__(name=f"{name}_{hashlib.sha256(described.encode()).hexdigest()[:12]}")

    def place(self, name: str) -> int:
        """Where in the table a member begins."""
        place = 0
        for member, kind in self.members.items():
            if member == name:
                break
            place += 1 + (kind.ndim if isinstance(kind, types.Array) else 0)
        return place


_bundle_type = lru_cache(BundleType)


@register_model(BundleType)
class _BundleModel(models.PrimitiveModel):
    """In machine code a bundle is the address of its table."""

    def __init__(self, manager: Any, kind: BundleType) -> None:
        super().__init__(manager, kind, _WORD.as_pointer())


@unbox(BundleType)
def _unbox_bundle(_: BundleType, value: Any, c: Any) -> NativeValue:
    number = c.pyapi.object_getattr_string(value, "address")
    failed = cgutils.is_null(c.builder, number)
    word = cgutils.alloca_once_value(c.builder, ir.Constant(_WORD, 0))
    with c.builder.if_then(c.builder.not_(failed)):
        c.builder.store(c.pyapi.long_as_ulonglong(number), word)
        c.pyapi.decref(number)
    table = c.builder.inttoptr(c.builder.load(word), _WORD.as_pointer())
    return NativeValue(table, is_error=failed)


@infer_getattr
class _BundleAttribute(AttributeTemplate):
    key = BundleType

    def generic_resolve(self, kind: BundleType, name: str) -> Any:  # type: ignore[override]
        return kind.members.get(name)


@lower_getattr_generic(BundleType)
def _get_member(context: Any, builder: Any, kind: BundleType, table: Any, name: str) -> Any:
    """Read a member from the table.

    Nothing ever writes to a table, and the optimiser is told so (``invariant.load``): it reads what
    it needs once, however many arrays are written to meanwhile. Arrays carry no reference count.
    """
    place = kind.place(name)
    member = kind.members[name]

    def word(offset: int) -> Any:
        slot = builder.gep(table, [ir.Constant(_WORD, place + offset)], inbounds=True)
        value = builder.load(slot)
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        return value

    if isinstance(member, BundleType):
        return builder.inttoptr(word(0), _WORD.as_pointer())
    if member == types.float64:
        return builder.bitcast(word(0), ir.DoubleType())
    if not isinstance(member, types.Array):
        return word(0)
    array = context.make_array(member)(context, builder)
    shape = [word(1 + i) for i in range(member.ndim)]
    strides = [ir.Constant(_WORD, _BYTES)]
    for extent in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], extent))
    data = builder.inttoptr(word(0), context.get_data_type(member.dtype).as_pointer())
    itemsize = ir.Constant(_WORD, _BYTES)
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=itemsize, meminfo=None)
    return array._getvalue()
