"""Bundles in compiled code: one word, the address of a table with the places of their members.

Only names of :mod:`numba.extending` are used here. How compiled code finds a member is said by
:meth:`~heelstrike.compiler.documented_numba.DocumentedNumba.declare`, or quicker by
:mod:`heelstrike.compiler.private_numba`; both read and write it as is said here.
"""

from __future__ import annotations

import hashlib
from functools import cache
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_setattr_generic,
    models,
    register_model,
    unbox,
)

from heelstrike.compiler.compilation import numba_in_use

WORD_BYTES = 8
_WORD = ir.IntType(64)

Fixed = tuple[tuple[str, int], ...]
"""Extents and whole numbers by name that compiled code takes for granted: it is made for them."""

_EXTENT = "heelstrike.extent."
_KNOWN = ir.FunctionType(_WORD, [_WORD] * 3)


class BundleType(types.Type):
    """Type of a bundle; each class of bundles has a class of types of its own.

    Attributes
    ----------
    cls : type
        Class of the bundle.
    members, extents : dict of str to type and to (str, int)
        Types of its members; of what member an extent is which one.
    cells : set of str
        Members that can be set.
    places : dict of str to int
        Where in the table a member begins.
    """

    def __init__(self, cls: Any) -> None:
        self.cls = cls
        self.members = {name: _member_type(each) for name, each in cls.declared.items()}
        self.cells = {name for name, member in cls.declared.items() if member.role == "cell"}
        self.extents: dict[str, tuple[str, int]] = {}
        self.places: dict[str, int] = {}
        place = 0
        for name, member in cls.declared.items():
            self.places[name] = place
            place += 1 + len(member.shape)
            for dimension, extent in enumerate(member.shape):
                if extent in cls.named:
                    self.extents[extent] = (name, dimension)
        described = repr((self.members, sorted(self.cells), self.extents))
        # The name goes into every symbol of the machine code: short, but never that of another.
        digest = hashlib.sha256(described.encode()).hexdigest()[:12]
        super().__init__(name=f"{cls.__name__}_{digest}")

    def __reduce__(self) -> Any:
        """Machine code on disk knows it by its name: a class of a script cannot be imported."""
        return _named, (self.name,)

    def member(self, name: str) -> Any:
        """Type of a member or an extent, or None."""
        return types.int64 if name in self.extents else self.members.get(name)

    def method(self, name: str) -> Any:
        """Kernel of the class of that name, or None."""
        found = getattr(self.cls, name, None)
        return found if hasattr(found, "py_func") else None

    def cell(self, context: Any, builder: Any, table: Any, name: str) -> Any:
        """Where a cell is."""
        pointer = context.get_value_type(self.members[name]).as_pointer()
        return builder.inttoptr(_word(builder, table, self.places[name]), pointer)

    def read(self, context: Any, builder: Any, table: Any, name: str) -> Any:
        """Read a member or an extent. Arrays carry no reference count."""
        if name in self.cells:
            return builder.load(self.cell(context, builder, table, name))
        if name in self.extents:
            member, dimension = self.extents[name]
            return _known(builder, _word(builder, table, self.places[member] + 1 + dimension), name)
        place, member = self.places[name], self.members[name]
        word = _word(builder, table, place)
        if isinstance(member, BundleType):
            return builder.inttoptr(word, _WORD.as_pointer())
        if member == types.float64:
            return builder.bitcast(word, ir.DoubleType())
        if not isinstance(member, types.Array):
            return _known(builder, word, name)
        shape = [
            _known(builder, _word(builder, table, place + 1 + i), extent, factor, more)
            if extent
            else ir.Constant(_WORD, more)
            for i, (factor, extent, more) in enumerate(self.cls.declared[name].extents)
        ]
        strides = [ir.Constant(_WORD, WORD_BYTES)]
        for extent in reversed(shape[1:]):
            strides.insert(0, builder.mul(strides[0], extent))
        made = context.make_array(member)(context, builder)  # all zero, so nobody's
        made.data = builder.inttoptr(word, context.get_data_type(member.dtype).as_pointer())
        made.itemsize = ir.Constant(_WORD, WORD_BYTES)
        made.nitems = ir.Constant(_WORD, 1)
        for extent in shape:
            made.nitems = builder.mul(made.nitems, extent, flags=("nsw",))
        for name, words in (("shape", shape), ("strides", strides)):
            packed: Any = ir.Constant(ir.ArrayType(_WORD, member.ndim), ir.Undefined)
            for dimension, each in enumerate(words):
                packed = builder.insert_value(packed, each, dimension)
            setattr(made, name, packed)
        return made._getvalue()


