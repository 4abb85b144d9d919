"""Bundles: arrays and numbers by name, which kernels receive by address.

A kernel needs some hundred arrays. Passed by value, as Numba passes a tuple, each of them is a
handful of arguments at every call: slow to compile and slow to call. A bundle is one argument, the
address of a table with the places and shapes of its arrays, and ``bundle.name`` reads the same in
compiled code as in Python.

What a bundle holds is declared once, where its class is written: shapes by the names of their
extents, from which follow its allocation, its compiled type, its checks and its contents by name.
Kernels written into the class are its methods, in compiled code as in Python.
"""

from __future__ import annotations

import ctypes
import hashlib
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    lower_setattr_generic,
    register_model,
    unbox,
)
from numba.np.arrayobj import populate_array

_WORD = ir.IntType(64)
_BYTES = 8
_EXTENT = re.compile(r"(?:(\d+)\s*)?([A-Za-z]\w*)?(?:\s*\+\s*(\d+))?")

# Names of no members: where a bundle keeps what is its own, and an argument of `allocate`.
_TAKEN = ("_cells", "_extents", "_block", "_places", "_table", "dtype")

_Some = TypeVar("_Some", bound="Bundle")


@dataclass(frozen=True)
class Member:
    """What a bundle says of one of its members.

    Attributes
    ----------
    role : str
        ``"array"``, ``"cell"`` (a number that changes), ``"number"`` (one that does not),
        ``"part"`` (another bundle) or ``"extent"`` (how long arrays are).
    kind : type
        ``float`` or ``int``, or the class of a part.
    shape : tuple of str and int
        Extents of an array: ``"nv"``, ``"2 nc"``, ``"nc + 1"``, 3.
    address : bool
        Whether it holds places in this process, or a part what is another's: nothing to keep.
    """

    role: str
    kind: type
    shape: tuple[str | int, ...] = ()
    address: bool = False

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Of its numbers: 64 bits."""
        return np.dtype(np.float64 if self.kind is float else np.int64)


def array(*shape: str | int, of: type = float, address: bool = False) -> Any:
    """Declare an array of a bundle by its extents.

    Parameters
    ----------
    *shape : str or int
        Extents: numbers, or names as in ``"nu"``, ``"2 nc + 1"``, which the robot knows.
    of : type
        ``float`` or ``int``.
    address : bool
        Whether it holds places in this process, which are not to be kept.

    Returns
    -------
    Member
        What the class of the bundle makes a member of.
    """
    return Member("array", of, shape, address)


def cell(of: type) -> Any:
    """Declare a number of a bundle that kernels may change.

    Parameters
    ----------
    of : type
        ``float`` or ``int``.

    Returns
    -------
    Member
        What the class of the bundle makes a member of.
    """
    return Member("cell", of)


def number(of: type) -> Any:
    """Declare a number of a bundle that stays as it is.

    Parameters
    ----------
    of : type
        ``float`` or ``int``.

    Returns
    -------
    Member
        What the class of the bundle makes a member of.
    """
    return Member("number", of)


def part(kind: type[Bundle], *, address: bool = False) -> Any:
    """Declare a bundle within a bundle."""
    return Member("part", kind, address=address)


def extent() -> Any:
    """Declare an extent of the arrays of a bundle that is read by its name: ``bundle.nv``."""
    return Member("extent", int)


class Bundle:
    """Base class of bundles; a subclass declares its members.

    Arrays are C-contiguous, of 64-bit numbers. A bundle never lets go of its arrays, so that its
    table stays good; what is in the arrays and cells may change.

    Parameters
    ----------
    **members : array, number or Bundle
        Every member by its name. Cells may be left out, and are zero then.

    Attributes
    ----------
    declared : dict of str to Member
        The members that the class declares, by name.
    methods : bool
        Whether the class has kernels for methods.
    named : frozenset of str
        The extents that it declares to be read by name.

    Raises
    ------
    TypeError
        If a member is missing or unknown, or an array does not have its shape; when it is handed to
        a kernel, if an array is not what kernels can read.

    Examples
    --------
    >>> import numba
    >>> class Rod(Bundle):
    ...     mass: float = number(float)
    ...     end: np.ndarray = array("axis")
    ...     swings: int = cell(int)
    >>> @numba.njit
    ... def swing(rod):
    ...     rod.swings += 1
    ...     return rod.mass * rod.end[0]
    >>> rod = Rod(mass=2.0, end=np.array([0.5, 0.0]))
    >>> swing(rod), rod.swings
    (1.0, 1)
    """

    _cell_count = 0

    declared: ClassVar[dict[str, Member]] = {}
    methods: ClassVar[bool] = False
    named: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls) -> None:
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Member)}
        for name in own:
            if name in _TAKEN or hasattr(Bundle, name):
                raise TypeError(
                    f"{cls.__name__}.{name}: every bundle has something else by the name of "
                    f"{name!r}; call this member something else"
                )
        cls.named = cls.named | {name for name, value in own.items() if value.role == "extent"}
        cls.declared = cls.declared | {k: v for k, v in own.items() if k not in cls.named}
        cls.methods = cls.methods or any(hasattr(value, "py_func") for value in vars(cls).values())
        cells = [name for name, member in cls.declared.items() if member.role == "cell"]
        cls._cell_count = len(cells)
        for name in own:
            if name in cls.named:
                setattr(cls, name, _extent_property(name))
            else:
                delattr(cls, name)
        for place, name in enumerate(cells):
            setattr(cls, name, _cell_property(place, cls.declared[name]))

    def __init__(self, **members: Any) -> None:
        for name, member in self.declared.items():
            if name not in members and member.role != "cell":
                raise TypeError(f"{type(self).__name__} is made with {name}, which is missing")
        own = self.__dict__
        own["_cells"] = np.zeros(self._cell_count, dtype=np.int64)
        own["_extents"] = {}
        self._take(members)

    def _take(self, members: dict[str, Any]) -> None:
        """Make members one's own, each of the shape that it is declared with."""
        own = self.__dict__
        extents = own["_extents"]
        for name, member in self.declared.items():
            if name not in members:
                continue
            value = members.pop(name)
            if member.role == "cell":
                setattr(self, name, value)
                continue
            if member.role == "array":
                _check_shape(f"{type(self).__name__}.{name}", member, np.shape(value), extents)
            elif member.role == "number":
                value = member.kind(value)
            elif not isinstance(value, member.kind):
                raise TypeError(f"{type(self).__name__}.{name} is a {member.kind.__name__}")
            own[name] = value
        if members:
            raise TypeError(f"{type(self).__name__} has no {', '.join(members)}")

    def __setattr__(self, name: str, value: Any) -> None:
        member = self.declared.get(name)
        if member is None or member.role != "cell":
            raise AttributeError(f"{type(self).__name__}.{name} is no cell, and stays what it is")
        object.__setattr__(self, name, value)

    @classmethod
    def allocate(cls: type[_Some], *, dtype: Any = None, **given: Any) -> _Some:
        """Make a bundle of zeros.

        Parameters
        ----------
        dtype : type, optional
            Of its arrays of floats, for other numbers than these: ``object`` for symbols.
        **given : int, array, number or Bundle
            The extents by name, and members that are not to be zeros; a whole number may be both.
            Parts are allocated with the same extents.

        Returns
        -------
        Bundle
            Of this class.

        Raises
        ------
        TypeError
            If an extent is missing, or something is given that is neither a member nor a whole
            number. Extents that no array has are ignored: those of a robot fit every bundle.
        """
        kind: Any = cls
        members = {name: value for name, value in given.items() if name in cls.declared}
        extents = {name: value for name, value in given.items() if name not in members}
        extents |= {name: members[name] for name in _whole_numbers(kind) if name in members}
        for name, value in extents.items():
            if not isinstance(value, int | np.integer):
                raise TypeError(f"{cls.__name__} has no {name}, and an extent is a whole number")
        plan = _plan(kind, frozenset(members), tuple(extents.items()))
        block = np.zeros(plan.size, dtype=np.int64)
        bundle = cls.__new__(cls)
        own = bundle.__dict__
        own["_cells"] = np.ndarray(cls._cell_count, np.int64, block, plan.cells)
        own["_extents"] = plan.extents.copy()
        for name, shape, numbers, place in plan.arrays:
            own[name] = np.ndarray(shape, numbers, block, place)
        if dtype is None:
            own["_block"], own["_places"] = block, plan.places
        else:
            floats = (each for each in plan.arrays if each[2].kind == "f")
            own |= {name: np.zeros(shape, dtype) for name, shape, _, _ in floats}
        for name, number in plan.numbers:
            own[name] = number
        for name, part in plan.parts:
            own[name] = part.allocate(dtype=dtype, **extents)
        bundle._take(members)
        return bundle

    @classmethod
    def compiled_type(cls) -> Any:
        """Return its type to Numba."""
        kind: Any = cls
        return _bundle_type(kind)

    @property
    def _numba_type_(self) -> Any:
        """Its type to Numba, which looks for it under this name."""
        return self.compiled_type()

    @property
    def extents(self) -> dict[str, int]:
        """How long its arrays are, by the names of their extents, as :meth:`allocate` takes it."""
        return dict(self.__dict__["_extents"])

    @property
    def table(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """One word for every number, cell and bundle, and address and shape of every array."""
        # Of two threads that ask at once both get the same one, which lives as long as the bundle.
        made: np.ndarray[Any, np.dtype[np.int64]] | None = self.__dict__.get("_table")
        return self.__dict__.setdefault("_table", self._new_table()) if made is None else made

    def _new_table(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        words: list[int] = []
        own = self.__dict__
        block, places, begin = own.get("_block"), own.get("_places", {}), 0
        if block is None:
            cells = _address(own["_cells"])
        else:
            own["address"] = begin = _address(block)
            cells = begin + places["_cells"]
        for name, member in self.declared.items():
            if member.role == "cell":
                words.append(cells)
                cells += _BYTES
                continue
            value = own[name]
            if name in places:
                words += [begin + places[name], *value.shape]
            elif member.role == "array":
                if not (value.flags.c_contiguous and value.dtype == member.dtype):
                    raise TypeError(
                        f"{type(self).__name__}.{name} is a C-contiguous array of "
                        f"{member.dtype}, not of {value.dtype}"
                    )
                words += [_address(value), *value.shape]
            elif member.role == "part":
                words.append(value.address)
            elif member.kind is float:
                words.append(int(np.float64(value).view(np.int64)))
            else:
                words.append(value)
        if block is None:
            return np.array(words, dtype=np.int64)
        table: np.ndarray[Any, np.dtype[np.int64]] = block[: len(words)]
        table[:] = words
        return table

    @cached_property
    def address(self) -> int:
        """Where its table is."""
        return _address(self.table)

    def __reduce__(self) -> Any:
        """Members only: a copy has a table of its own."""
        return _made, (type(self), self.members())

    def members(self) -> dict[str, Any]:
        """Members by name, in their order; of cells what they hold."""
        return {name: getattr(self, name) for name in self.declared}

    def replaced(self: _Some, **changes: Any) -> _Some:
        """Return a bundle with some other members, which shares the rest.

        Parameters
        ----------
        **changes : array, number or Bundle
            The others, by name.

        Returns
        -------
        Bundle
            Of the same class.
        """
        return type(self)(**self.members() | changes)

    def storage(self, prefix: str = "") -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
        """Yield the arrays behind it by name, ``part.array`` those of its parts.

        Addresses are left out; its cells are one array.

        Parameters
        ----------
        prefix : str
            What the names begin with.

        Yields
        ------
        tuple of str and array
            Name and array.
        """
        if self._cell_count:
            yield f"{prefix}cells", self.__dict__["_cells"]
        for name, member in self.declared.items():
            if member.role == "part" and not member.address:
                yield from getattr(self, name).storage(f"{prefix}{name}.")
            elif member.role == "array" and not member.address:
                yield prefix + name, getattr(self, name)

    def stored(
        self: _Some,
        place: Callable[[str, np.ndarray[Any, Any]], np.ndarray[Any, Any]],
        prefix: str = "",
    ) -> _Some:
        """Return a copy whose arrays are made of those of this one.

        Parameters
        ----------
        place : callable
            ``place(name, array)`` returns an array of the same shape.
        prefix : str
            What the names begin with.

        Returns
        -------
        Bundle
            The copy.
        """
        cells = self.__dict__["_cells"]
        if self._cell_count:
            cells = place(f"{prefix}cells", cells)
        members = self.members()
        for name, member in self.declared.items():
            if member.role == "part" and not member.address:
                members[name] = members[name].stored(place, f"{prefix}{name}.")
            elif member.role == "array" and not member.address:
                members[name] = place(prefix + name, members[name])
        copy = type(self)(**members)
        copy.__dict__["_cells"] = cells
        return copy

    def check(self, extents: Mapping[str, int]) -> None:
        """Refuse to be one for other extents.

        Parameters
        ----------
        extents : mapping of str to int
            Extents by name.

        Raises
        ------
        TypeError
            That names the array.
        """
        known = dict(extents)
        for name, member in self.declared.items():
            if member.role == "part":
                getattr(self, name).check(known)
            elif member.role == "array":
                _check_shape(
                    f"{type(self).__name__}.{name}", member, getattr(self, name).shape, known
                )

    @classmethod
    def extent_names(cls) -> set[str]:
        """Names of the extents of its arrays, and of those of its parts."""
        found = {
            _parsed(each)[1]
            for member in cls.declared.values()
            for each in member.shape
            if isinstance(each, str)
        }
        parts: Any = (member.kind for member in cls.declared.values() if member.role == "part")
        return found.union(*(part.extent_names() for part in parts))

    @classmethod
    def settable(cls: type[_Some]) -> type[_Some]:
        """Return a class of the same members whose numbers are cells, and so can be set."""
        return _settable(cls)  # type: ignore[arg-type]

    def contents(self, prefix: str = "") -> dict[str, np.ndarray[Any, Any]]:
        """Copy what is its own in its storage, by name: read-only arrays are shared with others.

        Parameters
        ----------
        prefix : str
            What the names begin with.

        Returns
        -------
        dict
            Copies by name.
        """
        return {name: each.copy() for name, each in self.storage(prefix) if each.flags.writeable}

    def fill(self, contents: Mapping[str, np.ndarray[Any, Any]], prefix: str = "") -> None:
        """Put contents of a bundle of the same kind and shapes in the place of its own.

        Parameters
        ----------
        contents : mapping of str to array
            What :meth:`contents` of that one returned.
        prefix : str
            What the names begin with.

        Raises
        ------
        ValueError
            If something is missing, or of another shape or kind; nothing has changed then.
        """
        storage = {name: mine for name, mine in self.storage(prefix) if mine.flags.writeable}
        for name, mine in storage.items():
            its = contents.get(name)
            if its is None or its.shape != mine.shape or its.dtype != mine.dtype:
                raise ValueError(f"{type(self).__name__}.{name} is missing, or of another shape")
        for name, mine in storage.items():
            mine[...] = contents[name]

    def become(self, other: Bundle) -> None:
        """Copy what is in a bundle of the same kind and shapes.

        Parameters
        ----------
        other : Bundle
            That bundle.
        """
        self.fill(dict(other.storage()))


def _made(kind: type[_Some], members: dict[str, Any]) -> _Some:
    return kind(**members)


_NOTHING = ctypes.c_char * 0


def _address(array: Any) -> int:
    if array.flags.writeable:  # four times as quick
        return ctypes.addressof(_NOTHING.from_buffer(array))
    address: int = array.__array_interface__["data"][0]
    return address


class _Plan(NamedTuple):
    """How a bundle is allocated: a block for table, cells and arrays, and where in it they lie."""

    size: int
    cells: int
    arrays: list[tuple[str, tuple[int, ...], np.dtype[Any], int]]
    places: dict[str, int]
    numbers: list[tuple[str, Any]]
    parts: list[tuple[str, Any]]
    extents: dict[str, int]


@lru_cache
def _whole_numbers(cls: Any) -> list[str]:
    return [
        name for name, each in cls.declared.items() if each.role == "number" and each.kind is int
    ]


@lru_cache(1024)
def _plan(cls: Any, given: frozenset[str], sizes: tuple[tuple[str, int], ...]) -> _Plan:
    """Plan the members of a bundle that are not given, for extents by name."""
    known = dict(sizes)
    members = [(name, each) for name, each in cls.declared.items() if name not in given]
    table = sum(1 + len(member.shape) for member in cls.declared.values())
    extents: dict[str, int] = {}
    size, arrays = table + cls._cell_count, []
    for name, member in members:
        if member.role == "array":
            shape = tuple(_extent(each, known) for each in member.shape)
            _check_shape(f"{cls.__name__}.{name}", member, shape, extents)
            arrays.append((name, shape, member.dtype, _BYTES * size))
            size += math.prod(shape)
    return _Plan(
        size + 1,  # arrays of nothing lie before its end, too
        _BYTES * table,
        arrays,
        {name: place for name, _, _, place in arrays} | {"_cells": _BYTES * table},
        [(name, member.kind()) for name, member in members if member.role == "number"],
        [(name, member.kind) for name, member in members if member.role == "part"],
        extents,
    )


@lru_cache
def _settable(cls: Any) -> Any:
    numbers = {
        name: cell(member.kind) for name, member in cls.declared.items() if member.role == "number"
    }
    return type(cls.__name__, (cls,), {"__module__": cls.__module__, **numbers})


def _cell_property(place: int, member: Member) -> property:
    """Read and write a cell from Python."""

    def get(bundle: Bundle) -> Any:
        return member.kind(bundle.__dict__["_cells"].view(member.dtype)[place])

    def put(bundle: Bundle, value: Any) -> None:
        bundle.__dict__["_cells"].view(member.dtype)[place] = value

    return property(get, put)


def _extent_property(name: str) -> property:
    """Read an extent from Python."""

    def get(bundle: Bundle) -> int:
        known: dict[str, int] = bundle.__dict__["_extents"]
        return known[name]

    return property(get)


def _extent(extent: str | int, known: Mapping[str, int]) -> int:
    """Return the size that an extent stands for."""
    if isinstance(extent, int):
        return extent
    factor, name, more = _parsed(extent)
    if name not in known:
        raise TypeError(f"the extent {name!r} is not given")
    return factor * known[name] + more


@lru_cache
def _parsed(extent: str) -> tuple[int, str, int]:
    match = _EXTENT.fullmatch(extent)
    if match is None or match[2] is None:
        raise TypeError(f"an extent is a number or reads like '2 nc + 1', not {extent!r}")
    return int(match[1] or 1), match[2], int(match[3] or 0)


def _check_shape(
    name: str, member: Member, shape: tuple[int, ...], extents: dict[str, int]
) -> None:
    """Refuse an array whose shape is not the declared one; note the extents that it tells."""
    fits = len(shape) == len(member.shape)
    for extent, size in zip(member.shape, shape, strict=False):
        if isinstance(extent, int):
            fits = fits and size == extent
            continue
        factor, letter, more = _parsed(extent)
        fits = fits and size >= more and (size - more) % factor == 0
        fits = fits and extents.setdefault(letter, (size - more) // factor) * factor + more == size
    if not fits:
        wanted = ", ".join(map(str, member.shape))
        known = ", ".join(f"{letter} = {size}" for letter, size in extents.items())
        raise TypeError(f"{name} has shape {shape} instead of ({wanted}), where {known}")


class BundleType(types.Type):
    """Type of a bundle: its members, of what array an extent is which one, and its class."""

    def __init__(
        self,
        cls: Any,
        members: tuple[tuple[str, Any, bool], ...],
        extents: dict[str, tuple[str, int]],
    ) -> None:
        name, self.cls = cls.__name__, cls
        self.members = {member: kind for member, kind, _ in members}
        self.cells = {member for member, _, changes in members if changes}
        self.extents = extents
        described = ", ".join(map(str, (*members, *extents.items())))
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


@lru_cache
def _bundle_type(cls: Any) -> BundleType:
    return BundleType(
        cls,
        tuple(
            (name, _member_type(member), member.role == "cell")
            for name, member in cls.declared.items()
        ),
        {
            extent: (name, place)
            for name, member in cls.declared.items()
            for place, extent in enumerate(member.shape)
            if extent in cls.named
        },
    )


def _member_type(member: Member) -> Any:
    if member.role == "part":
        return _bundle_type(member.kind)
    scalar = types.float64 if member.kind is float else types.int64
    return types.Array(scalar, len(member.shape), "C") if member.role == "array" else scalar


@register_model(BundleType)
class _BundleModel(models.PrimitiveModel):
    """In machine code a bundle is the address of its table."""

    def __init__(self, manager: Any, kind: BundleType) -> None:
        super().__init__(manager, kind, _WORD.as_pointer())


@unbox(BundleType)
def _unbox_bundle(_: BundleType, value: Any, c: Any) -> NativeValue:
    found = c.pyapi.object_getattr_string(value, "address")
    failed = cgutils.is_null(c.builder, found)
    word = cgutils.alloca_once_value(c.builder, ir.Constant(_WORD, 0))
    with c.builder.if_then(c.builder.not_(failed)):
        c.builder.store(c.pyapi.long_as_ulonglong(found), word)
        c.pyapi.decref(found)
    table = c.builder.inttoptr(c.builder.load(word), _WORD.as_pointer())
    return NativeValue(table, is_error=failed)


@infer_getattr
class _BundleAttribute(AttributeTemplate):
    key = BundleType

    def generic_resolve(self, kind: BundleType, name: str) -> Any:  # type: ignore[override]
        if name in kind.extents:
            return types.int64
        if name in kind.members:
            return kind.members[name]
        return _method(kind, name) if hasattr(getattr(kind.cls, name, None), "py_func") else None


@lru_cache
def _method(kind: BundleType, name: str) -> Any:
    """Type of a kernel of the class of a bundle, bound to the bundle."""
    function = getattr(kind.cls, name)._numba_type_

    class Method(AbstractTemplate):
        key = f"{kind.name}.{name}"

        def generic(self, arguments: Any, keywords: Any) -> Any:
            return function.get_call_type(self.context, (kind, *arguments), keywords).as_method()

    @lower_builtin(Method.key, kind, types.VarArg(types.Any))
    def call(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return context.get_function(function, signature)(builder, values)

    return types.BoundFunction(Method, kind)


@lru_cache
def bundle_at(cls: Any) -> Any:
    """Return an intrinsic that returns the bundle of a class whose table is at an address."""
    name = cls.compiled_type().name

    # What compiled code is made of is known by what functions enclose: the class, whose kernels are
    # methods, and the name, which tells its members.
    def define(context: Any, address: Any) -> Any:
        del context, address

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            del context, signature
            return builder.inttoptr(values[0], _WORD.as_pointer(), name=name)

        return cls.compiled_type()(types.int64), generate

    return intrinsic(define)


def _address_of(context: Any, bundle: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del context, signature
        return builder.ptrtoint(values[0], _WORD)

    return types.int64(bundle), generate


address_of: Any = intrinsic(_address_of)
"""``address_of(bundle)``: where its table is."""


def _word(builder: Any, table: Any, place: int) -> Any:
    """Read a word of a table.

    Nothing ever writes to a table, and the optimiser is told so (``invariant.load``): it reads what
    it needs once, however many arrays are written to meanwhile.
    """
    value = builder.load(builder.gep(table, [ir.Constant(_WORD, place)], inbounds=True))
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value


def _cell(context: Any, builder: Any, kind: BundleType, table: Any, name: str) -> Any:
    """Where a cell is."""
    pointer = context.get_value_type(kind.members[name]).as_pointer()
    return builder.inttoptr(_word(builder, table, kind.place(name)), pointer)


@lower_getattr_generic(BundleType)
def _get_member(context: Any, builder: Any, kind: BundleType, table: Any, name: str) -> Any:
    """Read a member. Arrays carry no reference count."""
    if name in kind.cells:
        return builder.load(_cell(context, builder, kind, table, name))
    if name in kind.extents:
        member, dimension = kind.extents[name]
        return _word(builder, table, kind.place(member) + 1 + dimension)
    place = kind.place(name)
    member = kind.members[name]
    word = _word(builder, table, place)
    if isinstance(member, BundleType):
        return builder.inttoptr(word, _WORD.as_pointer())
    if member == types.float64:
        return builder.bitcast(word, ir.DoubleType())
    if not isinstance(member, types.Array):
        return word
    made = context.make_array(member)(context, builder)
    shape = [_word(builder, table, place + 1 + i) for i in range(member.ndim)]
    strides = [ir.Constant(_WORD, _BYTES)]
    for extent in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], extent))
    data = builder.inttoptr(word, context.get_data_type(member.dtype).as_pointer())
    itemsize = ir.Constant(_WORD, _BYTES)
    populate_array(made, data=data, shape=shape, strides=strides, itemsize=itemsize, meminfo=None)
    return made._getvalue()


@lower_setattr_generic(BundleType)
def _set_member(context: Any, builder: Any, signature: Any, values: Any, name: str) -> None:
    """Write to a cell; nothing else of a bundle can be set."""
    kind: BundleType = signature.args[0]
    if name not in kind.cells:
        raise NotImplementedError(f"{name} is not a cell, and stays what it is")
    builder.store(values[1], _cell(context, builder, kind, values[0], name))
