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
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numba.extending import typeof_impl

from heelstrike.compiler.bundle_type import WORD_BYTES, BundleType, bundle_type
from heelstrike.field_texts import FieldTexts

_EXTENT = re.compile(r"(?:(\d+)\s*)?([A-Za-z]\w*)?(?:\s*\+\s*(\d+))?")

# Names of no members: where a bundle keeps what is its own, and an argument of `allocate`.
_TAKEN = (
    "_cells", "_floats", "_ints", "_extents", "_block", "_places", "_table", "_late", "_stored",
    "dtype",
)  # fmt: skip

_Some = TypeVar("_Some", bound="Bundle")


@dataclass(frozen=True)
class Member:
    """What a bundle says of one of its members."""

    role: str
    """``"array"``, ``"cell"`` (a number that changes), ``"number"`` (one that does not), ``"part"``
    (another bundle) or ``"extent"`` (how long arrays are)."""
    kind: type
    """``float`` or ``int``, or the class of a part."""
    shape: tuple[str | int, ...] = ()
    """Extents of an array: ``"nv"``, ``"2 nc"``, ``"nc + 1"``, 3."""
    address: bool = False
    """Whether it holds places in this process, or a part what is another's: nothing to keep."""
    flat: bool = False
    """Whether what a part holds is stored under the names of its own members."""
    unit: str = ""
    label: str = ""
    """unit, label: Of its numbers, and what they are, for those who read them."""

    @property
    def dimensions(self) -> tuple[str | int, ...]:
        """What the documentation says of its shape."""
        return self.shape

    def prefix(self, name: str) -> str:
        """What the names begin with under which the members of a part are stored."""
        return "" if self.flat else f"{name}."

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Of its numbers: 64 bits."""
        return np.dtype(np.float64 if self.kind is float else np.int64)

    @cached_property
    def extents(self) -> tuple[tuple[int, str, int], ...]:
        """Its shape as factors, names (none if it is a number) and numbers to add."""
        return tuple(map(_parsed, self.shape))


def array(
    *shape: str | int, of: type = float, address: bool = False, unit: str = "", label: str = ""
) -> Any:
    """Declare an array of a bundle by its extents.

    Parameters
    ----------
    *shape : str or int
        Extents: numbers, or names as in ``"nu"``, ``"2 nc + 1"``, which the robot knows.
    of : type
        ``float`` or ``int``.
    address : bool
        Whether it holds places in this process, which are not to be kept.
    unit, label : str
        Of its numbers, and what they are: what a log is recorded with.

    Returns
    -------
    Member
        What the class of the bundle makes a member of.
    """
    return Member("array", of, shape, address, unit=unit, label=label)


def cell(of: type, *, unit: str = "", label: str = "") -> Any:
    """Declare a number of a bundle that kernels may change.

    Parameters
    ----------
    of : type
        ``float`` or ``int``.
    unit, label : str
        Its unit, and what it is: what a log is recorded with.

    Returns
    -------
    Member
        What the class of the bundle makes a member of.
    """
    return Member("cell", of, unit=unit, label=label)


def number(of: type, *, unit: str = "", label: str = "") -> Any:
    """Declare a number of a bundle that stays as it is.

    Parameters
    ----------
    of : type
        ``float`` or ``int``.
    unit, label : str
        Its unit, and what it is: what a log is recorded with.

    Returns
    -------
    Member
        What the class of the bundle makes a member of.
    """
    return Member("number", of, unit=unit, label=label)


def part(kind: type[Bundle], *, address: bool = False, flat: bool = False) -> Any:
    """Declare a bundle within a bundle.

    Parameters
    ----------
    kind : type
        Class of the bundle within.
    address : bool
        Whether it is another's, which is not to be kept with this one.
    flat : bool
        Whether what is in it is stored, and recorded of a log, under the names of its own members,
        as if they were this one's.

    Returns
    -------
    Member
        What the class of the bundle makes a member of.

    Raises
    ------
    TypeError
        If it is no class of bundles.
    """
    if not (isinstance(kind, type) and issubclass(kind, Bundle)):
        raise TypeError(f"a part is declared by its class of heelstrike.Bundle, got {kind!r}")
    return Member("part", kind, address=address, flat=flat)


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
    named : frozenset of str
        The extents that it declares to be read by name.
    extent_names : frozenset of str
        The extents of its arrays, and of those of its parts.

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
    _cell_names: ClassVar[frozenset[str]] = frozenset()

    declared: ClassVar[dict[str, Member]] = {}
    named: ClassVar[frozenset[str]] = frozenset()
    extent_names: ClassVar[frozenset[str]] = frozenset()

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
        letters = {letter for each in cls.declared.values() for _, letter, _ in each.extents}
        parts: Any = (each.kind for each in cls.declared.values() if each.role == "part")
        cls.extent_names = frozenset(letters - {""}).union(*(part.extent_names for part in parts))
        cells = [name for name, member in cls.declared.items() if member.role == "cell"]
        cls._cell_count, cls._cell_names = len(cells), frozenset(cells)
        for name in own:
            if name in cls.named:
                setattr(cls, name, _extent_property(name))
            else:
                delattr(cls, name)
        for place, name in enumerate(cells):
            setattr(cls, name, _cell_property(place, cls.declared[name]))
        if cls.__doc__:
            cls.__doc__ = FieldTexts(cls.__doc__, own)  # type: ignore[assignment]

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
        for name in members:
            raise TypeError(f"{type(self).__name__} has no {name}")

    if not TYPE_CHECKING:  # what a class declares is all there is

        def __getattr__(self, name: str) -> Any:
            """Make a member that was not asked for before, of a bundle that was cast in a mold."""
            late = self.__dict__.get("_late")
            made = None if late is None else late(name)
            if made is None:
                raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
            return self.__dict__.setdefault(name, made)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._cell_names:
            raise AttributeError(f"{type(self).__name__}.{name} is no cell, and stays what it is")
        object.__setattr__(self, name, value)

    @classmethod
    def allocate(
        cls: type[_Some],
        known: Mapping[str, int] = MappingProxyType({}),
        /,
        *,
        dtype: Any = None,
        **given: Any,
    ) -> _Some:
        """Make a bundle of zeros.

        Parameters
        ----------
        known : mapping of str to int
            Extents by name, of which its arrays need not have all: those of a robot. Numbers of
            these names are that.
        dtype : type, optional
            Of its arrays of floats, for other numbers than these: ``object`` for symbols.
        **given : int, array, number or Bundle
            More extents, and members that are not to be zeros; a whole number may be both. Parts
            are allocated with the same extents.

        Returns
        -------
        Bundle
            Of this class.

        Raises
        ------
        TypeError
            If an extent is missing, or something is given that is neither a member nor an extent
            of an array, or not a whole number.
        """
        kind: Any = cls
        members = {name: known[name] for name in _whole_numbers(kind) if name in known}
        members |= {name: value for name, value in given.items() if name in cls.declared}
        extents = {name: size for name, size in known.items() if name in cls.extent_names}
        extents |= {name: members[name] for name in _whole_numbers(kind) if name in members}
        for name, value in given.items():
            if name in members:
                continue
            if name not in cls.extent_names:
                raise TypeError(f"{cls.__name__} has no {name}, neither member nor extent")
            if not isinstance(value, int | np.integer):
                raise TypeError(f"{cls.__name__}: the extent {name} is a whole number")
            extents[name] = int(value)
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
            own[name] = part.allocate(extents, dtype=dtype)
        bundle._take(members)
        return bundle

    @classmethod
    def compiled_type(cls) -> BundleType:
        """Return its type to Numba.

        Returns
        -------
        BundleType
            The type.
        """
        kind: Any = cls
        return bundle_type(kind)

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
            cells = address_of_array(own["_cells"])
        else:
            own["address"] = begin = address_of_array(block)
            cells = begin + places["_cells"]
        for name, member in self.declared.items():
            if member.role == "cell":
                words.append(cells)
                cells += WORD_BYTES
                continue
            value = getattr(self, name)
            if name in places:
                words += [begin + places[name], *value.shape]
            elif member.role == "array":
                if not (value.flags.c_contiguous and value.dtype == member.dtype):
                    raise TypeError(
                        f"{type(self).__name__}.{name} is a C-contiguous array of "
                        f"{member.dtype}, not of {value.dtype}"
                    )
                words += [address_of_array(value), *value.shape]
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
        return address_of_array(self.table)

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
                yield from getattr(self, name).storage(prefix + member.prefix(name))
            elif member.role == "array" and not member.address:
                yield prefix + name, getattr(self, name)

    def views(self, prefix: str = "") -> Iterator[tuple[str, Member, np.ndarray[Any, Any]]]:
        """Yield all its numbers by name, those of a cell as an array of no dimension.

        Parameters
        ----------
        prefix : str
            What the names begin with.

        Yields
        ------
        tuple of str, Member and array
            Name, what is declared of it, and what it holds, not copied.
        """
        cells, place = self.__dict__["_cells"], 0
        for name, member in self.declared.items():
            if member.role == "part":
                yield from getattr(self, name).views(prefix + member.prefix(name))
            elif member.role == "array":
                yield prefix + name, member, getattr(self, name)
            elif member.role == "cell":
                yield prefix + name, member, cells[place : place + 1].view(member.dtype).reshape(())
                place += 1

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
                members[name] = members[name].stored(place, prefix + member.prefix(name))
            elif member.role == "array" and not member.address:
                members[name] = place(prefix + name, members[name])
        members = {n: each for n, each in members.items() if self.declared[n].role != "cell"}
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
            What :meth:`contents` of that one returned. Arrays without entries may be missing.
        prefix : str
            What the names begin with.

        Raises
        ------
        ValueError
            If something is missing, or of another shape or kind; nothing has changed then.
        """
        storage = {
            n: mine for n, mine in self.storage(prefix) if mine.flags.writeable and mine.size
        }
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


