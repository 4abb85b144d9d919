"""What kernels write to, what they read, and what they could reach, read from their source."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import textwrap
from collections.abc import Iterable, Iterator
from functools import cache
from types import ModuleType
from typing import Any, get_type_hints

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import Kernel
from heelstrike.compiler.straight_line import play
from heelstrike.compiler.words import copy_words
from heelstrike.robot.model import Model
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.contacts.straight_line import KERNELS

NOWHERE: frozenset[tuple[str, ...]] = frozenset()

ROBOTS = {Model, SpatialModel}
"""The numbers of a robot, to which no kernel writes."""


def kernels_of(package: ModuleType) -> Iterator[Kernel]:
    """Yield the kernels that are defined in the modules of a package."""
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(found.name)
        for value in vars(module).values():
            owned = vars(value).values() if isinstance(value, type) else ()
            for kernel in (value, *owned):
                if isinstance(kernel, Kernel) and kernel.py_func.__module__ == found.name:
                    yield kernel


@cache
def definition_of(kernel: Kernel) -> ast.FunctionDef:
    """Return the syntax of a kernel; one made of text is taken at its word."""
    try:
        source = inspect.getsource(kernel.py_func)
    except OSError:
        code = kernel.py_func.__code__
        names = code.co_varnames[: code.co_argcount]
        source = f"def {kernel.__name__}({', '.join(names)}):\n    {names[-1]}[0] = {names}"
    tree = ast.parse(textwrap.dedent(source))
    assert isinstance(tree.body[0], ast.FunctionDef)
    return tree.body[0]


def arguments_of(kernel: Kernel) -> list[str]:
    """Return the names of the arguments of a kernel."""
    arguments = definition_of(kernel).args
    return [argument.arg for argument in (*arguments.posonlyargs, *arguments.args)]


Path = tuple[str, ...]
"""An argument, a bundle that it is, or something in it: ``("memory", "assembly", "jacobian")``."""


class _Reading(ast.NodeVisitor):
    """What of its arguments the names of a kernel stand for, what it touches, and what it writes.

    A name that is given an array or bundle stands for all that this may be, whatever else it is
    given elsewhere. One that is given a tuple with names stands for each of what that is made of.
    """

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.scope = scope_of(kernel)
        self.kinds = kinds_of(kernel)
        self.stands_for = {name: frozenset({(name,)}) for name in arguments_of(kernel)}
        self.given: dict[str, ast.expr] = {}
        self.made: dict[str, dict[str, frozenset[Path]]] = {}
        self.written: set[Path] = set()
        self.touched: set[Path] = set()
        known = -1
        while known != (known := sum(map(len, (*self.stands_for.values(), self.written)))):
            self.touched.clear()
            for statement in definition_of(kernel).body:
                self.visit(statement)

    def paths(self, node: ast.AST) -> frozenset[Path]:
        """Return what of the arguments an expression may be, or be a part of."""
        if isinstance(node, ast.Name):
            return self.stands_for.get(node.id, NOWHERE)
        if isinstance(node, ast.Attribute):
            return frozenset(self._members(node))
        if isinstance(node, ast.Subscript | ast.Starred):
            return self.paths(node.value)
        if isinstance(node, ast.IfExp):
            return self.paths(node.body) | self.paths(node.orelse)
        if isinstance(node, ast.Tuple):
            return NOWHERE.union(*map(self.paths, node.elts))
        if isinstance(node, ast.Call) and self._makes_a_tuple(node):
            return NOWHERE.union(*map(self.paths, node.args))
        return NOWHERE

    def _members(self, node: ast.Attribute) -> Iterator[Path]:
        """What is by a name in a bundle: extents are none of it. Of an array it is this one."""
        for path in self.paths(node.value):
            kind = kind_at(self.kinds, path)
            if kind is None:
                yield path
            elif node.attr in members_of(kind):
                yield (*path, node.attr)

    def visit_Assign(self, node: ast.Assign) -> None:
        for target in node.targets:
            self._assign(target, node.value)
        self._visit_values(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._write(node.target)
        self._visit_values(node)

    def _visit_values(self, node: ast.Assign | ast.AugAssign) -> None:
        """Visit an assignment: a bundle that only gets another name is not touched by that."""
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        for each in (*targets, *_each_of(node.value)):
            if not isinstance(each, ast.Name | ast.Attribute) or not self._is_bundle(each):
                self.visit(each)

    def _is_bundle(self, node: ast.expr) -> bool:
        return all(kind_at(self.kinds, path) is not None for path in self.paths(node))

    def visit_Name(self, node: ast.Name) -> None:
        if isinstance(node.ctx, ast.Load):
            self.touched |= self.paths(node)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        self.touched |= self.paths(node)
        if not self.paths(node.value):
            self.visit(node.value)

    def visit_Call(self, node: ast.Call) -> None:
        called = self._called(node.func)
        values: list[ast.expr] = []
        if called is play:
            program = self._program(node.args[0])
            assert isinstance(node.args[1], ast.Tuple)
            self.visit(node.args[0])
            self._hand_over(program, node.args[1].elts)
        elif isinstance(called, Kernel):
            self._hand_over(called, node.args)
        elif isinstance(node.func, ast.Attribute) and (method := self._method(node.func)):
            self._hand_over(method, [node.func.value, *node.args])
        elif self._makes_a_tuple(node):
            values = [value for value in node.args if not self._is_bundle(value)]
        else:
            values = [node.func, *node.args]
            handed = isinstance(node.func, ast.Name) and node.func.id in self.stands_for
            if handed or called is copy_words:
                # A function that was handed over, such as a controller, writes its last argument.
                self._write_to(self.paths(node.args[-1]))
        for value in values:
            self.visit(value)

    def _called(self, node: ast.AST) -> Any:
        return self.scope.get(node.id) if isinstance(node, ast.Name) else None

    def _makes_a_tuple(self, node: ast.Call) -> bool:
        made = self._called(node.func)
        return isinstance(made, type) and issubclass(made, tuple)

    def _method(self, node: ast.Attribute) -> Kernel | None:
        """Kernel of the class of a bundle, as that is annotated."""
        for path in self.paths(node.value):
            found = getattr(kind_at(self.kinds, path), node.attr, None)
            if isinstance(found, Kernel):
                return found
        return None

    def _program(self, node: ast.expr) -> Kernel | None:
        """Kernel that straight-line code was made of: the index into the programs names it."""
        if isinstance(node, ast.Name):
            node = self.given.get(node.id, node)
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Name):
            place = self.scope.get(node.slice.id)
            if isinstance(place, int):
                kernel = KERNELS[place]
                assert isinstance(kernel, Kernel)
                return kernel
        return None

    def _hand_over(self, kernel: Kernel | None, values: Iterable[ast.expr]) -> None:
        values = list(values)
        if kernel is None:  # straight-line code of another kind: its last argument
            self._write_to(self.paths(values[-1]))
            for value in values:
                self.visit(value)
            return
        names = arguments_of(kernel)
        for name, value in zip(names, values, strict=False):
            if isinstance(value, ast.Name) and value.id in self.made:
                self._hand_over_made(kernel, name, self.made[value.id])
                continue
            handed = self.paths(value)
            for written in writes_of(kernel):
                if written[0] == name:
                    self._write_to(frozenset(self._within(handed, written[1:])))
            if not handed or any(isinstance(each, ast.Slice) for each in ast.walk(value)):
                self.visit(value)
            for touched in touched_by(kernel):
                if touched[0] == name:
                    self.touched |= self._within(handed, touched[1:])

    def _within(self, paths: frozenset[Path], inside: Path) -> set[Path]:
        """What is somewhere inside of paths that are bundles; the others by themselves."""
        bundles = {path for path in paths if kind_at(self.kinds, path) is not None}
        return {(*path, *inside) for path in bundles} | (paths - bundles)

    def _hand_over_made(self, kernel: Kernel, name: str, made: dict[str, frozenset[Path]]) -> None:
        """What a kernel does with a tuple that was made here it does with what is in it."""
        for found, known in ((touched_by(kernel), self.touched), (writes_of(kernel), self.written)):
            for path in found:
                if path[0] == name:
                    fields = path[1:2] or tuple(made)
                    known.update(*(self._within(made[field], path[2:]) for field in fields))

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple | ast.List):
            parts = value.elts if isinstance(value, ast.Tuple) else [value] * len(target.elts)
            for each, part in zip(target.elts, parts, strict=True):
                self._assign(each, part)
        elif isinstance(target, ast.Name):
            self.given.setdefault(target.id, value)
            if isinstance(value, ast.Call) and self._makes_a_tuple(value):
                names = members_of(self._called(value.func))
                self.made[target.id] = dict(zip(names, map(self.paths, value.args), strict=True))
            known = self.stands_for.get(target.id, NOWHERE)
            self.stands_for[target.id] = known | self.paths(value)
        else:
            self._write(target)

    def _write(self, target: ast.expr) -> None:
        if isinstance(target, ast.Attribute | ast.Subscript):
            self._write_to(self.paths(target))

    def _write_to(self, paths: frozenset[Path]) -> None:
        self.written |= paths


def _each_of(value: ast.expr) -> list[ast.expr]:
    return value.elts if isinstance(value, ast.Tuple) else [value]


def members_of(kind: type) -> dict[str, Any]:
    """Return the members of a bundle, or of a tuple with names, each with its class if known."""
    if issubclass(kind, Bundle):
        return {name: member.kind for name, member in kind.declared.items()}
    return get_type_hints(kind)


def holds_others(kind: Any) -> bool:
    """Whether something is a class of bundles, or of tuples with names."""
    is_class = isinstance(kind, type)
    return is_class and (issubclass(kind, Bundle) or hasattr(kind, "_fields"))


def scope_of(kernel: Kernel) -> dict[str, Any]:
    """Return what the names in a kernel stand for that are not its own."""
    return kernel.py_func.__globals__ | inspect.getclosurevars(kernel.py_func).nonlocals


@cache
def kinds_of(kernel: Kernel) -> dict[str, type]:
    """Return the classes of the arguments of a kernel that are bundles, as they are annotated."""
    scope, kinds = kernel.py_func.__globals__, {}
    arguments = definition_of(kernel).args
    for argument in (*arguments.posonlyargs, *arguments.args):
        names = ast.walk(argument.annotation) if argument.annotation is not None else ()
        for node in names:
            kind = scope.get(node.id) if isinstance(node, ast.Name) else None
            if kind is not None and holds_others(kind):
                kinds[argument.arg] = kind
    return kinds


def kind_at(kinds: dict[str, type], path: Path) -> type | None:
    """Return the class of bundles that something in the arguments is of, None for no bundle."""
    kind: Any = kinds.get(path[0])
    for name in path[1:]:
        kind = members_of(kind).get(name)
    return kind if holds_others(kind) else None


def leaves_of(kind: type | None) -> int:
    """Return how many arrays and numbers there are in a bundle, and in the bundles in it.

    The robot's numbers count as none: no kernel writes to them.
    """
    if kind is None:
        return 1
    if kind in ROBOTS:
        return 0
    return sum(
        leaves_of(each if holds_others(each) else None) for each in members_of(kind).values()
    )


def reach_of(kernel: Kernel) -> int:
    """Return how many arrays and numbers a kernel could reach."""
    return sum(leaves_of(kinds_of(kernel).get(name)) for name in arguments_of(kernel))


def use_of(kernel: Kernel) -> int:
    """Return how many arrays and numbers a kernel touches, itself or by what it calls."""
    kinds = kinds_of(kernel)
    touched = {
        path
        for path in touched_by(kernel)
        if not ROBOTS & {kind_at(kinds, path[:k]) for k in range(1, len(path))}
    }
    whole = {path for path in touched if kind_at(kinds, path) is not None}
    inside = {path for path in touched if any(path[:k] in whole for k in range(1, len(path)))}
    return sum(leaves_of(kind_at(kinds, path)) for path in touched - inside)


_readings: dict[Kernel, _Reading | None] = {}


def _read(kernel: Kernel) -> _Reading | None:
    """Read a kernel; None while it is being read: it calls itself, with the same arguments."""
    if kernel not in _readings:
        _readings[kernel] = None
        _readings[kernel] = _Reading(kernel)
    return _readings[kernel]


def writes_of(kernel: Kernel) -> frozenset[Path]:
    """Return what of its arguments a kernel writes to, itself or by what it calls."""
    reading = _read(kernel)
    return NOWHERE if reading is None else frozenset(reading.written)


def written_by(kernel: Kernel) -> frozenset[str]:
    """Return the names of the arguments that a kernel writes to, itself or by what it calls."""
    return frozenset(path[0] for path in writes_of(kernel)) & set(arguments_of(kernel))


def touched_by(kernel: Kernel) -> frozenset[Path]:
    """Return what of its arguments a kernel reads or writes, itself or by what it calls."""
    reading = _read(kernel)
    return NOWHERE if reading is None else frozenset(reading.touched)


@cache
def members_touched(kernel: Kernel, kind: type[Bundle]) -> frozenset[str]:
    """Return the members of a bundle that a kernel uses, itself or by what it calls.

    One that is made of text has no annotations, and may use them all.
    """
    definition = definition_of(kernel)
    names = set(arguments_of_kind(kernel, kind))
    found: set[str] = set()
    for node in ast.walk(definition):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found |= {node.attr} if node.value.id in names else set()
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            called = kernel.py_func.__globals__.get(node.func.id)
            handed = {value.id for value in node.args if isinstance(value, ast.Name)} & names
            if isinstance(called, Kernel) and handed:
                of_text = not arguments_of_kind(called, kind)
                found |= set(kind.declared) if of_text else members_touched(called, kind)
    return frozenset(found)


def arguments_of_kind(kernel: Kernel, kind: type[Bundle]) -> list[str]:
    """Return the names of the arguments that are annotated with a class."""
    return [
        argument.arg
        for argument in definition_of(kernel).args.args
        if isinstance(argument.annotation, ast.Name) and argument.annotation.id == kind.__name__
    ]