@cache  # for good: a type made again would be another, and machine code for it compiled again
def bundle_type(cls: Any) -> BundleType:
    """Return the type of a class of bundles."""
    kind: type[BundleType] = type(cls.__name__, (BundleType,), {})
    register_model(kind)(_BundleModel)
    made = kind(cls)
    _made.append(made)
    numba_in_use().declare(made)
    return made


_made: list[BundleType] = []
"""All types. A list, since what that holds is no part of what kernels are made of."""


def _named(name: str) -> Any:
    """Return the type of a name; of one that is not made here, what is equal to no other."""
    return next((each for each in reversed(_made) if each.name == name), types.Opaque(name))


def _member_type(member: Any) -> Any:
    if member.role == "part":
        return bundle_type(member.kind)
    scalar = types.float64 if member.kind is float else types.int64
    return types.Array(scalar, len(member.shape), "C") if member.role == "array" else scalar


class _BundleModel(models.PrimitiveModel):
    """In machine code a bundle is the address of its table."""

    def __init__(self, manager: Any, kind: BundleType) -> None:
        super().__init__(manager, kind, _WORD.as_pointer())


@unbox(BundleType)
def _unbox_bundle(_: BundleType, value: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(value, "address")
    word = c.unbox(types.int64, address)
    c.pyapi.decref(address)
    return NativeValue(c.builder.inttoptr(word.value, _WORD.as_pointer()), is_error=word.is_error)


@cache
def bundle_at(cls: Any) -> Any:
    """Return an intrinsic that returns the bundle of a class whose table is at an address."""
    name = bundle_type(cls).name

    # What compiled code is made of is known by what functions enclose: the class, whose kernels are
    # methods, and the name, which tells its members.
    def define(context: Any, address: Any) -> Any:
        del context, address

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            del context, signature
            return builder.inttoptr(values[0], _WORD.as_pointer(), name=name)

        return bundle_type(cls)(types.int64), generate

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


def _known(builder: Any, word: Any, name: str, factor: int = 1, more: int = 0) -> Any:
    """Return a word that is so many times an extent or number, and some more.

    It goes through a function of that name, which returns it as it is, until
    :func:`definitions` put another in its place.
    """
    module = builder.module
    function = module.globals.get(_EXTENT + name)
    if function is None:
        function = ir.Function(module, _KNOWN, _EXTENT + name)
        function.linkage = "linkonce_odr"
        function.attributes.add("alwaysinline")
        ir.IRBuilder(function.append_basic_block()).ret(function.args[0])
    return builder.call(function, [word, ir.Constant(_WORD, factor), ir.Constant(_WORD, more)])


def definitions(fixed: Fixed) -> str:
    """Return the functions, as a module of LLVM, by which extents and numbers are constants."""
    return "\n".join(
        f"""define i64 @"{_EXTENT}{name}"(i64 %word, i64 %factor, i64 %more) alwaysinline {{
  %product = mul i64 %factor, {value}
  %sum = add i64 %product, %more
  ret i64 %sum
}}"""
        for name, value in fixed
    )


@lower_setattr_generic(BundleType)
def _set_member(context: Any, builder: Any, signature: Any, values: Any, name: str) -> None:
    """Write to a cell; nothing else of a bundle can be set."""
    kind: BundleType = signature.args[0]
    if name not in kind.cells:
        raise NotImplementedError(f"{name} is not a cell, and stays what it is")
    builder.store(values[1], kind.cell(context, builder, values[0], name))