def address_of_array(array: Any) -> int:
    """Return where an array begins."""
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
            try:
                shape = tuple(
                    factor * known[each] + more if each else more
                    for factor, each, more in member.extents
                )
            except KeyError as error:
                raise TypeError(f"{cls.__name__}: the extent {error} is not given") from None
            _check_shape(f"{cls.__name__}.{name}", member, shape, extents)
            arrays.append((name, shape, member.dtype, WORD_BYTES * size))
            size += math.prod(shape)
    return _Plan(
        size + 1,  # arrays of nothing lie before its end, too
        WORD_BYTES * table,
        arrays,
        {name: place for name, _, _, place in arrays} | {"_cells": WORD_BYTES * table},
        [(name, member.kind()) for name, member in members if member.role == "number"],
        [(name, member.kind) for name, member in members if member.role == "part"],
        extents,
    )


@cache
def _settable(cls: Any) -> Any:
    numbers = {
        name: cell(member.kind, unit=member.unit, label=member.label)
        for name, member in cls.declared.items()
        if member.role == "number"
    }
    return type(cls.__name__, (cls,), {"__module__": cls.__module__, **numbers})


def _cell_property(place: int, member: Member) -> property:
    """Read and write a cell from Python."""
    kept = f"_{member.kind.__name__}s"

    def numbers(bundle: Bundle) -> Any:
        """All cells as numbers of this kind, by what is quickest from Python."""
        made = memoryview(bundle.__dict__["_cells"].view(member.dtype))
        return bundle.__dict__.setdefault(kept, made)

    def get(bundle: Bundle) -> Any:
        made = bundle.__dict__.get(kept)
        return (numbers(bundle) if made is None else made)[place]

    def put(bundle: Bundle, value: Any) -> None:
        made = bundle.__dict__.get(kept)
        (numbers(bundle) if made is None else made)[place] = member.kind(value)

    return property(get, put)


