"""What kernels write to, read from their source."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import textwrap
from collections.abc import Iterable, Iterator
from functools import cache
from types import ModuleType
from typing import Any

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import Kernel
from heelstrike.compiler.straight_line import play
from heelstrike.sim.contacts.straight_line import KERNELS

NOTHING: frozenset[str] = frozenset()


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


class _Reading(ast.NodeVisitor):
    """Which arguments of a kernel its names stand for, and which it writes to.

    A name that is given an array or bundle stands for the arguments that this may be a part of,
    whatever else it is given elsewhere.
    """

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.scope = kernel.py_func.__globals__
        self.stands_for = {name: frozenset({name}) for name in arguments_of(kernel)}
        self.given: dict[str, ast.expr] = {}
        self.written: set[str] = set()
        known = -1
        while known != (known := sum(map(len, self.stands_for.values())) + len(self.written)):
            for statement in definition_of(kernel).body:
                self.visit(statement)

    def roots(self, node: ast.AST) -> frozenset[str]:
        """Return the arguments that an expression may be a part of."""
        if isinstance(node, ast.Name):
            return self.stands_for.get(node.id, NOTHING)
        if isinstance(node, ast.Attribute | ast.Subscript | ast.Starred):
            return self.roots(node.value)
        if isinstance(node, ast.IfExp):
            return self.roots(node.body) | self.roots(node.orelse)
        if isinstance(node, ast.Tuple):
            return NOTHING.union(*map(self.roots, node.elts))
        if isinstance(node, ast.Call) and self._makes_a_tuple(node):
            return NOTHING.union(*map(self.roots, node.args))
        return NOTHING

    def visit_Assign(self, node: ast.Assign) -> None:
        for target in node.targets:
            self._assign(target, node.value)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._write(node.target)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        called = self._called(node.func)
        if called is play:
            program = self._program(node.args[0])
            assert isinstance(node.args[1], ast.Tuple)
            self._hand_over(program, node.args[1].elts)
        elif isinstance(called, Kernel):
            self._hand_over(called, node.args)
        elif isinstance(node.func, ast.Attribute):
            method = self._method(node.func)
            if method is not None:
                self._hand_over(method, [node.func.value, *node.args])
        elif isinstance(node.func, ast.Name) and node.func.id in self.stands_for:
            # A function that was handed over: a controller, which writes its last argument.
            self._write_to(self.roots(node.args[-1]))
        self.generic_visit(node)

    def _called(self, node: ast.AST) -> Any:
        return self.scope.get(node.id) if isinstance(node, ast.Name) else None

    def _makes_a_tuple(self, node: ast.Call) -> bool:
        made = self._called(node.func)
        return isinstance(made, type) and issubclass(made, tuple)

    def _method(self, node: ast.Attribute) -> Kernel | None:
        """Kernel of the class of an argument, as that is annotated."""
        if not isinstance(node.value, ast.Name):
            return None
        arguments = definition_of(self.kernel).args.args
        for argument in arguments:
            if argument.arg == node.value.id and isinstance(argument.annotation, ast.Name):
                kind = self.scope.get(argument.annotation.id)
                found = getattr(kind, node.attr, None)
                return found if isinstance(found, Kernel) else None
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
            self._write_to(self.roots(values[-1]))
            return
        for name, value in zip(arguments_of(kernel), values, strict=False):
            if name in written_by(kernel):
                self._write_to(self.roots(value))

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple | ast.List):
            parts = value.elts if isinstance(value, ast.Tuple) else [value] * len(target.elts)
            for each, part in zip(target.elts, parts, strict=True):
                self._assign(each, part)
        elif isinstance(target, ast.Name):
            self.given.setdefault(target.id, value)
            known = self.stands_for.get(target.id, NOTHING)
            self.stands_for[target.id] = known | self.roots(value)
        else:
            self._write(target)

    def _write(self, target: ast.expr) -> None:
        if isinstance(target, ast.Attribute | ast.Subscript):
            self._write_to(self.roots(target))

    def _write_to(self, arguments: frozenset[str]) -> None:
        self.written |= arguments


_being_read: list[Kernel] = []


@cache
def written_by(kernel: Kernel) -> frozenset[str]:
    """Return the names of the arguments that a kernel writes to, itself or by what it calls."""
    if kernel in _being_read:
        return NOTHING  # it calls itself, with the same arguments
    _being_read.append(kernel)
    try:
        reading = _Reading(kernel)
    finally:
        _being_read.pop()
    return frozenset(reading.written & set(arguments_of(kernel)))


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