def _extent_property(name: str) -> property:
    """Read an extent from Python."""

    def get(bundle: Bundle) -> int:
        known: dict[str, int] = bundle.__dict__["_extents"]
        return known[name]

    return property(get)


@lru_cache
def _parsed(extent: str | int) -> tuple[int, str, int]:
    if isinstance(extent, int):
        return 0, "", extent
    match = _EXTENT.fullmatch(extent)
    if match is None or match[2] is None:
        raise TypeError(f"an extent is a number or reads like '2 nc + 1', not {extent!r}")
    return int(match[1] or 1), match[2], int(match[3] or 0)


def _check_shape(
    where: str, member: Member, shape: tuple[int, ...], extents: dict[str, int]
) -> None:
    """Refuse an array whose shape is not the declared one; note the extents that it tells."""
    fits = len(shape) == len(member.shape)
    for (factor, name, more), size in zip(member.extents, shape, strict=False):
        if name:
            fits = fits and size >= more and (size - more) % factor == 0
            known = extents.setdefault(name, (size - more) // factor)
        fits = fits and size == (factor * known + more if name else more)
    if not fits:
        wanted = ", ".join(map(str, member.shape))
        named = [name for _, name, _ in member.extents if name]
        told = ", ".join(f"{name} = {extents[name]}" for name in dict.fromkeys(named))
        where_told = f", where {told}" if told else ""
        raise TypeError(f"{where} has shape {shape} instead of ({wanted}){where_told}")


@typeof_impl.register(Bundle)
def _typeof_bundle(value: Bundle, _: Any) -> BundleType:
    return value.compiled_type()
